"""The plant of a system as programs: the residual ``F(x', x, u, p)`` of its equations, and its Jacobian row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import sympy as sp

from quasilpv.artifact.compilation import compile_program
from quasilpv.systems.descriptor.affine_system import AffineSystem
from quasilpv.systems.descriptor.names import rate, symbol
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.intervals.algebra import of_functions
from quasilpv.systems.intervals.chords import CHORDS, SmoothSinc, as_ramps
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient


def _chord(function: Callable[[sp.Expr], sp.Expr], a: sp.Expr, w: sp.Expr) -> sp.Expr:
    return (function(a + w) - function(a)) / w


QUOTIENTS: dict[Any, Callable[..., sp.Expr]] = {
    sp.sinc: lambda w: sp.sin(w) / w,
    expm1_quotient: lambda w: (sp.exp(w) - 1) / w,
    tanh_quotient: lambda w: sp.tanh(w) / w,
    **{chord: partial(_chord, function) for function, chord in CHORDS.items()},
}
"""What was left of a function when a state was factored out; times that state it is the function again."""


def plant_document(system: AffineSystem, signals: Sequence[sp.Symbol]) -> dict[str, Any]:
    """The member ``plant`` of an artifact.

    Args:
        system: in deviations from its trim.
        signals: states, inputs, parameters.

    Raises:
        InputError: an expression has no program.
    """
    residual = [row.replace(sp.sinc, SmoothSinc) for row in residual_expressions(system, signals)]
    rates = [rate(symbol) for symbol in system.state]
    numbers = {symbol: ("signal", k) for k, symbol in enumerate([*signals, *rates])}
    rows = [[sp.diff(row, symbol) for symbol in [*rates, *system.state]] for row in residual]
    return {
        "residual": compile_program(residual, numbers).model_dump(mode="json"),
        "jacobian": [compile_program(row, numbers).model_dump(mode="json") for row in rows],
    }


def residual_expressions(system: AffineSystem, signals: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """``F(x', x, u)``, one expression per equation: as it was written, or ``E(z) x' - A(z) x - B(z) u - d``."""
    n, m = system.order, len(system.inputs)
    if system.equations:
        written = {symbol(name): signal for name, signal in zip(system.inputs, signals[n : n + m], strict=True)}
        return [equation.xreplace(written) for equation in system.equations]
    inputs = sp.Matrix(signals[n : n + m])
    rates = sp.Matrix([rate(symbol) for symbol in system.state])
    left = _whole(system, system.E, rates)
    right = [
        a + b
        for a, b in zip(
            _whole(system, system.A, sp.Matrix(system.state)), _whole(system, system.B, inputs), strict=True
        )
    ]
    rest = system.disturbance or (0.0,) * n
    return [a - b - sp.Float(d) if d else a - b for a, b, d in zip(left, right, rest, strict=True)]


def _whole(system: AffineSystem, matrix: AffineMatrix, vector: sp.Matrix) -> list[sp.Expr]:
    """The product, term by term: a quotient meets the state it was divided by, and both are the function again."""
    rows, columns = matrix.shape
    total = [sp.S.Zero] * rows
    terms = [
        (sp.S.One, matrix.constant),
        *zip((p.expression for p in system.premises), matrix.coefficients, strict=True),
    ]
    for premise, coefficients in terms:
        for i in range(rows):
            own = {vector[j]: coefficients[i, j] for j in range(columns) if coefficients[i, j] != 0.0}
            total[i] += _row(premise, own)
    return total


def _row(premise: sp.Expr, factors: Mapping[sp.Expr, float]) -> sp.Expr:
    """A premise times a sum: sinc(a + b) a + sinc(a + b) b is sin(a + b), and no part alone is a function again."""
    parts = [_product(sp.Float(number), premise, factor) for factor, number in factors.items()]
    if len(parts) > 1 and any(part.has(*QUOTIENTS) for part in parts):
        first = next(iter(factors.values()))
        ratios = (sp.Rational(number) / sp.Rational(first) * factor for factor, number in factors.items())
        whole = _product(sp.Float(first), premise, sp.Add(*ratios))
        if not whole.has(*QUOTIENTS):
            return whole
    return sp.Add(*parts)


def _product(number: sp.Float, premise: sp.Expr, factor: sp.Expr) -> sp.Expr:
    plain = premise
    for quotient, explicit in QUOTIENTS.items():
        plain = plain.replace(quotient, explicit)
    if plain != premise:
        plain = as_ramps(plain)  # so that what stands in one quotient meets what the other was divided by
    whole = plain * factor
    whole = whole if _is_defined_at_rest(whole) else of_functions(sp.cancel, whole) if plain != premise else whole
    return number * (whole if _is_defined_at_rest(whole) else premise * factor)


def _is_defined_at_rest(expression: sp.Expr) -> bool:
    """Whether no denominator vanishes with its symbols."""
    denominators = [power.base for power in expression.atoms(sp.Pow) if power.exp.could_extract_minus_sign()]
    return all(base.subs(dict.fromkeys(base.free_symbols, 0)) != 0 for base in denominators)
