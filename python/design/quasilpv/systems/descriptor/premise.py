"""Premises, matrices affine in them, and which premises a controller that has the outputs can compute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import isfinite

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError
from quasilpv.systems.intervals.enclosure import enclose

BOX_MARGIN = 1e-3
"""By how much of its width the box of a widened premise exceeds its bounds on both sides."""


class PremiseKind(StrEnum):
    """What the controller knows of a premise at run time."""

    MEASURED = "measured"
    ESTIMATED = "estimated"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Premise:
    """A scalar function of the state on which a quasi-LPV model depends, with guaranteed bounds.

    Attributes:
        name: identifier, e.g. ``"z1"``.
        expression: sympy expression of the state symbols (or a symbol of its own for an uncertain parameter).
        bounds: (lower, upper), valid over the whole operating domain.
        kind: measured, estimated or unknown to the controller.

    Raises:
        InputError: the bounds are not finite or not in order.
    """

    name: str
    expression: sp.Expr
    bounds: tuple[float, float]
    kind: PremiseKind = PremiseKind.MEASURED

    def __post_init__(self) -> None:
        """Refuse bounds that are no interval."""
        low, high = self.bounds
        if not (isfinite(low) and isfinite(high) and low <= high):
            raise InputError(f"premise {self.name}", "bounds", self.bounds, "finite lower <= upper")

    @classmethod
    def over(
        cls,
        domain: Mapping[sp.Symbol, tuple[float, float]],
        name: str,
        expression: sp.Expr,
        kind: PremiseKind = PremiseKind.MEASURED,
    ) -> Premise:
        """A premise whose bounds are proved by interval arithmetic over a box of its symbols."""
        return cls(name, expression, enclose(expression, domain), kind)

    @property
    def lower(self) -> float:
        """Guaranteed lower bound."""
        return self.bounds[0]

    @property
    def upper(self) -> float:
        """Guaranteed upper bound."""
        return self.bounds[1]

    def widened(self) -> Premise:
        """The premise with `BOX_MARGIN` to spare, so that enclosures over pieces of the domain can prove its bounds."""
        margin = BOX_MARGIN * (self.upper - self.lower)
        return replace(self, bounds=(self.lower - margin, self.upper + margin))


@dataclass(frozen=True, eq=False)
class AffineMatrix:
    """A matrix affine in p premises, ``X(z) = X_0 + sum_k z_k X_k``.

    Attributes:
        constant: X_0, shape (rows, columns).
        coefficients: the X_k stacked, shape (p, rows, columns).

    Raises:
        InputError: the shapes do not agree or an entry is not finite.
    """

    constant: NDArray[np.float64]
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Store read-only copies of consistent shape."""
        constant = np.array(self.constant, dtype=float)
        coefficients = np.array(self.coefficients, dtype=float)
        if constant.ndim != 2:
            raise InputError("affine matrix", "constant", f"shape {constant.shape}", "a matrix")
        if coefficients.ndim != 3 or coefficients.shape[1:] != constant.shape:
            expected = f"shape (p, {constant.shape[0]}, {constant.shape[1]})"
            raise InputError("affine matrix", "coefficients", f"shape {coefficients.shape}", expected)
        if not (np.isfinite(constant).all() and np.isfinite(coefficients).all()):
            raise InputError("affine matrix", "entries", "a non-finite entry", "finite numbers")
        constant.setflags(write=False)
        coefficients.setflags(write=False)
        object.__setattr__(self, "constant", constant)
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of X(z)."""
        rows, columns = self.constant.shape
        return rows, columns

    @property
    def premises(self) -> int:
        """Number of premises p."""
        return len(self.coefficients)

    def evaluate(self, z: ArrayLike) -> NDArray[np.float64]:
        """X(z) for a premise vector z of shape (p,).

        Raises:
            InputError: z has another shape.
        """
        values = np.asarray(z, dtype=float)
        if values.shape != (self.premises,):
            raise InputError("affine matrix", "z", f"shape {values.shape}", f"shape ({self.premises},)")
        result: NDArray[np.float64] = self.constant + np.tensordot(values, self.coefficients, axes=1)
        return result


def with_kinds(premises: Sequence[Premise], state: Sequence[sp.Symbol], C: AffineMatrix) -> tuple[Premise, ...]:
    """The premises, those called measured that depend on more than the outputs show as estimated ones.

    Rows of C that are constant show combinations of the state. A premise is a function of them if no direction that
    they do not see changes it: ``z(x + t v) = z(x)`` for every v with ``C v = 0``. Rows of C that depend on premises
    are not counted on, because what they show has to be computed first.

    Args:
        premises: with the kinds given so far.
        state: the symbols of x.
        C: of the outputs, (o, n).
    """
    constant = ~C.coefficients.any(axis=(0, 2)) if C.premises else slice(None)
    rows = [[sp.Rational(float(entry)) for entry in row] for row in C.constant[constant]]
    unseen = sp.Matrix(len(rows), len(state), [entry for row in rows for entry in row]).nullspace()
    return tuple(
        replace(premise, kind=PremiseKind.ESTIMATED)
        if premise.kind is PremiseKind.MEASURED and any(_changes(premise.expression, state, v) for v in unseen)
        else premise
        for premise in premises
    )


def _changes(expression: sp.Expr, state: Sequence[sp.Symbol], direction: sp.Matrix) -> bool:
    """Whether an expression is not seen to stay the same along a direction."""
    along = sp.Dummy("t", real=True)
    moved = {s: s + along * step for s, step in zip(state, direction, strict=True) if step != 0}
    if not expression.free_symbols & set(moved):
        return False
    return bool(sp.expand(expression.xreplace(moved)).has(along))
