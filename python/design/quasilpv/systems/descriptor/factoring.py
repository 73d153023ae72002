"""Expressions of the state as ``e = c + row . x``, exactly: the row is what A(x) is made of.

The row is not unique, so the rule is fixed (`factored`); `factorings` in the module of that name lists others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.intervals.chords import CHORDS, Ramp
from quasilpv.systems.intervals.piecewise import clamped
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient

Row = dict[sp.Symbol, sp.Expr]
Choice = Callable[[sp.Expr, Sequence[Row]], Row]
"""Picks one of the rows a term can be written as, the documented one first."""

# f(w)/w of functions that vanish at 0.
_QUOTIENTS = {sp.sin: sp.sinc, sp.tanh: tanh_quotient}
_DISCONTINUOUS = (sp.sign, sp.Heaviside, sp.floor, sp.ceiling, sp.frac)

FACTORS = "sums, products, powers, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, sinc, Abs, Max, Min and"
FACTORED_FUNCTIONS = f"{FACTORS} continuous Piecewise"


def factored(
    source: str, expression: sp.Expr, state: Sequence[sp.Symbol], algebraic: Sequence[sp.Symbol] = ()
) -> list[sp.Expr]:
    """A row a(x) with ``expression = sum_j a_j(x) x_j``. Rule and errors: `split`.

    Raises:
        InputError: the expression does not vanish at x = 0, too.
    """
    constant, row = split(source, expression, state, algebraic)
    if constant != 0:
        raise InputError(source, "drift at x = 0", constant, "0: give the equilibrium, or make it an input")
    return row


def split(
    source: str,
    expression: sp.Expr,
    state: Sequence[sp.Symbol],
    algebraic: Sequence[sp.Symbol] = (),
    choose: Choice | None = None,
) -> tuple[sp.Expr, list[sp.Expr]]:
    """The constant c and the row a(x) with ``expression = c + sum_j a_j(x) x_j``.

    The expression is expanded and every term divided by one state:

    * a product of powers of states by the last algebraic state in it, so that premises depend on differential states if
      they can (Assumption 1), otherwise by the last state in it: ``x1 x2^2 = (x1 x2) x2``, ``x^3 = (x^2) x``;
    * a term without such a state by the argument of its first sine or tanh that vanishes at 0: ``sin w = sinc(w) w``, w
      split in its turn, ``tanh w = tanh_quotient(w) w``;
    * any other term recursively as c + r.x: sums add, products ``(c + r.x)(c' + r'.x) = c c' + (c' r + e r').x`` with
      ``e = c + r.x``, powers by finite geometric sums, ``sqrt b - sqrt c = (b - c)/(sqrt b + sqrt c)``,
      ``sin(c + w) - sin c = w cos(c + w/2) sinc(w/2)``, cosines likewise, ``e^(c + w) - e^c = e^c
      expm1_quotient(w) w``, every other function by its `Chord`; a continuous Piecewise becomes a sum of its pieces,
      each of a clamped argument.

    Args:
        source: what the expression is, for messages.
        expression: of states and parameters.
        state: the symbols of x.
        algebraic: those of them that are algebraic.
        choose: takes another row than the first of those a term can be written as.

    Raises:
        InputError: a function that is not continuous or not known, or one that is not finite at x = 0; it is named.
    """
    splitter = _Splitter(source, state, algebraic, choose or (lambda term, rows: rows[0]))
    constant, row = splitter.terms(expression)
    return _simplest(constant), [row.get(symbol, sp.S.Zero) for symbol in state]


def term_rows(source: str, term: sp.Expr, state: Sequence[sp.Symbol], algebraic: Sequence[sp.Symbol] = ()) -> list[Row]:
    """All rows that one expanded term can be written as by dividing it by one factor, the documented one first."""
    return _Splitter(source, state, algebraic, lambda term, rows: rows[0]).rows_of(term)


def expanded(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    """The terms of an expression, with exponentials and logarithms of sums left whole."""
    return tuple(sp.Add.make_args(sp.expand(expression, power_exp=False, log=False)))


def _simplest(constant: sp.Expr) -> sp.Expr:
    """0 if it is 0, whatever it looks like."""
    return constant if constant.is_Rational else sp.simplify(constant)


def _sum(rows: Sequence[Row]) -> Row:
    total: Row = {}
    for row in rows:
        for symbol, entry in row.items():
            total[symbol] = total.get(symbol, sp.S.Zero) + entry
    return total


def _scaled(row: Mapping[sp.Symbol, sp.Expr], factor: sp.Expr) -> Row:
    return {symbol: factor * entry for symbol, entry in row.items()} if factor != 0 else {}


class _Splitter:
    """Splits the expressions of one row of equations."""

    def __init__(self, source: str, state: Sequence[sp.Symbol], algebraic: Sequence[sp.Symbol], choose: Choice) -> None:
        self._source = source
        self._state = tuple(state)
        self._algebraic = set(algebraic)
        self._choose = choose
        self._at_zero = dict.fromkeys(state, 0)

    def terms(self, expression: sp.Expr) -> tuple[sp.Expr, Row]:
        """By the rules of terms, and recursively where they do not fit."""
        constant, rows = sp.S.Zero, []
        for term in expanded(clamped(self._source, expression)):
            choices = self.rows_of(term)
            if choices:
                rows.append(self._choose(term, choices))
            else:
                own, row = self.recursive(term)
                constant += own
                rows.append(row)
        return constant, _sum(rows)

    def rows_of(self, term: sp.Expr) -> list[Row]:
        """The term divided by one factor: each state in it, then each sine and tanh of something that vanishes at 0."""
        powers = term.as_powers_dict()
        plain = [symbol for symbol in self._state if self._is_at_least_one(powers.get(symbol, sp.S.Zero))]
        first = [symbol for symbol in plain if symbol in self._algebraic] or plain
        ordered = [*first[-1:], *(symbol for symbol in reversed(plain) if symbol not in first[-1:])]
        rows: list[Row] = [{symbol: term / symbol} for symbol in ordered]
        for base in sorted(powers, key=sp.default_sort_key):
            if base.func in _QUOTIENTS and self._is_at_least_one(powers[base]) and self._value(base.args[0]) == 0:
                _, row = self.terms(base.args[0])
                rows.append(_scaled(row, term / base * _QUOTIENTS[base.func](base.args[0])))
        return rows

    @staticmethod
    def _is_at_least_one(power: sp.Expr) -> bool:
        return bool(power.is_Rational and power >= 1)

    def _value(self, expression: sp.Expr) -> sp.Expr:
        """At x = 0, exactly."""
        value = expression.subs(self._at_zero)
        if value.has(sp.zoo, sp.oo, -sp.oo, sp.nan):
            raise InputError(self._source, f"{expression} at x = 0", value, "a finite value")
        return _simplest(value)

    # ---- recursion -------------------------------------------------------------------------------------------------

    def recursive(self, e: sp.Expr) -> tuple[sp.Expr, Row]:
        """``e = c + row . x`` by what e is made of."""
        if e.is_Symbol or not e.free_symbols & set(self._state):
            return (sp.S.Zero, {e: sp.S.One}) if e in self._state else (e, {})
        if e.is_Add:
            parts = [self.recursive(part) for part in e.args]
            return reduce(add, (c for c, _ in parts)), _sum([row for _, row in parts])
        if e.is_Mul:
            return self._product(e)
        return self._power(e.base, e.exp) if e.is_Pow else self._function(e)

    def _product(self, e: sp.Expr) -> tuple[sp.Expr, Row]:
        """Factors without states first, then in sympy's order."""
        c, so_far = sp.S.One, sp.S.One
        row: Row = {}
        for factor in sorted(e.args, key=lambda part: bool(part.free_symbols & set(self._state))):
            constant, own = self.recursive(factor)
            row = _sum([_scaled(row, constant), _scaled(own, so_far)])
            c, so_far = c * constant, so_far * factor
        return c, row

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> tuple[sp.Expr, Row]:
        """``b^n - c^n = (b - c)(b^(n-1) + b^(n-2) c + ... + c^(n-1))``, after roots and reciprocals in the same way.

        Other exponents make it an exponential.
        """
        if not exponent.is_Rational:
            return self.recursive(sp.exp(sp.expand(exponent * sp.log(base)), evaluate=False))
        c, row = self.recursive(base)
        if c.is_zero and exponent >= 1:
            return c, _scaled(row, base ** (exponent - 1))
        p, q = int(exponent.p), int(exponent.q)
        root, c_root = base ** sp.Rational(1, q), c ** sp.Rational(1, q)
        if q > 1:
            if c.is_zero:
                expected = "a root of what is not 0 at x = 0, where its slope is infinite"
                raise InputError(self._source, f"{base**exponent} at x = 0", 0, expected)
            row = _scaled(row, 1 / sp.Add(*(root**k * c_root ** (q - 1 - k) for k in range(q))))
        if p < 0:
            if c.is_zero:
                raise InputError(self._source, f"{base**exponent} at x = 0", "a division by 0", "a finite value")
            row = _scaled(row, -1 / (root * c_root))
            root, c_root, p = 1 / root, 1 / c_root, -p
        return c_root**p, _scaled(row, sp.Add(*(root**k * c_root ** (p - 1 - k) for k in range(p))))

    def _function(self, e: sp.Expr) -> tuple[sp.Expr, Row]:
        """``g(a + w) = g(a) + chord w`` with w = row . x."""
        function = e.func
        if isinstance(e, sp.Max | sp.Min):
            return self._extremum(e)
        if function is sp.acos:
            return self.recursive(sp.pi / 2 - sp.asin(e.args[0]))
        if function not in {sp.sin, sp.cos, sp.exp, *CHORDS}:
            expected = f"a continuous function, one of {FACTORED_FUNCTIONS}"
            if isinstance(e, _DISCONTINUOUS):
                expected = "a continuous function: e.g. tanh(x/width) or the saturation max(-1, min(1, x/width))"
            raise InputError(self._source, "drift", e, expected)
        a, row = self.recursive(e.args[0])
        a = _simplest(a)
        w = sp.expand(e.args[0] - a, power_exp=False, log=False)
        value = function(a)
        if value.has(sp.zoo, sp.oo, -sp.oo, sp.nan):
            raise InputError(self._source, f"{e} at x = 0", value, "a finite value")
        return value, _scaled(row, self._chord(function, a, w))

    @staticmethod
    def _chord(function: type[sp.Function], a: sp.Expr, w: sp.Expr) -> sp.Expr:
        if function is sp.sin:
            return sp.sinc(w) if a == 0 else sp.cos(a + w / 2) * sp.sinc(w / 2)
        if function is sp.cos:
            return -w / 2 * sp.sinc(w / 2) ** 2 if a == 0 else -sp.sin(a + w / 2) * sp.sinc(w / 2)
        if function is sp.exp:
            return sp.exp(a) * expm1_quotient(w)
        return tanh_quotient(w) if function is sp.tanh and a == 0 else CHORDS[function](a, w)

    def _extremum(self, e: sp.Expr) -> tuple[sp.Expr, Row]:
        """``max(v, b) = b + ramp(v - b)``, ``min(v, b) = b - ramp(b - v)``; what moves stands in the ramp."""
        first, *rest = sorted(e.args, key=lambda part: not part.free_symbols & set(self._state))
        other = e.func(*rest)
        if isinstance(e, sp.Max):
            return self.recursive(other + Ramp(first - other))
        return self.recursive(other - Ramp(other - first))
