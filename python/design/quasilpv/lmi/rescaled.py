"""Inequalities in other units, from those in their own: every coefficient times a power of two.

Units are powers of two for rows and columns of the inequalities and for the unknowns. What a coefficient is multiplied
by then depends on its place alone, not on the parameters of a family: read off at one member, it is known for all.
"""

from __future__ import annotations

import numpy as np

from quasilpv.arrays import IndexArray
from quasilpv.lmi.compiled import CompiledProblem


def powers_between(own: CompiledProblem, other: CompiledProblem) -> IndexArray | None:
    """Exponents (nnz,) with ``other = own * 2^exponents``, coefficient by coefficient; None if there are none.

    Args:
        own, other: the same inequalities in two systems of units, at a point where no coefficient vanishes.
    """
    a, b = own.layout, other.layout
    same = a.sizes == b.sizes and np.array_equal(a.row, b.row) and np.array_equal(a.unknown, b.unknown)
    if not same or not np.all(own.coefficients != 0):
        return None
    mantissa, exponent = np.frexp(other.doubles() / own.doubles())  # rounding commutes with powers of two
    return np.asarray(exponent - 1, dtype=np.intp) if np.all(mantissa == 0.5) else None


def rescaled(own: CompiledProblem, powers: IndexArray) -> CompiledProblem:
    """A problem with coefficients multiplied by powers of two, exactly.

    Args:
        own: the problem.
        powers: exponents, (nnz,).
    """
    least = int(powers.min(initial=0))
    factors = np.array([1 << int(power) for power in powers - least], dtype=object)
    return CompiledProblem(own.layout, own.coefficients.astype(object) * factors, own.denominator << -least)
