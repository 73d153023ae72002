"""A robot in space with all that a design needs to know of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import isfinite, sqrt
from typing import Any

import numpy as np

from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import ActuatorLimits, OperatingDomain
from quasilpv.systems.robots.joint_drive import ArmClass, ElasticDrive, arm_class
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.systems.robots.tree_mechanism import TORQUE_LOOP_GAIN, ElasticMechanism, TreeMechanism

Interval = tuple[float, float]

UNSTATED_SLEW_NM_PER_S = 1e6
"""Slew limit of a drive of which nobody says how fast its torque can change."""


@dataclass(frozen=True)
class SpatialJoint:
    """One joint as its owner states it.

    Attributes:
        name: of the joint.
        angle_rad: interval a design holds in, rad (m for a joint that slides).
        speed_rad_s, torque_nm, slew_nm_per_s: largest ones.
        rotor_inertia_kg_m2: reflected to the joint.
        rotor_tolerance: share by which it may differ, up and down.
        encoder_bits: per turn; None if nobody said.
        friction_viscous_nm_s, friction_coulomb_nm: of the true robot, as far as they are known.
        motion_angle_rad, motion_speed_rad_s: interval and largest speed that a proof in motion holds in; None for those
            above.
        drive: a gear that gives; None for a rigid joint.
        friction_breakaway_nm: torque up to which the joint sticks, at least its Coulomb friction; 0: nobody said, and
            in simulations it does not stick, its Coulomb friction is smoothed.
    """

    name: str
    angle_rad: Interval
    speed_rad_s: float
    torque_nm: float
    slew_nm_per_s: float
    rotor_inertia_kg_m2: float
    rotor_tolerance: float
    encoder_bits: int | None
    friction_viscous_nm_s: float
    friction_coulomb_nm: float
    motion_angle_rad: Interval | None = None
    motion_speed_rad_s: float | None = None
    drive: ElasticDrive | None = None
    friction_breakaway_nm: float = 0.0


@dataclass(frozen=True)
class PayloadBody:
    """All loads the robot may carry.

    Attributes:
        mass_kg: largest mass.
        com_box_m: box of the centre of mass in the tool's frame.
        inertia_kg_m2: bound of the moment of inertia about the centre of mass, per axis of the tool's frame.
    """

    mass_kg: float
    com_box_m: tuple[Interval, Interval, Interval]
    inertia_kg_m2: tuple[float, float, float]

    def corners(self) -> tuple[SpatialInertia, ...]:
        """The heaviest loads with the centre of mass at a corner of the box, about the tool's frame.

        Kinetic energy is convex in the place of the centre of mass and grows with mass and moment of inertia: whatever
        bounds the energy of these loads bounds that of every load.
        """
        rotational = np.diag(self.inertia_kg_m2)
        places = dict.fromkeys(product(*self.com_box_m))
        return tuple(SpatialInertia.about_com(self.mass_kg, place, rotational) for place in places)

    def farthest(self, share: float) -> SpatialInertia:
        """The load at the corner of the box that is farthest from the tool, with a share of mass and moment of inertia.

        Of corners equally far the one with the larger coordinates.
        """
        place = max(product(*self.com_box_m), key=lambda corner: (round(float(np.dot(corner, corner)), 12), corner))
        return SpatialInertia.about_com(self.mass_kg * share, place, share * np.diag(self.inertia_kg_m2))

    def central(self, share: float) -> SpatialInertia:
        """The load in the middle of the box with a share of mass and moment of inertia."""
        middle = [(low + high) / 2.0 for low, high in self.com_box_m]
        return SpatialInertia.about_com(self.mass_kg * share, middle, share * np.diag(self.inertia_kg_m2))


@dataclass(frozen=True, eq=False)
class SpatialPlants:
    """The set of robots around a nominal one, as an artifact states it.

    Attributes:
        link_tolerance: share by which the inertia of every link may differ.
        rotor_tolerance: the same of every rotor.
        load: what the tool may carry; None for nothing.
        tool: placement of the load's frame in that of the last joint.
        lag_s: shortest and longest time constant of the drives, common to all joints.
        gears: of joints that give, one each; none for an arm with a rigid joint.
        torque_gain: of drives that control the torque in their joints; 1: they do not.
    """

    link_tolerance: float
    rotor_tolerance: tuple[float, ...]
    load: PayloadBody | None
    tool: Placement
    lag_s: Interval = (0.0, 0.0)
    gears: tuple[ElasticDrive, ...] = ()
    torque_gain: float = 1.0

    def to_document(self) -> dict[str, Any]:
        """The ``payloads`` member of an artifact."""
        load = self.load
        return {
            "link_tolerance": self.link_tolerance,
            "rotor_tolerance": list(self.rotor_tolerance),
            "load": None
            if load is None
            else {
                "rotation": self.tool.rotation.tolist(),
                "translation_m": self.tool.translation_m.tolist(),
                "mass_kg": load.mass_kg,
                "com_box_m": [list(interval) for interval in load.com_box_m],
                "inertia_kg_m2": list(load.inertia_kg_m2),
            },
            **({"lag_s": list(self.lag_s)} if self.lag_s[1] > 0.0 else {}),
            **({"gears": [_gear(drive) for drive in self.gears]} if self.gears else {}),
            **({"torque_gain": self.torque_gain} if self.torque_gain > 1.0 else {}),
        }


def _gear(drive: ElasticDrive) -> dict[str, Any]:
    return {"stiffness_nm_rad": list(drive.stiffness_nm_rad), "damping_s": list(drive.damping_s)}


@dataclass(frozen=True, eq=False)
class SpatialRobot:
    """A robot in space.

    Attributes:
        id: the name it is known by.
        tree: without payload; limits of its joints are those of the design.
        joints: what is stated of each joint.
        payload: the loads it may carry; None for none.
        link_uncertainty: share by which the inertia of every link may differ.
        delay_s, lag_s: interval of the transport delay, and of the time constant of the drives, common to all joints.
        source: file it comes from.
        summary: one line for a listing.
        disturbance_frequency_rad_s: the fastest disturbance its controllers are tuned to reject.
    """

    id: str
    tree: KinematicTree
    joints: tuple[SpatialJoint, ...]
    payload: PayloadBody | None
    link_uncertainty: float
    delay_s: Interval
    lag_s: Interval
    source: str
    summary: str = ""
    disturbance_frequency_rad_s: float = 20.0

    def __repr__(self) -> str:
        """Its name and its line of the listing."""
        return f"SpatialRobot({self.id!r}: {self.summary or self.source})"

    # ---- what every robot has, see `quasilpv.systems.robots.registry.AnyRobot` ------------------------------------

    @property
    def in_space(self) -> bool:
        """True: its laws compute inertia and gravity by a recursion over its bodies."""
        return True

    @cached_property
    def model(self) -> TreeMechanism:
        """The nominal robot, empty."""
        return self._with_friction(self.tree)

    @cached_property
    def domain(self) -> OperatingDomain:
        """Angles and speeds a design is stated for."""
        return OperatingDomain(
            tuple(joint.angle_rad for joint in self.joints),
            tuple((-joint.speed_rad_s, joint.speed_rad_s) for joint in self.joints),
        )

    @cached_property
    def limits(self) -> ActuatorLimits:
        """What the drives deliver."""
        slews = (joint.slew_nm_per_s for joint in self.joints)
        return ActuatorLimits(
            tuple(joint.torque_nm for joint in self.joints),
            tuple(slew if isfinite(slew) else UNSTATED_SLEW_NM_PER_S for slew in slews),
        )

    @cached_property
    def payloads(self) -> SpatialPlants:
        """The robots a design must cover."""
        rotors = tuple(joint.rotor_tolerance for joint in self.joints)
        gears = tuple(joint.drive for joint in self.joints if joint.drive is not None)
        elastic = gears if len(gears) == len(self.joints) else ()
        gain = TORQUE_LOOP_GAIN if elastic and all(drive.torque_loop for drive in elastic) else 1.0
        return SpatialPlants(self.link_uncertainty, rotors, self.payload, self.tree.tool, self.lag_s, elastic, gain)

    def with_payload_fraction(self, fraction: float) -> TreeMechanism:
        """The nominal robot with a share of its load in [0, 1], far out: see `PayloadBody.farthest`.

        Its drives lag by that share of the way from the shortest to the longest lag.

        Raises:
            InputError: the fraction is outside [0, 1].
        """
        if not 0.0 <= fraction <= 1.0:
            raise InputError("payloads", "fraction", fraction, "a number in [0, 1]")
        if fraction == 0.0:
            return self.model
        tree = self.tree if self.payload is None else self.tree.carrying(self.payload.farthest(fraction))
        return self._with_friction(tree, fraction)

    def _with_friction(self, tree: KinematicTree, fraction: float = 0.0) -> TreeMechanism:
        viscous = tuple(joint.friction_viscous_nm_s for joint in self.joints)
        coulomb = tuple(joint.friction_coulomb_nm for joint in self.joints)
        sticking = tuple(joint.friction_breakaway_nm for joint in self.joints)
        drives = [joint.drive for joint in self.joints if joint.drive is not None]
        lag_s = self.lag_s[0] + fraction * (self.lag_s[1] - self.lag_s[0])
        if not drives:
            return TreeMechanism(tree, viscous, coulomb, lag_s, sticking)
        # The gears that are simulated are in the middle of their interval, with the least damping.
        stiffness = tuple(sqrt(drive.stiffness_nm_rad[0] * drive.stiffness_nm_rad[1]) for drive in drives)
        damping = tuple(drive.damping_least_s * pull for drive, pull in zip(drives, stiffness, strict=True))
        return ElasticMechanism(
            tree,
            viscous,
            coulomb,
            lag_s,
            sticking,
            stiffness_nm_rad=stiffness,
            damping_nm_s=damping,
            encoder_side=drives[0].encoder_side,
            torque_sensor=all(drive.torque_sensor for drive in drives),
            torque_noise_nm=tuple(drive.torque_noise_nm for drive in drives),
            torque_quantum_nm=tuple(drive.torque_resolution_nm for drive in drives),
            torque_gain=TORQUE_LOOP_GAIN if all(drive.torque_loop for drive in drives) else 1.0,
        )

    @property
    def motion(self) -> tuple[tuple[Interval, ...], tuple[float, ...]]:
        """Intervals and largest speeds of the joints that a proof in motion holds in."""
        angles = tuple(joint.motion_angle_rad or joint.angle_rad for joint in self.joints)
        return angles, tuple(joint.motion_speed_rad_s or joint.speed_rad_s for joint in self.joints)

    @property
    def arm_class(self) -> ArmClass:
        """What laws can be for it, by its joints' drives."""
        return arm_class([joint.drive for joint in self.joints])

    def sticking(self, ratio: float) -> SpatialRobot:
        """The robot whose joints stick when they are simulated, up to a multiple of their Coulomb friction.

        Raises:
            InputError: the ratio is below 1.
        """
        if not ratio >= 1.0:
            raise InputError("friction", "breakaway", ratio, "at least 1, of the Coulomb friction")
        joints = (replace(own, friction_breakaway_nm=ratio * own.friction_coulomb_nm) for own in self.joints)
        return replace(self, joints=tuple(joints))

    @property
    def rubs(self) -> bool:
        """Whether Coulomb friction is stated of a joint."""
        return any(joint.friction_coulomb_nm > 0.0 for joint in self.joints)

    # ---- the set of robots -------------------------------------------------------------------------------------------

    def lightest(self) -> KinematicTree:
        """The robot with the least inertia: empty, all links and rotors at the lower end."""
        return self._scaled(-1.0)

    def heaviest(self) -> tuple[KinematicTree, ...]:
        """The robots whose inertias bound all others from above: full load at every corner, links at the upper end."""
        full = self._scaled(1.0)
        return (full,) if self.payload is None else tuple(full.carrying(corner) for corner in self.payload.corners())

    def loaded(self, share: float) -> KinematicTree:
        """The nominal robot with a share of the load in the middle of its box."""
        return self.tree if self.payload is None else self.tree.carrying(self.payload.central(share))

    def _scaled(self, sign: float) -> KinematicTree:
        links = 1.0 + sign * self.link_uncertainty
        joints = tuple(
            replace(
                own,
                inertia=own.inertia.scaled(links),
                rotor_inertia_kg_m2=own.rotor_inertia_kg_m2 * (1.0 + sign * stated.rotor_tolerance),
            )
            for own, stated in zip(self.tree.joints, self.joints, strict=True)
        )
        return replace(self.tree, joints=joints)
