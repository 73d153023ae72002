"""Bounds and storages of a planar serial arm's inertia, for the proof by `certificate.robot.planar_chain`.

The arm is written as the chain in a vertical plane of space that its docstring describes. Across the plane, where no
twist of it leads, the inertias are made up: only what lies in the plane is shipped.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.synthesis.chain_storages import InertiaPairing, Side, find_storages
from quasilpv.systems.robots.arm_parameters import Link
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import Robot
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint

FEWEST_JOINTS = 5
"""Of an arm whose range is proved by a chain: below, branch and bound over postures takes seconds, and is tighter."""

IN_PLANE = np.ix_((0, 2, 4), (0, 2, 4))
ACROSS = np.diag([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
FRACTIONS = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)


def planar_chain_witness(robot: Robot, scale: float) -> dict[str, Any]:
    """The member ``chain`` of a witness; nothing for robots whose range is proved otherwise.

    Args:
        robot: what is designed for.
        scale: s of the design inertia s M.

    Raises:
        InfeasibleError: the solver has no answer.
    """
    arm = robot.model
    if not isinstance(arm, PlanarSerialArm) or arm.joints < FEWEST_JOINTS:
        return {}
    began = time.perf_counter()
    sides = {side: _side(robot, arm, side, scale) for side in ("lowest", "highest")}
    return {"chain": {**sides, "seconds_to_find": time.perf_counter() - began}}


def _side(robot: Robot, arm: PlanarSerialArm, side: Side, scale: float) -> dict[str, Any]:
    # Whatever makes the form positive across the plane: c ACROSS - 0, or 10 ACROSS - c 0.
    design = np.array([_in_plane(link) for link in arm.links]) + (ACROSS if side == "highest" else 0.1 * ACROSS)
    across = 0.0 if side == "highest" else 10.0
    chain, none = _chain(robot, arm), np.zeros(arm.joints)
    bounds, storages = [], []
    for bodies in _loaded_bodies(robot, arm):
        true = [(body + across * ACROSS)[None] for body in bodies]
        found = find_storages(InertiaPairing(chain, design, none, true, none), side)
        if found is None:
            raise InfeasibleError(f"{robot.id}: no bounds of the inertia were found: the solver has no answer")
        first, *others = found.matrices
        bounds.append(found.bound)
        storages.append([first.tolist(), *(storage[IN_PLANE].tolist() for storage in others)])
    # What is proved at a bound holds beyond it with the same storages.
    return {"bound": (max if side == "highest" else min)(bounds) / scale, "storages": storages}


def _in_plane(link: Link) -> FloatArray:
    """6 x 6 about the link's joint, zero across the plane."""
    body = np.zeros((6, 6))
    moment = link.mass_kg * link.com_m
    body[IN_PLANE] = [[link.mass_kg, 0.0, -moment], [0.0, link.mass_kg, 0.0], [-moment, 0.0, link.inertia_kg_m2]]
    return body


def _loaded_bodies(robot: Robot, arm: PlanarSerialArm) -> FloatArray:
    """Bernstein coefficients of all links' inertias in the payload fraction, (4, n, 6, 6), from their values."""
    # A cubic through its values at FRACTIONS, b = B^-1 v.
    powers = np.array(FRACTIONS)[:, None]
    orders = np.arange(4)
    bernstein = np.array([1.0, 3.0, 3.0, 1.0]) * powers**orders * (1.0 - powers) ** (3 - orders)
    loaded = [robot.with_payload_fraction(fraction) for fraction in FRACTIONS]
    values = np.array([[_in_plane(link) for link in model.links] for model in loaded])  # type: ignore[attr-defined]
    return np.linalg.solve(bernstein, values.reshape(4, -1)).reshape(values.shape)


def _chain(robot: Robot, arm: PlanarSerialArm) -> KinematicTree:
    """The joints, on massless bodies."""
    lengths = [0.0, *(link.length_m for link in arm.links[:-1])]
    joints = tuple(
        TreeJoint(
            f"joint{k + 1}",
            JointKind.REVOLUTE,
            Placement(np.eye(3), np.array([0.0, 0.0, -length])),
            np.array([0.0, -1.0, 0.0]),
            SpatialInertia.zero(),
            0.0,
            *robot.domain.angle_rad[k],
        )
        for k, length in enumerate(lengths)
    )
    return KinematicTree(arm.name, joints, Placement.identity(), np.zeros(3))
