"""A robot with elastic joints in MuJoCo: two bodies per joint, a motor and a link, with a spring and a damper between.

Written from the chain itself; it shares no equation with the plant. A motor stands on the ground and turns about an
axis of its own, since rotors turn about their joints only; a tendon ties its angle to the link's.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.tree import KinematicTree, TreeJoint
from reference.elastic_tree import ElasticArm


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _link(parent: ElementTree.Element, joint: TreeJoint) -> ElementTree.Element:
    quaternion, about_com = np.zeros(4), joint.inertia.about_its_com_kg_m2
    mujoco.mju_mat2Quat(quaternion, joint.placement.rotation.ravel())
    place = {"pos": _numbers(joint.placement.translation_m), "quat": _numbers(quaternion)}
    body = ElementTree.SubElement(parent, "body", {"name": f"{joint.name}-link", **place})
    moments = [*np.diag(about_com), about_com[0, 1], about_com[0, 2], about_com[1, 2]]
    inertial = {"pos": _numbers(joint.inertia.com_m), "mass": repr(float(joint.inertia.mass_kg))}
    ElementTree.SubElement(body, "inertial", {**inertial, "fullinertia": _numbers(moments)})
    ElementTree.SubElement(body, "joint", {"name": f"{joint.name}-link", "axis": _numbers(joint.axis)})
    return body


def _motor(ground: ElementTree.Element, name: str, inertia: float, viscous: float) -> None:
    body = ElementTree.SubElement(ground, "body", {"name": f"{name}-motor"})
    moments = _numbers([inertia] * 3)
    ElementTree.SubElement(body, "inertial", {"pos": "0 0 0", "mass": "1", "diaginertia": moments})
    ElementTree.SubElement(body, "joint", {"name": f"{name}-motor", "axis": "0 0 1", "damping": repr(viscous)})


def _gear(tendons: ElementTree.Element, name: str, stiffness: float, damping: float) -> None:
    spring = {"stiffness": repr(stiffness), "damping": repr(damping), "springlength": "0"}
    gear = ElementTree.SubElement(tendons, "fixed", spring)
    for side, share in (("motor", "1"), ("link", "-1")):
        ElementTree.SubElement(gear, "joint", {"joint": f"{name}-{side}", "coef": share})


def model(arm: ElasticArm) -> Any:
    """The compiled robot: links first, then motors; Runge-Kutta of order 4."""
    tree: KinematicTree = arm.tree
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", {"angle": "radian"})
    option = ElementTree.SubElement(root, "option", {"gravity": _numbers(tree.gravity_m_s2), "integrator": "RK4"})
    ElementTree.SubElement(option, "flag", {"constraint": "disable"})
    ground = ElementTree.SubElement(root, "worldbody")
    body = ground
    for joint in tree.joints:
        body = _link(body, joint)
    tendons = ElementTree.SubElement(root, "tendon")
    numbers = zip(arm.rotors, arm.viscous, arm.stiffness, arm.damping, strict=True)
    for joint, (inertia, viscous, stiffness, damping) in zip(tree.joints, numbers, strict=True):
        _motor(ground, joint.name, float(inertia), float(viscous))
        _gear(tendons, joint.name, float(stiffness), float(damping))
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def motion(arm: ElasticArm, start: FloatArray, torques: FloatArray, period_s: float, steps: int) -> FloatArray:
    """Angles of links and motors at the samples, (N + 1, 2 n), from rest at `start` under held torques (N, n)."""
    compiled = model(arm)
    data, n = mujoco.MjData(compiled), torques.shape[1]
    compiled.opt.timestep = period_s / steps
    data.qpos[:] = start
    angles = [data.qpos.copy()]
    for torque in torques:
        data.qfrc_applied[n:] = torque
        data.qacc_warmstart[:] = 0.0
        mujoco.mj_step(compiled, data, steps)
        angles.append(data.qpos.copy())
    return np.array(angles)
