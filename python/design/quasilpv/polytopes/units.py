"""Other units for a descriptor system: powers of two for states, inputs, outputs, equations and time.

With ``x = T x^``, ``u = S u^``, ``y = Y y^``, ``t = c t^`` and the equations multiplied by D,

    E^ = D E T / c,    A^ = D A T,    B^ = D B S,    C^ = Y^-1 C T,

T, S, Y, D diagonal. All factors are powers of two: the numbers of the new system are exact, unless they leave the range
of doubles (`Units.are_exact_for`), and so is the way back. The premises keep their values, and their bounds. What a
condition proves of the new system is true of the old one with ``P = T P^ T``, ``K = S K^ T^-1``, ``alpha = alpha^ / c``
and times multiplied by c: the two are one system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.systems.descriptor.premise import AffineMatrix, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

LARGEST_EXPONENT = 200
"""Of a power of two; three of them are multiplied."""

SMALLEST = 2.0**-400
"""Numbers between it and its inverse stay normal doubles, products with three powers of two included."""


@dataclass(frozen=True)
class Units:
    """Exponents of the powers of two of the module.

    Attributes:
        state, inputs, outputs, rows: of T, S, Y and D.
        time: of c.
        differential: number q of differential states, the first ones.
    """

    state: tuple[int, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    rows: tuple[int, ...]
    time: int
    differential: int

    @property
    def T(self) -> FloatArray:
        """Diagonal of T, (n,)."""
        return _powers(self.state)

    @property
    def T_differential(self) -> FloatArray:
        """Diagonal of T for the differential states, (q,)."""
        return self.T[: self.differential]

    @property
    def T_extended(self) -> FloatArray:
        """The same for ``(x_d, x_d', x_a)``, (n + q,)."""
        q = self.differential
        return np.concatenate([self.T[:q], self.T[:q] / self.c, self.T[q:]])

    @property
    def S(self) -> FloatArray:
        """Diagonal of S, (m,)."""
        return _powers(self.inputs)

    @property
    def Y(self) -> FloatArray:
        """Diagonal of Y, (outputs,)."""
        return _powers(self.outputs)

    @property
    def D(self) -> FloatArray:
        """Diagonal of D, (n,)."""
        return _powers(self.rows)

    @property
    def c(self) -> float:
        """Old units of time in a new one."""
        return float(2.0**self.time)

    def are_exact_for(self, system: DescriptorSystem) -> bool:
        """Whether no number of the system leaves the range of normal doubles in these units, nor on the way back."""
        exponents = (*self.state, *self.inputs, *self.outputs, *self.rows, self.time)
        if max(map(abs, exponents), default=0) > LARGEST_EXPONENT:
            return False
        numbers = np.concatenate(
            [part.ravel() for matrix in (system.E, system.A, system.B, system.C) for part in _parts(matrix)]
        )
        sizes = np.abs(numbers[numbers != 0.0])
        return bool(np.all((sizes > SMALLEST) & (sizes < 1.0 / SMALLEST)))

    def of(self, system: DescriptorSystem) -> DescriptorSystem:
        """The system in these units.

        Expressions of estimated premises are rewritten in the new states, with the domain: conditions differentiate
        them. Those of the others are read by nobody who designs, and stay.
        """
        D, T = self.D[:, None], self.T

        def in_units(matrix: AffineMatrix, left: FloatArray, right: FloatArray) -> AffineMatrix:
            return AffineMatrix(left * matrix.constant * right, left * matrix.coefficients * right)

        changed: dict[str, Any] = {
            "E": in_units(system.E, D / self.c, T),
            "A": in_units(system.A, D, T),
            "B": in_units(system.B, D, self.S),
            "C": in_units(system.C, 1.0 / self.Y[:, None], T),
        }
        if any(premise.kind is PremiseKind.ESTIMATED for premise in system.premises):
            factors = dict(zip(system.state, T.tolist(), strict=True))
            old = {symbol: symbol * sp.Rational(factor) for symbol, factor in factors.items()}
            changed["premises"] = tuple(
                replace(premise, expression=premise.expression.xreplace(old)) for premise in system.premises
            )
            changed["domain"] = {
                symbol: (low / factors.get(symbol, 1.0), high / factors.get(symbol, 1.0))
                for symbol, (low, high) in system.domain.items()
            }
        return replace(system, **changed, equations=())


def _parts(matrix: AffineMatrix) -> tuple[FloatArray, FloatArray]:
    return matrix.constant, matrix.coefficients


def _powers(exponents: Sequence[int]) -> FloatArray:
    return np.asarray(np.ldexp(1.0, np.asarray(exponents, dtype=int)))
