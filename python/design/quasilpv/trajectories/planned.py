"""Paths with the joints that follow them: what the fit of a trajectory asks, however the kinematics is inverted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement
from quasilpv.trajectories.document import Reference
from quasilpv.trajectories.inverse import JointPath, ToolTask
from quasilpv.trajectories.paths import TaskPath
from quasilpv.trajectories.spatial_paths import SpatialCourse

MIN_SINGULARITY = 0.05


class Kinematics(Protocol):
    """What planning needs of a robot.

    A pose is (X, Y), then the orientation Phi if the tool has one of its own, then the posture of a robot with joints
    to spare: as many coordinates as joints.
    """

    @property
    def name(self) -> str:
        """Identifier in errors and in the trajectory file."""

    @property
    def joints(self) -> int:
        """Number of joints n."""

    @property
    def posture(self) -> tuple[float, ...]:
        """What the coordinates of the pose that no path states are kept at."""

    def forward_kinematics(self, theta: npt.ArrayLike) -> FloatArray:
        """Pose of the tool, as many coordinates as joints."""

    def inverse_kinematics(self, pose: npt.ArrayLike) -> FloatArray:
        """Joint angles (n,); ``InputError`` if the pose is out of reach."""

    def jacobian(self, theta: npt.ArrayLike) -> FloatArray:
        """J, (n, n)."""

    def jacobian_rate_times_speed(self, theta: npt.ArrayLike, omega: npt.ArrayLike) -> FloatArray:
        """J' theta', (n,)."""

    def singularity(self, theta: npt.ArrayLike) -> tuple[str, float]:
        """A quantity in [0, 1] that vanishes with det J, with its name."""


class Planned(Protocol):
    """A path and how joints follow it: what the fit asks for."""

    @property
    def source(self) -> str:
        """Name of the path in errors."""

    @property
    def name(self) -> str:
        """Of the trajectory."""

    @property
    def segment_times_s(self) -> tuple[float, ...]:
        """Where segments start, and the end."""

    def place(self, time_s: float) -> str:
        """Where the tool is at a time, in words."""

    def motion(self, times_s: FloatArray) -> Reference:
        """Of the joints, (times, n)."""

    def errors(self, times_s: FloatArray, angles: FloatArray) -> tuple[float, float]:
        """Largest distance from the path, m, and from orientation and posture, rad, at angles (times, n)."""

    def document(self) -> dict[str, Any]:
        """Path and robot, for the trajectory's record."""


@dataclass(frozen=True, eq=False)
class _InPlane:
    """What is known of a path in the plane before anybody follows it."""

    path: TaskPath
    source: str

    @property
    def name(self) -> str:
        """See `Planned`."""
        return self.path.name

    @property
    def segment_times_s(self) -> tuple[float, ...]:
        """See `Planned`."""
        return self.path.segment_times_s

    def place(self, time_s: float) -> str:
        """See `Planned`."""
        return place_of(self.path, time_s)


@dataclass(frozen=True, eq=False)
class ClosedForm(_InPlane):
    """A path of an arm whose inverse kinematics is a formula."""

    arm: Kinematics

    def motion(self, times_s: FloatArray) -> Reference:
        """See `Planned`."""
        return joint_motion(self.arm, self.path, times_s, self.source)

    def errors(self, times_s: FloatArray, angles: FloatArray) -> tuple[float, float]:
        """See `Planned`."""
        poses = np.array([self.arm.forward_kinematics(angle) for angle in angles])
        turned = np.abs(poses[:, 2:] - np.array([*self.path.orientation, *self.arm.posture]))
        return _distance(self.path, times_s, poses), float(turned.max(initial=0.0))

    def document(self) -> dict[str, Any]:
        """See `Planned`."""
        return {"path": self.path.model_dump(mode="json", exclude_none=True), "robot": self.arm.name}


@dataclass(frozen=True, eq=False)
class PlanarPlan(_InPlane):
    """A path of a planar arm solved by Newton's method."""

    joints: JointPath

    def motion(self, times_s: FloatArray) -> Reference:
        """See `Planned`."""
        at_rest = np.zeros(len(self.path.orientation))
        tasks = []
        for time in times_s:
            task = self.path.evaluate(float(time))
            pose = np.array([*task.position, *self.path.orientation])
            tasks.append(ToolTask(pose, np.append(task.velocity, at_rest), np.append(task.acceleration, at_rest)))
        return self.joints.motion(tasks, lambda i: self.place(times_s[i]))

    def errors(self, times_s: FloatArray, angles: FloatArray) -> tuple[float, float]:
        """See `Planned`."""
        poses = [np.array([*self.path.evaluate(float(t)).position, *self.path.orientation]) for t in times_s]
        away = np.array([self.joints.tool.missing(q, pose) for q, pose in zip(angles, poses, strict=True)])
        return float(np.linalg.norm(away[:, :2], axis=1).max()), float(np.abs(away[:, 2:]).max(initial=0.0))

    def document(self) -> dict[str, Any]:
        """See `Planned`."""
        document = {"path": self.path.model_dump(mode="json", exclude_none=True), "robot": self.joints.tool.name}
        return {**document, "start_posture_rad": self.joints.start.tolist()}


@dataclass(frozen=True, eq=False)
class SpatialPlan:
    """A path of a robot in space."""

    joints: JointPath
    course: SpatialCourse
    source: str

    @property
    def name(self) -> str:
        """See `Planned`."""
        return self.course.path.name

    @property
    def segment_times_s(self) -> tuple[float, ...]:
        """See `Planned`."""
        return self.course.segment_times_s

    def place(self, time_s: float) -> str:
        """See `Planned`."""
        x, y, z = self.course.evaluate(float(time_s)).position
        segment = self.course.segment_at(time_s)
        return f"segments[{segment}] at t = {time_s:.4g} s, (X, Y, Z) = ({x:.4g}, {y:.4g}, {z:.4g}) m"

    def motion(self, times_s: FloatArray) -> Reference:
        """See `Planned`."""
        rows, tasks = len(self.joints.tool.scale), []
        for time in times_s:
            tool = self.course.evaluate(float(time))
            velocity = np.concatenate([tool.velocity, tool.angular_velocity])[:rows]
            acceleration = np.concatenate([tool.acceleration, tool.angular_acceleration])[:rows]
            tasks.append(ToolTask(Placement(tool.rotation, tool.position), velocity, acceleration))
        return self.joints.motion(tasks, lambda i: self.place(times_s[i]))

    def errors(self, times_s: FloatArray, angles: FloatArray) -> tuple[float, float]:
        """See `Planned`."""
        tools = [self.course.evaluate(float(time)) for time in times_s]
        poses = [Placement(tool.rotation, tool.position) for tool in tools]
        away = np.array([self.joints.tool.missing(q, pose) for q, pose in zip(angles, poses, strict=True)])
        turned = np.linalg.norm(away[:, 3:], axis=1)
        return float(np.linalg.norm(away[:, :3], axis=1).max()), float(turned.max(initial=0.0))

    def document(self) -> dict[str, Any]:
        """See `Planned`."""
        return {"path": self.course.path.model_dump(mode="json", exclude_none=True), "robot": self.joints.tool.name}


def joint_motion(arm: Kinematics, path: TaskPath, times_s: FloatArray, source: str) -> Reference:
    """Return angles, speeds and accelerations (times, n) of the exact inverse kinematics, angles without jumps of 2 pi.

    Raises:
        InputError: out of reach or singular (``singularity`` below ``MIN_SINGULARITY``) at one of the times.
    """
    angles, speeds, accelerations = [], [], []
    held = (*path.orientation, *arm.posture)
    at_rest = [0.0] * len(held)
    for time in times_s:
        task = path.evaluate(float(time))
        try:
            theta = arm.inverse_kinematics([*task.position, *held])
        except InputError as error:
            raise InputError(source, place_of(path, time), error.got, error.expected) from error
        measure, value = arm.singularity(theta)
        if not value >= MIN_SINGULARITY:
            expected = f"at least {MIN_SINGULARITY} (the robot is singular when links align)"
            raise InputError(source, place_of(path, time), f"{measure} = {value:.3g}", expected)
        J = arm.jacobian(theta)
        omega = np.linalg.solve(J, [*task.velocity, *at_rest])
        drift = arm.jacobian_rate_times_speed(theta, omega)
        angles.append(theta)
        speeds.append(omega)
        accelerations.append(np.linalg.solve(J, [*task.acceleration, *at_rest] - drift))
    return Reference(np.unwrap(np.array(angles), axis=0), np.array(speeds), np.array(accelerations))


def _distance(path: TaskPath, times_s: FloatArray, poses: FloatArray) -> float:
    positions = np.array([path.evaluate(float(time)).position for time in times_s])
    return float(np.linalg.norm(poses[:, :2] - positions, axis=1).max())


def place_of(path: TaskPath, time_s: float) -> str:
    """Segment, time and position of the tool, in words."""
    x, y = path.evaluate(float(time_s)).position
    return f"segments[{path.segment_at(time_s)}] at t = {time_s:.4g} s, (X, Y) = ({x:.4g}, {y:.4g}) m"
