"""Matrix polynomials of degree at most one in each premise: what vertex sums collapse to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError

Matrices = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MultilinearForm:
    """A matrix polynomial ``sum_S (product of z_p, p in S) X_S`` of degree at most one in each premise.

    Attributes:
        premises: number of premises r.
        terms: X_S by the sorted tuple S of premise indices; ``()`` is the constant.
    """

    premises: int
    terms: Mapping[tuple[int, ...], Matrices]

    @property
    def degree(self) -> int:
        """Largest number of premises multiplied in a term; 1 or less means affine."""
        return max(len(monomial) for monomial in self.terms)

    def affine(self) -> tuple[Matrices, Matrices]:
        """(X_0, X_p) of an affine form, shapes (...) and (r, ...).

        Raises:
            InputError: the form has terms of higher degree.
        """
        if self.degree > 1:
            raise InputError("multilinear form", "degree", self.degree, "at most 1 for an affine form")
        zero = np.zeros_like(self.terms[()])
        coefficients = [self.terms.get((p,), zero) for p in range(self.premises)]
        return self.terms[()], np.array(coefficients).reshape(self.premises, *zero.shape)

    def evaluate(self, z: ArrayLike) -> Matrices:
        """Value at a premise vector z (r,)."""
        values = np.asarray(z, dtype=float)
        total: Matrices = sum((np.prod(values[list(s)]) * X for s, X in self.terms.items()), np.zeros(()))
        return total
