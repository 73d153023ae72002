"""The law `link-damped`: the default law on the links of elastic joints, inverse dynamics fed forward, gears damped.

It claims nothing: the loops of its joints do not decouple, and its design is looked at on a grid of postures, loads and
stiffnesses (`quasilpv.synthesis.elastic`).
"""

from __future__ import annotations

from typing import Literal

from quasilpv.certificate.laws.dob_acceleration import Feedback
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.law import RestingLaw
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.strict_model import FieldError, Number, Positive
from quasilpv.documents.tables import PositiveVector, Vector


class LinkDampedLaw(RestingLaw):
    """Tracking with a disturbance observer on the links' angles; the tree is that of links and rotors.

    Attributes:
        inertia_scale: s of the inertia in the feedback, s M(y).
        rotor_inertia_kg_m2: B of the motors, reflected to the joints.
        stiffness_nm_rad: K of the gears.
        relative_damping_nm_s: D_s, by which the motors damp the gears.
        friction_viscous_nm_s, friction_coulomb_nm: of the motors, fed forward.
    """

    DISTURBANCE = "acceleration"

    inertia: DesignInertia

    kind: Literal["link-damped"]
    feedback: Feedback
    observer: tuple[Number, Number, Number, Number]
    filter_time_constant_s: Positive
    inertia_scale: Positive
    rotor_inertia_kg_m2: PositiveVector
    stiffness_nm_rad: PositiveVector
    relative_damping_nm_s: Vector
    friction_viscous_nm_s: Vector
    friction_coulomb_nm: Vector

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        if not isinstance(self.inertia, Tree):
            raise FieldError("law.inertia", "a table", "a tree, whose inverse dynamics is fed forward")
        for name in (
            "rotor_inertia_kg_m2",
            "stiffness_nm_rad",
            "relative_damping_nm_s",
            "friction_viscous_nm_s",
            "friction_coulomb_nm",
        ):
            if len(getattr(self, name)) != joints:
                raise FieldError(f"law.{name}", f"{len(getattr(self, name))} entries", f"{joints}, one per joint")


LAW = LawKind(LinkDampedLaw)
