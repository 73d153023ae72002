"""What a figure or table of the source is here: how to compute it, what is printed, and the rule that compares them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from matplotlib.figure import Figure


class Effort(StrEnum):
    """How fine a computation is."""

    QUICK = "quick"
    FULL = "full"


class ItemVerdict(StrEnum):
    """What came of an item; computed from its checks, never chosen."""

    REPRODUCED = "reproduced"
    WITH_ASSUMPTION = "reproduced with stated assumption"
    NOT_REPRODUCIBLE = "not reproducible"


@dataclass(frozen=True)
class Check:
    """One comparison of what is printed with what was computed.

    Attributes:
        claim: what the source says, in words.
        holds: whether the numbers agree under the rule of the claim's kind, see `quasilpv.reproduction.rules`.
        found: what was computed, in words.
    """

    claim: str
    holds: bool
    found: str


@dataclass(frozen=True)
class Finding:
    """The outcome of one computation.

    Attributes:
        checks: at least one.
        computed: the numbers, JSON-able.
        figures: by name; the item's own figure has the empty name.
        instead: where the printed claim does not hold, what holds instead and why.
    """

    checks: Sequence[Check]
    computed: Mapping[str, Any]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    instead: str = ""


@dataclass(frozen=True)
class Item:
    """A figure or a table of the source.

    Attributes:
        id: ``fig-II.7``, ``table-I.2``, ...
        title: one line for a listing.
        printed: what the source prints, JSON-able.
        assumptions: what the source leaves out and was chosen here.
        compute: the computation.
    """

    id: str
    title: str
    printed: Mapping[str, Any]
    assumptions: tuple[str, ...]
    compute: Callable[[Effort], Finding]


@dataclass(frozen=True)
class ItemResult:
    """An item, computed.

    Attributes:
        item: which.
        finding: what came out.
        seconds: wall time.
    """

    item: Item
    finding: Finding
    seconds: float

    @property
    def verdict(self) -> ItemVerdict:
        """From the checks: all must hold."""
        if not all(check.holds for check in self.finding.checks):
            return ItemVerdict.NOT_REPRODUCIBLE
        return ItemVerdict.WITH_ASSUMPTION if self.item.assumptions else ItemVerdict.REPRODUCED

    @property
    def reason(self) -> str:
        """One sentence per claim that does not hold, and what holds instead."""
        failed = [f"printed: {c.claim}; found: {c.found}" for c in self.finding.checks if not c.holds]
        return ". ".join([*failed, self.finding.instead] if self.finding.instead else failed)

    def to_document(self) -> dict[str, Any]:
        """JSON-able, a row of ``results.json``."""
        return {
            "id": self.item.id,
            "verdict": self.verdict.value,
            "reason": self.reason,
            "assumptions": list(self.item.assumptions),
            "printed": dict(self.item.printed),
            "computed": dict(self.finding.computed),
            "checks": [{"claim": c.claim, "holds": c.holds, "found": c.found} for c in self.finding.checks],
            "seconds": self.seconds,
        }
