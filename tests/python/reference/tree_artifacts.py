"""Small robots in space with all that a design needs, and artifacts of laws for them that nobody has proved."""

from typing import Any

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.spatial_robot import PayloadBody, SpatialJoint, SpatialRobot
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint
from quasilpv.systems.robots.tree_mechanism import TreeMechanism

LOAD = PayloadBody(1.0, ((-0.02, 0.02), (0.0, 0.0), (0.02, 0.06)), (0.002, 0.002, 0.001))


def small_robot(*, coulomb_nm: float = 0.0, links: float = 0.0, rotors: float = 0.0) -> SpatialRobot:
    """Three joints: a base that turns, a shoulder, an elbow."""
    axes = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0])
    offsets = ([0.0, 0.0, 0.1], [0.0, 0.08, 0.05], [0.0, 0.0, 0.35])
    limits = ((-3.0, 3.0), (-1.5, 1.5), (-2.2, 2.2))
    joints = tuple(
        TreeJoint(
            name=f"joint{k + 1}",
            kind=JointKind.REVOLUTE,
            placement=Placement(np.eye(3), np.array(offset)),
            axis=np.array(axis),
            inertia=SpatialInertia.about_com(3.0 - 0.8 * k, [0.0, 0.01, 0.12], np.diag([0.03, 0.03, 0.01])),
            rotor_inertia_kg_m2=0.05,
            lower=low,
            upper=high,
        )
        for k, (axis, offset, (low, high)) in enumerate(zip(axes, offsets, limits, strict=True))
    )
    stated = tuple(
        SpatialJoint(f"joint{k + 1}", limits[k], 3.0, torque, 1e5, 0.05, rotors, 20, 0.1, coulomb_nm)
        for k, torque in enumerate((40.0, 60.0, 30.0))
    )
    tool = Placement(np.eye(3), np.array([0.0, 0.0, 0.3]))
    tree = KinematicTree("small", joints, tool, np.array([0.0, 0.0, -9.81]))
    return SpatialRobot("small", tree, stated, LOAD, links, (0.0, 0.0), (0.0, 0.0), "test")


def tree_artifact(tree: KinematicTree, law: dict[str, Any], *, torque_nm: float = 1e3) -> Artifact:
    """An artifact of a law whose design inertia is the tree itself."""
    n = tree.order
    nothing = (0.0,) * n
    document = TreeMechanism(tree, nothing, nothing).parameters_document()
    return Artifact.from_document(
        {
            "schema": "quasilpv.artifact",
            "schema_version": 2,
            "name": "test",
            "creator": {"tool": "test", "version": "0"},
            "design_hash": "0" * 64,
            "units": "SI",
            "sample_period_s": 1e-3,
            "joints": n,
            "robot": {"id": tree.name, "parameters": document},
            "payloads": {"link_tolerance": 0.0, "rotor_tolerance": [0.0] * n, "load": None},
            "domain": {"angle_rad": [[-7.0, 7.0]] * n, "speed_rad_s": [[-20.0, 20.0]] * n},
            "limits": {"torque_nm": [torque_nm] * n, "slew_nm_per_s": [1e9] * n},
            "programs": {},
            "law": {**law, "inertia": document},
            "witness": None,
            "verification": None,
        }
    )
