"""Continuous Piecewise expressions as sums of their pieces, each of an argument held inside its own interval.

With breakpoints ``b_1 < ... < b_k`` of one symbol s and pieces p_0, ..., p_k,

    f(s) = sum_i p_i(clamp(s, b_i, b_i+1)) - sum_(i >= 1) p_i(b_i),    clamp(s, b, b') = max(b, min(b', s)):

where s is in piece k, the pieces before it add p_i(b_i+1) = p_i+1(b_i+1), the pieces behind it p_i(b_i), and all cancel
but p_k(s). No piece is ever evaluated outside its own interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp

from quasilpv.errors import InputError


def clamped(source: str, expression: sp.Expr) -> sp.Expr:
    """The expression without Piecewise.

    Raises:
        InputError: a Piecewise with conditions on more than one symbol or not linear in it, or one that jumps; it is
            named with the place.
    """
    while found := [node for node in sp.preorder_traversal(expression) if isinstance(node, sp.Piecewise)]:
        innermost = next(node for node in found if not any(arg.has(sp.Piecewise) for arg in node.args))
        expression = expression.xreplace({innermost: _sum_of_pieces(source, innermost)})
    return expression


def _sum_of_pieces(source: str, function: sp.Piecewise) -> sp.Expr:
    symbol, breakpoints = _breakpoints(source, function)
    if symbol is None:
        return _piece(source, function, {})
    inner = [(low + high) / 2 for low, high in pairwise(breakpoints)]
    samples = [breakpoints[0] - 1, *inner, breakpoints[-1] + 1]
    pieces = [_piece(source, function, {symbol: sample}) for sample in samples]
    total = pieces[0].subs(symbol, sp.Min(symbol, breakpoints[0]))
    for number, place in enumerate(breakpoints):
        before, after = pieces[number].subs(symbol, place), pieces[number + 1].subs(symbol, place)
        if sp.simplify(before - after) != 0:
            expected = f"a continuous one; at {symbol} = {place} it jumps from {before} to {after}"
            raise InputError(source, "Piecewise", function, expected)
        held = sp.Max(symbol, place)
        if number + 1 < len(breakpoints):
            held = sp.Max(place, sp.Min(symbol, breakpoints[number + 1]))
        total += pieces[number + 1].subs(symbol, held) - after
    return total


def _breakpoints(source: str, function: sp.Piecewise) -> tuple[sp.Symbol | None, Sequence[sp.Rational]]:
    """The symbol of all conditions, and where one of them changes, in order."""
    relations = {each for _, condition in function.args for each in condition.atoms(sp.core.relational.Relational)}
    symbols = {symbol for relation in relations for symbol in relation.free_symbols}
    expected = "conditions that compare one symbol with numbers; of an expression use Max, Min or Abs"
    if len(symbols) > 1:
        raise InputError(source, "Piecewise", function, expected)
    symbol = symbols.pop() if symbols else None
    places = set()
    for relation in relations:
        difference = sp.expand(relation.lhs - relation.rhs)
        slope = difference.coeff(symbol)
        place = sp.expand(difference - slope * symbol) / -slope if slope != 0 else None
        if place is None or not place.is_real or place.free_symbols or not slope.is_number:
            raise InputError(source, "Piecewise", function, expected)
        places.add(place)
    return symbol, sorted(places)


def _piece(source: str, function: sp.Piecewise, at: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """The expression that holds at a place."""
    for value, condition in function.args:
        if condition.subs(at) == sp.true:
            return value
    raise InputError(source, "Piecewise", function, f"a value everywhere, also at {at}")
