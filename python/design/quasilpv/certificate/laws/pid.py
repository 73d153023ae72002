"""The law `pid`: PID with feedforward. It claims nothing."""

from __future__ import annotations

from typing import Literal

from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.law import RestingLaw
from quasilpv.documents.strict_model import NonNegative
from quasilpv.documents.tables import Vector, require_size


class PidLaw(RestingLaw):
    """PID with feedforward (Dehak 2022, III.54): gains act on r - y, one per joint. With a tree only of gravity."""

    PROGRAMS = ("premises", "gravity", "coriolis_reference")

    kind: Literal["pid"]
    velocity_filter_time_constant_s: NonNegative
    kp: Vector
    kd: Vector
    ki: Vector

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        for name, gains in (("kp", self.kp), ("kd", self.kd), ("ki", self.ki)):
            require_size(f"law.{name}", gains, joints)


LAW = LawKind(PidLaw)
