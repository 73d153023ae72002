"""Implicit equations ``F(x, x', u) = 0`` written as ``E(x) x' = A(x) x + B(x) u``.

E and B follow from the equations; A does not. Here every term of the drift is divided by one state, chosen by a fixed
rule (`factored`), so the same equations always give the same matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.quotients import expm1_quotient, tanh_quotient

# f(w)/w of functions that vanish at 0, and functions that are 1 there as 1 plus a multiple of w.
_QUOTIENTS = {sp.sin: sp.sinc, sp.tanh: tanh_quotient}
_AROUND_ONE = {
    sp.cos: lambda w: 1 - w**2 / 2 * sp.sinc(w / 2) ** 2,
    sp.exp: lambda w: 1 + w * expm1_quotient(w),
}


class EquationMatrices(NamedTuple):
    """What a set of equations says: the states in order, and E(x), A(x), B(x), C(x) as expressions."""

    state: tuple[sp.Symbol, ...]
    E: sp.Matrix
    A: sp.Matrix
    B: sp.Matrix
    C: sp.Matrix


def rate(state: sp.Symbol) -> sp.Symbol:
    """The symbol that stands for the time derivative of a state in an equation."""
    return sp.Symbol(f"{state.name}'", real=True)


def equation_matrices(
    source: str,
    equations: Sequence[sp.Expr | sp.Eq],
    state: Sequence[sp.Symbol],
    inputs: Sequence[sp.Symbol],
    outputs: Sequence[sp.Expr],
) -> EquationMatrices:
    """Matrices of the equations ``F(x, x', u) = 0`` and of the outputs ``y = h(x)``.

    Equations without a rate, and states whose rate occurs nowhere, are moved behind the others.

    Raises:
        InputError: see `DescriptorSystem.from_equations`.
    """
    if len(equations) != len(state):
        raise InputError(source, "equations", f"{len(equations)} equations", f"{len(state)}, one for each state")
    residuals = [e.lhs - e.rhs if isinstance(e, sp.Eq) else sp.sympify(e) for e in equations]
    for number, residual in enumerate(residuals, 1):
        if not isinstance(residual, sp.Expr):  # sympy evaluates an equation without unknowns to true or false
            raise InputError(source, f"equation {number}", residual, "an expression or an equation with unknowns")
    rates = [rate(symbol) for symbol in state]
    E = sp.Matrix([_slopes(f"{source}: equation {k}", r, rates, inputs) for k, r in enumerate(residuals, 1)])
    B = -sp.Matrix([_slopes(f"{source}: equation {k}", r, inputs, rates) for k, r in enumerate(residuals, 1)])
    B = B.reshape(len(residuals), len(inputs))
    rows = sorted(range(E.rows), key=lambda row: E[row, :].is_zero_matrix is True)
    columns = sorted(range(E.cols), key=lambda column: E[:, column].is_zero_matrix is True)
    ordered = [state[column] for column in columns]
    algebraic = [state[column] for column in columns if E[:, column].is_zero_matrix]
    at_rest = dict.fromkeys([*rates, *inputs], 0)
    drift = [
        factored(f"{source}: equation {row + 1}", -residuals[row].subs(at_rest), ordered, algebraic) for row in rows
    ]
    measured = [factored(f"{source}: output {k}", sp.sympify(h), ordered, algebraic) for k, h in enumerate(outputs, 1)]
    return EquationMatrices(
        tuple(ordered),
        E.extract(rows, columns),
        sp.Matrix(drift),
        B.extract(rows, list(range(B.cols))),
        sp.Matrix(measured),
    )


def _slopes(source: str, residual: sp.Expr, along: Sequence[sp.Symbol], others: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Coefficients of some symbols in a residual that must be affine in them and in the others together."""
    slopes = [sp.expand(sp.diff(residual, symbol)) for symbol in along]
    for symbol, slope in zip(along, slopes, strict=True):
        if slope.free_symbols & {*along, *others}:
            raise InputError(source, f"coefficient of {symbol}", slope, "a function of the state alone")
    return slopes


def factored(
    source: str, expression: sp.Expr, state: Sequence[sp.Symbol], algebraic: Sequence[sp.Symbol] = ()
) -> list[sp.Expr]:
    """A row a(x) with ``expression = sum_j a_j(x) x_j``.

    The expression is expanded and every term divided by one state:

    * a product of powers of states by the last algebraic state in it, so that premises depend on differential states if
      they can (Assumption 1), otherwise by the last state in it: ``x1 x2^2 = (x1 x2) x2``, ``x^3 = (x^2) x``;
    * a term without such a state by the argument of its first sine or tanh: ``sin w = sinc(w) w``, w factored in its
      turn, ``tanh w = tanh_quotient(w) w``;
    * in terms left over, ``cos w = 1 - (w/2) sinc(w/2)^2 w`` and ``e^w = 1 + expm1_quotient(w) w``: so
      ``1 - cos x = (x/2) sinc(x/2)^2 x``.

    Raises:
        InputError: the expression does not vanish at x = 0, or a term is none of these.
    """
    constant = sp.simplify(expression.subs(dict.fromkeys(state, 0)))
    if constant != 0:
        raise InputError(source, "drift at x = 0", constant, "0: take the equilibrium as origin, or make it an input")
    row = dict.fromkeys(state, sp.S.Zero)
    left_over = _share_out(source, expression, row, algebraic)
    for function, around_one in _AROUND_ONE.items():
        left_over = left_over.replace(function, around_one)
    refused = _share_out(source, left_over, row, algebraic)
    if refused != 0:
        raise InputError(source, "drift", refused, "terms with a factor x, sin w, tanh w, 1 - cos w or e^w - 1")
    return [row[symbol] for symbol in state]


def _share_out(
    source: str, expression: sp.Expr, row: dict[sp.Symbol, sp.Expr], algebraic: Sequence[sp.Symbol]
) -> sp.Expr:
    """Add to the row the quotients of all terms that can be divided by a state, and return the sum of the others."""
    left_over = sp.S.Zero
    for term in sp.Add.make_args(sp.expand(expression)):
        quotients = _divided(source, term, list(row), algebraic)
        left_over += sp.S.Zero if quotients else term
        for symbol, quotient in quotients.items():
            row[symbol] += quotient
    return left_over


def _divided(
    source: str, term: sp.Expr, state: Sequence[sp.Symbol], algebraic: Sequence[sp.Symbol]
) -> dict[sp.Symbol, sp.Expr]:
    """Quotients of a term by states, none if it has no factor that is a state, a sine or a tanh."""
    powers = term.as_powers_dict()
    plain = [symbol for symbol in state if powers.get(symbol, sp.S.Zero).is_positive and powers[symbol] >= 1]
    for candidates in ([s for s in plain if s in algebraic], plain):
        if candidates:
            return {candidates[-1]: term / candidates[-1]}
    for base in sorted(powers, key=sp.default_sort_key):
        if base.func in _QUOTIENTS and powers[base] >= 1:
            (argument,) = base.args
            row = factored(source, argument, state, algebraic)
            quotient = term / base * _QUOTIENTS[base.func](argument)
            return {symbol: quotient * part for symbol, part in zip(state, row, strict=True) if part != 0}
    return {}
