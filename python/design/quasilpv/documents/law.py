"""What every law document has; the documents themselves stand with what is claimed of them, in `certificate.laws`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self, TypeAlias, get_args

from pydantic import SerializerFunctionWrapHandler, model_serializer, model_validator

from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.strict_model import FieldError, NonNegative, Number, StrictModel
from quasilpv.documents.tables import NonNegativeVector, PolytopeTable, Vector, require_size

Level: TypeAlias = Literal["acceleration", "torque"]

PROGRAM_INPUTS = {
    "premises": ("angle",),
    "schedule": ("angle", "speed"),
    "gravity": ("angle",),
    "coriolis": ("angle", "speed"),
    "coriolis_reference": ("angle", "speed", "reference_speed"),
}
"""Every program a law may ask for, and what it may read."""


class LawDocument(StrictModel):
    """What every law has: its kind, and its design inertia, a table over the premises of ``premises`` or a robot."""

    PROGRAMS: ClassVar[tuple[str, ...]] = ("premises", "gravity")
    """The programs an artifact of this law holds, no others; the first two only with a table for design inertia."""

    DISTURBANCE: ClassVar[Level | None] = None
    """What its estimate of the disturbance is: an acceleration, rad/s^2, or a torque, N m; None if it has none."""

    STABILISES: ClassVar[bool] = False
    """Whether it holds the robot at theta = 0 only, with gravity in its loop; otherwise it tracks."""

    kind: str
    inertia: DesignInertia

    @classmethod
    def tag(cls) -> str:
        """The kind that stands in documents."""
        return str(get_args(cls.model_fields["kind"].annotation)[0])

    @property
    def programs(self) -> tuple[str, ...]:
        """The programs its artifact holds; a robot as design inertia brings premises and gravity of its own."""
        if isinstance(self.inertia, PolytopeTable):
            return self.PROGRAMS
        return tuple(name for name in self.PROGRAMS if name not in LawDocument.PROGRAMS)

    @property
    def premise_box(self) -> tuple[Vector, Vector]:
        """Lower and upper bounds the premises of the inertia are clamped to; a robot has no premises."""
        inertia = self.inertia
        return (inertia.lower, inertia.upper) if isinstance(inertia, PolytopeTable) else ((), ())

    def check(self, joints: int) -> None:
        """Raise ``FieldError`` unless gains and tables fit a robot of n joints."""

    def premises_of(self, program: str) -> int | None:
        """How many premises a program of this law has to compute; None for a program of torques."""
        inertia = self.inertia
        return inertia.premises if program == "premises" and isinstance(inertia, PolytopeTable) else None


class TableLaw(LawDocument):
    """A law whose design inertia is a table."""

    inertia: PolytopeTable


class VelocityLaw(TableLaw):
    """A law that reads measured speeds through a low-pass filter."""

    velocity_filter_time_constant_s: NonNegative


class ScheduledLaw(VelocityLaw):
    """A stabilising law whose gains have premises of their own, of angles and speeds: the program ``schedule``."""

    PROGRAMS = ("premises", "gravity", "schedule")
    STABILISES = True

    scheduled: ClassVar[str]
    """The field that holds the table over these premises."""

    @property
    def schedule(self) -> PolytopeTable:
        """That table."""
        table: PolytopeTable = getattr(self, self.scheduled)
        return table

    def premises_of(self, program: str) -> int | None:
        """See `LawDocument.premises_of`."""
        return self.schedule.premises if program == "schedule" else super().premises_of(program)


class OptionalMemberLaw(LawDocument):
    """A law with members that may be absent, but are not null: a document without one has no such member."""

    optional: ClassVar[Mapping[str, str]]
    """These members and what they are, for messages."""

    @model_validator(mode="after")
    def _refuse_null(self) -> Self:
        for name, meaning in self.optional.items():
            if getattr(self, name) is None and name in self.model_fields_set:
                raise FieldError(name, "null", f"{meaning}, or no member of this name")
        return self

    @model_serializer(mode="wrap")
    def _leave_out_absent(self, serialise: SerializerFunctionWrapHandler) -> dict[str, Any]:
        members: dict[str, Any] = serialise(self)
        return {name: member for name, member in members.items() if member is not None}


class GravityLoad(StrictModel):
    """What the last body of a tree carries for the torque of gravity only, about the frame of its joint."""

    mass_kg: NonNegative
    first_moment_kg_m: tuple[Number, Number, Number]


class ChainLaw(OptionalMemberLaw):
    """A law whose design inertia may be a tree, which may carry a load for its gravity only and needs no programs."""

    optional: ClassVar[Mapping[str, str]] = {"gravity_load": "mass and first moment"}

    gravity_load: GravityLoad | None = None

    @property
    def programs(self) -> tuple[str, ...]:
        """None with a tree, whose recursion gives what the law needs."""
        return self.PROGRAMS if isinstance(self.inertia, PolytopeTable) else ()

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        if self.gravity_load is not None and isinstance(self.inertia, PolytopeTable):
            expected = "none beside an inertia by vertices, whose gravity is a program"
            raise FieldError("law.gravity_load", "a load", expected)


class RestingLaw(ChainLaw):
    """A law that may have a rule of rest.

    Attributes:
        dead_zone_rad: per joint: while the reference rests and the error is at most this, what integrates it waits, so
            that a joint that sticks does not hunt; 0, or none at all: it never waits.
    """

    optional: ClassVar[Mapping[str, str]] = {**ChainLaw.optional, "dead_zone_rad": "an angle per joint"}

    dead_zone_rad: NonNegativeVector | None = None

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        if self.dead_zone_rad is not None:
            require_size("law.dead_zone_rad", self.dead_zone_rad, joints)
