"""The member ``payloads`` of an artifact: the set of plants a design was gated for, one form per kind of mechanism."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from quasilpv.documents.strict_model import FieldError, NonNegative, Positive, StrictModel

Interval = tuple[float, float]
Row = tuple[float, float, float]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]

WHOLE = (0.0, 1.0)


class PayloadsDocument(StrictModel):
    """A set of plants; what it says and no more is what a gate proves.

    Attributes:
        lag_s: shortest and longest time constant of the drives, the same for all joints; absent for none.
    """

    lag_s: Interval | None = None

    @model_validator(mode="after")
    def _check_lag(self) -> Self:
        if "lag_s" not in self.model_fields_set:
            return self
        if self.lag_s is None or not 0.0 <= self.lag_s[0] <= self.lag_s[1] or self.lag_s[1] == 0.0:
            got = None if self.lag_s is None else list(self.lag_s)
            raise FieldError("lag_s", got, "0 <= shortest <= longest, the longest > 0, or no member of this name")
        return self

    @property
    def drive_lag_s(self) -> Interval:
        """Shortest and longest time constant of the drives; (0, 0) for none."""
        return self.lag_s or (0.0, 0.0)

    def require_joints(self, joints: int) -> None:
        """Raise ``FieldError`` unless there is one entry for each joint where there has to be."""

    @property
    def scales(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Factors of masses (of a disc, of its moment of inertia) and of distances to centres of mass at fraction 1.

        Raises:
            TypeError: the plants are not on one line.
        """
        raise TypeError(f"{type(self).__name__} is no set of plants along one line")


class _Fractions(PayloadsDocument):
    """Plants along one line: fraction 0 is the nominal robot, 1 the full payload."""

    fraction: Interval

    @model_validator(mode="after")
    def _check_fraction(self) -> Self:
        if self.fraction != WHOLE:
            raise FieldError("fraction", list(self.fraction), str(list(WHOLE)))
        return self


class LinkPayloads(_Fractions):
    """Factors of masses and of distances to centres of mass at fraction 1, one per link (or kind of link)."""

    mass_scale: tuple[float, ...]
    com_scale: tuple[float, ...]
    inertia_about_com: Literal["unchanged"]

    @property
    def scales(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """See `PayloadsDocument.scales`."""
        return self.mass_scale, self.com_scale

    def require_joints(self, joints: int) -> None:
        """See `PayloadsDocument.require_joints`."""
        for field in ("mass_scale", "com_scale"):
            if len(getattr(self, field)) != joints:
                raise FieldError(field, f"{len(getattr(self, field))} entries", str(joints))


class DiscPayloads(_Fractions):
    """Factor of the moment of inertia of a disc at fraction 1."""

    inertia_scale: float

    @property
    def scales(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """See `PayloadsDocument.scales`."""
        return (self.inertia_scale,), (1.0,)


class Load(StrictModel):
    """All bodies the last link may carry: from nothing to the largest mass, anywhere in a box.

    Attributes:
        rotation, translation_m: of the load's frame in the frame of the last joint; rows of the rotation.
        mass_kg: largest mass.
        com_box_m: box of the centre of mass, in the load's frame.
        inertia_kg_m2: bound of the moment of inertia about the centre of mass, per axis of the load's frame.
    """

    rotation: tuple[Row, Row, Row]
    translation_m: Row
    mass_kg: Positive
    com_box_m: tuple[Interval, Interval, Interval]
    inertia_kg_m2: tuple[NonNegative, NonNegative, NonNegative]


class Gear(StrictModel):
    """A gear that gives.

    Attributes:
        stiffness_nm_rad: softest and stiffest.
        damping_s: least and most damping over stiffness.
    """

    stiffness_nm_rad: Interval
    damping_s: Interval

    @model_validator(mode="after")
    def _check(self) -> Self:
        for field, least in (("stiffness_nm_rad", "0 <"), ("damping_s", "0 <=")):
            low, high = getattr(self, field)
            if not low <= high or low < 0.0 or (low == 0.0 and least == "0 <"):
                raise FieldError(field, [low, high], f"{least} lowest <= highest")
        return self


class TreePayloads(PayloadsDocument):
    """Robots in space around the nominal one, each difference on its own.

    Attributes:
        link_tolerance: share by which the inertia of every link may differ, up and down.
        rotor_tolerance: the same of the rotors, one per joint.
        load: what the robot may carry; null for nothing.
        gears: one per joint, of robots whose joints give; absent for rigid ones.
        torque_gain: of drives that control the torque in their joints, which leave this share of their rotors, 1 over
            it; absent for others.
    """

    link_tolerance: Share
    rotor_tolerance: tuple[Share, ...]
    load: Load | None
    gears: tuple[Gear, ...] | None = None
    torque_gain: Annotated[float, Field(ge=1.0)] | None = None

    def require_joints(self, joints: int) -> None:
        """See `PayloadsDocument.require_joints`."""
        if len(self.rotor_tolerance) != joints:
            raise FieldError("rotor_tolerance", f"{len(self.rotor_tolerance)} entries", str(joints))
        if self.gears is not None and len(self.gears) != joints:
            raise FieldError("gears", f"{len(self.gears)} entries", str(joints))
