"""Linear matrix inequalities as numbers: sparse, exact, and affine in parameters when a family of problems is.

`CompiledProblem` holds, for every inequality ``F_k(x) = F_k0 + sum_j x_j F_kj > 0``, the upper triangle of its
symmetric part as exact rational coefficients over the vector x of all unknowns. `compile_family` compiles a problem
whose data are affine in parameters once, ``F(x; p) = F(x; 0) + sum_i p_i G_i(x)``: a sweep over the parameters then
updates numbers instead of building matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import lcm
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse

from quasilpv.arrays import FloatArray, IndexArray, distinct
from quasilpv.lmi import budget
from quasilpv.lmi.assembly import unknown_offsets, unpack
from quasilpv.lmi.exact import is_positive_triangle, over_common_denominator
from quasilpv.lmi.expressions import Expression, Variable
from quasilpv.lmi.independence import independent_columns
from quasilpv.lmi.layout import Layout
from quasilpv.lmi.problem import Problem

ExactArray = npt.NDArray[Any]

CANDIDATE_BITS = 40
"""A candidate point is rounded to this many bits below its largest entry before it is checked exactly."""

SHORT = 2**62
"""Integers below it, in magnitude, are held in 64 bits."""

DEGREE = 3
"""Of inequalities as polynomials in parameters in which E, A and B are affine: two of them, and a basis, multiplied."""

HALF = 2 ** (CANDIDATE_BITS // 2)
"""Cuts the integers of a candidate point in two."""


@dataclass(frozen=True, eq=False)
class CompiledProblem:
    """The inequalities of a problem as exact coefficients; see the module.

    Attributes:
        layout: where the coefficients belong.
        coefficients: integers, (nnz,), off-diagonal ones of twice the symmetric part; int64 where they are short.
        denominator: that all of them share.
    """

    layout: Layout
    coefficients: ExactArray
    denominator: int

    @classmethod
    def of(cls, problem: Problem) -> CompiledProblem:
        """Compile one problem; its objective plays no part."""
        table = _Coefficients.of(problem)
        short = max(table.denominator, _largest(table.integers)) < SHORT
        integers = table.integers.astype(np.int64) if short else table.integers
        return cls(_layout(problem, table.places, table.integers[None]), integers, table.denominator)

    def matrix(self) -> tuple[sparse.csc_matrix, FloatArray]:
        """``(G, g)`` with the scaled upper triangles ``svec(F(x)) = G x_kept + g``, in double.

        Off-diagonal entries carry a factor sqrt(2), so that inner products of matrices are those of vectors.
        """
        layout = self.layout
        values = layout.scale * self.doubles()
        offset = layout.sums(np.where(layout.unknown < 0, values, 0.0))
        order, rows, starts = layout.columns
        return sparse.csc_matrix((values[order], rows, starts), shape=(layout.rows, len(layout.kept))), offset

    def doubles(self) -> FloatArray:
        """The coefficients, rounded, (nnz,)."""
        if self.coefficients.dtype == np.int64:
            return np.asarray(self.coefficients / float(self.denominator))
        return np.array([c / self.denominator for c in self.coefficients.tolist()])

    def values(self, point: FloatArray) -> dict[Variable, FloatArray]:
        """One matrix per variable from the kept unknowns, (kept,)."""
        return unpack(self._full(point), self.layout.variables)

    def holds_exactly(self, point: FloatArray) -> bool:
        """Whether every inequality holds strictly at the kept unknowns, in integer arithmetic.

        The point is taken as it is; round it first (`rounded`) to keep the integers short.
        """
        return self.first_violated(point) is None

    def first_violated(self, point: FloatArray) -> str | None:
        """Name of the first inequality that does not hold strictly at a point, or None."""
        x, denominator = _integers(self._full(point))
        entries = self._entries(np.append(x, denominator))
        entries = np.where(self.layout.diagonal, 2 * entries, entries)
        start = 0
        for name, size in zip(self.layout.names, self.layout.sizes, strict=True):
            budget.time_left_s()
            end = start + size * (size + 1) // 2
            if not is_positive_triangle(_triangle_rows(entries[start:end].tolist(), size)):
                return name
            start = end
        return None

    def _entries(self, x: ExactArray) -> ExactArray:
        """Upper triangles, off-diagonal entries doubled, at integer unknowns followed by what multiplies constants.

        Products of a coefficient and half the bits of an unknown are summed in 64-bit integers where none overflows.
        """
        layout, coefficients = self.layout, self.coefficients
        halves = x // HALF, x % HALF
        largest = max(map(_largest, halves)) * layout.longest_row * _largest(coefficients)
        if coefficients.dtype == np.int64 and largest < SHORT:
            high, low = (layout.sums(coefficients * half.astype(np.int64)[layout.unknown]) for half in halves)
            return np.asarray(high.astype(object) * HALF + low)
        return layout.sums(coefficients.astype(object) * x[layout.unknown])

    def _full(self, point: FloatArray) -> FloatArray:
        full = np.zeros(self.layout.unknowns)
        full[self.layout.kept] = point
        return full


@dataclass(frozen=True, eq=False)
class CompiledFamily:
    """Problems with data affine in parameters.

    Attributes:
        layout: common to all.
        parameters: their names.
        coefficients: integers, (1 + parameters, nnz): the constant part, then one slope per parameter.
        denominator: that all of them share.
    """

    layout: Layout
    parameters: tuple[str, ...]
    coefficients: ExactArray
    denominator: int

    def at(self, parameters: Mapping[str, float]) -> CompiledProblem:
        """The problem at a point.

        Args:
            parameters: a value for every parameter; doubles are taken as the rationals they are.
        """
        point = [Fraction(parameters[name]) for name in self.parameters]
        scale = lcm(1, *(value.denominator for value in point))
        factors = [scale, *(int(value * scale) for value in point)]
        denominator = self.denominator * scale
        if max(denominator, sum(abs(f) * m for f, m in zip(factors, self._magnitudes, strict=True))) < SHORT:
            return CompiledProblem(self.layout, np.array(factors) @ self._short, denominator)
        coefficients = sum((f * row for f, row in zip(factors, self.coefficients, strict=True)), 0)
        return CompiledProblem(self.layout, np.asarray(coefficients), denominator)

    @cached_property
    def _magnitudes(self) -> list[int]:
        """Of the largest coefficient of every level."""
        return [_largest(level) for level in self.coefficients]

    @cached_property
    def _short(self) -> npt.NDArray[np.int64]:
        """The coefficients as 64-bit integers, for points at which they are short."""
        return self.coefficients.astype(np.int64)


def compile_family(
    build: Callable[[Mapping[str, float]], Problem],
    base: Mapping[str, float],
    steps: Mapping[str, float] | None = None,
) -> CompiledFamily | None:
    """Compile a family of problems, or None if its data are not affine in the parameters.

    The problem is built at the points of `lattice`, of which the first give the affine model. At all of them it is
    compared with the truth, exactly: for polynomials of degree `DEGREE` at most, equality there is equality everywhere.

    Args:
        build: the problem at a parameter point; always the same unknowns and inequalities in the same order.
        base: names of the parameters and a point.
        steps: of the lattice, by name; 1 if they are not given.
    """
    names = tuple(base)
    nodes = lattice(base, steps)
    problem = build(base)
    tables = [_Coefficients.of(member) for member in (problem, *map(build, nodes[1:]))]
    places = distinct(np.concatenate([table.places for table in tables]))
    denominator = lcm(*(table.denominator for table in tables))
    origin, *others = (table.spread(places, denominator) for table in tables)
    slopes = [row - origin for row in others[: len(names)]]
    inverse = [1 / Fraction(steps[name] if steps else 1) for name in names]
    shift = [Fraction(base[name]) * per for name, per in zip(names, inverse, strict=True)]
    scale = lcm(1, *(value.denominator for value in (*shift, *inverse)))
    constant = scale * origin - sum((int(scale * p) * row for p, row in zip(shift, slopes, strict=True)), 0)
    levels = [int(scale * per) * row for per, row in zip(inverse, slopes, strict=True)]
    coefficients = np.stack([constant, *levels])
    family = CompiledFamily(_layout(problem, places, coefficients), names, coefficients, denominator * scale)
    for node, row in zip(nodes, (origin, *others), strict=True):
        member = family.at(node)
        if np.any(member.coefficients.astype(object) * denominator != row * member.denominator):
            return None
    return family


def rounded(point: FloatArray) -> FloatArray:
    """A finite point with its entries rounded to `CANDIDATE_BITS` bits below the largest one; exact in double.

    The unit itself need not be a double: it is a power of two, applied to the exponents.
    """
    _, exponent = np.frexp(np.max(np.abs(point), initial=0.0))
    steps = np.round(np.ldexp(point, CANDIDATE_BITS - exponent))
    most = 2.0**CANDIDATE_BITS - (exponent == np.finfo(float).maxexp)  # the largest doubles would round to infinity
    return np.asarray(np.ldexp(np.clip(steps, -most, most), exponent - CANDIDATE_BITS))


def lattice(base: Mapping[str, float], steps: Mapping[str, float] | None = None) -> list[dict[str, float]]:
    """Points at which a polynomial of degree `DEGREE` is zero only if it is zero everywhere.

    They are ``base + k``, k in steps (1 if none are given), for whole k >= 0 of sum `DEGREE` at most (principal
    lattice of a simplex, Nicolaides 1972), by that sum: the base point, one step along every parameter, the others.
    Masses and frictions are bounded below only.
    """
    counts = [k for k in product(range(DEGREE + 1), repeat=len(base)) if sum(k) <= DEGREE]
    counts.sort(key=lambda k: (sum(k), [-count for count in k]))
    length = steps or dict.fromkeys(base, 1.0)
    return [{name: base[name] + n * length[name] for name, n in zip(base, k, strict=True)} for k in counts]


@dataclass(frozen=True, eq=False)
class _Coefficients:
    """Exact coefficients of a problem by place, ``(row, unknown) -> row (U + 1) + unknown + 1``.

    Attributes:
        places: (nnz,), ascending.
        integers: (nnz,), off-diagonal ones of twice the symmetric part.
        denominator: that all of them share.
    """

    places: IndexArray
    integers: ExactArray
    denominator: int

    @classmethod
    def of(cls, problem: Problem) -> _Coefficients:
        """Read them off the terms."""
        offsets = unknown_offsets(problem.variables)
        stride = 1 + sum(variable.size for variable in problem.variables)
        parts: list[tuple[IndexArray, ExactArray, int]] = []
        start = 0
        for constraint in problem.constraints:
            budget.time_left_s()
            for row, column, unknown, integers, denominator in _exact_entries(constraint.expression, offsets):
                low, high = np.minimum(row, column), np.maximum(row, column)
                parts.append(((start + high * (high + 1) // 2 + low) * stride + unknown + 1, integers, denominator))
            size = constraint.expression.shape[0]
            start += size * (size + 1) // 2
        common = lcm(1, *{denominator for _, _, denominator in parts})
        places = np.concatenate([part[0] for part in parts])
        values = np.concatenate([integers * (common // denominator) for _, integers, denominator in parts])
        order = np.argsort(places, kind="stable")
        unique, first = np.unique(places[order], return_index=True)
        return cls(unique, np.add.reduceat(values[order], first), common)

    def spread(self, places: IndexArray, denominator: int) -> ExactArray:
        """The integers at a superset of the places, over a multiple of the denominator."""
        spread = np.zeros(len(places), dtype=object)
        spread[np.searchsorted(places, self.places)] = self.integers * (denominator // self.denominator)
        return spread


def _exact_entries(
    expression: Expression, offsets: Mapping[Variable, int]
) -> Iterator[tuple[IndexArray, IndexArray, IndexArray, ExactArray, int]]:
    """(rows, columns, unknowns, integers, denominator) of every term; unknown -1 is the constant."""
    for term in expression.terms:
        row, column, unknown, integers, denominator = term.exact_derivative()
        yield row, column, unknown + offsets[term.variable], integers, denominator
    row, column = np.nonzero(expression.constant)
    if row.size:
        yield row, column, np.full(row.shape, -1), *over_common_denominator(expression.constant[row, column])


def _layout(problem: Problem, places: IndexArray, coefficients: ExactArray) -> Layout:
    """Layout of coefficients at the given places, (levels, nnz)."""
    unknowns = sum(variable.size for variable in problem.variables)
    row, unknown = np.divmod(places, 1 + unknowns)
    layout = Layout(
        names=tuple(c.name for c in problem.constraints),
        sizes=tuple(c.expression.shape[0] for c in problem.constraints),
        variables=problem.variables,
        row=row,
        unknown=unknown - 1,
        kept=np.arange(unknowns),
    )
    return replace(layout, kept=_free_unknowns(layout, coefficients))


def _free_unknowns(layout: Layout, coefficients: ExactArray) -> IndexArray:
    """Unknowns whose columns span those of all, whatever the parameters; (levels, nnz) coefficients, exact.

    The slack matrices of a representation, for example, enter through their differences only. Columns are compared over
    all levels (constant part and slopes) at once: a dependence found here holds for every parameter point.
    """
    if layout.unknowns > MAX_COLUMNS_REDUCED:
        return layout.kept
    linear = layout.unknown >= 0
    row = np.concatenate([layout.row[linear] + level * layout.rows for level in range(len(coefficients))])
    column = np.tile(layout.unknown[linear], len(coefficients))
    values = coefficients[:, linear].ravel()
    largest = max(1, _largest(values))
    shape = (layout.rows * len(coefficients), layout.unknowns)
    return independent_columns(
        sparse.csr_matrix(([value / largest for value in values.tolist()], (row, column)), shape=shape)
    )


MAX_COLUMNS_REDUCED = 3_000
"""Larger problems keep all unknowns: the factorisation would cost more than it saves."""


def _largest(integers: ExactArray) -> int:
    """The largest magnitude, 0 without entries."""
    if integers.dtype == np.int64:
        return int(np.max(np.abs(integers), initial=0))
    return max(map(abs, integers.tolist()), default=0)


def _integers(point: FloatArray) -> tuple[ExactArray, int]:
    """Doubles as integers over a common power of two."""
    ratios = [value.as_integer_ratio() for value in point.tolist()]
    common = max((denominator for _, denominator in ratios), default=1)
    return np.array([n * (common // d) for n, d in ratios], dtype=object), common


def _triangle_rows(entries: list[int], size: int) -> list[list[int]]:
    """Rows of the upper triangle from its entries column by column."""
    return [[entries[j * (j + 1) // 2 + i] for j in range(i, size)] for i in range(size)]
