"""The robots known by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi
from typing import TypeAlias

from quasilpv.arguments import checked
from quasilpv.errors import look_up
from quasilpv.systems.robots.arm_parameters import ActuatorLimits, Link, OperatingDomain, PayloadSet
from quasilpv.systems.robots.fivebar import RhombicFiveBar
from quasilpv.systems.robots.fivebar_linkage import FiveBarLinkage
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.printed_arms import PrintedSerialArm
from quasilpv.systems.robots.rolling_disc import InertiaSet, RollingDisc
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.ur5 import ur5


@dataclass(frozen=True)
class Robot:
    """A robot and what is asked of it.

    Attributes:
        id: the name it is known by.
        summary: one line for a listing.
        model: its nominal dynamics and kinematics.
        domain: the operating domain a design is stated for.
        limits: what its actuators can deliver.
        payloads: the plants a robust design must cover.
        disturbance_frequency_rad_s: the fastest disturbance its controllers are tuned to reject.
        delay_s: interval of the transport delay, as far as it is known.
    """

    id: str
    summary: str
    model: PlanarMechanism
    domain: OperatingDomain
    limits: ActuatorLimits
    payloads: PayloadSet
    disturbance_frequency_rad_s: float = 20.0
    delay_s: tuple[float, float] = (0.0, 0.0)

    @property
    def in_space(self) -> bool:
        """False: it moves in a plane, and has premises."""
        return False

    def __repr__(self) -> str:
        """Its name and its line of the listing."""
        return f"Robot({self.id!r}: {self.summary})"

    def with_payload_fraction(self, fraction: float) -> PlanarMechanism:
        """The plant at a payload fraction in [0, 1]; 0 is the nominal robot. See `PayloadSet`."""
        return self.model.perturbed(*self.payloads.scales_at(fraction))


AnyRobot: TypeAlias = Robot | SpatialRobot
"""A planar robot or one in space: both have id, summary, model, domain, limits, payloads and payload fractions."""


def all_robots() -> tuple[AnyRobot, ...]:
    """All robots, planar ones first, in a fixed order."""
    return (*robots(), ur5())


@checked
def any_robot(name: str) -> AnyRobot:
    """The robot of that name, in the plane or in space.

    >>> import quasilpv as ql
    >>> ql.robot("ur5").id
    'ur5'

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {entry.id: entry for entry in all_robots()}
    return look_up(known, name, "robots", "robot")


def robots() -> tuple[Robot, ...]:
    """All planar robots, in a fixed order."""
    return (_arm2(), _arm3(), _arm2_upright(), _arm3_light(), _fivebar(), _spring_disc())


def robot(name: str) -> Robot:
    """The planar robot of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {entry.id: entry for entry in robots()}
    return look_up(known, name, "robots", "robot")


def arm2() -> PrintedSerialArm:
    """The 2-DoF arm of Dehak 2022, Table I.1, whose inertias are about the centres of mass (m L^2 / 12 of a rod)."""
    com_inertia = (0.3125, 0.1875)
    mass, com = (15.0, 9.0), 0.25
    links = tuple(Link(0.5, m, com, inertia + m * com**2) for m, inertia in zip(mass, com_inertia, strict=True))
    return PrintedSerialArm("arm2", links)


def arm3() -> PrintedSerialArm:
    """The 3-DoF arm of Dehak 2022, Table I.4, whose inertias are about the joint axes.

    The printed r_2 = .489 is 2.4/4.9 truncated: only that value gives all printed digits of the PID gains (III.55).
    """
    links = (
        Link(length_m=1.0, mass_kg=5.0, com_m=0.5, inertia_kg_m2=2.0),
        Link(length_m=0.9, mass_kg=4.9, com_m=2.4 / 4.9, inertia_kg_m2=1.9),
        Link(length_m=0.8, mass_kg=4.2, com_m=0.4, inertia_kg_m2=1.3),
    )
    return PrintedSerialArm("arm3", links)


def fivebar() -> FiveBarLinkage:
    """The five-bar robot of Dehak 2022, Table IV.3, whose inertias are about the joint axes.

    Only that reading gives the printed PID gains; the printed formulas of c_4 and c_5 add m r^2 to them.
    """
    active = Link(length_m=0.165, mass_kg=0.0825, com_m=0.0825, inertia_kg_m2=0.0011)
    passive = Link(length_m=0.165, mass_kg=0.0825, com_m=0.0825, inertia_kg_m2=0.0007)
    return FiveBarLinkage("fivebar", active, passive)


def spring_disc() -> RollingDisc:
    """The disc of Dehak 2022, Example III.12, with the mass of fig. III.4."""
    return RollingDisc(
        "spring-disc",
        mass_kg=0.1,
        radius_m=2.0,
        inertia_kg_m2=4.0,
        stiffness_n_m=1.0,
        cubic_stiffness_n_m3=1.0,
        damping_n_s_m=2.0,
    )


@lru_cache(maxsize=1)
def _arm2() -> Robot:
    """Operating domain, limits and payload (20 % more mass on the last link) are choices of this project."""
    return Robot(
        id="arm2",
        summary="planar serial arm, 2 joints, two links of 0.5 m (Dehak 2022, Table I.1)",
        model=arm2(),
        domain=OperatingDomain.symmetric(2, angle_rad=0.7853981633974483, speed_rad_s=2.0),
        limits=ActuatorLimits(torque_nm=(400.0, 150.0), slew_nm_per_s=(1e6, 1e6)),
        payloads=PayloadSet(mass_scale=(1.0, 1.2), com_scale=(1.0, 1.0)),
    )


@lru_cache(maxsize=1)
def _arm3() -> Robot:
    """The operating domain is the box of the default trajectories widened by 0.1 rad and 1.5 times their speeds.

    The payload is the perturbation of Dehak 2022, IV.5.1 (+40 % on links 1 and 2, +120 % on link 3, both mass and
    centre of mass).
    """
    return Robot(
        id="arm3",
        summary="planar serial arm, 3 joints, links of 1.0, 0.9 and 0.8 m (Dehak 2022, Table I.4)",
        model=arm3(),
        domain=OperatingDomain(
            angle_rad=((-0.266, 0.364), (0.960, 2.044), (-1.127, -0.440)),
            speed_rad_s=((-1.775, 1.775), (-2.030, 2.030), (-1.954, 1.954)),
        ),
        limits=ActuatorLimits(torque_nm=(1500.0, 1200.0, 700.0), slew_nm_per_s=(1e6, 1e6, 1e6)),
        payloads=PayloadSet(mass_scale=(1.4, 1.4, 2.2), com_scale=(1.4, 1.4, 2.2)),
    )


@lru_cache(maxsize=1)
def _arm2_upright() -> Robot:
    """The same arm with its angles counted from the upward vertical: theta = 0 is unstable."""
    hanging = _arm2()
    return replace(
        hanging,
        id="arm2-upright",
        summary="arm2 around its upper equilibrium (Dehak 2022, Example I.2 as printed)",
        model=replace(arm2(), name="arm2-upright", equilibrium="upright"),
    )


@lru_cache(maxsize=1)
def _arm3_light() -> Robot:
    """Dehak 2022, Example II.8 with m_3 = 1 kg and |theta_i| <= pi, without payload.

    The moment of inertia of link 3 about its centre of mass is that of arm3; the bound on speeds is a choice of this
    project.
    """
    loaded, model = _arm3(), arm3()
    *inner, last = model.links
    light = replace(last, mass_kg=1.0, inertia_kg_m2=last.com_inertia_kg_m2 + last.com_m**2)
    return replace(
        loaded,
        id="arm3-light",
        summary="arm3 with a last link of 1 kg, over its whole workspace (Dehak 2022, Example II.8)",
        model=replace(model, name="arm3-light", links=(*inner, light)),
        domain=OperatingDomain.symmetric(3, angle_rad=pi, speed_rad_s=2.0),
        payloads=PayloadSet(mass_scale=(1.0, 1.0, 1.0), com_scale=(1.0, 1.0, 1.0)),
    )


@lru_cache(maxsize=1)
def _fivebar() -> Robot:
    """The operating domain is the box of the default spiral widened by 0.1 rad and 1.5 times its speeds.

    The payload is the perturbation of Dehak 2022, IV.5.2 (+40 % on the mass of the active links, +120 % on that of the
    passive ones, centres of mass as they are). Limits are a choice of this project: they leave room for the disturbance
    of 100 N m.
    """
    return Robot(
        id="fivebar",
        summary="five-bar parallel robot, 2 coaxial motors, links of 0.165 m (Dehak 2022, Table IV.3)",
        model=RhombicFiveBar(fivebar()),
        domain=OperatingDomain(
            angle_rad=((-1.238, -0.388), (0.421, 1.206)),
            speed_rad_s=((-3.105, 3.105), (-3.045, 3.045)),
        ),
        limits=ActuatorLimits(torque_nm=(150.0, 150.0), slew_nm_per_s=(1e6, 1e6)),
        payloads=PayloadSet(mass_scale=(1.4, 2.2), com_scale=(1.0, 1.0)),
        disturbance_frequency_rad_s=50.0,
    )


@lru_cache(maxsize=1)
def _spring_disc() -> Robot:
    """``|x_1| <= 5`` of the source is 2.5 rad; the domain leaves 0.1 rad around it, where fig. III.4 starts.

    The uncertainty is 0 <= delta <= 3: moments of inertia from 4 down to 1 kg m^2. Limits and the bound on speeds are
    choices of this project.
    """
    return Robot(
        id="spring-disc",
        summary="rolling disc on a hardening spring, uncertain inertia, 1 joint (Dehak 2022, Example III.12)",
        model=spring_disc(),
        domain=OperatingDomain.symmetric(1, angle_rad=2.6, speed_rad_s=12.0),
        limits=ActuatorLimits(torque_nm=(200.0,), slew_nm_per_s=(1e6,)),
        payloads=InertiaSet(mass_scale=(0.25,), com_scale=()),
    )
