"""The rules by which printed and computed are compared, fixed before anything was computed.

Numbers agree within a factor 1.25, counts exactly, regions with a Jaccard index of at least 0.9; an inclusion of
regions is checked point by point. That one controller is better than another means: in every number named.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TypeAlias

from quasilpv.reproduction.item import Check
from quasilpv.studies.answer import Verdict
from quasilpv.studies.region import Region

FACTOR = 1.25
JACCARD = 0.9

Places: TypeAlias = frozenset[tuple[float, float]]


def number(claim: str, printed: float, computed: float) -> Check:
    """A positive number, within a factor 1.25 either way."""
    holds = printed / FACTOR <= computed <= printed * FACTOR
    return Check(f"{claim} = {printed:g}", holds, f"{computed:.4g}")


def numbers(claim: str, printed: Mapping[str, float], computed: Mapping[str, float]) -> Check:
    """Positive numbers by name, each of them by the rule of `number`."""
    holds = all(number(name, value, computed[name]).holds for name, value in printed.items())
    return Check(f"{claim}: {_listed(printed)}", holds, _listed({name: computed[name] for name in printed}))


def as_small(claim: str, printed: Mapping[str, float], computed: Mapping[str, float]) -> Check:
    """Positive numbers by name, none of them larger than the printed one by more than a factor 1.25."""
    holds = all(computed[name] <= FACTOR * value for name, value in printed.items())
    found = _listed({name: computed[name] for name in printed})
    return Check(f"{claim}: no larger than {_listed(printed)}", holds, found)


def at_most(claim: str, bounds: Mapping[str, float], computed: Mapping[str, float]) -> Check:
    """Numbers by name, none of them larger than its bound."""
    holds = all(computed[name] <= bound for name, bound in bounds.items())
    return Check(f"{claim}: at most {_listed(bounds)}", holds, _listed({name: computed[name] for name in bounds}))


def smaller(claim: str, values: Mapping[str, float], others: Mapping[str, float]) -> Check:
    """Every number is smaller than the one of the same name beside it."""
    holds = all(value < others[name] for name, value in values.items())
    found = ", ".join(f"{name} {_digits(value)} against {_digits(others[name])}" for name, value in values.items())
    return Check(claim, holds, found)


def exact(claim: str, printed: int, computed: int) -> Check:
    """A count."""
    return Check(f"{claim} = {printed}", printed == computed, str(computed))


def inclusion(claim: str, inner: Places, outer: Places) -> Check:
    """``inner`` lies in ``outer``, every point of it."""
    outside = sorted(inner - outer)
    found = f"{len(inner)} points inside {len(outer)}" if not outside else f"{len(outside)} outside, e.g. {outside[0]}"
    return Check(claim, not outside, found)


def strict_inclusion(claim: str, inner: Places, outer: Places) -> Check:
    """``inner`` lies in ``outer`` and is smaller."""
    check = inclusion(claim, inner, outer)
    return Check(
        claim, check.holds and inner != outer, check.found if inner != outer else f"equal, {len(inner)} points"
    )


def same_region(claim: str, one: Places, other: Places) -> Check:
    """Two regions with a Jaccard index of at least 0.9; two empty ones are the same."""
    union = one | other
    index = len(one & other) / len(union) if union else 1.0
    return Check(claim, index >= JACCARD, f"Jaccard index {index:.3f}")


def fact(claim: str, holds: bool, found: str) -> Check:
    """A claim decided by the caller's numbers, which ``found`` states."""
    return Check(claim, holds, found)


def feasible(region: Region) -> Places:
    """The proved points of a map."""
    return frozenset((p.x, p.y) for p in region.points if p.answer.verdict is Verdict.FEASIBLE)


def undecided(regions: Collection[Region]) -> int:
    """Points of maps about which nothing is known: they count as not feasible, and are reported."""
    return sum(p.answer.verdict is Verdict.UNKNOWN for region in regions for p in region.points)


def _listed(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {_digits(value)}" for name, value in values.items())


def _digits(value: float) -> str:
    """Three digits, all of those before the point."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
