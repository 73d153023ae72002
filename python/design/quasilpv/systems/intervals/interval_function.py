"""Sympy expressions as functions of boxes, by interval arithmetic: values and gradients that nothing on a box leaves.

Every number is an interval of 80-bit binary floats rounded outward (mpmath). First derivatives are found by forward
differentiation on intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from math import inf, nextafter
from operator import mul
from typing import Any

import sympy as sp
from mpmath import libmp, mp

from quasilpv.errors import InputError
from quasilpv.systems.intervals.chords import Chord, Ramp, abs_chord, ramp_chord
from quasilpv.systems.intervals.elementary import (
    SMOOTHNESS,
    arccosine,
    chord,
    chord_slopes,
    power,
    power_slope,
    sign,
)
from quasilpv.systems.intervals.functions import (
    expm1_ratio,
    expm1_ratio_slope,
    iv,
    sinc,
    sinc_slope,
    tanh,
    tanh_ratio,
    tanh_ratio_slope,
    tanh_slope,
)
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient

_OPERATIONS = (
    "+, *, a rational power, exp, log, sin, cos, tan, their inverses, sinh, cosh, tanh, sinc, Abs, Max, Min or sign"
)

Box = tuple[tuple[float, float], ...]
IntervalValue = Any  # mpmath's interval type carries no annotations
Rule = Callable[[IntervalValue], IntervalValue]


class UndefinedError(InputError):
    """A function is not defined on all of the range that its argument seems to have."""

    def __init__(self, source: str, field: str, got: object, expected: str, part: sp.Basic | None = None) -> None:
        """Take the parts of an `InputError`, and which part of the expression it is."""
        super().__init__(source, field, got, expected)
        self.part = part


class IntervalFunction:
    """A sympy expression evaluated on boxes, with its gradient.

    Raises:
        UndefinedError: of its methods: a function is not defined on all that the range of its argument holds.
    """

    def __init__(
        self, expression: sp.Expr, symbols: Sequence[sp.Symbol], known: Mapping[sp.Basic, IntervalValue] | None = None
    ) -> None:
        """Take an expression, and the symbols in the order of the axes of a box.

        Args:
            expression: what is evaluated.
            symbols: its symbols.
            known: by part of the expression, a range that it cannot leave on any box that is asked for.
        """
        self._parts: list[sp.Basic] = list(dict.fromkeys(sp.postorder_traversal(expression)))
        self.symbols = tuple(symbols)
        self._axes = {symbol: axis for axis, symbol in enumerate(symbols)}
        self._root = expression
        self.known = known or {}
        self.has_corners = expression.has(abs_chord, ramp_chord, Ramp, sp.Abs, sp.Max, sp.Min, sp.sign)
        self._constants = {node: _number(node) for node in self._parts if node.is_number}

    def value(self, box: Box) -> IntervalValue:
        """A range that holds every value on a box."""
        return self._evaluate(box, with_gradient=False)[0]

    def bounds(self, box: Box) -> tuple[float, float]:
        """The same as doubles, rounded outwards."""
        value = self.value(box)
        return lower(value), upper(value)

    def value_and_gradient(self, box: Box) -> tuple[IntervalValue, list[IntervalValue]]:
        """Ranges that hold every value and every partial derivative on a box."""
        return self._evaluate(box, with_gradient=True)

    def _evaluate(self, box: Box, with_gradient: bool) -> tuple[IntervalValue, list[IntervalValue]]:
        axes = range(len(box) if with_gradient else 0)
        zero = iv.mpf(0)
        values: dict[sp.Basic, IntervalValue] = {}
        slopes: dict[sp.Basic, list[IntervalValue]] = {}
        for node in self._parts:
            if node in self._constants:
                values[node] = self._constants[node]
                slopes[node] = [zero for _ in axes]
            elif node in self._axes:
                values[node] = iv.mpf(list(box[self._axes[node]]))
                slopes[node] = [iv.mpf(1 if axis == self._axes[node] else 0) for axis in axes]
            else:
                arguments = [values[argument] for argument in node.args]
                try:
                    values[node] = apply(node, arguments)
                except InputError as error:
                    raise UndefinedError(error.source, error.field, error.got, error.expected, node) from error
                partials = _partials(node, arguments) if with_gradient else []
                slopes[node] = [
                    sum((_chained(d, slopes[a][axis]) for d, a in zip(partials, node.args, strict=True)), zero)
                    for axis in axes
                ]
            if node in self.known:
                values[node] = common(values[node], self.known[node])
        return values[self._root], slopes[self._root]


def common(one: IntervalValue, other: IntervalValue) -> IntervalValue:
    """The numbers that are in both ranges; there are some."""
    return iv.mpf([max(one.a, other.a), min(one.b, other.b)])


def _chained(outer: IntervalValue, inner: IntervalValue) -> IntervalValue:
    """A product of slopes; an unbounded slope times what does not change is 0."""
    return inner if inner.a == 0 == inner.b else outer * inner


def _number(node: sp.Basic) -> IntervalValue:
    if node is sp.pi:
        return iv.pi
    if node is sp.E:
        return iv.e
    if isinstance(node, sp.Rational | sp.Float):
        exact = sp.Rational(node)
        return iv.mpf(int(exact.p)) / iv.mpf(int(exact.q))
    return apply(node, [_number(argument) for argument in node.args])


def apply(node: sp.Basic, arguments: list[IntervalValue]) -> IntervalValue:
    """The exact range (rounded outward) of one operation over the ranges of its arguments."""
    if isinstance(node, sp.Add):
        return sum(arguments, iv.mpf(0))
    if isinstance(node, sp.Mul):
        return reduce(mul, arguments)
    if isinstance(node, sp.Max | sp.Min):
        choice = max if isinstance(node, sp.Max) else min
        return iv.mpf([choice(x.a for x in arguments), choice(x.b for x in arguments)])
    if isinstance(node, Chord):
        return chord(SMOOTHNESS[node.smoothness], *arguments)
    value, _ = _rules(node)
    return value(arguments[0])


def _partials(node: sp.Basic, arguments: list[IntervalValue]) -> list[IntervalValue]:
    """Ranges of the partial derivatives of one operation with respect to its arguments."""
    if isinstance(node, sp.Add):
        return [iv.mpf(1)] * len(arguments)
    if isinstance(node, sp.Mul):
        return [
            reduce(mul, arguments[:skipped] + arguments[skipped + 1 :], iv.mpf(1)) for skipped in range(len(arguments))
        ]
    if isinstance(node, sp.Max | sp.Min):
        return [_share(node, arguments, number) for number in range(len(arguments))]
    if isinstance(node, Chord):
        return list(chord_slopes(SMOOTHNESS[node.smoothness], *arguments))
    _, slope = _rules(node)
    constant_exponent = [iv.mpf(0)] * (len(arguments) - 1)
    return [slope(arguments[0]), *constant_exponent]


def _share(node: sp.Basic, arguments: Sequence[IntervalValue], number: int) -> IntervalValue:
    """Range of a partial derivative of a maximum or minimum: 1 where the argument alone decides, 0 where it cannot."""
    others = [x for place, x in enumerate(arguments) if place != number]
    own = arguments[number]
    if isinstance(node, sp.Max):
        decides, cannot = all(own.a > x.b for x in others), any(own.b < x.a for x in others)
    else:
        decides, cannot = all(own.b < x.a for x in others), any(own.a > x.b for x in others)
    return iv.mpf([int(decides), int(not cannot)])


def _rules(node: sp.Basic) -> tuple[Rule, Rule]:
    """Value and slope, as functions of an interval, of an operation of one variable."""
    if isinstance(node, sp.Pow) and node.exp.is_Integer:
        n = int(node.exp)
        return lambda x: _integer_power(x, n, node), lambda x: n * _integer_power(x, n - 1, node)
    if isinstance(node, sp.Pow) and node.exp == sp.Rational(1, 2):
        return lambda x: _square_root(x, node), lambda x: _square_root_slope(x, node)
    if isinstance(node, sp.Pow) and node.exp.is_Rational:
        fraction = Fraction(int(node.exp.p), int(node.exp.q))
        return lambda x: power(x, fraction), lambda x: power_slope(x, fraction)
    if node.func in _UNARY:
        return _UNARY[node.func]
    raise InputError("expression", "operation", node, _OPERATIONS)


def _integer_power(base: IntervalValue, exponent: int, node: sp.Basic) -> IntervalValue:
    if exponent >= 0:
        return base**exponent
    if base.a <= 0 <= base.b:
        raise InputError("expression", "division", node, "a denominator that is not 0 on the domain")
    return 1 / base**-exponent


def _square_root(x: IntervalValue, node: sp.Basic) -> IntervalValue:
    if x.a < 0:
        raise InputError("expression", "square root", node, "an argument >= 0 on the domain")
    return iv.sqrt(x)


def _square_root_slope(x: IntervalValue, node: sp.Basic) -> IntervalValue:
    return 1 / (2 * _square_root(x, node)) if x.a > 0 else iv.mpf([0, inf])


_UNARY: dict[Any, tuple[Rule, Rule]] = {
    sp.sin: (iv.sin, iv.cos),
    sp.cos: (iv.cos, lambda x: -iv.sin(x)),
    sp.exp: (iv.exp, iv.exp),
    sp.tanh: (tanh, tanh_slope),
    sp.sinc: (sinc, sinc_slope),
    expm1_quotient: (expm1_ratio, expm1_ratio_slope),
    tanh_quotient: (tanh_ratio, tanh_ratio_slope),
    **{
        function: SMOOTHNESS[name][:2]
        for function, name in {
            sp.log: "log",
            sp.tan: "tan",
            sp.atan: "atan",
            sp.asin: "asin",
            sp.sinh: "sinh",
            sp.cosh: "cosh",
            sp.Abs: "abs",
            Ramp: "ramp",
        }.items()
    },
    sp.acos: (arccosine, lambda x: -SMOOTHNESS["asin"].slope(x)),
    sp.sign: (sign, lambda x: iv.mpf(0) if not x.a <= 0 <= x.b else iv.mpf([0, inf])),
}


def lower(x: IntervalValue) -> float:
    """The largest double below the lower end point."""
    value = float(libmp.to_float(x._mpi_[0], rnd="f"))
    return nextafter(value, -inf) if mp.mpf(value) > mp.make_mpf(x._mpi_[0]) else value  # gradual underflow


def upper(x: IntervalValue) -> float:
    """The smallest double above the upper end point."""
    value = float(libmp.to_float(x._mpi_[1], rnd="c"))
    return nextafter(value, inf) if mp.mpf(value) < mp.make_mpf(x._mpi_[1]) else value  # gradual underflow
