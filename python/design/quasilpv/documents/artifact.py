"""The frame of an artifact: its members as they are written, whatever the kind of its law.

``docs/reference/formats.md`` states them. Here only the forms are checked; that the members fit each other is checked
where artifacts are made and read (`quasilpv.artifact.schema`), and what they claim by `quasilpv.certificate`.
"""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal, Self, TypeVar

from pydantic import Field, model_validator

from quasilpv.documents.hashed import HashedDocument
from quasilpv.documents.law import LawDocument
from quasilpv.documents.mechanism import Mechanism
from quasilpv.documents.programs import MAX_JOINTS, Program
from quasilpv.documents.robot import read_mechanism
from quasilpv.documents.strict_model import FieldError, Number, Positive, StrictModel
from quasilpv.documents.tables import PolytopeTable
from quasilpv.errors import InputError

Interval = tuple[Number, Number]
LARGEST_TORQUE_NM = 1e12
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 1e-6, 10.0
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Name = Annotated[str, Field(min_length=1)]
LawT = TypeVar("LawT", bound=LawDocument)


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


class ArtifactDocument(HashedDocument, Generic[LawT]):
    """One controller, immutable."""

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
    law: LawT
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
