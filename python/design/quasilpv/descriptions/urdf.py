"""URDF, read by Pinocchio: it merges fixed links and knows the format's corners; its XML is looked at for the rest.

What a URDF cannot say: rotor inertias (`<transmission>` has no unit anybody keeps to), and gravity, which is -z of the
base link here.
"""

from __future__ import annotations

from math import inf, isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.descriptions.described_tree import BASE, DescribedJoint, DescribedTree
from quasilpv.descriptions.library_output import captured_stderr
from quasilpv.descriptions.safe_xml import read_xml, root_of
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind

GRAVITY_M_S2 = 9.81
FASTEST = 1000.0
"""A larger speed limit, rad/s, is a way to say that there is none."""


def read_urdf(path: Path) -> DescribedTree:
    """What a URDF file says.

    Raises:
        InputError: `pin` is not installed, the file cannot be read, is no URDF, or asks for what only xacro can do.
    """
    pin = _pinocchio(path)
    text = read_xml(path)
    root = root_of(path, text)
    if root.tag != "robot":
        raise InputError(str(path), "root element", root.tag, "robot")
    if is_xacro(root):
        raise InputError(str(path), "file", "xacro macros", "a URDF: expand a trusted file with --trust-xacro")
    model = _built(pin, path, text)
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY_M_S2])
    written = {element.get("name", ""): element for element in root.findall("joint")}
    joints = tuple(_joint(pin, model, k, written) for k in range(1, model.njoints))
    frames = {
        frame.name: (frame.parentJoint - 1, _placement(frame.placement))
        for frame in model.frames
        if frame.type == pin.FrameType.BODY
    }
    return DescribedTree(str(path), model.name, joints, frames, np.array(model.gravity.linear))


def is_xacro(root: ElementTree.Element) -> bool:
    """Whether joints and links of a file come from macros or expressions that have not been evaluated."""
    if any(element.tag.endswith(("}macro", "}include", "}property", "}arg", "}if", "}unless")) for element in root):
        return True
    elements = [*root.findall("joint"), *root.findall("link")]
    written = (value for element in elements for part in element.iter() for value in part.attrib.values())
    return any("${" in value for value in written)


def _built(pin: Any, path: Path, text: str) -> Any:
    """The library's model; what it prints on stderr becomes the reason of a refusal."""
    with captured_stderr() as said:
        try:
            model = pin.buildModelFromXML(text)
        except Exception as error:  # whatever the library throws at a text it cannot take
            reason = said() or str(error).strip() or type(error).__name__
            raise InputError(str(path), "file", reason, "a URDF") from error
        if said():  # it goes on without what it could not read, an inertia for example
            raise InputError(str(path), "file", said(), "a URDF")
        return model


def _pinocchio(path: Path) -> Any:
    try:
        import pinocchio  # noqa: PLC0415 -- heavy, and an extra
    except ImportError as error:
        expected = "Pinocchio, which reads URDF: pip install 'quasilpv[robots]'"
        raise InputError(str(path), "library pin", "not installed", expected) from error
    return pinocchio


def _placement(se3: Any) -> Placement:
    return Placement(np.array(se3.rotation), np.array(se3.translation))


def _joint(pin: Any, model: Any, k: int, written: dict[str, ElementTree.Element]) -> DescribedJoint:
    name, joint, inertia = model.names[k], model.joints[k], model.inertias[k]
    element = written.get(name, ElementTree.Element("joint"))
    limit = element.find("limit")
    kind = _KINDS.get(element.get("type", ""))
    lower, upper = -inf, inf
    if kind is not None and kind is not JointKind.CONTINUOUS and limit is not None:
        lower, upper = float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
    mimic = element.find("mimic")
    dynamics = element.find("dynamics")
    child = element.find("child")
    return DescribedJoint(
        name=name,
        body="" if child is None else child.get("link", ""),
        parent=model.parents[k] - 1 if model.parents[k] else BASE,
        kind=kind,
        written_kind=element.get("type", joint.shortname()),
        placement=_placement(model.jointPlacements[k]),
        axis=_axis(pin, model, k) if kind is not None else np.array([0.0, 0.0, 1.0]),
        inertia=SpatialInertia.about_com(float(inertia.mass), np.array(inertia.lever), np.array(inertia.inertia)),
        lower=lower,
        upper=upper,
        speed=_usable(limit, "velocity", FASTEST),
        torque=_usable(limit, "effort", inf),
        damping_nm_s=_stated(dynamics, "damping"),
        friction_nm=_stated(dynamics, "friction"),
        follows=None if mimic is None else mimic.get("joint", ""),
    )


_KINDS = {
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.CONTINUOUS,
    "prismatic": JointKind.PRISMATIC,
}


def _axis(pin: Any, model: Any, k: int) -> FloatArray:
    """The axis as Pinocchio moves along it: the twist of the body at unit speed."""
    data = model.createData()
    speed = np.zeros(model.nv)
    speed[model.joints[k].idx_v] = 1.0
    pin.forwardKinematics(model, data, pin.neutral(model), speed)
    parent = model.parents[k]
    twist = data.v[k] - data.liMi[k].actInv(data.v[parent])
    moved = np.array(twist.angular) + np.array(twist.linear)
    return np.asarray(moved / np.linalg.norm(moved))


def _usable(limit: ElementTree.Element | None, attribute: str, largest: float) -> float | None:
    """A limit that limits: files write 0 and very large numbers where they know none."""
    value = _stated(limit, attribute)
    return value if value is not None and isfinite(value) and 0.0 < value < largest else None


def _stated(element: ElementTree.Element | None, attribute: str) -> float | None:
    text = None if element is None else element.get(attribute)
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
