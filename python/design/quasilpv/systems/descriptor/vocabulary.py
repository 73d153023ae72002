"""The names of a system: what a user calls its states, inputs and parameters, in text or as symbols.

A name is one thing, however it is given: ``"x"``, ``Symbol("x")``, ``Symbol("x", positive=True)`` and
``Function("x")(t)`` all mean the real symbol x. Nothing occurs that is not declared, and nothing is declared that does
not occur.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from math import inf, isnan
from typing import Any, TypeAlias

import sympy as sp
from sympy.core.function import AppliedUndef

from quasilpv.errors import InputError, one_of
from quasilpv.systems.descriptor.formula import parse_equation, split_names
from quasilpv.systems.descriptor.names import IDENTIFIER, Name, rate, symbol
from quasilpv.systems.descriptor.open_parameters import OpenNumber, open_parameters

Formula: TypeAlias = "str | sp.Expr | sp.Eq | float"
SymbolicMatrix: TypeAlias = "sp.Matrix | Sequence[Sequence[Formula]]"
"""A matrix of sympy, or rows of expressions, numbers and formulas as text."""
Bounds: TypeAlias = "tuple[float, float]"

_SIGNS = (  # an assumption of a symbol, and the interval it says
    ("is_positive", 0.0, inf),
    ("is_nonnegative", 0.0, inf),
    ("is_negative", -inf, 0.0),
    ("is_nonpositive", -inf, 0.0),
)


class Vocabulary:
    """What the names in the formulas of one system stand for.

    Args:
        source: the name of the system, for messages.
        state, inputs: in order; a text may hold several names, separated by commas or spaces.
        domain: interval of every name that premises depend on.
        unknown: parameters the controller does not know.
        declared: expressions whose names are parameters, too.
        constants: names that stand for numbers in every formula.

    Raises:
        InputError: a name occurs twice, is no name, or has an interval that is empty, reversed, a point or no pair of
            numbers; an unknown parameter is a state or an input.
    """

    def __init__(
        self,
        source: str,
        state: str | Sequence[Name],
        inputs: str | Sequence[Name],
        domain: Mapping[Any, Any],
        *,
        unknown: str | Collection[Name] = (),
        declared: Iterable[sp.Expr] = (),
        constants: Mapping[str, sp.Expr] | None = None,
    ) -> None:
        """Take the names; see `read` for the formulas."""
        self.source = source
        self.state = tuple(symbol(name) for name in split_names(state))
        self.inputs = tuple(symbol(name) for name in split_names(inputs))
        listed = split_names(unknown) if isinstance(unknown, str) else [*unknown]
        self.unknown = tuple(symbol(name) for name in listed)
        self._constants = {symbol(name): value for name, value in (constants or {}).items()}
        self._declared = {symbol(name) for expression in declared for name in expression.free_symbols}
        self._refuse_repeated()
        self.domain: dict[sp.Symbol, Bounds] = {}
        self._mentioned: set[sp.Symbol] = {*self.state, *self.inputs}
        for name, bounds in domain.items():
            own = symbol(name)
            if own in self.domain:
                raise InputError(source, "domain", f"{own.name} twice", "one interval of every name")
            self.domain[own] = self._interval(own, bounds)
            self._refuse_contradiction(name)

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """The names declared by an interval or as unknown that are neither states nor inputs."""
        declared = dict.fromkeys([*self.domain, *self.unknown, *sorted(self._declared, key=str)])
        return tuple(name for name in declared if name not in (*self.state, *self.inputs))

    def read(self, field: str, formula: Formula, *, rates: bool = False, inputs: bool = False) -> sp.Expr:
        """A formula in the symbols of this vocabulary; of an equation left minus right side.

        Args:
            field: which formula, for messages, e.g. ``"equation 2"``.
            formula: text (see `quasilpv.systems.descriptor.formula`), an expression, an equation or a number. In
                expressions ``x(t).diff(t)`` is the rate of x.
            rates, inputs: whether rates and inputs may occur.

        Raises:
            InputError: text that is no formula, something that is no expression, or a name that is not declared.
        """
        allowed = [*self.state, *self.parameters, *(self.inputs if inputs else ()), *self._constants]
        allowed += [rate(name) for name in self.state] if rates else []
        left_open = open_parameters()
        allowed += left_open.values if left_open else ()
        if isinstance(formula, str):  # what has the factor 0 is written down all the same
            self._mentioned |= {name for name in allowed if name.name in IDENTIFIER.findall(formula)}
            expression = parse_equation(f"{self.source}: {field}", formula, {name.name: name for name in allowed})
        else:
            expression = self._canonical(field, formula)
        expression = self._with_constants(field, expression)
        self._mentioned |= expression.free_symbols
        for stranger in sorted(expression.free_symbols - set(allowed), key=str):
            self._refuse_stranger(field, stranger, allowed)
        return expression

    def _with_constants(self, field: str, expression: sp.Expr) -> sp.Expr:
        """An expression with the numbers that names stand for.

        Raises:
            InputError: it has no value for them: 1/R at R = 0.
        """
        replaced = expression.xreplace(self._constants)
        if replaced.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
            values = ", ".join(f"{name} = {value}" for name, value in self._constants.items() if expression.has(name))
            raise InputError(self.source, field, values or replaced, "values for which the formula is defined")
        return replaced

    def read_matrix(self, field: str, matrix: SymbolicMatrix) -> sp.Matrix:
        """A matrix whose entries are read as formulas of states and parameters. Errors: `read`."""
        if isinstance(matrix, sp.MatrixBase):
            shape, rows = matrix.shape, matrix.tolist()
        else:
            rows = [[*row] for row in matrix]
            shape = (len(rows), len(rows[0]) if rows else 0)
            if any(len(row) != shape[1] for row in rows):
                raise InputError(self.source, field, "rows of different length", "a matrix")
        entries = [self.read(f"{field}[{i},{j}]", entry) for i, row in enumerate(rows) for j, entry in enumerate(row)]
        return sp.Matrix(*shape, entries)

    def _refuse_stranger(self, field: str, stranger: sp.Symbol, allowed: Sequence[sp.Symbol]) -> None:
        """A symbol that is not declared, or not allowed here."""
        if stranger.name.endswith("'"):
            known = [name.name for name in allowed if name.name.endswith("'")]
            expected = f"a rate of a state, {one_of(known, str(stranger), 'the system')}"
            raise InputError(self.source, field, f"the rate {stranger}", expected)
        if stranger in self.inputs:
            raise InputError(self.source, field, f"the input {stranger}", "no input")
        names = [name.name for name in allowed if not name.name.endswith("'")]
        close = one_of(names, stranger.name, "the system")
        expected = f"a name that is declared (a parameter by its interval in the domain), {close}"
        raise InputError(self.source, field, stranger, expected)

    def finish(self) -> None:
        """After all formulas are read: refuse declared names that occurred nowhere.

        Raises:
            InputError: such a name, with the one that was probably meant.
        """
        names = [name.name for name in sorted(self._mentioned, key=str) if not name.name.endswith("'")]
        for field, declared in (("domain", self.domain), ("unknown", self.unknown)):
            for name in declared:
                if name not in self._mentioned:
                    expected = f"a name that occurs, {one_of(names, name.name, 'the system')}"
                    raise InputError(self.source, field, f"{name}, which occurs nowhere", expected)
        for name in self.unknown:
            if name in self.state or name in self.inputs:
                raise InputError(self.source, "unknown", name, "a parameter, not a state or an input")
            if name not in self.domain:
                raise InputError("domain", name.name, "nothing", "an interval, because it is an unknown parameter")

    def _canonical(self, field: str, formula: Any) -> sp.Expr:
        """An expression in real symbols, rates for derivatives; left minus right side of an equation."""
        if isinstance(formula, sp.Eq):
            formula = formula.lhs - formula.rhs
        number = isinstance(formula, int | float | OpenNumber)
        expression = sp.sympify(formula, strict=True) if number else formula
        if not isinstance(expression, sp.Expr):  # sympy evaluates an equation without unknowns to true or false
            raise InputError(self.source, field, expression, "an expression or an equation with unknowns")
        for derivative in expression.atoms(sp.Derivative):
            if derivative.derivative_count != 1 or not isinstance(derivative.expr, AppliedUndef):
                expected = "rates of states, rate(x): a second derivative needs a state for the first"
                raise InputError(self.source, field, derivative, expected)
        if expression.has(sp.Derivative):
            derivatives = expression.atoms(sp.Derivative)
            expression = expression.xreplace({each: rate(each.expr) for each in derivatives})
        functions = {each: symbol(each) for each in expression.atoms(AppliedUndef)}
        expression = expression.xreplace(functions)
        for each in expression.free_symbols:
            self._refuse_contradiction(each)
        return expression.xreplace({each: symbol(each) for each in expression.free_symbols})

    # ---- refusals --------------------------------------------------------------------------------------------------

    def _refuse_repeated(self) -> None:
        names = [name.name for name in (*self.state, *self.inputs)]
        for name in names:
            if names.count(name) > 1:
                raise InputError(self.source, "state and inputs", f"{name} twice", "different names")
        if not self.state:
            raise InputError(self.source, "state", "no name", "at least one")

    def _interval(self, name: sp.Symbol, bounds: Any) -> Bounds:
        """Two numbers in order, as doubles."""
        field, expected = f"domain of {name}", "two numbers, lower < upper"
        try:
            low, high = (float(bound) for bound in bounds)
        except (TypeError, ValueError):
            raise InputError(self.source, field, bounds, expected) from None
        if isnan(low) or isnan(high) or low == inf or high == -inf:
            raise InputError(self.source, field, bounds, expected)
        if low == high:
            raise InputError(self.source, field, (low, high), f"{expected}: put a constant into the equations")
        if low > high:
            raise InputError(self.source, field, (low, high), f"{expected}: the bounds are reversed")
        return low, high

    def _refuse_contradiction(self, given: Any) -> None:
        """A symbol said to be positive over a domain that is not: sympy has already simplified with it."""
        if not isinstance(given, sp.Symbol) or isinstance(given, sp.Dummy):
            return
        low, high = self.domain.get(symbol(given), (-inf, inf))
        for assumption, least, most in _SIGNS:
            if getattr(given, assumption) and not (least <= low and high <= most):
                expected = f"an interval in [{least:g}, {most:g}], because the symbol says {assumption[3:]}"
                raise InputError(self.source, f"domain of {given}", (low, high), expected)


def exact(expression: sp.Expr) -> sp.Expr:
    """The expression with its floats as the rationals they are, which products do not round."""
    return expression.xreplace({number: sp.Rational(number) for number in expression.atoms(sp.Float)})
