"""Guaranteed ranges of sympy expressions over a box, by interval arithmetic. Nothing here samples.

Every number is an interval of 80-bit binary floats rounded outward (mpmath). An expression in which every symbol occurs
once is enclosed without overestimation by its natural interval extension; any other is bounded by branch and bound with
the natural extension, the mean-value form and monotonicity (first derivatives by forward differentiation on intervals).

Reference: Moore, Kearfott and Cloud (2009), Introduction to Interval Analysis, chapters 5, 6 and 11.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, reduce
from itertools import count
from math import inf, isfinite, nextafter, pi
from operator import mul
from typing import Any

import sympy as sp
from mpmath import findroot, libmp, mp, workprec
from mpmath.ctx_iv import MPIntervalContext

from quasilpv.errors import InputError

_PRECISION_BITS = 80
_MAX_BOXES = 2_000  # reached only if the extremum is not isolated
_iv = MPIntervalContext()
_iv.prec = _PRECISION_BITS

Box = tuple[tuple[float, float], ...]
IntervalValue = Any  # mpmath's interval type carries no annotations
Rule = Callable[[IntervalValue], IntervalValue]


def enclose(
    expression: sp.Expr, domain: Mapping[sp.Symbol, tuple[float, float]], tolerance: float = 1e-9
) -> tuple[float, float]:
    """Bounds (lower, upper) that the expression cannot leave while its symbols stay in the domain.

    Args:
        expression: sums, products, integer powers, square roots, sin, cos, exp and sinc (sin(x)/x, 1 at 0) of symbols.
        domain: the interval of every symbol that occurs. It may be unbounded if every symbol occurs once, as in
            1/(1 + x^2).
        tolerance: largest excess over the exact range, relative to max(1, |bound|). If `_MAX_BOXES` boxes do not reach
            it the bounds are wider, and still guaranteed.

    Returns:
        Doubles rounded outward.

    Raises:
        InputError: a symbol has no interval, a function is not in the list, or the expression is unbounded.
    """
    expression = sp.sympify(expression)
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
    box = tuple((float(domain[symbol][0]), float(domain[symbol][1])) for symbol in symbols)
    function = _IntervalFunction(expression, symbols)
    whole = function.value(box)
    if not (isfinite(_lower(whole)) and isfinite(_upper(whole))):
        raise InputError("expression", str(expression), f"range [{_lower(whole)}, {_upper(whole)}]", "a bounded range")
    if _every_symbol_occurs_once(expression):
        return _lower(whole), _upper(whole)
    minimum = _lower_bound_of_minimum(function, box, tolerance)
    maximum = -_lower_bound_of_minimum(_IntervalFunction(-expression, symbols), box, tolerance)
    return max(minimum, _lower(whole)) + 0.0, min(maximum, _upper(whole)) + 0.0


def _every_symbol_occurs_once(expression: sp.Expr) -> bool:
    leaves = [node for node in sp.preorder_traversal(expression) if isinstance(node, sp.Symbol)]
    return len(leaves) == len(set(leaves))


# ---- branch and bound ------------------------------------------------------------------------------------------------


def _lower_bound_of_minimum(function: _IntervalFunction, box: Box, tolerance: float) -> float:
    """A guaranteed lower bound of the minimum, within the tolerance of it (best first, Skelboe's algorithm)."""
    tie_break = count()
    bound, box, split = _bound_and_shrink(function, box)
    heap = [(bound, next(tie_break), box, split)]
    reachable = _upper(function.value(_midpoint(box)))
    for _ in range(_MAX_BOXES):
        bound, _, box, split = heap[0]
        if reachable - bound <= tolerance * max(1.0, abs(reachable)) or split is None:
            break
        heapq.heappop(heap)
        for half in _halves(box, split):
            child_bound, child, child_split = _bound_and_shrink(function, half)
            reachable = min(reachable, _upper(function.value(_midpoint(child))))
            heapq.heappush(heap, (max(bound, child_bound), next(tie_break), child, child_split))
    return heap[0][0]


def _bound_and_shrink(function: _IntervalFunction, box: Box) -> tuple[float, Box, int | None]:
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
        offset = slope * (_iv.mpf([low, high]) - middle)
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


def _halves(box: Box, axis: int) -> tuple[Box, Box]:
    low, high = box[axis]
    middle = 0.5 * low + 0.5 * high
    return (
        (*box[:axis], (low, middle), *box[axis + 1 :]),
        (*box[:axis], (middle, high), *box[axis + 1 :]),
    )


# ---- interval evaluation ---------------------------------------------------------------------------------------------


class _IntervalFunction:
    """A sympy expression evaluated on boxes, with its gradient."""

    def __init__(self, expression: sp.Expr, symbols: Sequence[sp.Symbol]) -> None:
        self._nodes: list[sp.Basic] = list(dict.fromkeys(sp.postorder_traversal(expression)))
        self._symbols = {symbol: axis for axis, symbol in enumerate(symbols)}
        self._root = expression
        self._constants = {node: _number(node) for node in self._nodes if node.is_number}

    def value(self, box: Box) -> IntervalValue:
        return self._evaluate(box, with_gradient=False)[0]

    def value_and_gradient(self, box: Box) -> tuple[IntervalValue, list[IntervalValue]]:
        return self._evaluate(box, with_gradient=True)

    def _evaluate(self, box: Box, with_gradient: bool) -> tuple[IntervalValue, list[IntervalValue]]:
        axes = range(len(box) if with_gradient else 0)
        zero = _iv.mpf(0)
        values: dict[sp.Basic, IntervalValue] = {}
        slopes: dict[sp.Basic, list[IntervalValue]] = {}
        for node in self._nodes:
            if node in self._constants:
                values[node] = self._constants[node]
                slopes[node] = [zero for _ in axes]
            elif node in self._symbols:
                values[node] = _iv.mpf(list(box[self._symbols[node]]))
                slopes[node] = [_iv.mpf(1 if axis == self._symbols[node] else 0) for axis in axes]
            else:
                arguments = [values[argument] for argument in node.args]
                values[node] = _apply(node, arguments)
                partials = _partials(node, arguments) if with_gradient else []
                slopes[node] = [
                    sum((d * slopes[a][axis] for d, a in zip(partials, node.args, strict=True)), zero) for axis in axes
                ]
        return values[self._root], slopes[self._root]


def _number(node: sp.Basic) -> IntervalValue:
    if node is sp.pi:
        return _iv.pi
    if isinstance(node, sp.Rational | sp.Float):
        exact = sp.Rational(node)
        return _iv.mpf(int(exact.p)) / _iv.mpf(int(exact.q))
    return _apply(node, [_number(argument) for argument in node.args])


def _apply(node: sp.Basic, arguments: list[IntervalValue]) -> IntervalValue:
    """The exact range (rounded outward) of one operation over the ranges of its arguments."""
    if isinstance(node, sp.Add):
        return sum(arguments, _iv.mpf(0))
    if isinstance(node, sp.Mul):
        return reduce(mul, arguments)
    value, _ = _rules(node)
    return value(arguments[0])


def _partials(node: sp.Basic, arguments: list[IntervalValue]) -> list[IntervalValue]:
    """Ranges of the partial derivatives of one operation with respect to its arguments."""
    if isinstance(node, sp.Add):
        return [_iv.mpf(1)] * len(arguments)
    if isinstance(node, sp.Mul):
        return [
            reduce(mul, arguments[:skipped] + arguments[skipped + 1 :], _iv.mpf(1)) for skipped in range(len(arguments))
        ]
    _, slope = _rules(node)
    constant_exponent = [_iv.mpf(0)] * (len(arguments) - 1)
    return [slope(arguments[0]), *constant_exponent]


def _rules(node: sp.Basic) -> tuple[Rule, Rule]:
    """Value and slope, as functions of an interval, of an operation of one variable."""
    if isinstance(node, sp.Pow) and node.exp.is_Integer:
        n = int(node.exp)
        return lambda x: _integer_power(x, n, node), lambda x: n * _integer_power(x, n - 1, node)
    if isinstance(node, sp.Pow) and node.exp == sp.Rational(1, 2):
        return lambda x: _square_root(x, node), lambda x: _square_root_slope(x, node)
    if node.func in _UNARY:
        return _UNARY[node.func]
    raise InputError("expression", "operation", node, "+, *, integer power, square root, sin, cos, exp or sinc")


def _integer_power(base: IntervalValue, exponent: int, node: sp.Basic) -> IntervalValue:
    if exponent >= 0:
        return base**exponent
    if base.a <= 0 <= base.b:
        raise InputError("expression", "division", node, "a denominator that is not 0 on the domain")
    return 1 / base**-exponent


def _square_root(x: IntervalValue, node: sp.Basic) -> IntervalValue:
    if x.a < 0:
        raise InputError("expression", "square root", node, "an argument >= 0 on the domain")
    return _iv.sqrt(x)


def _square_root_slope(x: IntervalValue, node: sp.Basic) -> IntervalValue:
    return 1 / (2 * _square_root(x, node)) if x.a > 0 else _iv.mpf([0, inf])


def _sinc(x: IntervalValue) -> IntervalValue:
    """Range of sin(x)/x: end points of |x| and the stationary points in between (tan x = x)."""
    magnitude = abs(x)
    candidates = [_sinc_at(magnitude.a), _sinc_at(magnitude.b)]
    # Stationary point k >= 1 lies in (k pi, k pi + pi/2) with |sinc| = 1/sqrt(1 + x^2), which decreases with k and
    # alternates in sign: only the first two inside the interval can be extreme.
    first = max(1, int(_lower(magnitude) / pi) - 1)
    inside = []
    for k in range(first, first + 4):
        stationary = _sinc_stationary_point(k)
        if stationary.b >= magnitude.a and stationary.a <= magnitude.b:
            inside.append(_sinc_at(stationary))
    candidates += inside
    return _iv.mpf([min(c.a for c in candidates), max(c.b for c in candidates)])


def _sinc_at(x: IntervalValue) -> IntervalValue:
    """sin(x)/x on an interval as thin as a point, x >= 0."""
    if x.b == 0:
        return _iv.mpf(1)
    if x.b < 1e-4:  # alternating series with decreasing terms
        return _iv.mpf([1 - (x * x / 6).b, (1 - x * x / 6 + x**4 / 120).b])
    return _iv.sin(x) / x


@lru_cache(maxsize=64)
def _sinc_stationary_point(k: int) -> IntervalValue:
    """Interval proved to hold the root of x cos x = sin x in (k pi, k pi + pi/2).

    The derivative of x cos x - sin x is -x sin x, of one sign between multiples of pi: a sign change proves the root.
    """
    with workprec(_PRECISION_BITS + 40):
        guess = (k + mp.mpf(1) / 2) * mp.pi
        root = findroot(lambda x: x * mp.cos(x) - mp.sin(x), guess - 1 / guess)
        width = mp.mpf(2) ** (20 - _PRECISION_BITS)
        low, high = _iv.mpf(root - width), _iv.mpf(root + width)
    ends = [x * _iv.cos(x) - _iv.sin(x) for x in (low, high)]
    if not (ends[0].b < 0 < ends[1].a or ends[1].b < 0 < ends[0].a):
        raise ArithmeticError(f"stationary point {k} of sinc is not bracketed")
    return _iv.mpf([low.a, high.b])


def _sinc_slope(x: IntervalValue) -> IntervalValue:
    """Range of the derivative of sinc, (cos x - sinc x)/x, an odd function bounded by 0.4365 in magnitude."""
    bound = _iv.mpf([-0.4365, 0.4365])
    magnitude = abs(x)
    if magnitude.b <= 1:  # -x/3 + x^3/30 - x^5/840 + ... alternates with decreasing terms
        cubic = x**3
        slope = -x / 3 + _iv.mpf([min(0, (cubic / 30).a), max(0, (cubic / 30).b)])
    elif magnitude.a > 0:
        slope = (_iv.cos(x) - _sinc(x)) / x
    else:
        return bound
    return _iv.mpf([max(slope.a, bound.a), min(slope.b, bound.b)])


_UNARY: dict[Any, tuple[Rule, Rule]] = {
    sp.sin: (_iv.sin, _iv.cos),
    sp.cos: (_iv.cos, lambda x: -_iv.sin(x)),
    sp.exp: (_iv.exp, _iv.exp),
    sp.sinc: (_sinc, _sinc_slope),
}


def _lower(x: IntervalValue) -> float:
    """The largest double below the lower end point."""
    value = float(libmp.to_float(x._mpi_[0], rnd="f"))
    return nextafter(value, -inf) if mp.mpf(value) > mp.make_mpf(x._mpi_[0]) else value  # gradual underflow


def _upper(x: IntervalValue) -> float:
    """The smallest double above the upper end point."""
    value = float(libmp.to_float(x._mpi_[1], rnd="c"))
    return nextafter(value, inf) if mp.mpf(value) < mp.make_mpf(x._mpi_[1]) else value  # gradual underflow
