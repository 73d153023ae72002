"""Chords ``(f(a + w) - f(a))/w`` of programs, on numbers, arrays and balls: where w is 0, a slope of f.

Of balls, by the mean value theorem, a slope of f between a and a + w; and the quotient too where w has a sign.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from flint import arb

from quasilpv.certificate.exact.tangents import power

Scalar = Any

NEARLY_ZERO = 1e-5
"""Below it the slope in the middle is nearer to the chord of numbers than the rounded quotient."""


def _chord(
    of_numbers: Callable[[Scalar], Scalar],
    slope_of_numbers: Callable[[Scalar], Scalar],
    of_ball: Callable[[arb], arb],
    slopes_of_ball: Callable[[arb], arb],
) -> Callable[[Scalar, Scalar], Scalar]:
    def apply(a: Scalar, w: Scalar) -> Scalar:
        if not isinstance(w, arb):
            small = np.abs(w) < NEARLY_ZERO
            quotient = (of_numbers(a + w) - of_numbers(a)) / np.where(small, 1.0, w)
            return np.where(small, slope_of_numbers(a + w / 2.0), quotient)
        slopes = slopes_of_ball(arb(a).union(a + w))
        if w.contains(0):
            return slopes
        quotient = (of_ball(a + w) - of_ball(arb(a))) / w
        return quotient if not slopes.is_finite() else slopes.intersection(quotient) if quotient.is_finite() else slopes

    return apply


def _signs(x: arb) -> arb:
    """The slopes of the absolute value: both, and what is between them, where a ball holds 0."""
    return arb(0, 1) if x.contains(0) else arb(1 if x > 0 else -1)


CHORDS: Mapping[str, Callable[[Scalar, Scalar], Scalar]] = {
    "log_chord": _chord(np.log, lambda x: 1.0 / x, lambda x: x.log(), lambda x: 1 / x),
    "abs_chord": _chord(np.abs, np.sign, abs, _signs),
    "atan_chord": _chord(np.arctan, lambda x: 1.0 / (1.0 + x * x), lambda x: x.atan(), lambda x: 1 / (1 + power(x, 2))),
    "asin_chord": _chord(
        np.arcsin, lambda x: 1.0 / np.sqrt(1.0 - x * x), lambda x: x.asin(), lambda x: 1 / (1 - power(x, 2)).sqrt()
    ),
}
"""Of two values, a and w."""
