"""The arms of Dehak 2022 as stabilisation problems: the descriptor model around theta = 0 over a symmetric domain.

A varied link mass keeps the centre of mass and the moment of inertia *about the centre of mass*, so the one about the
joint axis follows. Kept itself (as the thesis does), the inertia of arm3 about the joint axis would leave no rigid body
for m_3 > 1.3/0.4^2 = 8.1 kg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import arm2, arm3
from quasilpv.systems.system_kind import Parameter, SystemKind

_DOMAIN = {
    "theta_max": Parameter(pi / 6, "largest |theta_i| of the operating domain", "rad"),
    "speed_max": Parameter(2.0, "largest |omega_i| of the operating domain", "rad/s"),
}
_M3 = Parameter(4.2, "mass of link 3", "kg", affine=True)


def arm2_kind(name: str) -> SystemKind:
    """The 2-DoF arm of Examples I.2 and I.3, known as `name`."""

    def build(
        *, m2: float, fv1: float, fv2: float, theta_max: float, speed_max: float, upright: float
    ) -> DescriptorSystem:
        if upright not in (0.0, 1.0):
            raise InputError(name, "upright", upright, "0 (theta = 0 hangs) or 1 (it is upright)")
        arm = _with_last_mass(name, "m2", arm2(), m2, (fv1, fv2))
        arm = replace(arm, equilibrium="upright" if upright else "hanging")
        return _stabilisation(name, arm, theta_max, speed_max)

    return SystemKind(
        id=name,
        summary="planar serial arm, 2 joints, around theta = 0: 4 states, 5 premises",
        reference="Dehak 2022, Examples I.2 and I.3, signs of H and N read as those of the right-hand side",
        parameters={
            "m2": Parameter(9.0, "mass of link 2; the premises hold it", "kg"),
            "fv1": Parameter(0.0, "viscous friction of joint 1", "N m s/rad", affine=True),
            "fv2": Parameter(0.0, "viscous friction of joint 2", "N m s/rad", affine=True),
            **_DOMAIN,
            "upright": Parameter(0.0, "theta = 0 is: 0 hanging (stable), 1 upright (unstable)"),
        },
        build=build,
    )


def arm3_kind(name: str) -> SystemKind:
    """The 3-DoF arm of Example I.4, known as `name`."""

    def build(*, m3: float, fv: float, theta_max: float, speed_max: float) -> DescriptorSystem:
        arm = _with_last_mass(name, "m3", arm3(), m3, (fv, fv, fv))
        return _stabilisation(name, arm, theta_max, speed_max)

    return SystemKind(
        id=name,
        summary="planar serial arm, 3 joints, around hanging: 6 states, 12 premises",
        reference="Dehak 2022, Example I.4, m_11 and z_4 corrected",
        parameters={
            "m3": _M3,
            "fv": Parameter(0.0, "viscous friction of every joint", "N m s/rad", affine=True),
            **_DOMAIN,
        },
        build=build,
    )


def frictionless_arm3_kind(name: str) -> SystemKind:
    """The 3-DoF arm without friction of Example II.8, known as `name`."""

    def build(*, m3: float, theta_max: float, speed_max: float) -> DescriptorSystem:
        arm = _with_last_mass(name, "m3", arm3(), m3, (0.0, 0.0, 0.0))
        return _stabilisation(name, arm, theta_max, speed_max)

    return SystemKind(
        id=name,
        summary="planar serial arm, 3 joints without friction, around hanging: 6 states, 12 premises",
        reference="Dehak 2022, Example II.8, m_11 and z_4 corrected",
        parameters={"m3": _M3, **_DOMAIN},
        build=build,
    )


def _with_last_mass(
    name: str, field: str, arm: PlanarSerialArm, mass_kg: float, friction_nm_s: Sequence[float]
) -> PlanarSerialArm:
    if mass_kg <= 0:
        raise InputError(name, field, mass_kg, "a number > 0")
    *inner, last = arm.links
    inertia = last.com_inertia_kg_m2 + mass_kg * last.com_m**2
    links = [*inner, replace(last, mass_kg=mass_kg, inertia_kg_m2=inertia)]
    return replace(
        arm,
        name=name,
        links=tuple(replace(link, friction_nm_s=friction) for link, friction in zip(links, friction_nm_s, strict=True)),
    )


def _stabilisation(name: str, arm: PlanarSerialArm, theta_max: float, speed_max: float) -> DescriptorSystem:
    for field, value in (("theta_max", theta_max), ("speed_max", speed_max)):
        if value < 0:
            raise InputError(name, field, value, "a number >= 0")
    return arm.as_descriptor_system(OperatingDomain.symmetric(arm.joints, theta_max, speed_max))
