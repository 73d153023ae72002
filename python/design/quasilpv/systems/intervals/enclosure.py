"""Guaranteed ranges of sympy expressions over a box, by interval arithmetic. Nothing here samples.

An expression in which every symbol occurs once, and no chord, is enclosed without overestimation by its natural
interval extension; any other is bounded by branch and bound with the natural extension, the mean-value form and
monotonicity. Where a function is not defined on all that the natural extension of its argument holds, the argument is
bounded like that first.

Reference: Moore, Kearfott and Cloud (2009), Introduction to Interval Analysis, chapters 5, 6 and 11.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from itertools import count
from math import isfinite

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.intervals.chords import Chord
from quasilpv.systems.intervals.elementary import CONVEX
from quasilpv.systems.intervals.functions import iv
from quasilpv.systems.intervals.interval_function import (
    Box,
    IntervalFunction,
    IntervalValue,
    UndefinedError,
    lower,
    upper,
)

_MAX_BOXES = 2_000  # reached only if the extremum is not isolated
_MAX_BOXES_WITH_CORNERS = 150  # which often have it on a whole face
_ARGUMENT_TOLERANCE = 1e-3  # of bounds of an argument, which only have to keep clear of where its function ends


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
    function = _defined(expression, symbols, box)
    whole = function.value(box)
    if not (isfinite(lower(whole)) and isfinite(upper(whole))):
        raise InputError("expression", str(expression), f"range [{lower(whole)}, {upper(whole)}]", "a bounded range")
    bounded = all(isfinite(low) and isfinite(high) for low, high in box)
    if _every_symbol_occurs_once(expression) and not (bounded and any(not _exact(c) for c in expression.atoms(Chord))):
        return lower(whole), upper(whole)
    minimum = _lower_bound_of_minimum(function, box, tolerance)
    maximum = -_lower_bound_of_minimum(IntervalFunction(-expression, symbols, function.known), box, tolerance)
    return max(minimum, lower(whole)) + 0.0, min(maximum, upper(whole)) + 0.0


def _defined(expression: sp.Expr, symbols: Sequence[sp.Symbol], box: Box) -> IntervalFunction:
    """An expression as a function that has a value on the box, although an argument may seem to leave where it has one.

    Raises:
        UndefinedError: an argument does so, or its bounds could not be told from that.
    """
    function, bounded = IntervalFunction(expression, symbols), set[sp.Basic]()
    while True:
        try:
            function.value(box)
        except UndefinedError as error:
            if error.part is None or error.part in bounded or not all(isfinite(low + high) for low, high in box):
                raise
            bounded.add(error.part)
            known = {argument: _range(argument, function, box) for argument in error.part.args if argument.free_symbols}
            function = IntervalFunction(expression, symbols, {**function.known, **known})
        else:
            return function


def _range(part: sp.Expr, function: IntervalFunction, box: Box) -> IntervalValue:
    """Bounds of a part of a function over the box."""
    both = [IntervalFunction(sign * part, function.symbols, function.known) for sign in (1, -1)]
    low, high = (_lower_bound_of_minimum(each, box, _ARGUMENT_TOLERANCE) for each in both)
    return iv.mpf([low, -high])


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
    return expression.xreplace(moved), {one: (lower(range_of_form), upper(range_of_form))}


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
    reachable = upper(function.value(_midpoint(box)))
    for _ in range(_MAX_BOXES_WITH_CORNERS if function.has_corners else _MAX_BOXES):
        bound, _, box, split = heap[0]
        if reachable - bound <= tolerance * max(1.0, abs(reachable)) or split is None:
            break
        heapq.heappop(heap)
        for half in halves(box, split):
            child_bound, child, child_split = _bound_and_shrink(function, half)
            reachable = min(reachable, upper(function.value(_midpoint(child))))
            heapq.heappush(heap, (max(bound, child_bound), next(tie_break), child, child_split))
    return heap[0][0]


def _bound_and_shrink(function: IntervalFunction, box: Box) -> tuple[float, Box, int | None]:
    """Lower bound over the box, the face that holds its minimum, and the axis to split (None: it is a point)."""
    value, gradient = function.value_and_gradient(box)
    bound = lower(value)
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
        bound = max(bound, lower(value))
    centre = _midpoint(shrunk)
    mean_value = function.value(centre)
    influence = []
    for slope, (low, high), (middle, _) in zip(gradient, shrunk, centre, strict=True):
        offset = slope * (iv.mpf([low, high]) - middle)
        mean_value += offset
        influence.append(0.0 if low == high else max(upper(offset.delta), 5e-324))
    bound = max(bound, lower(mean_value))
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
