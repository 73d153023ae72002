"""Chords ``(g(a + w) - g(a))/w`` of functions: what is left of a function when a state is factored out around a point.

``sin w = sinc(w) w`` has its quotient in sympy; for other functions, and around a point other than 0, the quotient is a
function of two arguments here: ``log(2 + x) - log 2 = log_chord(2, x) x``. At w = 0 it is the slope g'(a); of a
function with a corner there it is the mean of both slopes, which is one of the values that satisfy the identity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray

_SMALL = 1e-5  # below it the slope in the middle of a chord is nearer to its mean than the rounded quotient


class Ramp(sp.Function):  # type: ignore[misc]  # sympy carries no annotations
    """``max(w, 0)``, of which all maxima and minima are made: ``max(v, b) = b + ramp(v - b)``."""

    nargs = 1

    @classmethod
    def eval(cls, w: sp.Expr) -> sp.Expr | None:
        """Of numbers, and of what is known to have a sign."""
        if w.is_nonnegative:
            return w
        return sp.S.Zero if w.is_nonpositive else None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """The slope; at the corner the mean of both."""
        return (1 + sp.sign(self.args[0])) / 2

    @staticmethod
    def _imp_(w: ArrayLike) -> FloatArray:
        return np.asarray(np.maximum(np.asarray(w, dtype=float), 0.0))


def as_ramps(expression: sp.Expr) -> sp.Expr:
    """Maxima and minima as ramps: ``max(v, b) = b + ramp(v - b)``, ``min(v, b) = b - ramp(b - v)``, b the numbers."""

    def written(extremum: sp.Expr) -> sp.Expr:
        numbers_last = sorted(extremum.args, key=lambda part: not part.free_symbols)
        first, other = numbers_last[0], written_all(extremum.func(*numbers_last[1:]))
        return other + Ramp(first - other) if isinstance(extremum, sp.Max) else other - Ramp(other - first)

    def written_all(e: sp.Expr) -> sp.Expr:
        return e.replace(lambda node: isinstance(node, sp.Max | sp.Min), written)

    return written_all(expression)


def without_products_of_signs(expression: sp.Expr) -> sp.Expr:
    """``w sign(w)`` as ``|w|``, which does not jump."""

    def written(product: sp.Expr) -> sp.Expr:
        factors = list(product.args)
        for sign in [factor for factor in factors if isinstance(factor, sp.sign) and factor.args[0] in factors]:
            factors.remove(sign)
            factors[factors.index(sign.args[0])] = sp.Abs(sign.args[0])
        return sp.Mul(*factors)

    return expression.replace(lambda node: node.is_Mul and node.has(sp.sign), written)


class sinc_slope(sp.Function):  # type: ignore[misc]  # noqa: N801 -- spelt like the function
    """``sinc'(w) = (cos w - sinc w)/w``, 0 at 0."""

    nargs = 1

    @staticmethod
    def _imp_(w: ArrayLike) -> FloatArray:
        return _sinc_slope(np.asarray(w, dtype=float))


class SmoothSinc(sp.Function):  # type: ignore[misc]
    """sin(w)/w with the slope that sympy writes as a difference of two quotients by 0."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """The slope."""
        return sinc_slope(self.args[0])


class Chord(sp.Function):  # type: ignore[misc]
    """``(g(a + w) - g(a))/w``; subclasses name g. `_imp_` is what `sympy.lambdify` and `evalf` call."""

    nargs = 2
    smoothness = ""
    """Name of g among the functions whose derivatives are enclosed, `interval_elementary.SMOOTHNESS`."""


class log_chord(Chord):  # noqa: N801 -- spelt like the function
    """Of the natural logarithm."""

    smoothness = "log"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return _quotient(np.log1p(w / a), w, 1 / a)


class tan_chord(Chord):  # noqa: N801
    """Of tan: ``tan b - tan a = sin(b - a)/(cos a cos b)``."""

    smoothness = "tan"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return np.asarray(np.sinc(w / np.pi) / (np.cos(a) * np.cos(a + w)))


class atan_chord(Chord):  # noqa: N801
    """Of atan."""

    smoothness = "atan"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return _stable(np.arctan, lambda x: 1 / (1 + x**2), a, w)


class asin_chord(Chord):  # noqa: N801
    """Of asin."""

    smoothness = "asin"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return _stable(np.arcsin, lambda x: 1 / np.sqrt(1 - x**2), a, w)


class sinh_chord(Chord):  # noqa: N801
    """Of sinh: ``sinh b - sinh a = 2 sinh((b - a)/2) cosh((a + b)/2)``."""

    smoothness = "sinh"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return np.asarray(_quotient(2 * np.sinh(w / 2), w, 1.0) * np.cosh(a + w / 2))


class cosh_chord(Chord):  # noqa: N801
    """Of cosh: ``cosh b - cosh a = 2 sinh((b - a)/2) sinh((a + b)/2)``."""

    smoothness = "cosh"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return np.asarray(_quotient(2 * np.sinh(w / 2), w, 1.0) * np.sinh(a + w / 2))


class tanh_chord(Chord):  # noqa: N801
    """Of tanh: ``tanh b - tanh a = tanh(b - a) (1 - tanh a tanh b)``."""

    smoothness = "tanh"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return np.asarray(_quotient(np.tanh(w), w, 1.0) * (1 - np.tanh(a) * np.tanh(a + w)))


class sinc_chord(Chord):  # noqa: N801
    """Of sinc(w) = sin(w)/w."""

    smoothness = "sinc"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return _stable(lambda x: np.sinc(x / np.pi), _sinc_slope, a, w)


class abs_chord(Chord):  # noqa: N801
    """Of the absolute value: in [-1, 1]; around 0 it is the sign of w."""

    smoothness = "abs"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        return np.asarray(2 * ramp_chord._imp_(a, w) - 1)


class ramp_chord(Chord):  # noqa: N801
    """Of max(w, 0): in [0, 1]."""

    smoothness = "ramp"

    @staticmethod
    def _imp_(a: ArrayLike, w: ArrayLike) -> FloatArray:
        a, w = _arrays(a, w)
        b = a + w
        across = _quotient(np.maximum(a, b), np.abs(w), 0.5)
        return np.select([(a == 0) & (w == 0), np.minimum(a, b) >= 0, np.maximum(a, b) <= 0], [0.5, 1.0, 0.0], across)


CHORDS: dict[Any, type[Chord]] = {
    sp.log: log_chord,
    sp.tan: tan_chord,
    sp.atan: atan_chord,
    sp.asin: asin_chord,
    sp.sinh: sinh_chord,
    sp.cosh: cosh_chord,
    sp.tanh: tanh_chord,
    sp.sinc: sinc_chord,
    sp.Abs: abs_chord,
    Ramp: ramp_chord,
}
"""The chord of every function that is factored by one."""


def _arrays(a: ArrayLike, w: ArrayLike) -> tuple[FloatArray, FloatArray]:
    one, other = np.broadcast_arrays(np.asarray(a, dtype=float), np.asarray(w, dtype=float))
    return one, other


def _quotient(difference: ArrayLike, w: FloatArray, at_zero: ArrayLike) -> FloatArray:
    """The quotient, or its limit."""
    return np.asarray(np.where(w == 0, at_zero, difference / np.where(w == 0, 1.0, w)))


def _stable(function: Any, slope: Any, a: FloatArray, w: FloatArray) -> FloatArray:
    """The quotient of rounded values, or the slope in the middle."""
    small = np.abs(w) < _SMALL
    return np.asarray(np.where(small, slope(a + w / 2), (function(a + w) - function(a)) / np.where(small, 1.0, w)))


def _sinc_slope(x: FloatArray) -> FloatArray:
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, x)
    return np.asarray(np.where(small, -x / 3 + x**3 / 30 - x**5 / 840, (np.cos(x) - np.sinc(x / np.pi)) / safe))
