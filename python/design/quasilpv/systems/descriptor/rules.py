"""Takagi-Sugeno models given as rules: their memberships as premises."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.vocabulary import SymbolicMatrix, Vocabulary
from quasilpv.systems.intervals.enclosure import enclose

_NEGATIVE = 1e-9
"""By how much a proved lower bound of a membership may fall below 0: bounds are rounded outward."""


def membership_premises(names: Vocabulary, memberships: Sequence[sp.Expr]) -> tuple[Premise, ...]:
    """The memberships of all rules but the last, with bounds that make the simplex of their sectors hold them all.

    With ``h_i >= -e`` proved for all r memberships and sum 1, the bounds [-e, 1 + (r - 1) e] give sector coordinates
    ``(h_i + e)/(1 + r e) >= 0`` of the first r - 1, which sum to at most 1 because ``h_r >= -e``.

    Raises:
        InputError: the sum is not proved to be 1, or a membership not to be >= 0; it is named.
    """
    if not memberships:
        raise InputError(names.source, "rules", "none", "at least one")
    total = sp.simplify(sp.Add(*memberships) - 1)
    if total != 0:
        raise InputError(names.source, "memberships", f"the sum {sp.simplify(total + 1)}", "a sum proved to be 1")
    lowest = 0.0
    for number, membership in enumerate(memberships, 1):
        low = enclose(membership, names.domain)[0]
        if low < -_NEGATIVE:
            expected = "a membership proved to be >= 0 over the domain"
            raise InputError(names.source, f"h_{number}", f"{membership} >= {low:.4g}", expected)
        lowest = min(lowest, low)
    excess = (len(memberships) - 1) * -lowest
    bounds = (lowest, nextafter(1.0 + excess, inf) if excess else 1.0)
    return tuple(
        Premise(
            f"h{number}",
            membership,
            bounds,
            PremiseKind.UNKNOWN if membership.free_symbols & set(names.unknown) else PremiseKind.MEASURED,
        )
        for number, membership in enumerate(memberships[:-1], 1)
    )


def read_constant(names: Vocabulary, field: str, matrix: SymbolicMatrix | NDArray[np.float64]) -> NDArray[np.float64]:
    """A matrix of numbers.

    Raises:
        InputError: an entry depends on a name.
    """
    entries = names.read_matrix(field, matrix.tolist() if isinstance(matrix, np.ndarray) else matrix)
    if entries.free_symbols:
        raise InputError(names.source, field, entries.tolist(), "numbers: the rules' memberships depend on the state")
    return np.array(entries.tolist(), dtype=float).reshape(entries.shape)


def affine_in_memberships(source: str, field: str, vertices: Sequence[NDArray[np.float64]]) -> AffineMatrix:
    """``sum_i h_i X_i = X_r + sum_(i < r) h_i (X_i - X_r)``.

    Raises:
        InputError: the matrices differ in shape.
    """
    *first, last = vertices
    for number, vertex in enumerate(first, 1):
        if vertex.shape != last.shape:
            raise InputError(source, f"{field}_{number}", f"shape {vertex.shape}", f"shape {last.shape} as of the last")
    slopes = [vertex - last for vertex in first]
    return AffineMatrix(last, np.array(slopes).reshape(len(first), *last.shape))
