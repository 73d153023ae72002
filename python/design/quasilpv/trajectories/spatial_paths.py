"""Task-space paths in three dimensions: what the tool of an arm does in space, and when.

A path starts where the tool of the arm is in a given posture, so that its start is in reach and its branch of the
inverse kinematics is chosen. Its segments are straight lines and circular arcs; during each, the tool keeps its
orientation or turns by a rotation vector. Each starts and ends at rest, with the septic time law of
`quasilpv.trajectories.paths`. Frame: the base of the robot, metres and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from quasilpv.arrays import FloatArray
from quasilpv.documents.strict_model import FieldError, StrictModel
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement
from quasilpv.trajectories.paths import MAX_DURATION_S, Duration, read_model, septic

Vector3 = tuple[float, float, float]


class ToolMotion(NamedTuple):
    """The tool at one instant, in the axes of the base.

    Linear: position, m, velocity, acceleration. Angular: rotation matrix, angular velocity, rad/s, and acceleration.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    rotation: FloatArray
    angular_velocity: FloatArray
    angular_acceleration: FloatArray


class SpatialLine(StrictModel):
    """A straight line from the current point: exactly one of ``to``, a point, and ``by``, a vector."""

    to: Vector3 | None = None
    by: Vector3 | None = None
    duration_s: Duration

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        _require_one("to", self.to, "by", self.by)
        return self


class SpatialArc(StrictModel):
    """A circular arc about an axis through a centre, counter-clockwise seen from the tip of the axis.

    Exactly one of ``centre``, a point, and ``centre_by``, a vector from the current point, is given; the centre is
    moved along the axis into the plane of the current point.
    """

    centre: Vector3 | None = None
    centre_by: Vector3 | None = None
    axis: Vector3
    angle_rad: float
    duration_s: Duration

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_one("centre", self.centre, "centre_by", self.centre_by)
        if not 1e-6 < math.hypot(*self.axis) < 1e6:
            raise FieldError("axis", list(self.axis), "a direction")
        return self


class SpatialSegment(StrictModel):
    """One segment: a line or an arc, and the rotation vector by which the tool turns meanwhile, in the base's axes."""

    line: SpatialLine | None = None
    arc: SpatialArc | None = None
    turn_rad: Vector3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        _require_one("line", self.line, "arc", self.arc)
        return self

    @property
    def duration_s(self) -> float:
        """Time the segment takes."""
        given = self.line or self.arc
        assert given is not None
        return given.duration_s


class SpatialPath(StrictModel):
    """A named path of the tool in space.

    With the orientation ``free`` only the tool's position follows the path, and turns are refused.
    """

    name: Annotated[str, Field(min_length=1)]
    start_posture_rad: Annotated[tuple[float, ...], Field(min_length=1)]
    orientation: Literal["held", "free"] = "held"
    segments: Annotated[tuple[SpatialSegment, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for i, segment in enumerate(self.segments):
            if self.orientation == "free" and any(segment.turn_rad):
                raise FieldError(f"segments[{i}].turn_rad", list(segment.turn_rad), "no turn of a free orientation")
        if self.duration_s > MAX_DURATION_S:
            raise FieldError("segments", f"{self.duration_s} s in all", f"at most {MAX_DURATION_S} s")
        return self

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return sum(segment.duration_s for segment in self.segments)

    def from_pose(self, start: Placement) -> SpatialCourse:
        """The path of a tool that starts at a pose.

        Raises:
            InputError: an arc without a radius.
        """
        course = SpatialCourse(self, start)
        course.evaluate(0.0)
        return course


@dataclass(frozen=True, eq=False)
class SpatialCourse:
    """A path in space with its start: where the tool is at every time."""

    path: SpatialPath
    start: Placement

    @cached_property
    def segment_times_s(self) -> tuple[float, ...]:
        """The times at which segments start, and the end of the last one."""
        times = [0.0]
        for segment in self.path.segments:
            times.append(times[-1] + segment.duration_s)
        return tuple(times)

    @cached_property
    def _pieces(self) -> tuple[tuple[_Line | _Arc, FloatArray], ...]:
        """Every segment's curve, and the orientation the tool has at its start."""
        pieces: list[tuple[_Line | _Arc, FloatArray]] = []
        point, rotation = self.start.translation_m, self.start.rotation
        for i, segment in enumerate(self.path.segments):
            curve = self._curve(segment, point, i)
            pieces.append((curve, rotation))
            point, rotation = curve.evaluate(1.0)[0], _turned(segment.turn_rad, 1.0) @ rotation
        return tuple(pieces)

    def _curve(self, segment: SpatialSegment, point: FloatArray, index: int) -> _Line | _Arc:
        if segment.line is not None:
            line = segment.line
            return _Line(point, np.array(line.by) if line.to is None else np.array(line.to) - point)
        arc = segment.arc
        assert arc is not None
        axis = np.array(arc.axis) / np.linalg.norm(arc.axis)
        stated = point + np.array(arc.centre_by) if arc.centre is None else np.array(arc.centre)
        centre = stated + axis * (axis @ (point - stated))
        radial = point - centre
        if not np.linalg.norm(radial) > 0.0:
            field, expected = f"segments[{index}].arc.centre", "a centre away from the arc's start"
            raise InputError(self.path.name, field, stated.tolist(), expected)
        return _Arc(centre, radial, np.cross(axis, radial), arc.angle_rad)

    def segment_at(self, time_s: float) -> int:
        """Index of the segment under way at a time; the first before 0, the last after the end."""
        found = int(np.searchsorted(self.segment_times_s, time_s, side="right")) - 1
        return min(max(found, 0), len(self.path.segments) - 1)

    def evaluate(self, time_s: float) -> ToolMotion:
        """Where the tool is at a time and how it moves: at rest before 0 and after the end."""
        i = self.segment_at(time_s)
        segment, (curve, rotation) = self.path.segments[i], self._pieces[i]
        duration = segment.duration_s
        progress, rate, curvature = septic(min(max((time_s - self.segment_times_s[i]) / duration, 0.0), 1.0))
        speed, change = rate / duration, curvature / duration**2
        position, first, second = curve.evaluate(progress)
        turn = np.array(segment.turn_rad)
        return ToolMotion(
            position,
            first * speed,
            second * speed**2 + first * change,
            _turned(segment.turn_rad, progress) @ rotation,
            turn * speed,
            turn * change,
        )


@dataclass(frozen=True, eq=False)
class _Line:
    start: FloatArray
    by: FloatArray

    def evaluate(self, progress: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The point at a progress in [0, 1], and two derivatives with respect to it."""
        return self.start + progress * self.by, self.by, np.zeros(3)


@dataclass(frozen=True, eq=False)
class _Arc:
    centre: FloatArray
    radial: FloatArray
    tangential: FloatArray
    angle_rad: float

    def evaluate(self, progress: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The point at a progress in [0, 1], and two derivatives with respect to it."""
        turned = progress * self.angle_rad
        outwards = math.cos(turned) * self.radial + math.sin(turned) * self.tangential
        along = math.cos(turned) * self.tangential - math.sin(turned) * self.radial
        return self.centre + outwards, self.angle_rad * along, -(self.angle_rad**2) * outwards


def read_spatial_path(path: Path | str) -> SpatialPath:
    """Read a path file in space: ``{"name", "start_posture_rad": [...], "segments": [{"line": ...}, ...]}``.

    Raises:
        InputError: the file cannot be read, is not strict JSON, or is not a path; the message names the field.
    """
    return read_model(SpatialPath, path)


def _turned(vector: Vector3, share: float) -> FloatArray:
    """The rotation by a share of a rotation vector."""
    angle = math.hypot(*vector)
    return np.eye(3) if angle == 0.0 else Placement.turned(np.array(vector) / angle, share * angle).rotation


def _require_one(first: str, one: object, second: str, other: object) -> None:
    if (one is None) == (other is None):
        given = f"{first} and {second}" if one is not None else "neither"
        raise FieldError(first, given, f"exactly one of {first}, {second}")
