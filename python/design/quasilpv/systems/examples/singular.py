"""The singular examples of Dehak 2022: II.5 and II.6 (one premise pair on a circle), II.7, III.10 and III.11."""

from __future__ import annotations

from math import inf, pi

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import Parameter, SystemKind


def rotation_example(name: str) -> SystemKind:
    """The unforced system (II.12) = (II.41), known as `name`."""

    def build(*, a: float, b: float) -> DescriptorSystem:
        x1, x2 = sp.symbols("x1 x2", real=True)
        cosine, sine = sp.cos(x1), sp.sin(x1)
        return DescriptorSystem.from_symbols(
            name=name,
            state=(x1, x2),
            inputs=(),
            E=sp.diag(1, 0),
            A=sp.Matrix([[-1, cosine + 5 * sine], [a * sine, b]]),
            B=sp.zeros(2, 0),
            C=sp.eye(2),
            premises=[Premise("z1", cosine, (-1.0, 1.0)), Premise("z2", sine, (-1.0, 1.0))],
            domain={x1: (-pi, pi), x2: (-inf, inf)},
        )

    return SystemKind(
        id=name,
        summary="unforced singular system, 1 differential and 1 algebraic state, 2 premises cos x_1 and sin x_1",
        reference="Dehak 2022, (II.12) and (II.41)",
        parameters={
            "a": Parameter(1.0, "gain of sin x_1 in the constraint", affine=True),
            "b": Parameter(1.0, "the algebraic pivot A22", affine=True),
        },
        build=build,
    )


def singular_example(name: str) -> SystemKind:
    """The singular system (II.42), all premises measured, known as `name`."""

    def build(*, a: float, b: float, z2_lower: float) -> DescriptorSystem:
        x1 = sp.Symbol("x1", real=True)
        z3 = sp.sin(x1 / 10)
        return _build(name, a=a, b=b, z2_lower=z2_lower, z3=z3, z3_kind=PremiseKind.MEASURED)

    return SystemKind(
        id=name,
        summary="singular academic system, 2 differential and 1 algebraic states, 3 premises",
        reference="He et al. (2021); Dehak 2022, (II.42)",
        parameters=_PARAMETERS,
        build=build,
    )


def uncertain_example(name: str) -> SystemKind:
    """The uncertain singular system (III.10), (III.11), known as `name`: the third premise is unknown."""

    def build(*, a: float, b: float, z2_lower: float) -> DescriptorSystem:
        z3 = sp.Symbol("z3", real=True)
        return _build(name, a=a, b=b, z2_lower=z2_lower, z3=z3, z3_kind=PremiseKind.UNKNOWN)

    return SystemKind(
        id=name,
        summary="singular academic system with an unknown premise, 2 differential and 1 algebraic states, 3 premises",
        reference="He et al. (2021); Dehak 2022, (III.10) and (III.11)",
        parameters=_PARAMETERS,
        build=build,
    )


_PARAMETERS = {
    "a": Parameter(-10.0, "input gain of the second equation, also in A", affine=True),
    "b": Parameter(-20.0, "input gain of the constraint, also in A", affine=True),
    "z2_lower": Parameter(0.5, "lower bound of z_2 = (1 + sin^2 x_2)/2; the range is [0.5, 1], III.10 prints 0"),
}


def _build(name: str, *, a: float, b: float, z2_lower: float, z3: sp.Expr, z3_kind: PremiseKind) -> DescriptorSystem:
    if not z2_lower <= 0.5:
        raise InputError(name, "z2_lower", z2_lower, "a number <= 0.5, which z_2 reaches")
    x1, x2, x3 = sp.symbols("x1 x2 x3", real=True)
    z1, z2 = 1 / (1 + sp.exp(2 * x1)), (1 + sp.sin(x2) ** 2) / 2
    known = sp.Matrix([[-z2 - 5, 1, z2], [z2, b * z2 - b, 1], [(a + 2) * z2 - 2, 0, 1]])
    # H_a W_a and H_b W_b of (III.11), written as fractions so that the coefficients are correctly rounded.
    drift = sp.Matrix([[5, -5, 15], [4, -4, 12], [6, -6, 18]]) / 100
    unknown_domain = {z3: (-1.0, 1.0)} if z3_kind is PremiseKind.UNKNOWN else {}
    return DescriptorSystem.from_symbols(
        name=name,
        state=(x1, x2, x3),
        inputs=("u",),
        E=sp.Matrix([[1, 0, 0], [z1, 1, 0], [0, 0, 0]]),
        A=known + drift * z3,
        B=sp.Matrix([0, a + sp.Rational(16, 100) * z3, b + sp.Rational(12, 100) * z3]),
        C=sp.eye(3),
        premises=[
            Premise("z1", z1, (0.0, 1.0)),
            Premise("z2", z2, (z2_lower, 1.0)),
            Premise("z3", z3, (-1.0, 1.0), z3_kind),
        ],
        domain={x1: (-inf, inf), x2: (-inf, inf), x3: (-inf, inf), **unknown_domain},
    )
