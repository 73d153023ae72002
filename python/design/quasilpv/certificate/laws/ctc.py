"""The laws `ctc` and `ctc-dob`: computed torque without and with a disturbance observer. They claim nothing."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.law import RestingLaw
from quasilpv.documents.strict_model import FieldError, NonNegative
from quasilpv.documents.tables import Vector, require_size


class ComputedTorqueLaw(RestingLaw):
    """What both have."""

    PROGRAMS = ("premises", "gravity", "coriolis")

    velocity_filter_time_constant_s: NonNegative
    gp: Vector
    gd: Vector
    gi: Vector
    disturbance_observer_bandwidth_rad_s: NonNegative

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        for name, gains in (("gp", self.gp), ("gd", self.gd), ("gi", self.gi)):
            require_size(f"law.{name}", gains, joints)


class CtcLaw(ComputedTorqueLaw):
    """Computed torque (Dehak 2022, III.56) without disturbance observer: its bandwidth is 0."""

    kind: Literal["ctc"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        bandwidth = self.disturbance_observer_bandwidth_rad_s
        if bandwidth != 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", bandwidth, "0 for kind ctc")
        return self


class CtcDobLaw(ComputedTorqueLaw):
    """Computed torque (Dehak 2022, III.56, sign of the estimate corrected) with a disturbance observer."""

    DISTURBANCE = "torque"

    kind: Literal["ctc-dob"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        if self.disturbance_observer_bandwidth_rad_s == 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", 0, "more than 0 for kind ctc-dob")
        return self


LAW = LawKind(CtcLaw)
LAW_WITH_OBSERVER = LawKind(CtcDobLaw)
