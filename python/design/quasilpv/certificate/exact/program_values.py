"""Programs of an artifact run on numbers of any kind: doubles, arrays, balls that enclose a range, or polynomials.

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

from quasilpv.certificate.exact.trigonometric import Polynomial, UnsupportedError

Scalar = Any
Code = Sequence[Sequence[Any]]

_BINARY: Mapping[str, Callable[[Scalar, Scalar], Scalar]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
}


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


def _unary(name: str) -> Callable[[Scalar], Scalar]:
    def apply(x: Scalar) -> Scalar:
        if isinstance(x, Polynomial) and not hasattr(x, name):
            raise UnsupportedError(f"{name} of an angle or a speed")
        return getattr(x, name)() if isinstance(x, arb | Polynomial) else getattr(np, name)(x)

    return apply


_UNARY: Mapping[str, Callable[[Scalar], Scalar]] = {
    "neg": operator.neg,
    "sinc": _sinc,
    **{name: _unary(name) for name in ("sin", "cos", "exp", "sqrt")},
}


def program_values(code: Code, angle: Sequence[Scalar], speed: Sequence[Scalar]) -> list[Scalar]:
    """Outputs of a program at angles and speeds.

    Args:
        code: of a program of an artifact, or of a part of one that leaves values on the stack.
        angle, speed: n values each, all of one kind: numbers, arrays of one shape, `flint.arb` balls, or polynomials.

    Raises:
        KeyError: an operation that no premise of an arm needs (arcs), or a reference.
        UnsupportedError: of polynomials, what is none.
    """
    inputs = {"angle": angle, "speed": speed}
    stack: list[Scalar] = []
    for name, *argument in code:
        if name == "const":
            stack.append(0 * angle[0] + float(argument[0]))
        elif name in inputs:
            stack.append(inputs[name][int(argument[0])])
        elif name == "pow_int":
            stack.append(stack.pop() ** int(argument[0]))
        elif name in _BINARY:
            right = stack.pop()
            stack.append(_BINARY[name](stack.pop(), right))
        else:
            stack.append(_UNARY[name](stack.pop()))
    return stack
