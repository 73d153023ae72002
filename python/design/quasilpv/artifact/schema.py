"""The artifact: everything the run-time side and an independent checker need to know of one controller.

The members, their units and the meaning of each law kind are in ``docs/reference/formats.md``; the classes here are
that table, checked. Numbers are SI, angles rad, index 0 is the first joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from quasilpv.artifact.laws import Law
from quasilpv.documents.canonical import Document, document_hash, with_hash
from quasilpv.documents.design_inertia import DESIGN_INERTIA_TAGS
from quasilpv.documents.mechanism import Mechanism
from quasilpv.documents.programs import MAX_JOINTS, Program
from quasilpv.documents.robot import read_mechanism
from quasilpv.documents.strict_model import FieldError, Number, Positive, StrictModel, validate
from quasilpv.documents.tables import PolytopeTable, require_size
from quasilpv.errors import InputError

Interval = tuple[Number, Number]
LARGEST_TORQUE_NM = 1e12
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 1e-6, 10.0
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

    torque_nm: tuple[Annotated[float, Field(ge=1.0 / LARGEST_TORQUE_NM, le=LARGEST_TORQUE_NM)], ...]
    slew_nm_per_s: tuple[Positive, ...]


PROGRAM_INPUTS: Mapping[str, tuple[str, ...]] = {
    "premises": ("angle",),
    "schedule": ("angle", "speed"),
    "gravity": ("angle",),
    "coriolis": ("angle", "speed"),
    "coriolis_reference": ("angle", "speed", "reference_speed"),
}

REQUIRED_PROGRAMS: Mapping[str, tuple[str, ...]] = {
    "dob-acceleration": ("premises", "gravity"),
    "dob-torque": ("premises", "gravity"),
    "hinf-tracking": ("premises", "gravity"),
    "state-feedback": ("premises", "gravity", "schedule"),
    "descriptor-feedback": ("premises", "gravity", "schedule"),
    "delayed-feedback": ("premises", "gravity", "schedule"),
    "pid": ("premises", "gravity", "coriolis_reference"),
    "ctc": ("premises", "gravity", "coriolis"),
    "ctc-dob": ("premises", "gravity", "coriolis"),
}


class Artifact(StrictModel):
    """One controller, immutable and consistent: a constructed artifact satisfies every rule of the format.

    The hash is not stored; it is computed from the content.
    """

    schema_: Literal["quasilpv.artifact"] = Field(alias="schema")
    schema_version: Literal[1, 2]
    name: Name
    creator: Creator
    design_hash: Sha256
    units: Literal["SI"]
    sample_period_s: float = Field(ge=SHORTEST_PERIOD_S, le=LONGEST_PERIOD_S)
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
    def mechanism(self) -> Mechanism:
        """The nominal robot, typed.

        Raises:
            InputError: ``robot.parameters``, which nothing reads at run time, are those of no kind known here.
        """
        return read_mechanism(self.robot.parameters, self.schema_version, self.name)

    @property
    def inertia_table(self) -> PolytopeTable:
        """The design inertia of a law that has a table.

        Raises:
            InputError: it has the robot itself.
        """
        if isinstance(self.law.inertia, PolytopeTable):
            return self.law.inertia
        raise InputError(self.name, "law.inertia", f"a robot of kind {self.law.inertia.kind}", "a table")

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical JSON of the content, 64 hexadecimal digits."""
        return document_hash(self.content())

    def __repr__(self) -> str:
        """What it is, in a few lines; `content` has all of it."""
        rate = f"{1.0 / self.sample_period_s:g} Hz"
        stated = "nothing" if self.verification is None else ", ".join(self.verification)
        lines = [
            f"Artifact({self.name!r}, {self.law.kind} for {self.robot.id!r}, {self.joints} joints, {rate}",
            f"  hash={self.hash}",
            f"  verification={stated})",
        ]
        return "\n".join(lines)

    def __str__(self) -> str:
        """The same."""
        return repr(self)

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
        return validate(cls, content, source, tags=(*REQUIRED_PROGRAMS, *DESIGN_INERTIA_TAGS))

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        n = self.joints
        for field in ("domain.angle_rad", "domain.speed_rad_s", "limits.torque_nm", "limits.slew_nm_per_s"):
            section, member = field.split(".")
            require_size(field, getattr(getattr(self, section), member), n)
        if isinstance(self.law.inertia, PolytopeTable):
            self.law.inertia.require_inertia("law.inertia", n)
        elif self.law.inertia.joints != n:
            raise FieldError("law.inertia.joints", f"{self.law.inertia.joints} entries", str(n))
        self.law.check(n)
        self._check_programs()
        return self

    def _check_programs(self) -> None:
        required = REQUIRED_PROGRAMS[self.law.kind] if self.law.reads_programs else ()
        if set(self.programs) != set(required):
            raise FieldError("programs", sorted(self.programs), f"{sorted(required)} for kind {self.law.kind}")
        for name in required:
            program = self.programs[name]
            premises = self.law.premises_of(name)
            outputs = self.joints if premises is None else premises
            if program.outputs != outputs:
                raise FieldError(f"programs.{name}.outputs", program.outputs, str(outputs))
            field, allowed = f"programs.{name}.code", PROGRAM_INPUTS[name]
            for variable, highest in program.inputs().items():
                if variable not in allowed:
                    raise FieldError(field, variable, f"only {', '.join(allowed)} as inputs")
                if highest >= self.joints:
                    raise FieldError(field, f"{variable} {highest}", f"joint indices below {self.joints}")
