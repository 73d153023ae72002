"""Parameters left open: what makes a system is run once with symbols in place of numbers, and its matrices are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

import sympy as sp

from quasilpv.systems.descriptor.affine_system import AffineSystem
from quasilpv.systems.descriptor.open_number import OpenNumber
from quasilpv.systems.descriptor.premise import Premise


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
