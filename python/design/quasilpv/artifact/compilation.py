"""From sympy expressions to programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy.core.sorting import default_sort_key

from quasilpv.documents.programs import MAX_LENGTH, MAX_POWER, MAX_STACK, OPERATIONS, Program
from quasilpv.errors import InputError
from quasilpv.systems.intervals.chords import (
    Ramp,
    SmoothSinc,
    abs_chord,
    asin_chord,
    atan_chord,
    cosh_chord,
    log_chord,
    ramp_chord,
    sinc_slope,
    sinh_chord,
    tan_chord,
    tanh_chord,
)
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient

Instruction = tuple[str] | tuple[str, int] | tuple[str, float]


def compile_program(expressions: Sequence[sympy.Expr], inputs: Mapping[sympy.Symbol, tuple[str, int]]) -> Program:
    """Compile sympy expressions to one program with ``len(expressions)`` outputs.

    Sums and products are evaluated from left to right in sympy's canonical sort order, so that equal expressions give
    equal code on every machine. ``sympy.sinc`` is sin(x)/x, as in the programs; tan and atan are written with the
    operations there are.

    Args:
        expressions: real expressions in the keys of ``inputs``.
        inputs: where each symbol is read from, e.g. ``{theta_1: ("angle", 0)}``.

    Raises:
        InputError: an unknown symbol, a function outside the closed list, a number that is not a finite real, or code
            that is too long or needs too deep a stack.
    """
    code: list[Instruction] = []
    for i, expression in enumerate(expressions):
        _Compiler(inputs, f"output {i}", code).emit(sympy.sympify(expression, strict=True))
    if len(code) > MAX_LENGTH:
        raise InputError("program", "code", f"{len(code)} instructions", f"at most {MAX_LENGTH}")
    try:
        return Program(outputs=len(expressions), code=tuple(code))
    except ValueError as error:
        raise InputError("program", "code", error, f"a stack of at most {MAX_STACK} values") from error


def _sinh_quotient(x: sympy.Expr) -> sympy.Expr:
    return sympy.exp(-x) * expm1_quotient(2 * x)


_WRITTEN_OUT: Mapping[Any, Callable[..., sympy.Expr]] = {
    sympy.tan: lambda x: sympy.sin(x) / sympy.cos(x),
    sympy.sinh: lambda x: x * _sinh_quotient(x),
    sympy.cosh: lambda x: (sympy.exp(x) + sympy.exp(-x)) / 2,
    sympy.sign: lambda x: abs_chord(sympy.S.Zero, x),
    sympy.Heaviside: lambda x, *at_zero: (1 + abs_chord(sympy.S.Zero, x)) / 2,
    tan_chord: lambda a, w: sympy.sinc(w) / (sympy.cos(a) * sympy.cos(a + w)),
    sinh_chord: lambda a, w: sympy.cosh(a + w / 2) * _sinh_quotient(w / 2),
    cosh_chord: lambda a, w: sympy.sinh(a + w / 2) * _sinh_quotient(w / 2),
    tanh_chord: lambda a, w: tanh_quotient(w) * (1 - sympy.tanh(a) * sympy.tanh(a + w)),
    ramp_chord: lambda a, w: (1 + abs_chord(a, w)) / 2,
}
"""Functions without an operation, in those that have one."""


class _Compiler:
    """Emits the postfix code of one expression tree."""

    _FUNCTIONS: Mapping[Any, str] = {
        sympy.sin: "sin",
        sympy.cos: "cos",
        sympy.asin: "asin",
        sympy.acos: "acos",
        sympy.exp: "exp",
        sympy.sinc: "sinc",
        SmoothSinc: "sinc",
        sinc_slope: "sinc_slope",
        sympy.log: "log",
        sympy.tanh: "tanh",
        sympy.Abs: "abs",
        sympy.atan2: "atan2",
        expm1_quotient: "expm1_quotient",
        tanh_quotient: "tanh_quotient",
        log_chord: "log_chord",
        abs_chord: "abs_chord",
        atan_chord: "atan_chord",
        asin_chord: "asin_chord",
    }
    _FOLDED: Mapping[Any, str] = {sympy.Min: "min", sympy.Max: "max"}
    _WITH_CONSTANT: Mapping[Any, tuple[float, str]] = {Ramp: (0.0, "max"), sympy.atan: (1.0, "atan2")}

    def __init__(self, inputs: Mapping[sympy.Symbol, tuple[str, int]], field: str, code: list[Instruction]) -> None:
        self._inputs = inputs
        self._field = field
        self._code = code

    def emit(self, node: sympy.Expr) -> None:
        if node in self._inputs:
            self._code.append(self._inputs[node])
        elif node.is_number:
            self._code.append(("const", self._number(node)))
        elif node.is_Add:
            self._emit_sum(node)
        elif node.is_Mul:
            self._emit_product(node)
        elif node.is_Pow:
            self._emit_power(node.base, node.exp)
        elif node.func in self._FUNCTIONS:
            for argument in node.args:
                self.emit(argument)
            self._code.append((self._FUNCTIONS[node.func],))
        elif node.func in self._FOLDED:
            self._emit_factors(sorted(node.args, key=default_sort_key), self._FOLDED[node.func])
        elif node.func in self._WITH_CONSTANT:
            number, name = self._WITH_CONSTANT[node.func]
            self.emit(node.args[0])
            self._code.extend([("const", number), (name,)])
        elif node.func in _WRITTEN_OUT:
            self.emit(_WRITTEN_OUT[node.func](*node.args))
        else:
            known = map(str, self._inputs) if node.is_Symbol else OPERATIONS
            raise InputError("program", self._field, node, f"one of {', '.join(known)}")

    def _number(self, node: sympy.Expr) -> float:
        if node.is_real is False or not np.isfinite(value := float(node)):
            raise InputError("program", self._field, node, "a finite real number")
        return value

    def _emit_sum(self, node: sympy.Expr) -> None:
        first, *rest = sorted(node.args, key=lambda term: (term.could_extract_minus_sign(), default_sort_key(term)))
        self.emit(first)
        for term in rest:
            negative = term.could_extract_minus_sign()
            self.emit(-term if negative else term)
            self._code.append(("sub",) if negative else ("add",))

    def _emit_product(self, node: sympy.Expr) -> None:
        if node.could_extract_minus_sign():
            self.emit(-node)
            self._code.append(("neg",))
            return
        numerator: list[sympy.Expr] = []
        denominator: list[sympy.Expr] = []
        for factor in sorted(node.args, key=default_sort_key):
            inverted = factor.is_Pow and factor.exp.could_extract_minus_sign()
            (denominator if inverted else numerator).append(1 / factor if inverted else factor)
        self._emit_factors(numerator or [sympy.Integer(1)])
        if denominator:
            self._emit_factors(denominator)
            self._code.append(("div",))

    def _emit_factors(self, factors: Sequence[sympy.Expr], operation: str = "mul") -> None:
        self.emit(factors[0])
        for factor in factors[1:]:
            self.emit(factor)
            self._code.append((operation,))

    def _emit_power(self, base: sympy.Expr, exponent: sympy.Expr) -> None:
        if exponent.could_extract_minus_sign():
            self._code.append(("const", 1.0))
            self.emit(base**-exponent)
            self._code.append(("div",))
        elif exponent == sympy.Rational(1, 2):
            self.emit(base)
            self._code.append(("sqrt",))
        elif exponent.is_Integer and int(exponent) <= MAX_POWER:
            self.emit(base)
            self._code.append(("pow_int", int(exponent)))
        elif exponent.is_Rational and exponent.q == 2 and exponent.p <= MAX_POWER:
            self.emit(base)
            self._code.extend([("sqrt",), ("pow_int", exponent.p)])
        elif exponent.is_number and not exponent.is_Integer:  # of what is not negative
            self.emit(base)
            self._code.extend([("log",), ("const", self._number(exponent)), ("mul",), ("exp",)])
        else:
            expected = f"an integer power of at most {MAX_POWER} in absolute value, or one of a number"
            raise InputError("program", self._field, base**exponent, expected)
