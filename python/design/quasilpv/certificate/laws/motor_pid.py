"""The law `motor-pid`: PID of the motors of elastic joints, the inverse dynamics of the links fed forward.

It claims nothing: its design is looked at on a grid of postures, loads and stiffnesses (`quasilpv.synthesis.elastic`).
"""

from __future__ import annotations

from typing import Literal

from quasilpv.certificate.laws.dob_acceleration import Feedback
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.law import ChainLaw
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.strict_model import FieldError, NonNegative, Number
from quasilpv.documents.tables import PositiveVector, Vector


class MotorPidLaw(ChainLaw):
    """PID of the motors: errors are x - x_r, stabilising gains negative; the tree is that of the links alone.

    Attributes:
        rotor_inertia_kg_m2: B of the motors, reflected to the joints.
        stiffness_nm_rad: K of the gears.
        correction_bandwidth_rad_s: of the correction of the motors' reference by the torque; 0 for none.
        friction_viscous_nm_s, friction_coulomb_nm: of the motors, fed forward.
        dead_zone_rad: errors up to this are not integrated, so that a motor that sticks does not hunt.
    """

    inertia: DesignInertia

    kind: Literal["motor-pid"]
    feedback: Feedback
    observer: tuple[Number, Number, Number, Number]
    rotor_inertia_kg_m2: PositiveVector
    stiffness_nm_rad: PositiveVector
    correction_bandwidth_rad_s: NonNegative
    friction_viscous_nm_s: Vector
    friction_coulomb_nm: Vector
    dead_zone_rad: NonNegative

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        if not isinstance(self.inertia, Tree):
            raise FieldError("law.inertia", "a table", "a tree, whose inverse dynamics is fed forward")
        for name in ("rotor_inertia_kg_m2", "stiffness_nm_rad", "friction_viscous_nm_s", "friction_coulomb_nm"):
            if len(getattr(self, name)) != joints:
                raise FieldError(f"law.{name}", f"{len(getattr(self, name))} entries", f"{joints}, one per joint")


LAW = LawKind(MotorPidLaw)
