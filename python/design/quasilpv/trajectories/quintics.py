"""Piecewise quintics: through given motions at the knots, or through points alone with the least jerk."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from quasilpv.arrays import FloatArray

Motion: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Angles, speeds and accelerations at the knots, (knots, n) each."""


def quintic_hermite(knots_s: FloatArray, motion: Motion) -> FloatArray:
    """Return the coefficients (K, n, 6) of the quintics that take the motion of both ends of a segment.

    Differences of nearly equal values are divided by powers of the spacing, which in floating point would spoil the
    continuity of r''; the arithmetic is therefore exact, with one rounding at the end.
    """
    spacing = [Fraction(after) - Fraction(before) for before, after in pairwise(knots_s)]
    states = [[tuple(map(Fraction, state)) for state in zip(*knot, strict=True)] for knot in zip(*motion, strict=True)]
    return np.array(
        [
            [_hermite(h, before, after) for before, after in zip(starts, ends, strict=True)]
            for h, starts, ends in zip(spacing, states[:-1], states[1:], strict=True)
        ]
    )


def _hermite(h: Fraction, start: tuple[Fraction, ...], end: tuple[Fraction, ...]) -> list[float]:
    r0, v0, a0 = start
    r1, v1, a1 = end
    # What the motion from the start with constant acceleration leaves to be made up at the end.
    r = (r1 - r0 - h * v0 - h * h * a0 / 2) / h**3
    v = (v1 - v0 - h * a0) / h**2
    a = (a1 - a0) / h
    cubic = 10 * r - 4 * v + a / 2
    quartic = (-15 * r + 7 * v - a) / h
    quintic = (6 * r - 3 * v + a / 2) / h**2
    return [float(c) for c in (r0, v0, a0 / 2, cubic, quartic, quintic)]


def least_jerk(times_s: FloatArray, points: FloatArray) -> Motion:
    """The motion through points with the least integral of the squared jerk, at rest at both ends.

    It is the piecewise quintic whose third and fourth derivatives are continuous too (de Boor 1963): two linear
    equations for speed and acceleration at every inner point.

    Args:
        times_s: (K,), strictly increasing, K >= 2.
        points: (K, n).
    """
    inner, joints = len(times_s) - 2, points.shape[1]
    speed, acceleration = np.zeros((2, inner + 2, joints))
    if inner:
        matrix, right = np.zeros((2 * inner, 2 * inner + 4)), np.zeros((2 * inner, joints))
        for k, (h, g) in enumerate(pairwise(np.diff(times_s))):
            first, second = points[k + 1] - points[k], points[k + 2] - points[k + 1]
            # Third and fourth derivative from the left minus from the right, in (v, a) of the three points.
            place = slice(2 * k, 2 * k + 6)
            matrix[2 * k, place] = -24 / h**2, -3 / h, 36 / g**2 - 36 / h**2, 9 / h + 9 / g, 24 / g**2, -3 / g
            matrix[2 * k + 1, place] = (
                *(-168 / h**3, -24 / h**2),
                *(-192 / h**3 - 192 / g**3, 36 / h**2 - 36 / g**2),
                *(-168 / g**3, 24 / g**2),
            )
            right[2 * k] = 60 * (second / g**3 - first / h**3)
            right[2 * k + 1] = -360 * (second / g**4 + first / h**4)
        solved = np.linalg.solve(matrix[:, 2:-2], right)
        speed[1:-1], acceleration[1:-1] = solved[0::2], solved[1::2]
    return points, speed, acceleration
