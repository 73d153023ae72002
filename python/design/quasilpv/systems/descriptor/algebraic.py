"""Whether algebraic states that premises depend on follow from the differential ones.

The algebraic equations ``0 = g(x_d, x_a) = A_21(z) x_d + A_22(z) x_a`` with z a function of x_a as well are solved for
x_a near a solution where the derivative ``dg/dx_a`` is invertible, which is not what an invertible A_22 says: of
``0 = x - (x_a - 0.4 x_a^3)`` the factor ``1 - 0.4 x_a^2`` is not 0 for |x_a| <= 1.2, but the curve turns back at 0.91.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite

import numpy as np
import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.descriptor.vocabulary import exact
from quasilpv.systems.intervals.enclosure import halves
from quasilpv.systems.intervals.functions import iv
from quasilpv.systems.intervals.interval_function import Box, IntervalFunction, IntervalValue

_MAX_BOXES = 400
_MAX_ALGEBRAIC = 4  # determinants are expanded
_PLACES = 31  # of the algebraic state, where solutions are looked for
_BISECTIONS = 50


class AlgebraicEquations:
    """``g(x_d, x_a) = 0`` of a system on boxes of its domain, with the derivative by x_a."""

    def __init__(self, system: DescriptorSystem) -> None:
        """Write the equations down exactly: doubles are the rationals they are."""
        q = system.differential
        equations = [sp.S.Zero] * (system.order - q)
        weights = [sp.S.One, *(exact(premise.expression) for premise in system.premises)]
        for weight, matrix in zip(weights, [system.A.constant, *system.A.coefficients], strict=True):
            for number, row in enumerate(matrix[q:]):
                linear = sp.Add(*(sp.Rational(float(a)) * s for a, s in zip(row, system.state, strict=True)))
                equations[number] += weight * linear
        self.symbols = sorted(set().union(*(e.free_symbols for e in equations)), key=lambda symbol: str(symbol.name))
        self.algebraic = [axis for axis, s in enumerate(self.symbols) if s in system.state[q:]]
        self.differential = [axis for axis, s in enumerate(self.symbols) if s in system.state[:q]]
        self.square = len(self.algebraic) == len(equations)
        self.domain: Box = tuple(system.domain.get(symbol, (-inf, inf)) for symbol in self.symbols)
        self._functions = [IntervalFunction(equation, self.symbols) for equation in equations]

    def values(self, box: Box) -> list[IntervalValue]:
        """Ranges of g."""
        return [function.value(box) for function in self._functions]

    def derivative_sign(self, box: Box) -> int:
        """The sign of det dg/dx_a if it is proved to be one on all of a box, else 0."""
        rows = [function.value_and_gradient(box)[1] for function in self._functions]
        determinant = _determinant([[row[axis] for axis in self.algebraic] for row in rows])
        if determinant.a > 0:
            return 1
        return -1 if determinant.b < 0 else 0


def follows(system: DescriptorSystem) -> tuple[bool | None, str]:
    """Whether x_a follows from x_d over the domain: True proved, False refuted, None neither; and why.

    Proved: det dg/dx_a has one sign on the domain, shown by interval arithmetic on pieces of it. Refuted: there are two
    solutions of g = 0 in the domain at which it has different signs; if every x_d had exactly one x_a, with an
    invertible derivative, its sign would be the same on all of the domain.
    """
    q = system.differential
    if system.B.constant[q:].any() or system.B.coefficients[:, q:].any():
        return None, "an input acts in the algebraic equations that premises depend on"
    equations = AlgebraicEquations(system)
    if not equations.square or len(equations.algebraic) > _MAX_ALGEBRAIC:
        return None, f"the derivative of {len(equations.algebraic)} algebraic states is not examined"
    try:
        if _has_one_sign(equations):
            return (
                True,
                "the derivative of the algebraic equations by the algebraic states is invertible over the domain",
            )
        if _has_both_signs_at_solutions(equations):
            return False, "the algebraic equation folds: its derivative has both signs at solutions in the domain"
    except InputError as error:  # an operation that is not defined on a piece
        return None, str(error)
    return None, "the derivative of the algebraic equations is not proved to be invertible over the domain"


def _has_one_sign(equations: AlgebraicEquations) -> bool:
    boxes, signs = [equations.domain], set()
    for _ in range(_MAX_BOXES):
        if not boxes:
            return True
        box = boxes.pop()
        sign = equations.derivative_sign(box)
        if sign:
            signs.add(sign)
            if len(signs) > 1:
                return False
            continue
        widths = [high - low if isfinite(high - low) else -1.0 for low, high in box]
        axis = int(np.argmax(widths))
        if widths[axis] <= 0:
            return False
        boxes += halves(box, axis)
    return False


def _has_both_signs_at_solutions(equations: AlgebraicEquations) -> bool:
    """Of one equation: places of x_a at which a bracket of one differential state holds a solution."""
    if len(equations.algebraic) != 1 or not all(isfinite(end) for bounds in equations.domain for end in bounds):
        return False
    (axis,) = equations.algebraic
    signs = set()
    for place in np.linspace(*equations.domain[axis], _PLACES + 2)[1:-1].tolist():
        middle = [(0.5 * low + 0.5 * high,) * 2 for low, high in equations.domain]
        middle[axis] = (place, place)
        for free in equations.differential:
            bracket = _bracket(equations, middle, free)
            if bracket is not None:
                signs.add(equations.derivative_sign(bracket))
                break
    return {1, -1} <= signs


def _bracket(equations: AlgebraicEquations, point: Sequence[tuple[float, float]], free: int) -> Box | None:
    """A thin box along one axis with g of different, proved signs at its ends: by continuity g = 0 in it."""

    def at(value: float) -> Box:
        return (*point[:free], (value, value), *point[free + 1 :])

    def sign(value: float) -> int:
        (g,) = equations.values(at(value))
        return 1 if g.a > 0 else -1 if g.b < 0 else 0

    low, high = equations.domain[free]
    at_low, at_high = sign(low), sign(high)
    if at_low * at_high >= 0:
        return None
    for _ in range(_BISECTIONS):
        middle = 0.5 * low + 0.5 * high
        at_middle = sign(middle)
        if at_middle == 0 or not low < middle < high:
            break
        low, high = (middle, high) if at_middle == at_low else (low, middle)
    return (*point[:free], (low, high), *point[free + 1 :])


def _determinant(rows: Sequence[Sequence[IntervalValue]]) -> IntervalValue:
    """By expansion along the first row."""
    if len(rows) == 1:
        return rows[0][0]
    total = iv.mpf(0)
    for column, entry in enumerate(rows[0]):
        minor = [[*row[:column], *row[column + 1 :]] for row in rows[1:]]
        total += (-1) ** column * entry * _determinant(minor)
    return total
