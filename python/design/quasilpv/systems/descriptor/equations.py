"""Implicit equations ``F(x, x', u) = 0`` written as ``E(x) x' = A(x) x + B(x) u + d``.

E and B follow from the equations; A does not: see `quasilpv.systems.descriptor.factoring`. d is what the equations
leave over at the point that is taken for the equilibrium: rounding, or it is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.factoring import expanded, split
from quasilpv.systems.descriptor.names import rate, symbol
from quasilpv.systems.descriptor.rest import nearest_rest
from quasilpv.systems.descriptor.vocabulary import Formula, Vocabulary, exact
from quasilpv.systems.intervals.chords import without_products_of_signs
from quasilpv.systems.intervals.piecewise import clamped

__all__ = ["RESIDUAL", "EquationMatrices", "Equilibrium", "equation_matrices", "rate"]

RESIDUAL = 1e-9
"""Largest constant left over at an equilibrium, relative to the summed magnitudes of the terms of its equation."""


class EquationMatrices(NamedTuple):
    """What a set of equations says: the states in order, E(x), A(x), B(x), C(x) as expressions, the constants d, and
    the equations themselves, of the deviations, in the order of the rows."""

    state: tuple[sp.Symbol, ...]
    E: sp.Matrix
    A: sp.Matrix
    B: sp.Matrix
    C: sp.Matrix
    d: tuple[float, ...]
    residuals: tuple[sp.Expr, ...]


class Equilibrium(NamedTuple):
    """The point around which a system is written down, by symbol of state and input; 0 for those not named."""

    state: Mapping[sp.Symbol, sp.Expr]
    inputs: Mapping[sp.Symbol, sp.Expr]

    @classmethod
    def of(cls, names: Vocabulary, given: tuple[Any, Any] | None) -> Equilibrium:
        """From ``(x0, u0)``, each a sequence in order or a mapping by name; doubles are the rationals they are.

        Raises:
            InputError: not two parts, a wrong number of values, or a value that is no finite real number.
        """
        if given is None:
            return cls({}, {})
        try:
            x0, u0 = given
        except (TypeError, ValueError):
            raise InputError(names.source, "equilibrium", given, "(x0, u0): values of states and inputs") from None
        return cls(cls._values(names, "x0", names.state, x0), cls._values(names, "u0", names.inputs, u0))

    @staticmethod
    def _values(names: Vocabulary, field: str, symbols: Sequence[sp.Symbol], given: Any) -> dict[sp.Symbol, sp.Expr]:
        source, field = names.source, f"equilibrium {field}"
        if isinstance(given, Mapping):
            values = {symbol(name): value for name, value in given.items()}
            strangers = [name for name in values if name not in symbols]
            if strangers:
                raise InputError(source, field, strangers[0], f"one of {', '.join(map(str, symbols))}")
        else:
            listed = list(given)
            if len(listed) != len(symbols):
                raise InputError(source, field, f"{len(listed)} values", f"{len(symbols)}")
            values = dict(zip(symbols, listed, strict=True))
        return {name: _number(source, f"{field}, {name}", value) for name, value in values.items()}

    def values(self, state: Sequence[sp.Symbol], inputs: Sequence[sp.Symbol]) -> tuple[float, ...]:
        """As doubles, states and then inputs in the order given; empty for the origin."""
        found = [self.state.get(name, 0) for name in state] + [self.inputs.get(name, 0) for name in inputs]
        return tuple(map(float, found)) if any(found) else ()

    def of_deviations(self, expression: sp.Expr) -> sp.Expr:
        """An expression of the symbols as one of their deviations from here, which have the same names."""
        shift = {name: name + value for name, value in {**self.state, **self.inputs}.items() if value != 0}
        return expression.xreplace(shift) if shift else expression

    def at(self, expression: sp.Expr, names: Vocabulary) -> sp.Expr:
        """An expression here, states and inputs not named being 0."""
        values = {name: sp.S.Zero for name in (*names.state, *names.inputs)}
        return expression.subs({**values, **self.state, **self.inputs})


def _number(source: str, field: str, value: Any) -> sp.Expr:
    try:
        number = exact(sp.sympify(value, strict=True))
    except (sp.SympifyError, TypeError, ValueError):
        number = None
    if number is None or not (isinstance(number, sp.Expr) and number.is_number and number.is_real and number.is_finite):
        raise InputError(source, field, value, "a finite number")
    return number


def equation_matrices(
    names: Vocabulary, equations: Sequence[Formula], outputs: Sequence[Formula], equilibrium: Equilibrium
) -> EquationMatrices:
    """Matrices of the equations ``F(x, x', u) = 0`` and of the outputs ``y = h(x)`` around an equilibrium.

    Equations without a rate, and states whose rate occurs nowhere, are moved behind the others.

    Raises:
        InputError: see `DescriptorSystem.from_equations`.
    """
    source, state, inputs = names.source, names.state, names.inputs
    if len(equations) != len(state):
        raise InputError(source, "equations", f"{len(equations)} equations", f"{len(state)}, one for each state")
    given = [
        without_products_of_signs(exact(names.read(f"equation {number}", equation, rates=True, inputs=True)))
        for number, equation in enumerate(equations, 1)
    ]
    residuals = [equilibrium.of_deviations(equation) for equation in given]
    rates = [rate(name) for name in state]
    if not any(residual.has(*rates) for residual in residuals):
        expected = "a rate, x' or rate(x): x.diff(t) of a symbol x is 0"
        raise InputError(source, "equations", "no rate of a state", expected)
    E = sp.Matrix([_slopes(f"{source}: equation {k}", r, rates, inputs) for k, r in enumerate(residuals, 1)])
    B = -sp.Matrix([_slopes(f"{source}: equation {k}", r, inputs, rates) for k, r in enumerate(residuals, 1)])
    B = B.reshape(len(residuals), len(inputs))
    rows = sorted(range(E.rows), key=lambda row: E[row, :].is_zero_matrix is True)
    columns = sorted(range(E.cols), key=lambda column: E[:, column].is_zero_matrix is True)
    ordered = [state[column] for column in columns]
    algebraic = [state[column] for column in columns if E[:, column].is_zero_matrix]
    at_rest = dict.fromkeys([*rates, *inputs], 0)
    drift, constants = [], []
    for row in rows:
        field = f"{source}: equation {row + 1}"
        constant, entries = split(field, -residuals[row].subs(at_rest), ordered, algebraic)
        drift.append(entries)
        terms = [equilibrium.at(term.subs(dict.fromkeys(rates, 0)), names) for term in expanded(given[row])]
        constants.append(_left_over(field, constant, terms, lambda: _rest_near(names, given, equilibrium)))
    measured = []
    for number, output in enumerate(outputs, 1):
        whole = exact(names.read(f"output {number}", output))
        deviation = equilibrium.of_deviations(whole) - (equilibrium.at(whole, names) if equilibrium.state else 0)
        constant, entries = split(f"{source}: output {number}", deviation, ordered, algebraic)
        if constant != 0:
            expected = "0: an output is a deviation from its value at the equilibrium"
            raise InputError(f"{source}: output {number}", "value at x = 0", constant, expected)
        measured.append(entries)
    return EquationMatrices(
        tuple(ordered),
        E.extract(rows, columns),
        sp.Matrix(drift),
        B.extract(rows, list(range(B.cols))),
        sp.Matrix(measured).reshape(len(measured), len(ordered)),
        tuple(constants),
        tuple(clamped(f"{source}: equation {row + 1}", residuals[row]) for row in rows),
    )


def _rest_near(names: Vocabulary, equations: Sequence[sp.Expr], equilibrium: Equilibrium) -> str:
    """In words, where the system rests near the equilibrium it was given; empty without one, or if it rests nowhere."""
    symbols = (*names.state, *names.inputs)
    still = [equation.subs(dict.fromkeys([rate(name) for name in names.state], 0)) for equation in equations]
    if not (equilibrium.state or equilibrium.inputs) or any(e.free_symbols - {*symbols} for e in still):
        return ""
    given = {**equilibrium.state, **equilibrium.inputs}
    rest = nearest_rest(still, symbols, [float(given.get(name, 0)) for name in symbols])
    if rest is None:
        return ""
    return f"; near the one given it rests at {(rest[: len(names.state)], rest[len(names.state) :])}"


def _left_over(
    field: str, constant: sp.Expr, terms: Sequence[sp.Expr], rest_near: Callable[[], str] = lambda: ""
) -> float:
    """The constant of an equation at the equilibrium if it is rounding, which is reported as a disturbance.

    Args:
        field: which equation, for messages.
        constant: what its terms sum to at the equilibrium.
        terms: what they are there.
        rest_near: where it is 0, for the message.

    Raises:
        InputError: it is more than `RESIDUAL` of the row, or depends on a parameter.
    """
    if constant == 0:
        return 0.0
    size = sum((sp.Abs(sp.N(term)) for term in terms), sp.S.Zero)
    if constant.is_number and size.is_number and abs(sp.N(constant)) <= RESIDUAL * size:
        return float(constant)
    expected = "0: give the equilibrium, equilibrium=(x0, u0), or make it an input" + rest_near()
    raise InputError(field, "drift at x = 0", sp.N(constant, 6) if constant.is_number else constant, expected)


def _slopes(source: str, residual: sp.Expr, along: Sequence[sp.Symbol], others: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Coefficients of some symbols in a residual that must be affine in them and in the others together."""
    slopes = [sp.expand(sp.diff(residual, name)) for name in along]
    for name, slope in zip(along, slopes, strict=True):
        if slope.free_symbols & {*along, *others}:
            raise InputError(source, f"coefficient of {name}", slope, "a function of the state alone")
    return slopes
