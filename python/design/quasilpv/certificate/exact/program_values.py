"""Programs of an artifact run on numbers of any kind: doubles, arrays, balls of a range, polynomials, or tangents.

The evaluator of the checker, apart from that of the design (``docs/reference/formats.md``, "Programs").
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from flint import arb

from quasilpv.certificate.exact.program_chords import CHORDS
from quasilpv.certificate.exact.tangents import Tangent, power
from quasilpv.certificate.exact.trigonometric import Polynomial, UnsupportedError

Scalar = Any
Code = Sequence[Sequence[Any]]

SINC_RADIUS = 0.01
"""Wider balls are taken apart: the enclosure of sinc is that of a slope times the radius."""


def _sinc(x: Scalar) -> Scalar:
    if isinstance(x, Polynomial):
        return x.sinc()
    if not isinstance(x, arb):
        return np.sinc(x / np.pi)
    pieces = math.ceil(float(x.rad()) / SINC_RADIUS)
    if pieces <= 1:
        return x.sinc()
    width = (x.upper() - x.lower()) / pieces
    parts = [(x.lower() + k * width).union(x.lower() + (k + 1) * width).sinc() for k in range(pieces)]
    return functools.reduce(arb.union, parts)


def _sinc_slope(x: Scalar) -> Scalar:
    """``(cos x - sinc x)/x``; of balls also ``x sinc''`` with ``|sinc''| <= 1/3``, which 0 does not disturb."""
    if not isinstance(x, arb):
        safe = np.where(np.abs(x) < SINC_RADIUS, 1.0, x)
        return np.where(np.abs(x) < SINC_RADIUS, -x / 3.0 + x**3 / 30.0, (np.cos(safe) - np.sin(safe) / safe) / safe)
    by_curvature = x * arb(0, 1) / 3
    return by_curvature if x.contains(0) else by_curvature.intersection((x.cos() - x.sin() / x) / x)


def _quotient(name: str, slope: Callable[[Scalar], Scalar]) -> Callable[[Scalar], Scalar]:
    """``f(x)/x`` with value 0 and slope 1 at 0: near 0, where a ball holds 0, by the mean value theorem its slopes."""

    def apply(x: Scalar) -> Scalar:
        if not isinstance(x, arb):
            safe = np.where(x == 0.0, 1.0, x)
            return np.where(x == 0.0, 1.0, getattr(np, name)(safe) / safe)
        return slope(x.union(arb(0))) if x.contains(0) else getattr(x, name)() / x

    return apply


def _of_two(x: Scalar, y: Scalar, name: str) -> Scalar:
    """The smaller or the larger one; where balls overlap, of every pair in them."""
    if not isinstance(x, arb):
        return np.minimum(x, y) if name == "min" else np.maximum(x, y)
    ends = [(x.lower(), arb(y).lower()), (x.upper(), arb(y).upper())]
    low, high = (a if bool(a <= b) == (name == "min") else b for a, b in ends)
    return low.union(high)


_BINARY: Mapping[str, Callable[[Scalar, Scalar], Scalar]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "min": lambda x, y: _of_two(x, y, "min"),
    "max": lambda x, y: _of_two(x, y, "max"),
    **CHORDS,
    "atan2": lambda y, x: arb.atan2(y, arb(x)) if isinstance(y, arb) else np.arctan2(y, x),
}


def _unary(name: str) -> Callable[[Scalar], Scalar]:
    def apply(x: Scalar) -> Scalar:
        if isinstance(x, Polynomial) and not hasattr(x, name):
            raise UnsupportedError(f"{name} of an angle or a speed")
        return getattr(x, name)() if isinstance(x, arb | Polynomial | Tangent) else getattr(np, name)(x)

    return apply


def _arc(name: str) -> Callable[[Scalar], Scalar]:
    def apply(x: Scalar) -> Scalar:
        if isinstance(x, Polynomial | Tangent):
            raise UnsupportedError(f"{name} of an angle or a speed")
        return getattr(x, name)() if isinstance(x, arb) else getattr(np, f"arc{name[1:]}")(x)

    return apply


_UNARY: Mapping[str, Callable[[Scalar], Scalar]] = {
    "neg": operator.neg,
    "sinc": _sinc,
    "sinc_slope": _sinc_slope,
    "abs": operator.abs,
    "expm1_quotient": _quotient("expm1", lambda x: x.exp()),
    "tanh_quotient": _quotient("tanh", lambda x: 1 - x.tanh() ** 2),
    **{name: _unary(name) for name in ("sin", "cos", "exp", "sqrt", "log", "tanh")},
    **{name: _arc(name) for name in ("asin", "acos")},
}


_WITHOUT_SLOPE = frozenset({"min", "max", "atan2", *CHORDS, "sinc", "sinc_slope", "expm1_quotient", "tanh_quotient"})
"""Operations whose slope is not built."""


def program_values(
    code: Code, angle: Sequence[Scalar] = (), speed: Sequence[Scalar] = (), signal: Sequence[Scalar] = ()
) -> list[Scalar]:
    """Outputs of a program at angles and speeds, or at signals.

    Args:
        code: of a program of an artifact, or of a part of one that leaves values on the stack.
        angle, speed: n values each, all of one kind: numbers, arrays of one shape, `flint.arb` balls, polynomials, or
            tangents.
        signal: instead of these, values by number.

    Raises:
        KeyError: a reference, which no premise reads.
        UnsupportedError: of polynomials, what is none; of tangents, what has no slope here.
    """
    inputs = {"angle": angle, "speed": speed, "signal": signal}
    zero = 0 * (*angle, *signal)[0]
    stack: list[Scalar] = []
    for name, *argument in code:
        if name in _WITHOUT_SLOPE and isinstance(stack[-1], Tangent):
            raise UnsupportedError(f"the slope of {name}")
        if name == "const":
            stack.append(zero + float(argument[0]))
        elif name in inputs:
            stack.append(inputs[name][int(argument[0])])
        elif name == "pow_int":
            base = stack.pop()
            stack.append(power(base, int(argument[0])) if isinstance(base, arb) else base ** int(argument[0]))
        elif name in _BINARY:
            right = stack.pop()
            stack.append(_BINARY[name](stack.pop(), right))
        else:
            stack.append(_UNARY[name](stack.pop()))
    return stack
