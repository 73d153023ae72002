"""The law `pid`: PID with feedforward. It claims nothing."""

from __future__ import annotations

from typing import Literal

from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.law import VelocityLaw
from quasilpv.documents.tables import Vector, require_size


class PidLaw(VelocityLaw):
    """PID with feedforward (Dehak 2022, III.54): gains act on r - y, one per joint."""

    PROGRAMS = ("premises", "gravity", "coriolis_reference")

    kind: Literal["pid"]
    kp: Vector
    kd: Vector
    ki: Vector

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        for name, gains in (("kp", self.kp), ("kd", self.kd), ("ki", self.ki)):
            require_size(f"law.{name}", gains, joints)


LAW = LawKind(PidLaw)
