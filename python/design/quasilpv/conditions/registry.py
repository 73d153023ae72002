"""The conditions known by name: one file each, one line here."""

from __future__ import annotations

from quasilpv.conditions.condition import Condition
from quasilpv.conditions.theorems import (
    estimated_observer,
    guerra2007,
    i1,
    i2,
    i3,
    i53,
    ii5,
    ii6,
    ii6_direct,
    ii7,
    ii8,
    iii9,
    sampled_feedback,
    sampled_observer,
    tanaka_wang,
    ts_pj,
)
from quasilpv.errors import look_up

CONDITIONS: dict[str, Condition] = {
    entry.id: entry
    for entry in (
        i1.CONDITION,
        i2.CONDITION,
        i53.CONDITION,
        i3.CONDITION,
        ii5.CONDITION,
        ii5.COROLLARY,
        ii6.CONDITION,
        ii6_direct.CONDITION,
        ii7.CONDITION,
        ii8.CONDITION,
        iii9.CONDITION,
        ts_pj.CONDITION,
        guerra2007.CONDITION,
        tanaka_wang.CONDITION,
        sampled_feedback.CONDITION,
        sampled_observer.CONDITION,
        estimated_observer.CONDITION,
    )
}


def condition(name: str) -> Condition:
    """The condition of that id.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    return look_up(CONDITIONS, name, "conditions", "condition")
