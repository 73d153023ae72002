"""Trajectory files: joint-space references as piecewise quintic polynomials (``docs/reference/formats.md``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import (
    Document,
    canonical_cbor,
    canonical_json,
    document_hash,
    parse_document,
    with_hash,
)
from quasilpv.documents.programs import MAX_JOINTS
from quasilpv.documents.strict_model import FieldError, Number, StrictModel, validate
from quasilpv.errors import InputError
from quasilpv.files import read_bytes, write_atomically
from quasilpv.trajectories.quintics import least_jerk, quintic_hermite

Quintic = tuple[Number, Number, Number, Number, Number, Number]

CONTINUITY_TOLERANCE = 1e-9


class Reference(NamedTuple):
    """Reference angle, rad, speed, rad/s, and acceleration, rad/s^2: (n,) at one time or (times, n)."""

    angle: FloatArray
    speed: FloatArray
    acceleration: FloatArray


class TrajectoryModel(StrictModel):
    """The members of a trajectory file, without its hash."""

    schema_: Literal["quasilpv.trajectory"] = Field(alias="schema")
    schema_version: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    joints: int = Field(ge=1, le=MAX_JOINTS)
    task: dict[str, Any] | None
    knots_s: Annotated[tuple[Number, ...], Field(min_length=2)]
    coefficients: tuple[tuple[Quintic, ...], ...]

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        if self.knots_s[0] != 0.0:
            raise FieldError("knots_s[0]", self.knots_s[0], "0")
        for i, (before, after) in enumerate(pairwise(self.knots_s)):
            if not before < after:
                raise FieldError(f"knots_s[{i + 1}]", after, f"more than knots_s[{i}] = {before}")
        segments = len(self.knots_s) - 1
        if len(self.coefficients) != segments:
            raise FieldError("coefficients", f"{len(self.coefficients)} segments", f"{segments}, one between two knots")
        for i, segment in enumerate(self.coefficients):
            if len(segment) != self.joints:
                raise FieldError(f"coefficients[{i}]", f"{len(segment)} joints", f"{self.joints}")
        return self


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An immutable reference r(t) in joint space, twice continuously differentiable.

    On segment s, ``r_j(t) = sum_i coefficients[s, j, i] tau^i`` with ``tau = t - knots_s[s]``.

    Attributes:
        name: identifier, e.g. ``"serial-square"``.
        knots_s: (K+1,), strictly increasing from 0.
        coefficients: (K, n, 6).
        task: how the trajectory was made, informative; or None.
    """

    name: str
    knots_s: FloatArray
    coefficients: FloatArray
    task: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        self.knots_s.setflags(write=False)
        self.coefficients.setflags(write=False)

    @classmethod
    def through(cls, angles: npt.ArrayLike, times_s: npt.ArrayLike, name: str = "waypoints") -> Trajectory:
        """The reference through waypoints in joint space with the least jerk, at rest at both ends.

        Two waypoints are joined by the quintic ``10 s^3 - 15 s^4 + 6 s^5``; through inner ones it does not stop.

        Args:
            angles: waypoints, (K, n), rad (m for a joint that slides), K >= 2.
            times_s: when, (K,), strictly increasing from 0.
            name: of the reference.

        Raises:
            InputError: a number is not finite, times do not increase from 0, or their number is another one.
        """
        points, times = np.array(angles, dtype=np.float64), np.array(times_s, dtype=np.float64)
        if points.ndim != 2 or len(points) < 2 or not points.shape[1] or not np.all(np.isfinite(points)):
            raise InputError(name, "angles", f"shape {points.shape}", "two or more waypoints of finite coordinates")
        if times.shape != (len(points),):
            raise InputError(name, "times_s", f"shape {times.shape}", f"{len(points)} times, one per waypoint")
        if times[0] != 0.0 or not np.all(np.isfinite(times)) or not np.all(np.diff(times) > 0.0):
            raise InputError(name, "times_s", times.tolist(), "finite times that increase from 0")
        return cls(name, times, quintic_hermite(times, least_jerk(times, points)))

    def __repr__(self) -> str:
        """Its size in a line."""
        return (
            f"Trajectory({self.name!r}, {self.joints} joints, {len(self.coefficients)} segments, {self.duration_s:g} s)"
        )

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.coefficients.shape[1])

    @property
    def duration_s(self) -> float:
        """Time of the last knot."""
        return float(self.knots_s[-1])

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical JSON of the content, 64 hexadecimal digits."""
        return document_hash(self._content())

    def evaluate(self, time_s: npt.ArrayLike) -> Reference:
        """Return the reference at one time (n,) or at several (times, n), in s.

        Before 0 the first angles at rest, after the last knot the last angles at rest.
        """
        time = np.asarray(time_s, dtype=np.float64)
        inside = np.clip(time, 0.0, self.duration_s)
        segment = np.clip(np.searchsorted(self.knots_s, inside, side="right") - 1, 0, len(self.coefficients) - 1)
        tau = (inside - self.knots_s[segment])[..., None]
        c = np.moveaxis(self.coefficients[segment], -1, 0)
        angle = c[0] + tau * (c[1] + tau * (c[2] + tau * (c[3] + tau * (c[4] + tau * c[5]))))
        speed = c[1] + tau * (2 * c[2] + tau * (3 * c[3] + tau * (4 * c[4] + tau * 5 * c[5])))
        acceleration = 2 * c[2] + tau * (6 * c[3] + tau * (12 * c[4] + tau * 20 * c[5]))
        moving = (inside == time)[..., None]
        return Reference(angle, np.where(moving, speed, 0.0), np.where(moving, acceleration, 0.0))

    def to_document(self) -> Document:
        """Return the trajectory as a normalised JSON tree, hash included."""
        return with_hash(self._content())

    @classmethod
    def from_document(cls, document: Mapping[str, object], source: str = "trajectory") -> Trajectory:
        """Return the trajectory of a JSON tree; a member ``hash`` is ignored (``canonical.parse_document`` checks it).

        Raises:
            InputError: a rule of the format is broken, continuity included; the message names the field.
        """
        content = {key: value for key, value in document.items() if key != "hash"}
        model = validate(TrajectoryModel, content, source)
        trajectory = cls(model.name, np.array(model.knots_s), np.array(model.coefficients), model.task)
        trajectory._require_continuity(source)
        return trajectory

    def _content(self) -> Document:
        return {
            "schema": "quasilpv.trajectory",
            "schema_version": 1,
            "name": self.name,
            "joints": self.joints,
            "task": self.task,
            "knots_s": self.knots_s.tolist(),
            "coefficients": self.coefficients.tolist(),
        }

    def _require_continuity(self, source: str) -> None:
        h = np.diff(self.knots_s)[:, None]
        c = np.moveaxis(self.coefficients, -1, 0)
        derivatives = {"r": [1.0] * 6, "r'": [0.0, 1, 2, 3, 4, 5], "r''": [0.0, 0, 2, 6, 12, 20]}
        for order, (name, factors) in enumerate(derivatives.items()):
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is a jump
                ends = sum(factors[i] * c[i] * h ** (i - order) for i in range(order, 6))
            starts = factors[order] * c[order]
            scale = np.maximum(1.0, np.maximum(np.abs(starts[1:]), np.abs(ends[:-1])))
            jumps = np.abs(starts[1:] - ends[:-1]) / scale
            for segment, joint in np.argwhere(~(jumps <= CONTINUITY_TOLERANCE))[:1]:
                got = f"a jump of {name} of {jumps[segment, joint]:.3g} (relative) into this segment"
                field = f"coefficients[{segment + 1}][{joint}]"
                raise InputError(source, field, got, f"at most {CONTINUITY_TOLERANCE}")


def write_trajectory(path: Path | str, trajectory: Trajectory) -> Path:
    """Write a trajectory file, JSON or CBOR by its extension, ``.json`` or ``.cbor``.

    Raises:
        InputError: another extension, or the file cannot be written; nothing half-written is left behind.
    """
    path = Path(path)
    encoders = {".json": canonical_json, ".cbor": canonical_cbor}
    if path.suffix not in encoders:
        raise InputError(str(path), "extension", path.suffix or "none", "one of .json, .cbor")
    write_atomically({path: encoders[path.suffix](trajectory.to_document())})
    return path


def read_trajectory(path: Path | str) -> Trajectory:
    """Read either twin of a trajectory file.

    Raises:
        InputError: the file is missing, damaged, not canonical, or not a valid trajectory.
    """
    source = str(path)
    return Trajectory.from_document(parse_document(read_bytes(path), source), source)
