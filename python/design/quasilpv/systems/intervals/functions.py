"""Ranges of functions that mpmath's intervals do not have: tanh, and the quotients sin(x)/x, (e^x - 1)/x, tanh(x)/x.

Each function comes with its slope. All are exact up to the rounding of the interval's ends, except the slopes of sinc
and tanh(x)/x near 0, which are enclosed.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi
from typing import Any

from mpmath import findroot, libmp, mp, workprec
from mpmath.ctx_iv import MPIntervalContext

PRECISION_BITS = 80
iv = MPIntervalContext()
iv.prec = PRECISION_BITS

Interval = Any  # mpmath's interval type carries no annotations


def sinc(x: Interval) -> Interval:
    """Range of sin(x)/x: end points of |x| and the stationary points in between (tan x = x)."""
    magnitude = abs(x)
    candidates = [_sinc_at(magnitude.a), _sinc_at(magnitude.b)]
    # Stationary point k >= 1 lies in (k pi, k pi + pi/2) with |sinc| = 1/sqrt(1 + x^2), which decreases with k and
    # alternates in sign: only the first two inside the interval can be extreme.
    first = max(1, int(libmp.to_float(magnitude._mpi_[0]) / pi) - 1)
    inside = []
    for k in range(first, first + 4):
        stationary = _sinc_stationary_point(k)
        if stationary.b >= magnitude.a and stationary.a <= magnitude.b:
            inside.append(_sinc_at(stationary))
    candidates += inside
    return iv.mpf([min(c.a for c in candidates), max(c.b for c in candidates)])


def _sinc_at(x: Interval) -> Interval:
    """sin(x)/x on an interval as thin as a point, x >= 0."""
    if x.b == 0:
        return iv.mpf(1)
    if x.b < 1e-4:  # alternating series with decreasing terms
        return iv.mpf([1 - (x * x / 6).b, (1 - x * x / 6 + x**4 / 120).b])
    return iv.sin(x) / x


@lru_cache(maxsize=64)
def _sinc_stationary_point(k: int) -> Interval:
    """Interval proved to hold the root of x cos x = sin x in (k pi, k pi + pi/2).

    The derivative of x cos x - sin x is -x sin x, of one sign between multiples of pi: a sign change proves the root.
    """
    with workprec(PRECISION_BITS + 40):
        guess = (k + mp.mpf(1) / 2) * mp.pi
        root = findroot(lambda x: x * mp.cos(x) - mp.sin(x), guess - 1 / guess)
        width = mp.mpf(2) ** (20 - PRECISION_BITS)
        low, high = iv.mpf(root - width), iv.mpf(root + width)
    ends = [x * iv.cos(x) - iv.sin(x) for x in (low, high)]
    if not (ends[0].b < 0 < ends[1].a or ends[1].b < 0 < ends[0].a):
        raise ArithmeticError(f"stationary point {k} of sinc is not bracketed")
    return iv.mpf([low.a, high.b])


def sinc_slope(x: Interval) -> Interval:
    """Range of the derivative of sinc, (cos x - sinc x)/x, an odd function bounded by 0.4365 in magnitude."""
    bound = iv.mpf([-0.4365, 0.4365])
    magnitude = abs(x)
    if magnitude.b <= 1:  # -x/3 + x^3/30 - x^5/840 + ... alternates with decreasing terms
        cubic = x**3
        slope = -x / 3 + iv.mpf([min(0, (cubic / 30).a), max(0, (cubic / 30).b)])
    elif magnitude.a > 0:
        slope = (iv.cos(x) - sinc(x)) / x
    else:
        return bound
    return iv.mpf([max(slope.a, bound.a), min(slope.b, bound.b)])


def tanh(x: Interval) -> Interval:
    """Range of tanh, ``1 - 2/(e^(2x) + 1)``."""
    return 1 - 2 / (iv.exp(2 * x) + 1)


def tanh_slope(x: Interval) -> Interval:
    """Range of its derivative ``1 - tanh^2``."""
    return 1 - tanh(x) ** 2


def tanh_ratio(x: Interval) -> Interval:
    """Range of tanh(x)/x, which is even and decreases with |x|."""
    magnitude = abs(x)
    return iv.mpf([_tanh_ratio_at(magnitude.b).a, _tanh_ratio_at(magnitude.a).b])


def _tanh_ratio_at(x: Interval) -> Interval:
    """tanh(x)/x on an interval as thin as a point, x >= 0."""
    if x.b < 1e-4:  # 1 - x^2/3 <= tanh(x)/x <= 1 - x^2/3 + 2 x^4/15
        return iv.mpf([1 - (x * x / 3).b, (1 - x * x / 3 + 2 * x**4 / 15).b])
    return tanh(x) / x


def tanh_ratio_slope(x: Interval) -> Interval:
    """Range of its derivative, odd and bounded by 0.385.

    ``tanh(x)/x`` is the integral of sech^2(x s) over 0 <= s <= 1, and |2 sech^2 tanh| <= 4/(3 sqrt 3).
    """
    bound = iv.mpf([-0.385, 0.385])
    if x.a <= 0 <= x.b:
        return bound
    slope = (tanh_slope(x) - tanh_ratio(x)) / x
    return iv.mpf([max(slope.a, bound.a), min(slope.b, bound.b)])


def expm1_ratio(x: Interval) -> Interval:
    """Range of (e^x - 1)/x, the integral of e^(x s) over 0 <= s <= 1, which increases."""
    return iv.mpf([_expm1_ratio_at(x.a).a, _expm1_ratio_at(x.b).b])


def _expm1_ratio_at(x: Interval) -> Interval:
    if abs(x).b < 1e-6:  # Taylor with the remainder x^2/6 e^xi
        return 1 + x / 2 + x * x / 6 * iv.exp(iv.mpf([-1e-6, 1e-6]))
    return (iv.exp(x) - 1) / x


def expm1_ratio_slope(x: Interval) -> Interval:
    """Range of its derivative, the integral of s e^(x s), which increases."""
    return iv.mpf([_expm1_ratio_slope_at(x.a).a, _expm1_ratio_slope_at(x.b).b])


def _expm1_ratio_slope_at(x: Interval) -> Interval:
    if abs(x).b < 1e-6:  # Taylor with the remainder x^2/8 e^xi
        return iv.mpf(1) / 2 + x / 3 + x * x / 8 * iv.exp(iv.mpf([-1e-6, 1e-6]))
    return (iv.exp(x) - _expm1_ratio_at(x)) / x
