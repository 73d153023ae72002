"""Ranges of elementary functions that mpmath's intervals do not have, each with its first and second derivative.

A monotone function is evaluated at the ends of the interval with 40 bits more than the result keeps, and the result is
widened by far more than the error of that evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import inf
from typing import Any, NamedTuple

from mpmath import mp, workprec

from quasilpv.errors import InputError
from quasilpv.systems.intervals.functions import PRECISION_BITS, iv, sinc, sinc_slope, tanh, tanh_slope

Interval = Any  # mpmath's interval type carries no annotations
Rule = Callable[[Interval], Interval]

_WIDENING = mp.mpf(2) ** (6 - PRECISION_BITS)  # relative


class Smoothness(NamedTuple):
    """A function with its first two derivatives, each as a range over an interval."""

    value: Rule
    slope: Rule
    curvature: Rule


def hull(first: Interval, second: Interval) -> Interval:
    """The smallest interval that holds both."""
    return iv.mpf([min(first.a, second.a), max(first.b, second.b)])


def meet(first: Interval, second: Interval) -> Interval:
    """The part of two enclosures of one thing that both hold."""
    low, high = max(first.a, second.a), min(first.b, second.b)
    return iv.mpf([low, high]) if low <= high else first  # disjoint by less than the rounding of an end


def _at(function: Callable[[Any], Any], x: Interval) -> Interval:
    """A function of mpmath at an interval as thin as a point."""
    with workprec(PRECISION_BITS + 40):
        value = function(mp.make_mpf(x._mpi_[0]))
        width = abs(value) * _WIDENING
        return iv.mpf([value - width, value + width])


def _increasing(function: Callable[[Any], Any]) -> Rule:
    return lambda x: iv.mpf([_at(function, x.a).a, _at(function, x.b).b])


def _required(holds: bool, function: str, x: Interval, expected: str) -> None:
    if not holds:
        got = f"an argument in [{float(mp.make_mpf(x._mpi_[0])):.6g}, {float(mp.make_mpf(x._mpi_[1])):.6g}]"
        raise InputError("expression", function, got, expected)


def logarithm(x: Interval) -> Interval:
    """Range of the natural logarithm."""
    _required(bool(x.a > 0), "log", x, "an argument > 0 on the domain")
    return _increasing(mp.log)(x)


def tangent(x: Interval) -> Interval:
    """Range of tan on an interval between two poles."""
    half_pi = iv.pi / 2
    with workprec(PRECISION_BITS):
        branch = mp.floor((mp.make_mpf(x._mpi_[0]) + mp.pi / 2) / mp.pi)
    shift = int(branch) * iv.pi
    _required(bool(-half_pi < x - shift) and bool(x - shift < half_pi), "tan", x, "an argument between two poles")
    return _increasing(mp.tan)(x)


def arctangent(x: Interval) -> Interval:
    """Range of atan."""
    return _increasing(mp.atan)(x)


def arcsine(x: Interval) -> Interval:
    """Range of asin."""
    _required(bool(x.a >= -1) and bool(x.b <= 1), "asin", x, "an argument in [-1, 1] on the domain")
    return _increasing(mp.asin)(x)


def arccosine(x: Interval) -> Interval:
    """Range of acos."""
    return iv.pi / 2 - arcsine(x)


def sinh(x: Interval) -> Interval:
    """Range of sinh."""
    return _increasing(mp.sinh)(x)


def cosh(x: Interval) -> Interval:
    """Range of cosh, which is even."""
    return _increasing(mp.cosh)(abs(x))


def power(x: Interval, exponent: Fraction) -> Interval:
    """Range of x to a fraction, for x >= 0; x > 0 if the exponent is negative."""
    if exponent < 0:
        _required(bool(x.a > 0), f"power {exponent}", x, "an argument > 0 on the domain")
        return 1 / power(x, -exponent)
    _required(bool(x.a >= 0), f"power {exponent}", x, "an argument >= 0 on the domain")
    return _increasing(lambda v: mp.power(v, mp.mpf(exponent.numerator) / exponent.denominator))(x)


def power_slope(x: Interval, exponent: Fraction) -> Interval:
    """Range of its derivative, unbounded at 0 for an exponent below 1."""
    if exponent < 1 and x.a <= 0 <= x.b:
        return iv.mpf([0, inf])
    return iv.mpf(exponent.numerator) / exponent.denominator * power(x, exponent - 1)


def sign(x: Interval) -> Interval:
    """Range of sign; at the jump, what a sliding mode takes: all of [-1, 1]."""
    return iv.mpf([-1 if x.a <= 0 else 1, 1 if x.b >= 0 else -1])


def step(x: Interval) -> Interval:
    """Range of the slope of max(x, 0)."""
    return (1 + sign(x)) / 2


def ramp(x: Interval) -> Interval:
    """Range of max(x, 0)."""
    return iv.mpf([max(x.a, 0), max(x.b, 0)])


def kink(x: Interval) -> Interval:
    """Range of the second derivative of a convex function with a corner at 0 and straight elsewhere."""
    return iv.mpf([0, inf]) if x.a <= 0 <= x.b else iv.mpf(0)


def _root_of_one_minus_square(x: Interval) -> Interval:
    return iv.sqrt(iv.mpf([max(0, (1 - x * x).a), (1 - x * x).b]))


def _over(value: Interval, divisor: Interval) -> Interval:
    """A quotient by something >= 0, unbounded where that is 0."""
    if divisor.a > 0:
        return value / divisor
    return iv.mpf([-inf if value.a < 0 else 0, inf if value.b > 0 else 0])


SMOOTHNESS: dict[str, Smoothness] = {
    "log": Smoothness(logarithm, lambda x: 1 / x, lambda x: -1 / x**2),
    "tan": Smoothness(tangent, lambda x: 1 + tangent(x) ** 2, lambda x: 2 * tangent(x) * (1 + tangent(x) ** 2)),
    "atan": Smoothness(arctangent, lambda x: 1 / (1 + x**2), lambda x: -2 * x / (1 + x**2) ** 2),
    "asin": Smoothness(
        arcsine,
        lambda x: _over(iv.mpf(1), _root_of_one_minus_square(x)),
        lambda x: _over(x, _root_of_one_minus_square(x) ** 3),
    ),
    "sinh": Smoothness(sinh, cosh, sinh),
    "cosh": Smoothness(cosh, sinh, cosh),
    "tanh": Smoothness(tanh, tanh_slope, lambda x: -2 * tanh(x) * tanh_slope(x)),
    "sinc": Smoothness(sinc, sinc_slope, lambda x: iv.mpf([-1, 1]) / 3),
    "abs": Smoothness(abs, sign, kink),
    "ramp": Smoothness(ramp, step, kink),
}
"""By name. sinc is the mean of cos(x s) over 0 <= s <= 1, so its curvature is that of -s^2 cos(x s), within 1/3."""

CONVEX = frozenset({"log", "cosh", "abs", "ramp"})
"""Functions that bend one way everywhere; the others but sinc do so on either side of 0."""


def chord(function: Smoothness, a: Interval, w: Interval) -> Interval:
    """Range of ``(g(a + w) - g(a))/w``, the mean of g' between a and a + w, g'(a) at w = 0.

    Where g is convex on all that a + s w reaches, 0 <= s <= 1, the mean increases with a and with w, so the ends of
    both bound it exactly; where g is concave it decreases.
    """
    if a.a == a.b and w.a < 0 < w.b:  # most functions bend one way on either side of 0, where a mostly is
        return hull(chord(function, a, iv.mpf([w.a, 0])), chord(function, a, iv.mpf([0, w.b])))
    reach = hull(a, a + w)
    bounds = function.slope(reach)
    curvature = function.curvature(reach)
    if curvature.a >= 0:
        return meet(bounds, iv.mpf([_chord_at(function, a.a, w.a).a, _chord_at(function, a.b, w.b).b]))
    if curvature.b <= 0:
        return meet(bounds, iv.mpf([_chord_at(function, a.b, w.b).a, _chord_at(function, a.a, w.a).b]))
    if not (w.a <= 0 <= w.b):
        bounds = meet(bounds, (function.value(a + w) - function.value(a)) / w)
    return bounds


def _chord_at(function: Smoothness, a: Interval, w: Interval) -> Interval:
    """At intervals as thin as points: by the quotient, or by Taylor's formula where w is small."""
    reach = hull(a, a + w)
    bounds = function.slope(reach)
    curvature = function.curvature(reach)
    if curvature.b < inf:
        bounds = meet(bounds, function.slope(a) + w / 2 * curvature)
    if not (w.a <= 0 <= w.b):
        bounds = meet(bounds, (function.value(a + w) - function.value(a)) / w)
    return bounds


def chord_slopes(function: Smoothness, a: Interval, w: Interval) -> tuple[Interval, Interval]:
    """Ranges of the derivatives of `chord` with respect to a and to w: means of g'' with weights 1 and s."""
    reach = hull(a, a + w)
    curvature = function.curvature(reach)
    along_a, along_w = curvature, curvature / 2
    if not (w.a <= 0 <= w.b):
        b = a + w
        along_a = meet(along_a, (function.slope(b) - function.slope(a)) / w)
        along_w = meet(along_w, (function.slope(b) - chord(function, a, w)) / w)
    return along_a, along_w
