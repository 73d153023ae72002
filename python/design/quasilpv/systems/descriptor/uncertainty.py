"""The norm-bounded view of the unknown premises of a descriptor system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.affine_system import AffineSystem
from quasilpv.systems.descriptor.premise import AffineMatrix

System = TypeVar("System", bound=AffineSystem)

# A coefficient matrix written in doubles has its rank up to rounding only.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class NormBoundedUncertainty(Generic[System]):
    """Unknown premises as ``A + H_a Delta W_a`` and ``B + H_b Delta' W_b`` with ``|Delta| <= 1``, ``|Delta'| <= 1``.

    An unknown premise in [lower, upper] is ``centre + radius d`` with ``|d| <= 1``; each coefficient matrix times its
    radius is factored at its rank k, so that Delta is diagonal, every d repeated k times.

    Attributes:
        nominal: the system at the centres of the unknown premises; the known premises remain.
        Ha, Wa: n x k_a and k_a x n; no column if A does not depend on an unknown premise.
        Hb, Wb: n x k_b and k_b x m.

    Reference: Dehak 2022, (I.37) and Theorem I.3.
    """

    nominal: System
    Ha: NDArray[np.float64]
    Wa: NDArray[np.float64]
    Hb: NDArray[np.float64]
    Wb: NDArray[np.float64]

    @classmethod
    def of(cls, system: System, unknown: Sequence[int]) -> NormBoundedUncertainty[System]:
        """Take the premises of the given indices for unknown.

        Raises:
            InputError: E or C depends on one of them.
        """
        for field in ("E", "C"):
            matrix: AffineMatrix = getattr(system, field)
            if matrix.coefficients[list(unknown)].any():
                raise InputError(
                    system.name, field, "an entry in an unknown premise", "unknown premises in A and B only"
                )
        known = [p for p in range(len(system.premises)) if p not in unknown]
        centre = np.zeros(len(system.premises))
        centre[list(unknown)] = 0.5 * (system.lower + system.upper)[list(unknown)]
        radius = 0.5 * (system.upper - system.lower)

        def nominal(matrix: AffineMatrix) -> AffineMatrix:
            return AffineMatrix(matrix.evaluate(centre), matrix.coefficients[known])

        Ha, Wa = _factored([radius[p] * system.A.coefficients[p] for p in unknown])
        Hb, Wb = _factored([radius[p] * system.B.coefficients[p] for p in unknown])
        return cls(
            replace(
                system,
                premises=tuple(system.premises[p] for p in known),
                E=nominal(system.E),
                A=nominal(system.A),
                B=nominal(system.B),
                C=nominal(system.C),
            ),
            Ha,
            Wa,
            Hb,
            Wb,
        )


def _factored(matrices: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left factors side by side and right factors stacked, each at the rank of its matrix (full pivoting)."""
    rows, columns = matrices[0].shape
    left, right = [np.zeros((rows, 0))], [np.zeros((0, columns))]
    for matrix in matrices:
        remainder = np.array(matrix)
        scale = np.abs(remainder).max(initial=0.0)
        while np.abs(remainder).max(initial=0.0) > _ROUNDING * scale:
            row, column = np.unravel_index(np.abs(remainder).argmax(), remainder.shape)
            left.append(remainder[:, [column]])
            right.append(remainder[[row], :] / remainder[row, column])
            remainder = remainder - left[-1] @ right[-1]
    return np.hstack(left), np.vstack(right)
