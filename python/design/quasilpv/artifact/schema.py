"""The artifact: everything the run-time side and an independent checker need to know of one controller.

The members, their units and the meaning of each law kind are in ``docs/reference/formats.md``; the classes here are
that table, checked. Numbers are SI, angles rad, index 0 is the first joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from quasilpv.artifact.canonical import Document, document_hash, with_hash
from quasilpv.artifact.programs import MAX_JOINTS, Program
from quasilpv.artifact.strict_model import FieldError, StrictModel, validate

MAX_PREMISES = 32
ROUNDING = 1e-12

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Interval = tuple[float, float]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Name = Annotated[str, Field(min_length=1)]


class Creator(StrictModel):
    """The program that wrote a document."""

    tool: Name
    version: Name


class Robot(StrictModel):
    """The robot the controller is for; ``parameters`` are its nominal physical parameters, informative at run time."""

    id: Name
    parameters: dict[str, Any]


class Domain(StrictModel):
    """Operating domain: one interval ``(lower, upper)`` per joint of angles, rad, and of speeds, rad/s."""

    angle_rad: tuple[Interval, ...]
    speed_rad_s: tuple[Interval, ...]

    @model_validator(mode="after")
    def _check_intervals(self) -> Self:
        for field in ("angle_rad", "speed_rad_s"):
            for i, (lower, upper) in enumerate(getattr(self, field)):
                if not lower < upper:
                    raise FieldError(f"{field}[{i}]", [lower, upper], "a lower bound below the upper bound")
        return self


class Limits(StrictModel):
    """Torque limit, N m, and slew limit, N m/s, per joint."""

    torque_nm: tuple[Positive, ...]
    slew_nm_per_s: tuple[Positive, ...]


class BoxBlock(StrictModel):
    """One block of a block polytope: 2^g vertices for g premises, the first listed premise the most significant bit."""

    kind: Literal["box"]
    premises: tuple[int, ...]
    vertices: tuple[Matrix, ...]


class PolytopeTable(StrictModel):
    """A matrix X(z), affine in the premises z of a box, as vertices (weights in ``docs/reference/formats.md``)."""

    premises: int = Field(ge=0, le=MAX_PREMISES)
    lower: Vector
    upper: Vector
    centre: Vector
    blocks: tuple[BoxBlock, ...]

    @model_validator(mode="after")
    def _check_partition(self) -> Self:
        for field in ("lower", "upper", "centre"):
            require_size(field, getattr(self, field), self.premises)
        for i, (lower, upper) in enumerate(zip(self.lower, self.upper, strict=True)):
            if not lower < upper:
                raise FieldError(f"upper[{i}]", upper, f"more than lower[{i}] = {lower}")
        listed = [premise for block in self.blocks for premise in block.premises]
        if sorted(listed) != list(range(self.premises)):
            raise FieldError("blocks", f"premises {listed}", f"each of 0 to {self.premises - 1} in exactly one block")
        if not self.blocks or (self.premises == 0) != (len(self.blocks) == 1 and not self.blocks[0].premises):
            raise FieldError("blocks", len(self.blocks), "at least one, and one without premises if there are none")
        shape = None
        for field, vertex in self._vertices():
            shape = shape or (len(vertex), len(vertex[0]) if vertex else 0)
            if len(vertex) != shape[0] or any(len(row) != shape[1] for row in vertex) or 0 in shape:
                raise FieldError(field, "another shape", f"a {shape[0]} x {shape[1]} matrix, like the first vertex")
        return self

    def _vertices(self) -> Iterator[tuple[str, Matrix]]:
        for i, block in enumerate(self.blocks):
            if i > 0 and not block.premises:
                raise FieldError(f"blocks[{i}].premises", "none", "at least one premise")
            require_size(f"blocks[{i}].vertices", block.vertices, 2 ** len(block.premises))
            for j, vertex in enumerate(block.vertices):
                yield f"blocks[{i}].vertices[{j}]", vertex

    def at_centre(self) -> npt.NDArray[np.float64]:
        """Return X at the centring point: vertices of a block weighted with products of its premises' weights."""
        matrix = np.zeros(np.shape(self.blocks[0].vertices[0]))
        for block in self.blocks:
            weights = np.ones(1)
            for p in block.premises:
                upper_weight = (self.centre[p] - self.lower[p]) / (self.upper[p] - self.lower[p])
                weights = np.outer(weights, [1.0 - upper_weight, upper_weight]).ravel()
            matrix += np.tensordot(weights, np.array(block.vertices), axes=1) / len(self.blocks)
        return matrix

    def require_gains(self, field: str, rows: int, columns: int, inertia: PolytopeTable) -> None:
        """Raise ``FieldError`` unless vertices are ``rows`` x ``columns``, scheduled on the premises of the inertia."""
        for path, vertex in self._vertices():
            if (len(vertex), len(vertex[0])) != (rows, columns):
                raise FieldError(f"{field}.{path}", f"{len(vertex)} x {len(vertex[0])}", f"{rows} x {columns}")
        if self._schedule() != inertia._schedule():
            raise FieldError(field, "another box, centre or partition of the premises", "that of law.inertia")

    def _schedule(self) -> tuple[object, ...]:
        return self.lower, self.upper, self.centre, tuple(block.premises for block in self.blocks)

    def require_inertia(self, field: str, size: int) -> None:
        """Raise ``FieldError`` unless vertices are symmetric ``size`` x ``size`` and the centre is positive definite.

        Corners of the box need not be configurations of the robot, so the vertices themselves may be indefinite.
        """
        for path, vertex in self._vertices():
            matrix = np.array(vertex)
            if matrix.shape != (size, size):
                raise FieldError(f"{field}.{path}", f"{len(vertex)} x {len(vertex[0])}", f"{size} x {size}")
            require_symmetric(f"{field}.{path}", vertex)
        require_positive_definite(field, self.at_centre(), "a positive definite inertia", " at the centre")


def require_symmetric(field: str, rows: Matrix) -> None:
    """Raise ``FieldError`` unless a square matrix is symmetric."""
    matrix = np.array(rows)
    asymmetry = np.abs(matrix - matrix.T)
    if asymmetry.max() > ROUNDING * np.abs(matrix).max():
        i, j = np.unravel_index(int(asymmetry.argmax()), asymmetry.shape)
        raise FieldError(f"{field}[{i}][{j}]", rows[i][j], f"{rows[j][i]}, the symmetric entry")


def require_positive_definite(field: str, matrix: npt.NDArray[np.float64], expected: str, where: str = "") -> None:
    """Raise ``FieldError`` unless a symmetric matrix is positive definite."""
    eigenvalues = np.linalg.eigvalsh(matrix)
    smallest, largest = eigenvalues[0], np.abs(eigenvalues).max()
    if not smallest > ROUNDING * largest:
        raise FieldError(field, f"smallest eigenvalue {smallest:.3g}{where}", expected)


class Feedback(StrictModel):
    """Acceleration-level feedback ``kp e + kd e' + ki int e`` with e = x - x_r: stabilising gains are negative."""

    kp: float
    kd: float
    ki: float


class DobAccelerationLaw(StrictModel):
    """Tracking at the acceleration level with a disturbance observer, the same scalars for every joint.

    With ``disturbance_compensation`` false the observer runs but its filtered disturbance is not fed back.
    """

    kind: Literal["dob-acceleration"]
    feedback: Feedback
    observer: tuple[float, float, float, float]
    filter_time_constant_s: Positive
    disturbance_compensation: bool
    inertia: PolytopeTable


class DobTorqueLaw(StrictModel):
    """Tracking in torque coordinates with a disturbance observer and scheduled gains (Dehak 2022, Theorem IV.11).

    ``feedback`` holds [Kp Kd KI], n x 3n, acting on x - x_r; ``observer`` holds [L1; L2; L3; L4], 4n x n.
    """

    kind: Literal["dob-torque"]
    feedback: PolytopeTable
    observer: PolytopeTable
    filter_time_constant_s: Positive
    inertia: PolytopeTable


class HinfTrackingLaw(StrictModel):
    """H-infinity PI tracking (Dehak 2022, Theorem III.10): ``Gamma = Y(z) diag(I, M, I)^-1 P^-1 (e, e', int e)``.

    ``numerator`` holds Y, n x 3n; ``lyapunov`` is P, 3n x 3n; e = x - x_r.
    """

    kind: Literal["hinf-tracking"]
    numerator: PolytopeTable
    lyapunov: Matrix
    velocity_filter_time_constant_s: NonNegative
    inertia: PolytopeTable

    @model_validator(mode="after")
    def _check_lyapunov(self) -> Self:
        rows = len(self.lyapunov)
        if any(len(row) != rows for row in self.lyapunov):
            raise FieldError("lyapunov", "rows of other lengths", f"a {rows} x {rows} matrix")
        require_symmetric("lyapunov", self.lyapunov)
        require_positive_definite("lyapunov", np.array(self.lyapunov), "a positive definite matrix")
        return self


class PidLaw(StrictModel):
    """PID with feedforward (Dehak 2022, III.54): gains act on r - y, one per joint."""

    kind: Literal["pid"]
    kp: Vector
    kd: Vector
    ki: Vector
    velocity_filter_time_constant_s: NonNegative
    inertia: PolytopeTable


class _ComputedTorque(StrictModel):
    gp: Vector
    gd: Vector
    gi: Vector
    velocity_filter_time_constant_s: NonNegative
    disturbance_observer_bandwidth_rad_s: NonNegative
    inertia: PolytopeTable


class CtcLaw(_ComputedTorque):
    """Computed torque (Dehak 2022, III.56) without disturbance observer: its bandwidth is 0."""

    kind: Literal["ctc"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        bandwidth = self.disturbance_observer_bandwidth_rad_s
        if bandwidth != 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", bandwidth, "0 for kind ctc")
        return self


class CtcDobLaw(_ComputedTorque):
    """Computed torque (Dehak 2022, III.56, sign of the estimate corrected) with a disturbance observer."""

    kind: Literal["ctc-dob"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        if self.disturbance_observer_bandwidth_rad_s == 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", 0, "more than 0 for kind ctc-dob")
        return self


Law = Annotated[
    DobAccelerationLaw | DobTorqueLaw | HinfTrackingLaw | PidLaw | CtcLaw | CtcDobLaw, Field(discriminator="kind")
]

GAIN_FIELDS: Mapping[str, tuple[str, ...]] = {
    "dob-acceleration": (),
    "dob-torque": (),
    "hinf-tracking": (),
    "pid": ("kp", "kd", "ki"),
    "ctc": ("gp", "gd", "gi"),
    "ctc-dob": ("gp", "gd", "gi"),
}

PROGRAM_INPUTS: Mapping[str, tuple[str, ...]] = {
    "premises": ("angle",),
    "gravity": ("angle",),
    "coriolis": ("angle", "speed"),
    "coriolis_reference": ("angle", "speed", "reference_speed"),
}

REQUIRED_PROGRAMS: Mapping[str, tuple[str, ...]] = {
    "dob-acceleration": ("premises", "gravity"),
    "dob-torque": ("premises", "gravity"),
    "hinf-tracking": ("premises", "gravity"),
    "pid": ("premises", "gravity", "coriolis_reference"),
    "ctc": ("premises", "gravity", "coriolis"),
    "ctc-dob": ("premises", "gravity", "coriolis"),
}


class Artifact(StrictModel):
    """One controller, immutable and consistent: a constructed artifact satisfies every rule of the format.

    The hash is not stored; it is computed from the content.
    """

    schema_: Literal["quasilpv.artifact"] = Field(alias="schema")
    schema_version: Literal[1]
    name: Name
    creator: Creator
    design_hash: Sha256
    units: Literal["SI"]
    sample_period_s: Positive
    joints: int = Field(ge=1, le=MAX_JOINTS)
    robot: Robot
    payloads: dict[str, Any]
    domain: Domain
    limits: Limits
    programs: dict[str, Program]
    law: Law
    witness: dict[str, Any] | None
    verification: dict[str, Any] | None

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical JSON of the content, 64 hexadecimal digits."""
        return document_hash(self.content())

    def content(self) -> Document:
        """Return the artifact as a JSON tree without its hash."""
        return self.model_dump(mode="json", by_alias=True)

    def to_document(self) -> Document:
        """Return the artifact as a normalised JSON tree, hash included."""
        return with_hash(self.content())

    @classmethod
    def from_document(cls, document: Mapping[str, object], source: str = "artifact") -> Artifact:
        """Return the artifact of a JSON tree; a member ``hash`` is ignored (``canonical.parse_document`` checks it).

        Raises:
            InputError: a rule of the format is broken; the message names the field.
        """
        content = {key: value for key, value in document.items() if key != "hash"}
        return validate(cls, content, source, tags=REQUIRED_PROGRAMS)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        n = self.joints
        for field in ("domain.angle_rad", "domain.speed_rad_s", "limits.torque_nm", "limits.slew_nm_per_s"):
            section, member = field.split(".")
            require_size(field, getattr(getattr(self, section), member), n)
        for member in GAIN_FIELDS[self.law.kind]:
            require_size(f"law.{member}", getattr(self.law, member), n)
        self.law.inertia.require_inertia("law.inertia", n)
        if isinstance(self.law, DobTorqueLaw):
            self.law.feedback.require_gains("law.feedback", n, 3 * n, self.law.inertia)
            self.law.observer.require_gains("law.observer", 4 * n, n, self.law.inertia)
        if isinstance(self.law, HinfTrackingLaw):
            self.law.numerator.require_gains("law.numerator", n, 3 * n, self.law.inertia)
            require_size("law.lyapunov", self.law.lyapunov, 3 * n)
        self._check_programs()
        return self

    def _check_programs(self) -> None:
        required = REQUIRED_PROGRAMS[self.law.kind]
        if set(self.programs) != set(required):
            raise FieldError("programs", sorted(self.programs), f"{sorted(required)} for kind {self.law.kind}")
        for name in required:
            program = self.programs[name]
            outputs = self.law.inertia.premises if name == "premises" else self.joints
            if program.outputs != outputs:
                raise FieldError(f"programs.{name}.outputs", program.outputs, str(outputs))
            field, allowed = f"programs.{name}.code", PROGRAM_INPUTS[name]
            for variable, highest in program.inputs().items():
                if variable not in allowed:
                    raise FieldError(field, variable, f"only {', '.join(allowed)} as inputs")
                if highest >= self.joints:
                    raise FieldError(field, f"{variable} {highest}", f"joint indices below {self.joints}")


def require_size(field: str, values: tuple[object, ...], size: int) -> None:
    """Raise ``FieldError`` unless ``values`` has ``size`` entries."""
    if len(values) != size:
        raise FieldError(field, f"{len(values)} entries", f"{size}")
