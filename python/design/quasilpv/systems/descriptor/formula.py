"""Formulas that people write as text, read by a parser of our own: nothing is ever evaluated as code.

What is not in the grammar is refused with its position:

    equation = sum ["=" sum]                      "x' = v" says the same as "x' - v"
    sum      = product {("+" | "-") product}
    product  = factor {("*" | "/") factor}
    factor   = {"+" | "-"} atom [("**" | "^") factor]
    atom     = number | name | name "'" | function "(" arguments ")" | "(" sum ")"

A number is the rational it says: 0.1 is 1/10. ``x'`` and ``rate(x)`` are the time derivative of x. The functions are
`FUNCTIONS`; ``piecewise(x < 1, x, 1)`` takes pairs of a condition and a value, then the value elsewhere. Length, depth,
size of numbers and number of terms after expansion are bounded, so that no text keeps the computer busy.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from math import comb
from typing import NamedTuple, NoReturn

import sympy as sp

from quasilpv.errors import InputError, one_of

MAX_LENGTH = 10_000  # characters
MAX_DEPTH = 40  # of parentheses, powers and signs inside each other
MAX_POWER = 64  # numerator and denominator of an exponent
MAX_DIGITS = 60  # of a number, and the largest power of ten behind its e
MAX_BITS = 4096  # numerator and denominator of any number on the way
MAX_TERMS = 5_000  # after expansion
_LARGEST = 1e300  # of a constant that is not rational

_TOKEN = re.compile(
    r"(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*'?)"
    r"|(?P<operator>\*\*|==|<=|>=|[-+*/^(),=<>])",
    re.ASCII,
)
_SPACE = re.compile(r"[ \t\r\n]*", re.ASCII)
_RELATIONS = {"<": sp.StrictLessThan, "<=": sp.LessThan, ">": sp.StrictGreaterThan, ">=": sp.GreaterThan}


class _Value(NamedTuple):
    """An expression, and at most how many terms it has after expansion."""

    expression: sp.Expr
    terms: int


class _Token(NamedTuple):
    kind: str
    text: str
    position: int


def saturation(w: sp.Expr, limit: sp.Expr = sp.S.One) -> sp.Expr:
    """``w`` where ``|w| <= limit``, else ``limit`` with the sign of w."""
    return sp.Min(sp.Max(w, -limit), limit)


def dead_zone(w: sp.Expr, width: sp.Expr = sp.S.One) -> sp.Expr:
    """0 where ``|w| <= width``, else what exceeds it: ``w - saturation(w, width)``."""
    return w - saturation(w, width)


FUNCTIONS: Mapping[str, tuple[Callable[..., sp.Expr], int, int]] = {
    **{name: (getattr(sp, name), 1, 1) for name in ("sin", "cos", "tan", "asin", "acos", "atan")},
    **{name: (getattr(sp, name), 1, 1) for name in ("sinh", "cosh", "tanh", "exp", "log", "sqrt", "sinc", "sign")},
    "abs": (sp.Abs, 1, 1),
    "min": (sp.Min, 2, 8),
    "max": (sp.Max, 2, 8),
    "sat": (saturation, 1, 2),
    "dead_zone": (dead_zone, 1, 2),
}
"""Functions of a formula: what they are, and how many arguments they take at least and at most.

``sat(w, limit)`` is `saturation`, ``dead_zone(w, width)`` is `dead_zone`, ``sinc(w)`` is sin(w)/w and 1 at 0.
"""


def parse_expression(source: str, text: str, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """The expression a text says.

    Args:
        source: what the text is, for messages, e.g. ``"dc-bus: equation 2"``.
        text: a formula without ``=``.
        symbols: what the names in it stand for; the rate of x is under ``x'``. ``pi`` is known.

    Raises:
        InputError: anything but a formula of the grammar, a name that is not known, or one of the bounds exceeded; the
            column and what was expected there are named.
    """
    return _Parser(source, text, symbols).expression()


def parse_equation(source: str, text: str, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """Left minus right side of an equation; a text without ``=`` stands for itself = 0. Errors: `parse_expression`."""
    return _Parser(source, text, symbols).equation()


class _Parser:
    """One text, read from left to right."""

    def __init__(self, source: str, text: str, symbols: Mapping[str, sp.Symbol]) -> None:
        self._source = source
        self._symbols = symbols
        self._depth = 0
        if len(text) > MAX_LENGTH:
            raise InputError(source, "formula", f"{len(text)} characters", f"at most {MAX_LENGTH}")
        self._tokens = self._split(text)
        self._next = 0

    def expression(self) -> sp.Expr:
        value = self._sum()
        self._end("an operator or the end")
        return value.expression

    def equation(self) -> sp.Expr:
        value = self._sum()
        if self._accept("=", "=="):
            value = self._added(value, self._negative(self._sum()))
        self._end("an operator, = or the end")
        return value.expression

    # ---- tokens ----------------------------------------------------------------------------------------------------

    def _split(self, text: str) -> list[_Token]:
        tokens: list[_Token] = []
        position = 0
        while True:
            space = _SPACE.match(text, position)
            position = space.end() if space else position
            if position == len(text):
                return [*tokens, _Token("end", "the end", position)]
            match = _TOKEN.match(text, position)
            if match is None:
                expected = "a number, a name, a parenthesis or one of + - * / ** = ,"
                if text[position] == ".":
                    expected += "; the rate of x is x' or rate(x)"
                self._refuse(
                    _Token("", text[position].encode("ascii", "backslashreplace").decode(), position), expected
                )
            tokens.append(_Token(str(match.lastgroup), match.group(), position))
            position = match.end()

    def _peek(self) -> _Token:
        return self._tokens[self._next]

    def _take(self) -> _Token:
        token = self._peek()
        self._next += 1
        return token

    def _accept(self, *operators: str) -> str | None:
        token = self._peek()
        if token.kind == "operator" and token.text in operators:
            return self._take().text
        return None

    def _expect(self, operator: str) -> None:
        if self._accept(operator) is None:
            self._refuse(self._peek(), operator)

    def _end(self, expected: str) -> None:
        if self._peek().kind != "end":
            self._refuse(self._peek(), expected)

    def _refuse(self, token: _Token, expected: str) -> NoReturn:
        raise InputError(self._source, f"column {token.position + 1}", token.text, expected)

    # ---- the grammar -----------------------------------------------------------------------------------------------

    def _sum(self) -> _Value:
        value = self._product()
        while operator := self._accept("+", "-"):
            term = self._product()
            value = self._added(value, term if operator == "+" else self._negative(term))
        return value

    def _product(self) -> _Value:
        value = self._factor()
        while operator := self._accept("*", "/"):
            at = self._peek()
            factor = self._factor()
            if operator == "/":
                if factor.expression.is_zero:
                    self._refuse(at, "a divisor that is not 0")
                factor = _Value(1 / factor.expression, factor.terms)
            value = self._bounded(at, value.expression * factor.expression, value.terms * factor.terms)
        return value

    def _factor(self) -> _Value:
        self._deeper()
        if operator := self._accept("+", "-"):
            value = self._factor()
            value = value if operator == "+" else self._negative(value)
        else:
            value = self._atom()
            if self._accept("**", "^"):
                at = self._peek()
                value = self._power(at, value, self._factor())
        self._depth -= 1
        return value

    def _atom(self) -> _Value:
        token = self._take()
        if token.kind == "number":
            return _Value(self._number(token), 1)
        if token.kind == "name":
            return self._call(token) if self._peek().text == "(" else _Value(self._symbol(token), 1)
        if token.text == "(":
            value = self._sum()
            self._expect(")")
            return value
        self._refuse(token, "a number, a name or (")

    def _call(self, token: _Token) -> _Value:
        self._expect("(")
        if token.text == "rate":
            name = self._take()
            self._expect(")")
            return _Value(self._symbol(name._replace(text=f"{name.text}'")), 1)
        if token.text == "piecewise":
            return self._piecewise(token)
        if token.text not in FUNCTIONS:
            self._refuse(token, f"a function: {one_of([*FUNCTIONS, 'piecewise', 'rate'], token.text, 'the grammar')}")
        arguments = [self._sum()]
        while self._accept(","):
            arguments.append(self._sum())
        self._expect(")")
        function, fewest, most = FUNCTIONS[token.text]
        if not fewest <= len(arguments) <= most:
            count = f"{fewest}" if fewest == most else f"{fewest} to {most}"
            self._refuse(token._replace(text=f"{token.text} of {len(arguments)} arguments"), f"{count} arguments")
        return self._bounded(token, function(*(a.expression for a in arguments)), 2)

    def _piecewise(self, token: _Token) -> _Value:
        """The arguments of ``piecewise``: condition, value, condition, value, ..., value elsewhere."""
        pairs = []
        while True:
            first = self._sum()
            relation = self._accept(*_RELATIONS)
            if relation is None:
                self._expect(")")
                pairs.append((first.expression, sp.true))
                return self._bounded(token, sp.Piecewise(*pairs), 1)
            second = self._sum()
            self._expect(",")
            pairs.append((self._sum().expression, _RELATIONS[relation](first.expression, second.expression)))
            self._expect(",")

    def _symbol(self, token: _Token) -> sp.Expr:
        name = token.text
        if name in self._symbols:
            return self._symbols[name]
        if name == "pi":
            return sp.pi
        self._refuse(
            token,
            f"a name that is declared: {one_of(self._symbols, name, 'the system') if self._symbols else 'none is'}",
        )

    def _number(self, token: _Token) -> sp.Rational:
        mantissa, _, exponent = token.text.lower().partition("e")
        if len(mantissa) > MAX_DIGITS or abs(int(exponent[:9] or 0)) > MAX_DIGITS * 5:
            expected = f"a number of at most {MAX_DIGITS} digits and a power of ten of at most {MAX_DIGITS * 5}"
            self._refuse(token._replace(text=token.text[:20]), expected)
        value = Fraction(token.text)
        return sp.Rational(value.numerator, value.denominator)

    # ---- values ----------------------------------------------------------------------------------------------------

    def _added(self, first: _Value, second: _Value) -> _Value:
        return self._bounded(self._peek(), first.expression + second.expression, first.terms + second.terms)

    @staticmethod
    def _negative(value: _Value) -> _Value:
        return _Value(-value.expression, value.terms)

    def _power(self, at: _Token, base: _Value, exponent: _Value) -> _Value:
        power = exponent.expression
        if power.is_Rational and not (abs(power.p) <= MAX_POWER and power.q <= MAX_POWER):
            self._refuse(at, f"an exponent of at most {MAX_POWER}")
        if power.is_Integer and base.expression.is_Rational:
            number = base.expression
            if number == 0 and power < 0:
                self._refuse(at, "an exponent >= 0 of 0")
            if max(abs(number.p), number.q).bit_length() * abs(int(power)) > MAX_BITS:
                self._refuse(at, f"numbers of at most {MAX_BITS} bits")
        whole = abs(int(power)) if power.is_Integer and power != 0 else 1
        return self._bounded(at, base.expression**power, comb(base.terms + whole - 1, whole))

    def _bounded(self, at: _Token, expression: sp.Expr, terms: int) -> _Value:
        if terms > MAX_TERMS:
            self._refuse(at, f"a formula that expands to at most {MAX_TERMS} terms")
        if expression.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
            self._refuse(at, "a formula without a division by 0")
        if expression.is_Rational:
            if max(abs(expression.p), expression.q).bit_length() > MAX_BITS:
                self._refuse(at, f"numbers of at most {MAX_BITS} bits")
        elif expression.is_number:
            value = sp.N(expression, 15)
            if not (value.is_real and abs(value) < _LARGEST):
                self._refuse(at, f"real numbers below {_LARGEST:g}")
        return _Value(expression, terms)

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            self._refuse(self._peek(), f"at most {MAX_DEPTH} levels of parentheses, powers and signs")


def split_names(names: str | Sequence[str | sp.Symbol]) -> list[str | sp.Symbol]:
    """``"x, v"`` and ``"x v"`` as two names; a sequence as it is."""
    return [name for name in re.split(r"[,\s]+", names) if name] if isinstance(names, str) else list(names)
