"""A robot in space with all that a design needs to know of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from quasilpv.systems.robots.spatial import SpatialInertia
from quasilpv.systems.robots.tree import KinematicTree

Interval = tuple[float, float]


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

    def central(self, share: float) -> SpatialInertia:
        """The load in the middle of the box with a share of mass and moment of inertia."""
        middle = [(low + high) / 2.0 for low, high in self.com_box_m]
        return SpatialInertia.about_com(self.mass_kg * share, middle, share * np.diag(self.inertia_kg_m2))


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
    """

    id: str
    tree: KinematicTree
    joints: tuple[SpatialJoint, ...]
    payload: PayloadBody | None
    link_uncertainty: float
    delay_s: Interval
    lag_s: Interval
    source: str

    def payloads_document(self) -> dict[str, Any]:
        """The member ``payloads`` of an artifact: all robots between `lightest` and `heaviest`."""
        tool, load = self.tree.tool, self.payload
        return {
            "link_tolerance": self.link_uncertainty,
            "rotor_tolerance": [joint.rotor_tolerance for joint in self.joints],
            "load": None
            if load is None
            else {
                "rotation": tool.rotation.tolist(),
                "translation_m": tool.translation_m.tolist(),
                "mass_kg": load.mass_kg,
                "com_box_m": [list(interval) for interval in load.com_box_m],
                "inertia_kg_m2": list(load.inertia_kg_m2),
            },
        }

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
