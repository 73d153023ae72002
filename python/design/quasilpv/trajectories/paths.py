"""Task-space paths: what the tool does in the plane of the arm, and when.

A path is a start point and segments: straight lines, circular arcs and spirals. Each segment starts and ends at rest,
with the septic time law ``q(s) = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7`` (velocity, acceleration and jerk vanish at both
ends); a tool with an orientation of its own keeps it. Frame: the robot's base frame, X to the right, Y up, metres and
radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, NamedTuple, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import parse_strict_json, require_bounded
from quasilpv.documents.strict_model import FieldError, StrictModel, validate
from quasilpv.files import read_bytes

Point = tuple[float, float]
Duration = Annotated[float, Field(gt=0)]

MAX_DURATION_S = 600.0


AnyPath = TypeVar("AnyPath", bound=StrictModel)


class TaskMotion(NamedTuple):
    """Tool position (2), m, velocity (2), m/s, and acceleration (2), m/s^2, at one instant."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def septic(s: float) -> tuple[float, float, float]:
    """Return q(s) and two derivatives for s in [0, 1]: q(0) = 0, q(1) = 1, three derivatives vanish at both ends."""
    value = s**4 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
    first = 140.0 * (s * (1.0 - s)) ** 3
    second = 420.0 * (s * (1.0 - s)) ** 2 * (1.0 - 2.0 * s)
    return value, first, second


class LineSegment(StrictModel):
    """A straight line from the current point to ``to``."""

    to: Point
    duration_s: Duration


class ArcSegment(StrictModel):
    """A circular arc about ``centre`` from the current point, counter-clockwise for a positive angle."""

    centre: Point
    angle_rad: float
    duration_s: Duration


class SpiralSegment(StrictModel):
    """An Archimedean spiral from the current point, its centre, outwards to ``radius``; counter-clockwise if positive.

    It starts in the direction of X and turns by ``angle_rad`` in all.
    """

    radius: Annotated[float, Field(gt=0)]
    angle_rad: float
    duration_s: Duration


class Segment(StrictModel):
    """One segment: exactly one of ``line``, ``arc`` and ``spiral``."""

    line: LineSegment | None = None
    arc: ArcSegment | None = None
    spiral: SpiralSegment | None = None

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        given = [name for name in Segment.model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise FieldError("line", " and ".join(given) or "no kind of segment", "exactly one of line, arc, spiral")
        return self

    @property
    def duration_s(self) -> float:
        """Time the segment takes."""
        return self._given.duration_s

    @property
    def _given(self) -> LineSegment | ArcSegment | SpiralSegment:
        given = self.line or self.arc or self.spiral
        assert given is not None
        return given

    def curve(self, start: Point) -> Line | Arc | Spiral:
        """Return the curve of the segment when it starts at ``start``."""
        match self._given:
            case LineSegment(to=end):
                return Line(start, end)
            case ArcSegment(centre=centre, angle_rad=angle):
                dx, dy = start[0] - centre[0], start[1] - centre[1]
                return Arc(centre, math.hypot(dx, dy), math.atan2(dy, dx), angle)
            case SpiralSegment(radius=radius, angle_rad=angle):
                return Spiral(start, radius, angle)


class TaskPath(StrictModel):
    """A named path of the tool.

    ``tool_angle_rad`` is the constant orientation Phi from the downward vertical of a tool that has one of its own;
    None for the others.
    """

    name: Annotated[str, Field(min_length=1)]
    tool_angle_rad: float | None = None
    start: Point
    segments: Annotated[tuple[Segment, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check_geometry(self) -> Self:
        point = self.start
        for i, segment in enumerate(self.segments):
            curve = segment.curve(point)
            if isinstance(curve, Arc) and curve.radius == 0.0:
                raise FieldError(f"segments[{i}].arc.centre", list(curve.centre), "a centre other than the arc's start")
            point = curve.end
        if self.duration_s > MAX_DURATION_S:
            raise FieldError("segments", f"{self.duration_s} s in all", f"at most {MAX_DURATION_S} s")
        return self

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return self.segment_times_s[-1]

    @property
    def orientation(self) -> tuple[float, ...]:
        """What follows the position in a pose: (Phi,) or nothing."""
        return () if self.tool_angle_rad is None else (self.tool_angle_rad,)

    @cached_property
    def segment_times_s(self) -> tuple[float, ...]:
        """The times at which segments start, and the end of the last one."""
        times = [0.0]
        for segment in self.segments:
            times.append(times[-1] + segment.duration_s)
        return tuple(times)

    @cached_property
    def _curves(self) -> tuple[Line | Arc | Spiral, ...]:
        curves: list[Line | Arc | Spiral] = []
        point = self.start
        for segment in self.segments:
            curves.append(segment.curve(point))
            point = curves[-1].end
        return tuple(curves)

    def segment_at(self, time_s: float) -> int:
        """Return the index of the segment under way at a time; the first before 0, the last after the end."""
        return int(np.clip(np.searchsorted(self.segment_times_s, time_s, side="right") - 1, 0, len(self.segments) - 1))

    def evaluate(self, time_s: float) -> TaskMotion:
        """Return where the tool is at a time and how it moves: at rest before 0 and after the end."""
        i = self.segment_at(time_s)
        duration = self.segments[i].duration_s
        progress, rate, curvature = septic(min(max((time_s - self.segment_times_s[i]) / duration, 0.0), 1.0))
        position, first, second = self._curves[i].evaluate(progress)
        velocity = first * (rate / duration)
        acceleration = second * (rate / duration) ** 2 + first * (curvature / duration**2)
        return TaskMotion(position, velocity, acceleration)


@dataclass(frozen=True)
class Line:
    """The points from ``start`` to ``end``, over a parameter from 0 to 1."""

    start: Point
    end: Point

    def evaluate(self, progress: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the point at ``progress`` and its first two derivatives with respect to it."""
        start, end = np.array(self.start), np.array(self.end)
        return (1.0 - progress) * start + progress * end, end - start, np.zeros(2)


@dataclass(frozen=True)
class Arc:
    """The points of a circle from ``start_angle_rad`` on over ``angle_rad``, over a parameter from 0 to 1."""

    centre: Point
    radius: float
    start_angle_rad: float
    angle_rad: float

    @property
    def end(self) -> Point:
        """Last point."""
        point, _, _ = self.evaluate(1.0)
        return float(point[0]), float(point[1])

    def evaluate(self, progress: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the point at ``progress`` and its first two derivatives with respect to it."""
        angle = self.start_angle_rad + progress * self.angle_rad
        radial = self.radius * np.array([math.cos(angle), math.sin(angle)])
        tangential = np.array([-radial[1], radial[0]])
        return np.array(self.centre) + radial, self.angle_rad * tangential, -(self.angle_rad**2) * radial


@dataclass(frozen=True)
class Spiral:
    """The points ``centre + p radius (cos(p angle), sin(p angle))`` over a parameter p from 0 to 1."""

    centre: Point
    radius: float
    angle_rad: float

    @property
    def end(self) -> Point:
        """Last point."""
        point, _, _ = self.evaluate(1.0)
        return float(point[0]), float(point[1])

    def evaluate(self, progress: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the point at ``progress`` and its first two derivatives with respect to it."""
        angle, turn = progress * self.angle_rad, self.angle_rad
        radial = self.radius * np.array([math.cos(angle), math.sin(angle)])
        tangential = np.array([-radial[1], radial[0]])
        first = radial + progress * turn * tangential
        second = 2.0 * turn * tangential - progress * turn**2 * radial
        return np.array(self.centre) + progress * radial, first, second


def read_path(path: Path | str) -> TaskPath:
    """Read a path file: ``{"name", "tool_angle_rad", "start": [x, y], "segments": [{"line": ...}, ...]}``.

    Raises:
        InputError: the file cannot be read, is not strict JSON, or is not a path; the message names the field.
    """
    return read_model(TaskPath, path)


def read_model(kind: type[AnyPath], path: Path | str) -> AnyPath:
    """A path of any kind from its file. Errors as `read_path`."""
    source = str(path)
    document = parse_strict_json(read_bytes(path), source)
    require_bounded(document, source)
    return validate(kind, document, source)
