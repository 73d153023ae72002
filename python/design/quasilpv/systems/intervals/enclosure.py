"""Guaranteed ranges of sympy expressions over a box, by interval arithmetic. Nothing here samples.

Every number is an interval of 80-bit binary floats rounded outward (mpmath). An expression in which every symbol occurs
once, and no chord, is enclosed without overestimation by its natural interval extension; any other is bounded by branch
and bound with the natural extension, the mean-value form and monotonicity (first derivatives by forward differentiation
on intervals).

Reference: Moore, Kearfott and Cloud (2009), Introduction to Interval Analysis, chapters 5, 6 and 11.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from itertools import count
from math import inf, isfinite, nextafter
from operator import mul
from typing import Any

import sympy as sp
from mpmath import libmp, mp

from quasilpv.errors import InputError
from quasilpv.systems.intervals.chords import Chord, Ramp, abs_chord, ramp_chord
from quasilpv.systems.intervals.elementary import (
    CONVEX,
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

_MAX_BOXES = 2_000  # reached only if the extremum is not isolated
_MAX_BOXES_WITH_CORNERS = 150  # which often have it on a whole face

_OPERATIONS = (
    "+, *, a rational power, exp, log, sin, cos, tan, their inverses, sinh, cosh, tanh, sinc, Abs, Max, Min or sign"
)

Box = tuple[tuple[float, float], ...]
IntervalValue = Any  # mpmath's interval type carries no annotations
Rule = Callable[[IntervalValue], IntervalValue]


def enclose(
    expression: sp.Expr, domain: Mapping[sp.Symbol, tuple[float, float]], tolerance: float = 1e-9
) -> tuple[float, float]:
    """Bounds (lower, upper) that the expression cannot leave while its symbols stay in the domain.

    Args:
        expression: sums, products, rational powers, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, sinc
            (sin(x)/x, 1 at 0), Abs, Max, Min, sign and the functions of `quotients` and `chords`, of symbols. Abs, Max
            and Min take their corners along; sign takes all of [-1, 1] at its jump.
        domain: the interval of every symbol that occurs. It may be unbounded if every symbol occurs once, as in
            1/(1 + x^2).
        tolerance: largest excess over the exact range, relative to max(1, |bound|). If `_MAX_BOXES` boxes do not reach
            it the bounds are wider, and still guaranteed.

    Returns:
        Doubles rounded outward.

    Raises:
        InputError: a symbol has no interval, a function is not in the list, or the expression is unbounded.
    """
    expression = sp.sympify(expression, strict=True)  # a number; text is refused, not parsed
    symbols = sorted(expression.free_symbols, key=lambda symbol: symbol.name)
    for symbol in symbols:
        if symbol not in domain:
            raise InputError("domain", symbol.name, "nothing", f"an interval, because {expression} depends on it")
        low, high = domain[symbol]
        if not low <= high:
            raise InputError("domain", symbol.name, (low, high), "lower <= upper")
        if not ((isfinite(low) and isfinite(high)) or _every_symbol_occurs_once(expression)):
            expected = f"finite bounds, because a symbol occurs more than once in {expression}"
            raise InputError("domain", symbol.name, (low, high), expected)
    expression, domain = in_one_variable(expression, domain)
    symbols = sorted(expression.free_symbols, key=lambda symbol: symbol.name)
    box = tuple((float(domain[symbol][0]), float(domain[symbol][1])) for symbol in symbols)
    function = IntervalFunction(expression, symbols)
    whole = function.value(box)
    if not (isfinite(_lower(whole)) and isfinite(_upper(whole))):
        raise InputError("expression", str(expression), f"range [{_lower(whole)}, {_upper(whole)}]", "a bounded range")
    bounded = all(isfinite(low) and isfinite(high) for low, high in box)
    if _every_symbol_occurs_once(expression) and not (bounded and any(not _exact(c) for c in expression.atoms(Chord))):
        return _lower(whole), _upper(whole)
    minimum = _lower_bound_of_minimum(function, box, tolerance)
    maximum = -_lower_bound_of_minimum(IntervalFunction(-expression, symbols), box, tolerance)
    return max(minimum, _lower(whole)) + 0.0, min(maximum, _upper(whole)) + 0.0


def _exact(chord_of_a: Chord) -> bool:
    """Whether a chord of independent arguments is enclosed without overestimation: g bends one way on either side."""
    return chord_of_a.smoothness in CONVEX or (chord_of_a.args[0] == 0 and chord_of_a.smoothness != "sinc")


def in_one_variable(
    expression: sp.Expr, domain: Mapping[sp.Symbol, tuple[float, float]]
) -> tuple[sp.Expr, Mapping[sp.Symbol, tuple[float, float]]]:
    """An expression of several symbols that depends on one linear form of them only, as one of that form.

    Its extrema are whole faces in the symbols, and points in the form.
    """
    symbols = sorted(expression.free_symbols, key=lambda symbol: symbol.name)
    nodes = _affine_nodes(expression, symbols) if len(symbols) > 1 else []
    if not nodes:
        return expression, domain
    forms = [[node.coeff(symbol) for symbol in symbols] for node in map(sp.expand, nodes)]
    lead = next(axis for axis, slope in enumerate(forms[0]) if slope != 0)
    ratios = [form[lead] / forms[0][lead] for form in forms]
    if any(form != [ratio * slope for slope in forms[0]] for form, ratio in zip(forms, ratios, strict=True)):
        return expression, domain
    form = sp.Add(*(slope * symbol for slope, symbol in zip(forms[0], symbols, strict=True)))
    range_of_form = IntervalFunction(form, symbols).value(tuple(domain[symbol] for symbol in symbols))
    one = sp.Dummy("form", real=True)
    moved = {
        node: sp.expand(node).subs(dict.fromkeys(symbols, 0)) + ratio * one
        for node, ratio in zip(nodes, ratios, strict=True)
    }
    return expression.xreplace(moved), {one: (_lower(range_of_form), _upper(range_of_form))}


def _affine_nodes(node: sp.Basic, symbols: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """The largest parts of an expression that are affine in the symbols."""
    if not node.free_symbols:
        return []
    if node.is_polynomial(*symbols) and sp.Poly(node, *symbols).total_degree() <= 1:
        return [node]
    return [part for argument in node.args for part in _affine_nodes(argument, symbols)]


def _every_symbol_occurs_once(expression: sp.Expr) -> bool:
    leaves = [node for node in sp.preorder_traversal(expression) if isinstance(node, sp.Symbol)]
    return len(leaves) == len(set(leaves))


# ---- branch and bound ------------------------------------------------------------------------------------------------


def _lower_bound_of_minimum(function: IntervalFunction, box: Box, tolerance: float) -> float:
    """A guaranteed lower bound of the minimum, within the tolerance of it (best first, Skelboe's algorithm)."""
    tie_break = count()
    bound, box, split = _bound_and_shrink(function, box)
    heap = [(bound, next(tie_break), box, split)]
    reachable = _upper(function.value(_midpoint(box)))
    for _ in range(_MAX_BOXES_WITH_CORNERS if function.has_corners else _MAX_BOXES):
        bound, _, box, split = heap[0]
        if reachable - bound <= tolerance * max(1.0, abs(reachable)) or split is None:
            break
        heapq.heappop(heap)
        for half in halves(box, split):
            child_bound, child, child_split = _bound_and_shrink(function, half)
            reachable = min(reachable, _upper(function.value(_midpoint(child))))
            heapq.heappush(heap, (max(bound, child_bound), next(tie_break), child, child_split))
    return heap[0][0]


def _bound_and_shrink(function: IntervalFunction, box: Box) -> tuple[float, Box, int | None]:
    """Lower bound over the box, the face that holds its minimum, and the axis to split (None: it is a point)."""
    value, gradient = function.value_and_gradient(box)
    bound = _lower(value)
    face = list(box)
    for axis, slope in enumerate(gradient):
        low, high = box[axis]
        if slope.a >= 0:
            face[axis] = (low, low)
        elif slope.b <= 0:
            face[axis] = (high, high)
    shrunk = tuple(face)
    if shrunk != box:
        value, gradient = function.value_and_gradient(shrunk)
        bound = max(bound, _lower(value))
    centre = _midpoint(shrunk)
    mean_value = function.value(centre)
    influence = []
    for slope, (low, high), (middle, _) in zip(gradient, shrunk, centre, strict=True):
        offset = slope * (iv.mpf([low, high]) - middle)
        mean_value += offset
        influence.append(0.0 if low == high else max(_upper(offset.delta), 5e-324))
    bound = max(bound, _lower(mean_value))
    split = max(range(len(box)), key=influence.__getitem__, default=None)
    if split is not None:
        low, high = shrunk[split]
        if not low < 0.5 * low + 0.5 * high < high:
            split = None
    return bound, shrunk, split


def _midpoint(box: Box) -> Box:
    return tuple((0.5 * low + 0.5 * high,) * 2 for low, high in box)


def halves(box: Box, axis: int) -> tuple[Box, Box]:
    """A box cut in the middle of one axis."""
    low, high = box[axis]
    middle = 0.5 * low + 0.5 * high
    return (
        (*box[:axis], (low, middle), *box[axis + 1 :]),
        (*box[:axis], (middle, high), *box[axis + 1 :]),
    )


# ---- interval evaluation ---------------------------------------------------------------------------------------------


class IntervalFunction:
    """A sympy expression evaluated on boxes, with its gradient."""

    def __init__(self, expression: sp.Expr, symbols: Sequence[sp.Symbol]) -> None:
        """Take an expression, and the symbols in the order of the axes of a box."""
        self._nodes: list[sp.Basic] = list(dict.fromkeys(sp.postorder_traversal(expression)))
        self._symbols = {symbol: axis for axis, symbol in enumerate(symbols)}
        self._root = expression
        self.has_corners = expression.has(abs_chord, ramp_chord, Ramp, sp.Abs, sp.Max, sp.Min, sp.sign)
        self._constants = {node: _number(node) for node in self._nodes if node.is_number}

    def value(self, box: Box) -> IntervalValue:
        """A range that holds every value on a box."""
        return self._evaluate(box, with_gradient=False)[0]

    def bounds(self, box: Box) -> tuple[float, float]:
        """The same as doubles, rounded outwards."""
        value = self.value(box)
        return _lower(value), _upper(value)

    def value_and_gradient(self, box: Box) -> tuple[IntervalValue, list[IntervalValue]]:
        """Ranges that hold every value and every partial derivative on a box."""
        return self._evaluate(box, with_gradient=True)

    def _evaluate(self, box: Box, with_gradient: bool) -> tuple[IntervalValue, list[IntervalValue]]:
        axes = range(len(box) if with_gradient else 0)
        zero = iv.mpf(0)
        values: dict[sp.Basic, IntervalValue] = {}
        slopes: dict[sp.Basic, list[IntervalValue]] = {}
        for node in self._nodes:
            if node in self._constants:
                values[node] = self._constants[node]
                slopes[node] = [zero for _ in axes]
            elif node in self._symbols:
                values[node] = iv.mpf(list(box[self._symbols[node]]))
                slopes[node] = [iv.mpf(1 if axis == self._symbols[node] else 0) for axis in axes]
            else:
                arguments = [values[argument] for argument in node.args]
                values[node] = _apply(node, arguments)
                partials = _partials(node, arguments) if with_gradient else []
                slopes[node] = [
                    sum((_chained(d, slopes[a][axis]) for d, a in zip(partials, node.args, strict=True)), zero)
                    for axis in axes
                ]
        return values[self._root], slopes[self._root]


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
    return _apply(node, [_number(argument) for argument in node.args])


def _apply(node: sp.Basic, arguments: list[IntervalValue]) -> IntervalValue:
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


def _lower(x: IntervalValue) -> float:
    """The largest double below the lower end point."""
    value = float(libmp.to_float(x._mpi_[0], rnd="f"))
    return nextafter(value, -inf) if mp.mpf(value) > mp.make_mpf(x._mpi_[0]) else value  # gradual underflow


def _upper(x: IntervalValue) -> float:
    """The smallest double above the upper end point."""
    value = float(libmp.to_float(x._mpi_[1], rnd="c"))
    return nextafter(value, inf) if mp.mpf(value) < mp.make_mpf(x._mpi_[1]) else value  # gradual underflow
