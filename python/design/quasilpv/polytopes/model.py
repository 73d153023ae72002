"""A descriptor system on a block polytope: the vertices on which every condition of the project is stated."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InputError
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.systems.descriptor import DescriptorSystem
from quasilpv.systems.premise import AffineMatrix, PremiseKind

ExactMatrix: TypeAlias = npt.NDArray[Any]
"""Array of `fractions.Fraction`."""


@dataclass(frozen=True, eq=False)
class PolytopicModel:
    """``E(z) x' = A(z) x + B(z) u`` with ``X(z) = sum_i w_i(z) X_i``, the vertices X_i exact.

    The vertices are rational numbers: the doubles of the system are taken as the rationals they are, and nothing is
    rounded on the way from them to an inequality.

    Attributes:
        system: the system, whose state holds the q differential states first and the algebraic ones last.
        polytope: of its premises.

    Raises:
        InputError: the polytope has another box than the system, or its controller knows an unknown premise.
    """

    system: DescriptorSystem
    polytope: BlockPolytope

    def __post_init__(self) -> None:
        """Refuse a polytope that is not one of the system's premises."""
        if not (
            np.array_equal(self.polytope.lower, self.system.lower)
            and np.array_equal(self.polytope.upper, self.system.upper)
        ):
            raise InputError(self.system.name, "polytope", "another box", "the bounds of the system's premises")
        unknown = unknown_premises(self.system)
        if not set(unknown) <= self.polytope.unknown:
            got = sorted(self.polytope.unknown)
            raise InputError(self.system.name, "unknown premises", got, f"at least {list(unknown)}")

    @cached_property
    def E(self) -> tuple[ExactMatrix, ...]:
        """Vertices E_i, (n, n) arrays of `fractions.Fraction`."""
        return self._vertices(self.system.E)

    @cached_property
    def A(self) -> tuple[ExactMatrix, ...]:
        """Vertices A_i, (n, n)."""
        return self._vertices(self.system.A)

    @cached_property
    def B(self) -> tuple[ExactMatrix, ...]:
        """Vertices B_i, (n, m)."""
        return self._vertices(self.system.B)

    @property
    def order(self) -> int:
        """Number of states n, algebraic ones included."""
        return self.system.order

    @property
    def differential(self) -> int:
        """Number of differential states q."""
        return self.system.differential

    @property
    def inputs(self) -> int:
        """Number of inputs m."""
        return len(self.system.inputs)

    @property
    def vertex_count(self) -> int:
        """Number of vertices N."""
        return self.polytope.vertex_count

    @property
    def constant_input(self) -> bool:
        """Whether B does not depend on the premises: a gain then meets one vertex index only."""
        return not self.system.B.coefficients.any()

    @property
    def constant_descriptor(self) -> bool:
        """Whether E does not depend on the premises."""
        return not self.system.E.coefficients.any()

    def _vertices(self, matrix: AffineMatrix) -> tuple[ExactMatrix, ...]:
        """One array per vertex; vertices that differ only in premises the matrix does not depend on share theirs."""
        relevant = [p for p in range(matrix.premises) if matrix.coefficients[p].any()]
        constant, slopes = _rational(matrix.constant), [_rational(matrix.coefficients[p]) for p in relevant]
        computed: dict[tuple[Fraction, ...], ExactMatrix] = {}
        for row in self.polytope.exact_vertex_offsets[:, relevant]:
            offsets = tuple(row)
            if offsets not in computed:
                computed[offsets] = sum((c * X for c, X in zip(offsets, slopes, strict=True)), constant)
        return tuple(computed[tuple(row)] for row in self.polytope.exact_vertex_offsets[:, relevant])


def unknown_premises(system: DescriptorSystem) -> tuple[int, ...]:
    """Indices of the premises whose value no controller has."""
    return tuple(k for k, premise in enumerate(system.premises) if premise.kind is PremiseKind.UNKNOWN)


def _rational(matrix: ExactMatrix) -> ExactMatrix:
    return np.array([Fraction(entry) for entry in matrix.flat], dtype=object).reshape(matrix.shape)
