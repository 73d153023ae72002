"""Several members of a family with common unknowns: one solution that holds at all of them holds between them.

The inequalities ``F_k(x; p) > 0`` of a `CompiledFamily` are affine in the parameters p. For fixed x the set of p where
they hold is therefore convex: it contains the convex hull of every set of points it contains, a whole rectangle if it
contains the four corners.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from math import lcm

import numpy as np

from quasilpv.lmi.compiled import SHORT, CompiledFamily, CompiledProblem
from quasilpv.lmi.layout import Layout


def common_problem(family: CompiledFamily, points: Sequence[Mapping[str, float]]) -> CompiledProblem:
    """The inequalities of all these members, with one set of unknowns.

    Args:
        family: of problems.
        points: a value for every parameter; at least one.
    """
    members = [family.at(point) for point in points]
    if len(members) == 1:
        return members[0]
    denominator = lcm(*(member.denominator for member in members))
    coefficients = np.concatenate(
        [member.coefficients.astype(object) * (denominator // member.denominator) for member in members]
    )
    if max(denominator, int(np.max(np.abs(coefficients), initial=0))) < SHORT:
        coefficients = coefficients.astype(np.int64)
    return CompiledProblem(_repeated(family.layout, len(members)), coefficients, denominator)


@lru_cache(maxsize=8)
def _repeated(layout: Layout, count: int) -> Layout:
    """The same inequalities count times over, in the same unknowns."""
    shift = np.repeat(np.arange(count) * layout.rows, len(layout.row))
    return replace(
        layout,
        names=tuple(f"{name} at point {k}" for k in range(count) for name in layout.names),
        sizes=layout.sizes * count,
        row=np.tile(layout.row, count) + shift,
        unknown=np.tile(layout.unknown, count),
    )
