"""``robot.toml``: what a description of a robot lacks, stated by the person who has the robot.

The schema is in ``docs/reference/robot-toml.md``. Nothing that decides about stability has a default: rotor inertias,
torque limits and the inertia of a payload are asked for by name.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, pi
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from quasilpv.descriptions.described_tree import DescribedJoint, DescribedTree
from quasilpv.descriptions.mjcf import read_mjcf
from quasilpv.descriptions.safe_xml import read_xml, root_of
from quasilpv.descriptions.stated_drive import DriveKeys, drive_of
from quasilpv.descriptions.urdf import read_urdf
from quasilpv.documents.programs import MAX_JOINTS
from quasilpv.documents.strict_model import FieldError, StrictModel, validate
from quasilpv.errors import InputError, one_of
from quasilpv.files import read_bytes
from quasilpv.systems.robots.spatial import Placement
from quasilpv.systems.robots.spatial_robot import PayloadBody, SpatialJoint, SpatialRobot
from quasilpv.systems.robots.tree import JointKind

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]
Interval = tuple[float, float]

ORIENTATIONS: Mapping[str, tuple[tuple[float, float, float], float]] = {
    "floor": ((1.0, 0.0, 0.0), 0.0),
    "ceiling": ((1.0, 0.0, 0.0), pi),
    "wall": ((0.0, 1.0, 0.0), pi / 2.0),
}
"""Axis and angle by which the base is turned from standing on the floor; on the wall its z axis is horizontal."""

MOST_BYTES = 1 << 20


class Base(StrictModel):
    """How the base stands: gravity in m/s^2, and the base's orientation by name or as roll, pitch and yaw in rad."""

    gravity: NonNegative = 9.81
    orientation: Literal["floor", "wall", "ceiling"] | tuple[float, float, float] = "floor"


class Joint(DriveKeys):
    """What is stated of one joint; SI units, angles in rad (m for a joint that slides)."""

    angle: Interval | None = None
    speed: Positive | None = None
    torque: Positive | None = None
    slew: Positive | None = None
    rotor_inertia: NonNegative | None = None
    rotor_tolerance: Share = 0.0
    encoder_bits: int | None = Field(default=None, ge=8, le=32)
    friction_viscous: NonNegative = 0.0
    friction_coulomb: NonNegative = 0.0
    friction_breakaway: NonNegative = 0.0
    motion_angle: Interval | None = None
    motion_speed: Positive | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.angle is not None and not self.angle[0] < self.angle[1]:
            raise FieldError("angle", list(self.angle), "a lower bound below the upper bound")
        sticks = self.friction_breakaway > 0.0
        if sticks and (self.friction_coulomb == 0.0 or self.friction_breakaway < self.friction_coulomb):
            expected = "at least friction_coulomb, which is to be stated with it; or 0 for a joint that does not stick"
            raise FieldError("friction_breakaway", self.friction_breakaway, expected)
        if self.motion_angle is not None and not self.motion_angle[0] < self.motion_angle[1]:
            raise FieldError("motion_angle", list(self.motion_angle), "a lower bound below the upper bound")
        return self


class Payload(StrictModel):
    """Every load the robot may carry: up to a mass, its centre of mass in a box of the tool's frame, its inertia.

    ``inertia`` bounds the moment of inertia about the load's centre of mass: one number for all axes, or three.
    """

    mass: Positive
    com_box: tuple[Interval, Interval, Interval]
    inertia: NonNegative | tuple[NonNegative, NonNegative, NonNegative]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for i, (low, high) in enumerate(self.com_box):
            if low > high:
                raise FieldError(f"com_box[{i}]", [low, high], "a lower bound that is not above the upper bound")
        return self


class Uncertainty(StrictModel):
    """By which share the inertia of every link may differ from the description, up and down."""

    links: Share = 0.0


class RobotFile(StrictModel):
    """The whole file."""

    description: str
    tip_link: str | None = None
    base: Base = Base()
    locked: dict[str, float] = Field(default_factory=dict)
    joints: dict[str, Joint] = Field(default_factory=dict)
    payload: Payload | None = None
    uncertainty: Uncertainty = Uncertainty()
    delay: tuple[NonNegative, NonNegative] | NonNegative = 0.0
    lag: tuple[NonNegative, NonNegative] | NonNegative = 0.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("delay", "lag"):
            low, high = _interval(getattr(self, name))
            if low > high:
                raise FieldError(name, [low, high], "a lower bound that is not above the upper bound")
        return self


@dataclass(frozen=True)
class RobotSource:
    """A robot file with what it names.

    Attributes:
        path: of the robot file.
        stated: its content.
        described: what the description says.
    """

    path: Path
    stated: RobotFile
    described: DescribedTree

    def robot(self) -> SpatialRobot:
        """The robot.

        Raises:
            InputError: something that decides about stability is stated nowhere, or contradicts the description.
        """
        source, stated = str(self.path), self.stated
        tip = self.described.tip(stated.tip_link)
        moving = self.described.moving(tip, stated.locked)
        names = [joint.name for joint in moving]
        for name in stated.joints:
            if name not in names:
                raise InputError(source, f"joints.{name}", name, one_of(names, name))
        if len(names) > MAX_JOINTS:
            expected = f"at most {MAX_JOINTS}: lock some by name, or choose another tip_link"
            raise InputError(source, "joints", f"{len(names)} joints", expected)
        joints = tuple(_joint(source, described, stated.joints.get(described.name, Joint())) for described in moving)
        _require_one_kind(source, joints)
        chain = self.described.chain(tip, stated.locked, {joint.name: joint.angle_rad for joint in joints})
        driven = tuple(
            replace(own, rotor_inertia_kg_m2=joint.rotor_inertia_kg_m2)
            for own, joint in zip(chain.joints, joints, strict=True)
        )
        tree = replace(chain, joints=driven, gravity_m_s2=_gravity(stated.base))
        return SpatialRobot(
            id=self.path.stem,
            tree=tree,
            joints=joints,
            payload=_payload(stated.payload),
            link_uncertainty=stated.uncertainty.links,
            delay_s=_interval(stated.delay),
            lag_s=_interval(stated.lag),
            source=source,
        )

    def places(self) -> dict[str, tuple[int, Placement]]:
        """For every link of the description the joint of the robot it moves with (-1: the base), and its place there.

        Raises:
            InputError: as for `robot`.
        """
        limits = {joint.name: joint.angle_rad for joint in self.robot().joints}
        return self.described.places(self.described.tip(self.stated.tip_link), self.stated.locked, limits)


def read_robot_file(path: Path) -> RobotSource:
    """A robot file and its description.

    Args:
        path: of a ``robot.toml``.

    Raises:
        InputError: the file cannot be read, is no TOML, breaks a rule of the schema, or its description does.
    """
    content = read_bytes(path)
    if len(content) > MOST_BYTES:
        raise InputError(str(path), "size", f"{len(content)} bytes", f"at most {MOST_BYTES}")
    try:
        document = tomllib.loads(content.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(str(path), "file", error, "TOML in UTF-8") from error
    stated = validate(RobotFile, document, str(path))
    described = (path.parent / stated.description).resolve()
    return RobotSource(path, stated, read_description(described))


def read_description(path: Path) -> DescribedTree:
    """A description in either format, told apart by its root element.

    Raises:
        InputError: it is neither, or its reader refuses it.
    """
    root = root_of(path, read_xml(path))
    if root.tag == "mujoco":
        return read_mjcf(path)
    if root.tag == "robot":
        return read_urdf(path)
    raise InputError(str(path), "root element", root.tag, "robot (URDF) or mujoco (MJCF)")


def _joint(source: str, described: DescribedJoint, stated: Joint) -> SpatialJoint:
    """What file and description say of a joint together; silence where it matters is refused."""
    place = f"joints.{described.name}"

    def required(name: str, own: float | None, other: float | None, expected: str) -> float:
        value = own if own is not None else other
        if value is None:
            raise InputError(source, f"{place}.{name}", "nothing", expected)
        return value

    rotor = required(
        "rotor_inertia",
        stated.rotor_inertia,
        described.rotor_inertia_kg_m2,
        "the rotor's inertia times the gear ratio squared, kg m^2 (data sheet of the drive); 0 only for direct drive",
    )
    drive = drive_of(source, place, stated, rotor)
    torque = required("torque", stated.torque, described.torque, "the largest torque of the drive, N m")
    speed = required("speed", stated.speed, described.speed, "the largest speed of the joint, rad/s")
    angle = _angles(source, place, described, stated)
    _check_motion(source, place, stated, angle, speed)
    return SpatialJoint(
        name=described.name,
        angle_rad=angle,
        speed_rad_s=speed,
        torque_nm=torque,
        slew_nm_per_s=stated.slew if stated.slew is not None else inf,
        rotor_inertia_kg_m2=rotor,
        rotor_tolerance=stated.rotor_tolerance,
        encoder_bits=stated.encoder_bits,
        friction_viscous_nm_s=stated.friction_viscous,
        friction_coulomb_nm=stated.friction_coulomb,
        motion_angle_rad=stated.motion_angle,
        motion_speed_rad_s=stated.motion_speed,
        drive=drive,
        friction_breakaway_nm=stated.friction_breakaway,
    )


def _require_one_kind(source: str, joints: Sequence[SpatialJoint]) -> None:
    """Refuse arms that are rigid in some joints only, or whose encoders sit on several sides."""
    sides = [None if joint.drive is None else joint.drive.encoder_side for joint in joints]
    for joint, side in zip(joints, sides, strict=True):
        if side != sides[0]:
            expected = "all joints rigid, or all elastic with their encoders on the same side"
            raise InputError(source, f"joints.{joint.name}.stiffness", "joints of several kinds", expected)


def _check_motion(source: str, place: str, stated: Joint, angle: Interval, speed: float) -> None:
    """The motions a proof holds for are among those the joint can make."""
    motion = stated.motion_angle
    if motion is not None and not angle[0] <= motion[0] < motion[1] <= angle[1]:
        expected = f"an interval inside the joint's [{angle[0]:g}, {angle[1]:g}]"
        raise InputError(source, f"{place}.motion_angle", list(motion), expected)
    if stated.motion_speed is not None and stated.motion_speed > speed:
        raise InputError(source, f"{place}.motion_speed", stated.motion_speed, f"at most the joint's {speed:g}")


def _angles(source: str, place: str, described: DescribedJoint, stated: Joint) -> Interval:
    """The stated interval inside the described one, or the described one."""
    low, high = described.lower, described.upper
    if stated.angle is not None:
        slack = 1e-9 * max(1.0, abs(stated.angle[0]), abs(stated.angle[1]))
        bounded = described.kind is not JointKind.CONTINUOUS and low < high
        if bounded and (stated.angle[0] < low - slack or stated.angle[1] > high + slack):
            expected = f"an interval inside the description's [{low:g}, {high:g}]"
            raise InputError(source, f"{place}.angle", list(stated.angle), expected)
        return stated.angle
    if described.kind is JointKind.CONTINUOUS:
        return (-2.0 * pi, 2.0 * pi)
    if not (-inf < low < high < inf):
        raise InputError(source, f"{place}.angle", "nothing", "an interval: the description has no usable one")
    return (low, high)


def _gravity(base: Base) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Gravity in the axes of the base."""
    down = np.array([0.0, 0.0, -base.gravity])
    if isinstance(base.orientation, str):
        axis, angle = ORIENTATIONS[base.orientation]
        return np.asarray(Placement.turned(axis, angle).rotation.T @ down)
    roll, pitch, yaw = base.orientation
    turned = Placement.turned((0.0, 0.0, 1.0), yaw).then(Placement.turned((0.0, 1.0, 0.0), pitch))
    return np.asarray(turned.then(Placement.turned((1.0, 0.0, 0.0), roll)).rotation.T @ down)


def _payload(stated: Payload | None) -> PayloadBody | None:
    if stated is None:
        return None
    inertia = stated.inertia if isinstance(stated.inertia, tuple) else (stated.inertia,) * 3
    return PayloadBody(stated.mass, stated.com_box, inertia)


def _interval(stated: float | tuple[float, float]) -> Interval:
    return stated if isinstance(stated, tuple) else (0.0, stated)
