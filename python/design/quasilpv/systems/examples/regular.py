"""Example I.1 of Dehak 2022, which is also its Example II.9: a regular system of two states."""

from __future__ import annotations

from math import inf, pi

import sympy as sp

from quasilpv.systems.descriptor.premise import Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import Parameter, SystemKind


def regular_example(name: str) -> SystemKind:
    """The system of (I.9), known as `name`."""

    def build(*, a: float, b: float) -> DescriptorSystem:
        return _build(name, a, b)

    return SystemKind(
        id=name,
        summary="regular academic system, 2 states, 3 premises",
        reference="Bouarar, Guelton and Manamanni (2010); Dehak 2022, (I.9), whose (I.10) misprints B_1 = z_2",
        parameters={
            "a": Parameter(1.0, "gain of cos^2 x_2 on the input of the second equation", affine=True),
            "b": Parameter(1.0, "gain of the destabilising sinc term", affine=True),
        },
        build=build,
    )


def _build(name: str, a: float, b: float) -> DescriptorSystem:
    """(I.9) for x_1 real and |x_2| <= pi; only B_1 = 1 + z_2 follows from it.

    With the printed B_1 = z_2 the first row of [A B] vanishes at z_1 = z_2 = 0, so no feedback moves the eigenvalue 0.
    """
    x1, x2 = sp.symbols("x1 x2", real=True)
    z1, z2, z3 = sp.cos(x2) ** 2, 1 / (1 + x1**2), (1 + 1 / (1 + x1**2)) * sp.sinc(x2)
    return DescriptorSystem.from_symbols(
        name=name,
        state=(x1, x2),
        inputs=("u",),
        E=sp.Matrix([[1, 1], [-1, z1]]),
        A=sp.Matrix([[0, z1 - z2], [-1.5, -3 + b * z3]]),
        B=sp.Matrix([1 + z2, a * z1 - 2]),
        C=sp.eye(2),
        premises=[
            Premise("z1", z1, (0.0, 1.0)),
            Premise("z2", z2, (0.0, 1.0)),
            Premise("z3", z3, (0.0, 2.0)),
        ],
        domain={x1: (-inf, inf), x2: (-pi, pi)},
    )
