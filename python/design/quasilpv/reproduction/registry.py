"""The items known by id: one line per file, by chapter."""

from __future__ import annotations

from quasilpv.errors import InputError, one_of
from quasilpv.reproduction import (
    chapter_one,
    chapter_three,
    chapter_two_analysis,
    chapter_two_design,
    complexity_growth,
    complexity_tables,
    conservatism,
    estimated_premises,
    lumped_premises,
    nonquadratic,
    overbounding,
    rolling_disc,
    stabilised_arms,
    tracking_hinf,
    tracking_parallel,
    tracking_serial,
)
from quasilpv.reproduction.item import Item

ITEMS: dict[str, Item] = {
    entry.id: entry
    for module in (
        chapter_one,
        overbounding,
        complexity_growth,
        chapter_two_analysis,
        chapter_two_design,
        nonquadratic,
        stabilised_arms,
        chapter_three,
        rolling_disc,
        tracking_hinf,
        tracking_serial,
        tracking_parallel,
        lumped_premises,
        estimated_premises,
        complexity_tables,
        conservatism,
    )
    for entry in module.ITEMS
}


def item(name: str) -> Item:
    """The item of that id.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    if name not in ITEMS:
        raise InputError("reproduction", "item", name, one_of(ITEMS, name, "design list --items"))
    return ITEMS[name]
