"""The conditions known by name: one file each, one line here."""

from __future__ import annotations

from quasilpv.conditions import ii6
from quasilpv.conditions.condition import Condition
from quasilpv.errors import InputError

CONDITIONS: dict[str, Condition] = {entry.id: entry for entry in (ii6.CONDITION,)}


def condition(name: str) -> Condition:
    """The condition of that id.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    if name not in CONDITIONS:
        raise InputError("conditions", "condition", name, f"one of {', '.join(CONDITIONS)}")
    return CONDITIONS[name]
