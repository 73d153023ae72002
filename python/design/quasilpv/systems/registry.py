"""The robots known by name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from quasilpv.errors import InputError
from quasilpv.systems.arm_parameters import ActuatorLimits, Link, OperatingDomain, PayloadSet
from quasilpv.systems.arms import PlanarSerialArm


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
    """

    id: str
    summary: str
    model: PlanarSerialArm
    domain: OperatingDomain
    limits: ActuatorLimits
    payloads: PayloadSet

    def with_payload_fraction(self, fraction: float) -> PlanarSerialArm:
        """The plant at a payload fraction in [0, 1]; 0 is the nominal arm. See `PayloadSet`."""
        return self.model.perturbed(*self.payloads.scales_at(fraction))


def robots() -> tuple[Robot, ...]:
    """All robots, in a fixed order."""
    return (_arm2(), _arm3())


def robot(name: str) -> Robot:
    """The robot of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {entry.id: entry for entry in robots()}
    if name not in known:
        raise InputError("robots", "robot", name, f"one of {', '.join(known)}")
    return known[name]


@lru_cache(maxsize=1)
def _arm2() -> Robot:
    """Dehak 2022, Table I.1, whose moments of inertia are about the centres of mass (m L^2 / 12 of a uniform rod).

    The operating domain, the limits and the payload (20 % more mass on the last link) are choices of this project.
    """
    com_inertia = (0.3125, 0.1875)
    mass, com = (15.0, 9.0), 0.25
    links = tuple(Link(0.5, m, com, inertia + m * com**2) for m, inertia in zip(mass, com_inertia, strict=True))
    return Robot(
        id="arm2",
        summary="planar serial arm, 2 joints, two links of 0.5 m (Dehak 2022, Table I.1)",
        model=PlanarSerialArm("arm2", links, coriolis_factorisation="printed"),
        domain=OperatingDomain.symmetric(2, angle_rad=0.7853981633974483, speed_rad_s=2.0),
        limits=ActuatorLimits(torque_nm=(400.0, 150.0), slew_nm_per_s=(1e6, 1e6)),
        payloads=PayloadSet(mass_scale=(1.0, 1.2), com_scale=(1.0, 1.0)),
    )


@lru_cache(maxsize=1)
def _arm3() -> Robot:
    """Dehak 2022, Table I.4, whose moments of inertia are about the joint axes.

    The printed r_2 = .489 is 2.4/4.9 truncated: only that value gives all printed digits of the PID gains (III.55). The
    operating domain is the box of the default trajectories widened by 0.1 rad and 1.5 times their speeds; the payload
    is the perturbation of Dehak 2022, IV.5.1 (+40 % on links 1 and 2, +120 % on link 3, both mass and centre of mass).
    """
    links = (
        Link(length_m=1.0, mass_kg=5.0, com_m=0.5, inertia_kg_m2=2.0),
        Link(length_m=0.9, mass_kg=4.9, com_m=2.4 / 4.9, inertia_kg_m2=1.9),
        Link(length_m=0.8, mass_kg=4.2, com_m=0.4, inertia_kg_m2=1.3),
    )
    return Robot(
        id="arm3",
        summary="planar serial arm, 3 joints, links of 1.0, 0.9 and 0.8 m (Dehak 2022, Table I.4)",
        model=PlanarSerialArm("arm3", links, coriolis_factorisation="printed"),
        domain=OperatingDomain(
            angle_rad=((-0.266, 0.364), (0.960, 2.044), (-1.127, -0.440)),
            speed_rad_s=((-1.775, 1.775), (-2.030, 2.030), (-1.954, 1.954)),
        ),
        limits=ActuatorLimits(torque_nm=(1500.0, 1200.0, 700.0), slew_nm_per_s=(1e6, 1e6, 1e6)),
        payloads=PayloadSet(mass_scale=(1.4, 1.4, 2.2), com_scale=(1.4, 1.4, 2.2)),
    )
