"""Quotients f(w)/w of functions that vanish at 0, with their limits there: what is left when a state is factored out.

sympy has sinc(w) = sin(w)/w; diodes and chemical reactions need (e^w - 1)/w, smooth friction and saturation tanh(w)/w.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray


class _Quotient(sp.Function):  # type: ignore[misc]  # sympy carries no annotations
    """A function f(w)/w with f(0) = 0 and f'(0) = 1; `_imp_` is what `sympy.lambdify` and `evalf` call."""

    nargs = 1

    @classmethod
    def eval(cls, w: sp.Expr) -> sp.Expr | None:
        """The limit at 0; other arguments stay symbolic."""
        return sp.S.One if w.is_zero else None


class expm1_quotient(_Quotient):  # noqa: N801 -- spelt like sympy's sinc
    """``(e^w - 1)/w``, 1 at w = 0; positive and increasing."""

    @staticmethod
    def _imp_(w: ArrayLike) -> NDArray[np.float64]:
        return _quotient(np.expm1, w)


class tanh_quotient(_Quotient):  # noqa: N801
    """``tanh(w)/w``, 1 at w = 0; even, positive, decreasing in |w|."""

    @staticmethod
    def _imp_(w: ArrayLike) -> NDArray[np.float64]:
        return _quotient(np.tanh, w)


def _quotient(function: Any, w: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(w, dtype=float)
    divisor = np.where(values == 0, 1.0, values)
    return np.where(values == 0, 1.0, function(divisor) / divisor)
