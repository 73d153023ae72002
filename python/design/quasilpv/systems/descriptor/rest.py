"""Where a system rests near a point that was meant for its equilibrium and is not quite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

STEPS = 30
"""Of Newton's method; from near a rest it takes five."""

NEAR = 0.2
"""A rest farther away, relative to the size of each value or to 1, is not the one that was meant."""


def nearest_rest(
    equations: Sequence[sp.Expr], symbols: Sequence[sp.Symbol], given: Sequence[float]
) -> tuple[float, ...] | None:
    """The values nearest to given ones at which all equations hold, by Gauss and Newton; None if there are none near.

    Args:
        equations: F of ``F = 0``, with rates at 0 and parameters at numbers.
        symbols: states and inputs.
        given: their values.
    """
    residual = sp.lambdify([symbols], list(equations), "numpy")
    slopes = sp.lambdify([symbols], sp.Matrix(equations).jacobian(list(symbols)), "numpy")
    start = np.array(given, dtype=float)
    size = np.maximum(np.abs(start), 1.0)
    point = start
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            values = np.array(residual(point), dtype=float)
            jacobian = np.array(slopes(point), dtype=float) * size
            if not (np.isfinite(values).all() and np.isfinite(jacobian).all()):
                return None
            step = -np.linalg.lstsq(jacobian, values, rcond=1e-12)[0] * size
            point = point + step
            if np.abs(step / size).max() < 1e-14:
                break
        left = np.array(residual(point), dtype=float)
        terms = np.abs(np.array(slopes(point), dtype=float)) @ size
    near = bool((np.abs(point - start) <= NEAR * size).all())
    return tuple(point.tolist()) if near and bool((np.abs(left) <= 1e-12 * np.maximum(terms, 1e-300)).all()) else None
