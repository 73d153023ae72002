"""Matrix variables and affine matrix expressions ``C0 + sum_k L_k X_k R_k``.

An expression keeps its terms in the form in which they were written, so that the same object is compiled for a
solver (double) and evaluated at a candidate point in exact rational arithmetic (`fractions.Fraction`): the arrays
``L_k``, ``R_k``, ``C0`` may hold either scalar.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.lmi.exact import Matrix, over_common_denominator, to_rational

Indices: TypeAlias = npt.NDArray[np.intp]
Places: TypeAlias = tuple[Indices, Indices]
Triplets: TypeAlias = tuple[Indices, Indices, Indices, npt.NDArray[np.float64]]
ExactTriplets: TypeAlias = tuple[Indices, Indices, Indices, npt.NDArray[Any], int]

_ids = itertools.count()


@dataclass(frozen=True, eq=False)
class Variable:
    """A decision matrix of ``rows x cols``; symmetric ones have ``rows (rows + 1) / 2`` free entries.

    Args:
        name: used in diagnostics only.
        rows: number of rows.
        cols: number of columns (default: square).
        symmetric: restrict to symmetric matrices.
    """

    name: str
    rows: int
    cols: int = 0
    symmetric: bool = False
    _id: int = field(default_factory=lambda: next(_ids), repr=False)

    def __post_init__(self) -> None:
        """Fill in the default number of columns and check the shape."""
        if self.cols == 0:
            object.__setattr__(self, "cols", self.rows)
        if self.symmetric and self.rows != self.cols:
            raise ValueError(f"{self.name}: a symmetric variable is square, got {self.rows} x {self.cols}")

    @property
    def size(self) -> int:
        """Number of scalar unknowns."""
        return self.rows * (self.rows + 1) // 2 if self.symmetric else self.rows * self.cols

    def index(self) -> npt.NDArray[np.intp]:
        """Which scalar unknown each entry is, shape (rows, cols); symmetric: upper triangle, column by column."""
        if not self.symmetric:
            return np.arange(self.rows * self.cols).reshape((self.rows, self.cols), order="F")
        i, j = np.indices((self.rows, self.rows))
        low, high = np.minimum(i, j), np.maximum(i, j)
        return np.asarray(high * (high + 1) // 2 + low)

    def unpack(self, unknowns: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Matrix value from its scalar unknowns."""
        return unknowns[self.index()]

    @property
    def expression(self) -> Expression:
        """The variable as an expression."""
        return Expression(_zero(self.rows, self.cols), (Product(_eye(self.rows), self, _eye(self.cols), False),))

    @property
    def T(self) -> Expression:
        """Transpose."""
        return self.expression.T

    def __add__(self, other: Operand) -> Expression:
        """Sum."""
        return self.expression + other

    __radd__ = __add__

    def __sub__(self, other: Operand) -> Expression:
        """Difference."""
        return self.expression - other

    def __rsub__(self, other: Operand) -> Expression:
        """Difference, reversed."""
        return -self.expression + other

    def __neg__(self) -> Expression:
        """Opposite."""
        return -self.expression

    def __mul__(self, factor: Any) -> Expression:
        """Product with a number, or of a 1 x 1 variable with a constant matrix."""
        product: Expression = self.expression * factor
        return product

    __rmul__ = __mul__

    def __matmul__(self, other: Matrix) -> Expression:
        """Product with a constant matrix on the right."""
        return self.expression.__matmul__(other)

    def __rmatmul__(self, other: Matrix) -> Expression:
        """Product with a constant matrix on the left."""
        return self.expression.__rmatmul__(other)

    __array_ufunc__ = None  # a numpy array on the left defers to __rmatmul__


@dataclass(frozen=True, eq=False)
class Product:
    """The term ``left @ X @ right``, or ``left @ X.T @ right``."""

    left: Matrix
    variable: Variable
    right: Matrix
    transposed: bool

    def at(self, value: Matrix) -> Matrix:
        """Value of the term at X = value."""
        return self.left @ (value.T if self.transposed else value) @ self.right

    def add_to(self, total: Matrix, value: Matrix) -> None:
        """``total += left @ X @ right`` entry by entry, for exact scalars: constants are mostly zeros."""
        middle = value.T if self.transposed else value
        rows = [(i, p, self.left[i, p]) for i, p in np.argwhere(self.left)]
        for q, j in np.argwhere(self.right):
            factor = self.right[q, j]
            for i, p, coefficient in rows:
                total[i, j] += coefficient * middle[p, q] * factor

    def T(self) -> Product:
        """Transposed term."""
        return Product(self.right.T, self.variable, self.left.T, not self.transposed)

    def scaled(self, left: Matrix | None, right: Matrix | None) -> Product:
        """``left @ term @ right``."""
        new_left = self.left if left is None else _product(left, self.left)
        new_right = self.right if right is None else _product(self.right, right)
        return Product(new_left, self.variable, new_right, self.transposed)

    def times(self, factor: Any) -> Product:
        """``factor * term`` for a number."""
        return Product(_scaled(self.left, factor), self.variable, self.right, self.transposed)

    def placed(self, rows: slice, columns: slice, shape: tuple[int, int]) -> Product:
        """The term as a block of an otherwise zero matrix of the given shape."""
        left = _placed(self.left, rows, slice(None), (shape[0], self.left.shape[1]))
        right = _placed(self.right, slice(None), columns, (self.right.shape[0], shape[1]))
        return Product(left, self.variable, right, self.transposed)

    def map_constants(self, function: Callable[[Matrix], Matrix]) -> Product:
        """The same term with ``function`` applied to its constants."""
        return Product(function(self.left), self.variable, function(self.right), self.transposed)

    def derivative(self) -> Triplets:
        """``d term / d unknowns`` as (row, column, unknown, value), one entry per non-zero product; double."""
        (i, p), (q, j), places = self._places()
        value = np.outer(self.left[i, p].astype(float), self.right[q, j].astype(float))
        return *places, value.ravel()

    def exact_derivative(self) -> ExactTriplets:
        """`derivative` without rounding: (row, column, unknown, integer value, common denominator)."""
        (i, p), (q, j), places = self._places()
        left, left_denominator = over_common_denominator(self.left[i, p])
        right, right_denominator = over_common_denominator(self.right[q, j])
        return *places, np.multiply.outer(left, right).ravel(), left_denominator * right_denominator

    def _places(self) -> tuple[Places, Places, tuple[Indices, Indices, Indices]]:
        """Where left and right are not zero, and row, column and unknown of every product of such entries."""
        index = self.variable.index().T if self.transposed else self.variable.index()
        (i, p), (q, j) = np.nonzero(self.left), np.nonzero(self.right)
        return (i, p), (q, j), (np.repeat(i, len(j)), np.tile(j, len(i)), index[p[:, None], q[None, :]].ravel())


@dataclass(frozen=True, eq=False)
class ScalarProduct:
    """The term ``x * coefficient`` with a 1 x 1 variable x."""

    coefficient: Matrix
    variable: Variable

    def at(self, value: Matrix) -> Matrix:
        """Value of the term at x = value."""
        product: Matrix = self.coefficient * value[0, 0]
        return product

    def add_to(self, total: Matrix, value: Matrix) -> None:
        """``total += x * coefficient`` entry by entry, for exact scalars."""
        for i, j in np.argwhere(self.coefficient):
            total[i, j] += self.coefficient[i, j] * value[0, 0]

    def T(self) -> ScalarProduct:
        """Transposed term."""
        return ScalarProduct(self.coefficient.T, self.variable)

    def scaled(self, left: Matrix | None, right: Matrix | None) -> ScalarProduct:
        """``left @ term @ right``."""
        new = self.coefficient if left is None else _product(left, self.coefficient)
        return ScalarProduct(new if right is None else _product(new, right), self.variable)

    def times(self, factor: Any) -> ScalarProduct:
        """``factor * term`` for a number."""
        return ScalarProduct(_scaled(self.coefficient, factor), self.variable)

    def placed(self, rows: slice, columns: slice, shape: tuple[int, int]) -> ScalarProduct:
        """The term as a block of an otherwise zero matrix of the given shape."""
        return ScalarProduct(_placed(self.coefficient, rows, columns, shape), self.variable)

    def map_constants(self, function: Callable[[Matrix], Matrix]) -> ScalarProduct:
        """The same term with ``function`` applied to its constants."""
        return ScalarProduct(function(self.coefficient), self.variable)

    def derivative(self) -> Triplets:
        """``d term / d x`` as (row, column, unknown, value); double."""
        row, column = np.nonzero(self.coefficient)
        return row, column, np.zeros_like(row), self.coefficient[row, column].astype(float)

    def exact_derivative(self) -> ExactTriplets:
        """`derivative` without rounding: (row, column, unknown, integer value, common denominator)."""
        row, column = np.nonzero(self.coefficient)
        return row, column, np.zeros_like(row), *over_common_denominator(self.coefficient[row, column])


Term: TypeAlias = Product | ScalarProduct
Operand: TypeAlias = "Expression | Variable | Matrix"


def _zero(rows: int, cols: int) -> Matrix:
    return np.zeros((rows, cols), dtype=int).astype(object)


def _placed(matrix: Matrix, rows: slice, columns: slice, shape: tuple[int, int]) -> Matrix:
    larger = _zero(*shape)
    larger[rows, columns] = matrix
    return larger


def _product(left: Matrix, right: Matrix) -> Matrix:
    """``left @ right`` without the products of exact zeros, of which there are many."""
    if left.dtype != object or right.dtype != object or left.shape[1:] != right.shape[:1]:
        product: Matrix = left @ right
        return product
    rows: dict[int, list[tuple[int, Any]]] = {}
    for p, j in zip(*(places.tolist() for places in np.nonzero(right)), strict=True):
        rows.setdefault(p, []).append((j, right[p, j]))
    total: dict[tuple[int, int], Any] = {}
    for i, p in zip(*(places.tolist() for places in np.nonzero(left)), strict=True):
        factor = left[i, p]
        for j, entry in rows.get(p, ()):
            value = factor * entry
            total[i, j] = total[i, j] + value if (i, j) in total else value
    result = _zero(left.shape[0], right.shape[1])
    for place, value in total.items():
        result[place] = value
    return result


def _scaled(matrix: Matrix, factor: Any) -> Matrix:
    """``factor * matrix`` without the products of exact zeros, of which there are many."""
    if matrix.dtype != object:
        product: Matrix = matrix * factor
        return product
    scaled, places = matrix.copy(), np.nonzero(matrix)
    entries = matrix[places]
    scaled[places] = -entries if factor == -1 else entries * factor  # a fraction is negated in a tenth of the time
    return scaled


def _eye(size: int) -> Matrix:
    return np.eye(size, dtype=int).astype(object)


@dataclass(frozen=True, eq=False)
class Expression:
    """Affine matrix expression: a constant plus terms, all of one shape."""

    constant: Matrix
    terms: tuple[Term, ...]

    __array_ufunc__ = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.constant.shape
        return rows, cols

    @property
    def T(self) -> Expression:
        """Transpose."""
        return Expression(self.constant.T, tuple(term.T() for term in self.terms))

    def __add__(self, other: Operand) -> Expression:
        """Sum of expressions of one shape. ValueError if the shapes differ."""
        right = as_expression(other)
        if self.shape != right.shape:
            raise ValueError(f"sum of {self.shape} and {right.shape}: the shapes must agree")
        return Expression(self.constant + right.constant, self.terms + right.terms)

    __radd__ = __add__

    def __neg__(self) -> Expression:
        """Opposite."""
        return self * -1

    def __sub__(self, other: Operand) -> Expression:
        """Difference."""
        return self + (-as_expression(other))

    def __rsub__(self, other: Operand) -> Expression:
        """Difference, reversed."""
        return -self + other

    def __mul__(self, factor: Any) -> Expression:
        """Product with a number; for a 1 x 1 expression, also with a constant matrix."""
        if isinstance(factor, np.ndarray):
            if self.shape != (1, 1):
                raise ValueError(f"only a 1 x 1 expression multiplies a matrix with *, got {self.shape}")
            terms = tuple(_times_matrix(term, factor) for term in self.terms)
            return Expression(self.constant[0, 0] * factor, terms)
        return Expression(_scaled(self.constant, factor), tuple(term.times(factor) for term in self.terms))

    __rmul__ = __mul__

    def __matmul__(self, other: Matrix) -> Expression:
        """Product with a constant matrix on the right."""
        return Expression(_product(self.constant, other), tuple(term.scaled(None, other) for term in self.terms))

    def __rmatmul__(self, other: Matrix) -> Expression:
        """Product with a constant matrix on the left."""
        return Expression(_product(other, self.constant), tuple(term.scaled(other, None) for term in self.terms))

    def at(self, values: Mapping[Variable, Matrix]) -> Matrix:
        """Value at a point; exact when constants and values are exact.

        Args:
            values: one matrix per variable of the expression.

        Raises:
            KeyError: a variable of the expression has no value.
        """
        total = self.constant
        for term in self.terms:
            total = total + term.at(values[term.variable])
        return total

    def at_exactly(self, values: Mapping[Variable, Matrix]) -> Matrix:
        """Value at a point in rational arithmetic, doubles taken as the rationals they are. Errors as `at`."""
        total = to_rational(self.constant)
        exact = {variable: to_rational(values[variable]) for variable in self.variables}
        for term in self.terms:
            term.map_constants(to_rational).add_to(total, exact[term.variable])
        return total

    def given(self, values: Mapping[Variable, Matrix]) -> Expression:
        """The same expression with these values of some variables, which it then no longer has; exact if they are."""
        total, rest = self.constant, []
        for term in self.terms:
            if term.variable in values:
                total = total + term.at(values[term.variable])
            else:
                rest.append(term)
        return Expression(total, tuple(rest))

    def map_constants(self, function: Callable[[Matrix], Matrix]) -> Expression:
        """The same expression with ``function`` applied to every constant array (a change of scalar)."""
        return Expression(function(self.constant), tuple(term.map_constants(function) for term in self.terms))

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables of the expression, each once, in order of appearance."""
        return tuple(dict.fromkeys(term.variable for term in self.terms))


def _times_matrix(term: Term, matrix: Matrix) -> Term:
    if isinstance(term, ScalarProduct):
        return ScalarProduct(term.coefficient[0, 0] * matrix, term.variable)
    if (term.variable.rows, term.variable.cols) != (1, 1):
        raise ValueError(f"{term.variable.name}: only a 1 x 1 variable multiplies a matrix with *")
    return ScalarProduct(term.left[0, 0] * term.right[0, 0] * matrix, term.variable)


def as_expression(operand: Operand) -> Expression:
    """Variables and constant matrices as expressions."""
    if isinstance(operand, Expression):
        return operand
    if isinstance(operand, Variable):
        return operand.expression
    return constant(operand)


def constant(matrix: Any) -> Expression:
    """A constant matrix as an expression. ValueError if it is not two-dimensional."""
    array = np.asarray(matrix)
    if array.ndim != 2:
        raise ValueError(f"a constant is a matrix, got {array.ndim} dimensions")
    return Expression(array, ())


def zeros(rows: int, cols: int) -> Expression:
    """Zero matrix, exact."""
    return Expression(_zero(rows, cols), ())


def identity(size: int) -> Expression:
    """Identity matrix, exact."""
    return Expression(_eye(size), ())


def he(expression: Operand) -> Expression:
    """``He(X) = X + X'``."""
    square = as_expression(expression)
    return square + square.T


def block(rows: Sequence[Sequence[Operand | None]]) -> Expression:
    """Block matrix; ``None`` below the diagonal means the transpose of the mirrored block.

    Raises:
        ValueError: blocks of one row (column) differ in height (width), or a ``None`` has no mirror.
    """
    grid: list[list[Expression]] = []
    for i, row in enumerate(rows):
        line: list[Expression] = []
        for j, entry in enumerate(row):
            mirrored = rows[j][i] if entry is None else entry
            if mirrored is None:
                raise ValueError(f"block ({i}, {j}) and its mirror are both missing")
            expression = as_expression(mirrored)
            line.append(expression.T if entry is None else expression)
        grid.append(line)
    heights = [line[0].shape[0] for line in grid]
    widths = [entry.shape[1] for entry in grid[0]]
    shape = sum(heights), sum(widths)
    total = _zero(*shape)
    terms: list[Term] = []
    for i, line in enumerate(grid):
        for j, entry in enumerate(line):
            if entry.shape != (heights[i], widths[j]):
                raise ValueError(f"block ({i}, {j}): got {entry.shape}, expected {(heights[i], widths[j])}")
            place = _span(heights, i), _span(widths, j)
            total[place] = entry.constant
            terms += [term.placed(*place, shape) for term in entry.terms]
    return Expression(total, tuple(terms))


def _span(sizes: Sequence[int], index: int) -> slice:
    start = sum(sizes[:index])
    return slice(start, start + sizes[index])
