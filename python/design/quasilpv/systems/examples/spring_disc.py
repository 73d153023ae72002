"""Example III.12 of Dehak 2022: a disc that rolls without slipping, held by a damper and a hardening spring.

    M x_2' = -k_1 x_1 - k_2 x_1^3 - b x_2 + lambda,    J_delta x_3' = -r lambda + u,    0 = x_2 - r x_3

with x_1 the position of the centre, x_2 its speed, x_3 the angular speed, lambda the contact force and the uncertain
inertia ``1/J_delta = 1/J + delta/r^2``. The constraint has index 2; its derivative is the fourth row of the model:

    0 = x_2' - r x_3' = -(k_1 + k_2 x_1^2)/M x_1 - b/M x_2 + (1/M + r^2/J + delta) lambda - (r/J + delta/r) u.

The thesis prints both terms in delta with the other sign; then the pivot of lambda vanishes at delta = r^2/J + 1/M.
"""

from __future__ import annotations

from math import inf

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import Parameter, SystemKind


def spring_disc(name: str) -> SystemKind:
    """The disc of (III.33) in index-1 form, known as `name`."""

    def build(**parameters: float) -> DescriptorSystem:
        return _build(name, **parameters)

    return SystemKind(
        id=name,
        summary="damped-spring-disc with uncertain inertia, 2 differential and 2 algebraic states, 2 premises",
        reference="Arceo et al. (2019); Dehak 2022, Example III.12 with the signs of its uncertain terms corrected",
        parameters={
            "M": Parameter(0.1, "mass of the disc", "kg"),
            "c": Parameter(3.0, "the inertia is uncertain by 0 <= delta <= c, 1/J_delta = 1/J + delta/r^2", "1/kg"),
            "x1_max": Parameter(5.0, "largest |x_1| of the operating domain", "m"),
            "k1": Parameter(1.0, "stiffness of the linear spring", "N/m"),
            "k2": Parameter(1.0, "coefficient of the cubic spring", "N/m^3"),
            "damping": Parameter(2.0, "coefficient of the damper", "N s/m"),
            "r": Parameter(2.0, "radius of the disc", "m"),
            "J": Parameter(4.0, "moment of inertia of the disc at delta = 0", "kg m^2"),
        },
        build=build,
    )


def _build(
    name: str, *, M: float, c: float, x1_max: float, k1: float, k2: float, damping: float, r: float, J: float
) -> DescriptorSystem:
    for field, value in (("M", M), ("x1_max", x1_max), ("r", r), ("J", J)):
        if value <= 0:
            raise InputError(name, field, value, "a number > 0")
    for field, value in (("c", c), ("k1", k1), ("k2", k2), ("damping", damping)):
        if value < 0:
            raise InputError(name, field, value, "a number >= 0")
    x1, x2, x3, force, delta = sp.symbols("x1 x2 x3 lambda delta", real=True)
    stiffness = (k1 + k2 * x1**2) / M
    return DescriptorSystem.from_symbols(
        name=name,
        state=(x1, x2, x3, force),
        inputs=("torque",),
        E=sp.diag(1, 1, 0, 0),
        A=sp.Matrix(
            [
                [0, 1, 0, 0],
                [-stiffness, -damping / M, 0, 1 / M],
                [0, 1, -r, 0],
                [-stiffness, -damping / M, 0, 1 / M + r**2 / J + delta],
            ]
        ),
        B=sp.Matrix([0, 0, 0, -r / J - delta / r]),
        C=sp.Matrix([[1, 0, 0, 0], [0, 1, 0, 0]]),
        premises=[
            Premise("z1", x1**2, (0.0, x1_max**2)),
            Premise("z2", delta, (0.0, c), PremiseKind.UNKNOWN),
        ],
        domain={
            x1: (-x1_max, x1_max),
            **{free: (-inf, inf) for free in (x2, x3, force)},
            delta: (0.0, c),
        },
    )
