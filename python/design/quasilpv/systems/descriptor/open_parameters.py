"""Parameters left open: what makes a system is run once with symbols in place of numbers, and its matrices are kept.

A number left open takes part in arithmetic and in the text of formulas and in nothing else. Code that compares one,
needs it as a number or branches on it fails, so that nothing is concluded from one branch about another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, NoReturn

import sympy as sp

from quasilpv.systems.descriptor.affine_system import AffineSystem
from quasilpv.systems.descriptor.premise import Premise


class OpenNumber:
    """A number that is not known: an exact expression of open symbols.

    Raises:
        TypeError: it is compared, tested, hashed, formatted to digits, or needed as a number.
    """

    __array_ufunc__ = None  # arrays leave arithmetic to it

    def __init__(self, expression: sp.Expr) -> None:
        """Of an expression."""
        self._expression = expression

    def _sympy_(self) -> sp.Expr:
        return self._expression

    def __str__(self) -> str:
        """As it is written in a formula."""
        return f"({self._expression})"

    __repr__ = __str__

    def __format__(self, specification: str) -> str:
        """As it is written in a formula; digits were not asked for."""
        return self._needed() if specification else str(self)

    def _with(self, other: Any, operation: Callable[[sp.Expr, sp.Expr], sp.Expr]) -> Any:
        if not isinstance(other, OpenNumber | sp.Expr | int | float):
            return NotImplemented
        result = operation(self._expression, sp.sympify(other, strict=True))
        return result if isinstance(other, sp.Expr) else OpenNumber(result)

    def __add__(self, other: Any) -> Any:
        """Sum."""
        return self._with(other, lambda a, b: a + b)

    def __sub__(self, other: Any) -> Any:
        """Difference."""
        return self._with(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Any:
        """Difference."""
        return self._with(other, lambda a, b: b - a)

    def __mul__(self, other: Any) -> Any:
        """Product."""
        return self._with(other, lambda a, b: a * b)

    def __truediv__(self, other: Any) -> Any:
        """Quotient."""
        return self._with(other, lambda a, b: a / b)

    def __rtruediv__(self, other: Any) -> Any:
        """Quotient."""
        return self._with(other, lambda a, b: b / a)

    def __pow__(self, other: Any) -> Any:
        """Power."""
        return self._with(other, lambda a, b: a**b)

    def __neg__(self) -> OpenNumber:
        """Negative."""
        return OpenNumber(-self._expression)

    def __pos__(self) -> OpenNumber:
        """Itself."""
        return self

    __radd__, __rmul__ = __add__, __mul__

    def _needed(self, *_: Any) -> NoReturn:
        raise TypeError("a number is needed here, and this parameter is open")

    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _needed
    __bool__ = __float__ = __int__ = __index__ = __hash__ = __abs__ = __round__ = _needed


@dataclass(frozen=True)
class Made:
    """A system made while parameters were open.

    Attributes:
        system: at the values that stand for the open ones.
        matrices: E, A, B, C as expressions of states, parameters and open symbols.
        premises: if they were given.
        unknown: the parameters the controller does not know.
    """

    system: AffineSystem
    matrices: Sequence[sp.Matrix]
    premises: Sequence[Premise] | None
    unknown: Sequence[sp.Symbol]


@dataclass(frozen=True)
class OpenParameters:
    """Which parameters are open, and what was made meanwhile.

    Attributes:
        symbols: by name.
        values: that stand for them where a system of numbers is needed, by symbol.
        made: the systems, in order.
    """

    symbols: Mapping[str, sp.Symbol]
    values: Mapping[sp.Symbol, sp.Rational]
    made: list[Made] = field(default_factory=list)

    def numbers(self) -> dict[str, OpenNumber]:
        """What to call a function of parameters with."""
        return {name: OpenNumber(own) for name, own in self.symbols.items()}

    def closed(self, matrices: Sequence[sp.Matrix]) -> list[sp.Matrix]:
        """Matrices with the values for the open symbols."""
        return [matrix.xreplace(self.values) for matrix in matrices]


_open: ContextVar[OpenParameters | None] = ContextVar("open_parameters", default=None)


def open_parameters() -> OpenParameters | None:
    """The parameters that are open now, None if none is."""
    return _open.get()


@contextmanager
def opened(values: Mapping[str, sp.Rational] | None) -> Iterator[OpenParameters]:
    """Leave parameters open.

    Args:
        values: by name, what stands for them where a system of numbers is needed; None to close all.
    """
    symbols = {name: sp.Symbol(f"open_{name}_", real=True) for name in values or {}}
    record = OpenParameters(symbols, {symbols[name]: value for name, value in (values or {}).items()})
    token = _open.set(None if values is None else record)
    try:
        yield record
    finally:
        _open.reset(token)
