"""Random robots in space, and the same robots in Pinocchio."""

import numpy as np
import pinocchio as pin

from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    axis = rng.normal(size=3)
    return Placement.turned(axis / np.linalg.norm(axis), rng.uniform(-np.pi, np.pi)).rotation


def random_body(rng: np.random.Generator, size_m: float = 0.3) -> SpatialInertia:
    """Six point masses: a body by construction."""
    points, masses = rng.uniform(-size_m, size_m, (6, 3)), rng.uniform(0.1, 2.0, 6)
    first = masses @ points
    rotational = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    return SpatialInertia(float(masses.sum()), first, rotational)


def random_tree(rng: np.random.Generator, n: int, *, sliding: float = 0.2) -> KinematicTree:
    """A chain of n joints with oblique axes, about one in five of them prismatic."""
    joints = []
    for k in range(n):
        axis = rng.normal(size=3)
        kind = JointKind.PRISMATIC if rng.uniform() < sliding else JointKind.REVOLUTE
        low, high = np.sort(rng.uniform(-3.0, 3.0, 2))
        joints.append(
            TreeJoint(
                name=f"joint{k + 1}",
                kind=kind,
                placement=Placement(random_rotation(rng), rng.uniform(-0.5, 0.5, 3)),
                axis=axis / np.linalg.norm(axis),
                inertia=random_body(rng),
                rotor_inertia_kg_m2=float(rng.uniform(0.0, 0.5)),
                lower=float(low),
                upper=float(high) + 0.1,
            )
        )
    tool = Placement(random_rotation(rng), rng.uniform(-0.2, 0.2, 3))
    return KinematicTree("random", tuple(joints), tool, rng.normal(size=3) * 9.81)


def coordinates(tree: KinematicTree, rng: np.random.Generator, count: int) -> np.ndarray:
    """Within the limits, corners included now and then."""
    lower, upper = np.array([j.lower for j in tree.joints]), np.array([j.upper for j in tree.joints])
    inside = rng.uniform(lower, upper, (count, tree.order))
    corners = np.where(rng.uniform(size=inside.shape) < 0.5, lower, upper)
    return np.where(rng.uniform(size=(count, 1)) < 0.2, corners, inside)


def pinocchio_tree(tree: KinematicTree) -> pin.Model:
    """The same robot, its tool as the frame "tool"."""
    model = pin.Model()
    parent = 0
    for joint in tree.joints:
        make = pin.JointModelRevoluteUnaligned if joint.turns else pin.JointModelPrismaticUnaligned
        placement = pin.SE3(joint.placement.rotation, joint.placement.translation_m)
        parent = model.addJoint(parent, make(joint.axis), placement, joint.name)
        body = joint.inertia
        model.appendBodyToJoint(
            parent, pin.Inertia(body.mass_kg, body.com_m, body.about_its_com_kg_m2), pin.SE3.Identity()
        )
        model.armature[-1] = joint.rotor_inertia_kg_m2
    model.gravity.linear[:] = tree.gravity_m_s2
    tool = pin.SE3(tree.tool.rotation, tree.tool.translation_m)
    model.addFrame(pin.Frame("tool", parent, tool, pin.FrameType.OP_FRAME))
    return model
