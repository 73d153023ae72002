"""Symmetric matrices that are polynomials in cosines of a posture and in the payload fraction, exactly.

``X(delta, f) = sum_k cos(N_k . delta) sum_p f^p C_kp`` with integer combinations N_k of the angles delta, up to a
symmetric error no entry of which exceeds ``rest``. Inertias are of this form, and so are their products, because
``2 cos a cos b = cos(a + b) + cos(a - b)``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.cells import Pencil
from quasilpv.certificate.exact.matrices import magnitude, zero
from quasilpv.certificate.exact.rationals import to_floats

Combination: TypeAlias = tuple[int, ...]
Powers: TypeAlias = tuple[fmpq_mat, ...]


@dataclass(frozen=True)
class CosineMatrix:
    """See the module.

    Attributes:
        terms: coefficients C_kp of ascending powers of f by combination N_k, whose first nonzero entry is positive.
        rest: bound on the absolute value of every entry of what is left out.
    """

    terms: Mapping[Combination, Powers]
    rest: fmpq_mat

    def __add__(self, other: CosineMatrix) -> CosineMatrix:
        """Sum; the errors add up."""
        terms = dict(self.terms)
        for combination, powers in other.terms.items():
            terms[combination] = _sum(terms.get(combination, ()), powers)
        return CosineMatrix(terms, self.rest + other.rest)

    def __mul__(self, factor: fmpq) -> CosineMatrix:
        """Multiple."""
        terms = {combination: tuple(C * factor for C in powers) for combination, powers in self.terms.items()}
        return CosineMatrix(terms, self.rest * abs(factor))

    def times(self, middle: fmpq_mat, other: CosineMatrix) -> CosineMatrix:
        """``self middle other``, which need not be symmetric."""
        terms: dict[Combination, Powers] = {}
        for a, left in self.terms.items():
            for b, right in other.terms.items():
                product = _product(left, middle / 2, right)
                for combination in (
                    _canonical(tuple(x + y for x, y in zip(a, b, strict=True))),
                    _canonical(tuple(x - y for x, y in zip(a, b, strict=True))),
                ):
                    terms[combination] = _sum(terms.get(combination, ()), product)
        between = magnitude(middle)
        rest = (
            self.magnitude() * between * other.rest
            + self.rest * between * other.magnitude()
            + self.rest * between * other.rest
        )
        return CosineMatrix(terms, rest)

    def magnitude(self) -> fmpq_mat:
        """Bound on the absolute value of every entry, for f in [0, 1]; the error is left out."""
        return sum((magnitude(C) for powers in self.terms.values() for C in powers), self.rest * 0)

    def at(self, points: FloatArray) -> FloatArray:
        """The matrix in doubles, (N, n, n), at points (delta, f), (N, n)."""
        total = np.zeros((len(points), self.rest.nrows(), self.rest.ncols()))
        for combination, powers in self.terms.items():
            cosine = np.cos(points[:, :-1] @ np.array(combination, dtype=float))
            for power, C in enumerate(powers):
                total += (cosine * points[:, -1] ** power)[:, None, None] * to_floats(C)
        return total

    def to_pencil(self) -> Pencil:
        """The symmetric matrix as a pencil for the test of cells."""
        size, angles = self.rest.nrows(), len(next(iter(self.terms)))
        none = (0,) * angles
        waves = [combination for combination in self.terms if combination != none]
        degree = max(len(powers) for powers in self.terms.values()) - 1
        K = np.full((degree + 1, 1 + len(waves), size, size), fmpq(0), dtype=object)
        for place, combination in enumerate([none, *waves]):
            for power, C in enumerate(self.terms.get(combination, ())):
                K[power, place] = np.array(C.table(), dtype=object)
        sums = np.array(waves, dtype=object).reshape(len(waves), angles).T
        return Pencil.enclosing(K, np.array(self.rest.table(), dtype=object), sums)


def _canonical(combination: Combination) -> Combination:
    """The combination or its negative, whose cosine is the same: the first nonzero entry is positive."""
    leading = next((entry for entry in combination if entry), 0)
    return combination if leading >= 0 else tuple(-entry for entry in combination)


def _sum(left: Powers, right: Powers) -> Powers:
    shorter, longer = sorted((left, right), key=len)
    return (*(x + y for x, y in zip(shorter, longer, strict=False)), *longer[len(shorter) :])


def _product(left: Powers, middle: fmpq_mat, right: Powers) -> Powers:
    """Coefficients of the product of two polynomials with a constant matrix between them."""
    size = middle.nrows()
    total = [zero(size, size) for _ in range(len(left) + len(right) - 1)]
    for p, L in enumerate(left):
        for q, R in enumerate(right):
            total[p + q] += L * middle * R
    return tuple(total)
