"""A descriptor system on a block polytope: the vertices on which every condition of the project is stated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InputError
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

ExactMatrix: TypeAlias = npt.NDArray[Any]
"""Array of `fractions.Fraction`."""

Vertices: TypeAlias = tuple[ExactMatrix, ...]

MatrixFunction: TypeAlias = Callable[[ExactMatrix, ExactMatrix, ExactMatrix], ExactMatrix]
"""From exact (E, A, B) to an exact matrix."""


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
        return self.vertices(lambda E, A, B: E)

    @cached_property
    def A(self) -> tuple[ExactMatrix, ...]:
        """Vertices A_i, (n, n)."""
        return self.vertices(lambda E, A, B: A)

    @cached_property
    def B(self) -> tuple[ExactMatrix, ...]:
        """Vertices B_i, (n, m)."""
        return self.vertices(lambda E, A, B: B)

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

    def vertices(self, function: MatrixFunction) -> Vertices:
        """Vertices of an affine function of (E, A, B), exact.

        Vertices that differ only in premises the function does not depend on are one and the same object: of the 4096
        vertices of a function of three premises, eight are computed.
        """
        constant, slopes = self._affine(function)
        first = self.polytope.equal_vertices(list(slopes))
        distinct = np.unique(first).tolist()
        values = {
            vertex: sum((offsets[p] * slope for p, slope in slopes.items()), constant)
            for vertex, offsets in zip(distinct, self.polytope.exact_offsets(distinct), strict=True)
        }
        return tuple(values[vertex] for vertex in first.tolist())

    def premises_of(self, function: MatrixFunction) -> list[int]:
        """The premises on which an affine function of (E, A, B) depends, ascending."""
        return sorted(self._affine(function)[1])

    def spread(self, function: MatrixFunction) -> tuple[ExactMatrix, dict[int, ExactMatrix]]:
        """An affine function of (E, A, B) over the box, exact: ``X_c + sum_p d_p X_p`` with ``-1 <= d_p <= 1``.

        Returns:
            X_c, its value at the centre of the box, and the X_p that are not zero by premise.
        """
        constant, slopes = self._affine(function)
        bounds = {p: (Fraction(self.polytope.lower[p]), Fraction(self.polytope.upper[p])) for p in slopes}
        centre = sum(((low + high) / 2 * slopes[p] for p, (low, high) in bounds.items()), constant)
        return centre, {p: (high - low) / 2 * slopes[p] for p, (low, high) in bounds.items()}

    def _affine(self, function: MatrixFunction) -> tuple[ExactMatrix, dict[int, ExactMatrix]]:
        """Value at z = 0 and coefficients of the premises on which a function depends."""
        origin = function(*(np.zeros(X.shape, dtype=int).astype(object) for X in self._constants))
        slopes = {p: function(*X) - origin for p, X in self._slopes.items()}
        return function(*self._constants), {p: slope for p, slope in slopes.items() if slope.any()}

    @cached_property
    def _constants(self) -> tuple[ExactMatrix, ExactMatrix, ExactMatrix]:
        system = self.system
        return _rational(system.E.constant), _rational(system.A.constant), _rational(system.B.constant)

    @cached_property
    def _slopes(self) -> dict[int, tuple[ExactMatrix, ExactMatrix, ExactMatrix]]:
        """Coefficient matrices of every premise."""
        E, A, B = (matrix.coefficients for matrix in (self.system.E, self.system.A, self.system.B))
        return {p: (_rational(E[p]), _rational(A[p]), _rational(B[p])) for p in range(self.polytope.premises)}


def unknown_premises(system: DescriptorSystem) -> tuple[int, ...]:
    """Indices of the premises whose value no controller has."""
    return tuple(k for k, premise in enumerate(system.premises) if premise.kind is PremiseKind.UNKNOWN)


def _rational(matrix: ExactMatrix) -> ExactMatrix:
    return np.array([Fraction(entry) for entry in matrix.flat], dtype=object).reshape(matrix.shape)
