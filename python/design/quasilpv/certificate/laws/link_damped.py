"""The law `link-damped`: the default law on the links of elastic joints, inverse dynamics fed forward, gears damped.

It claims nothing: the loops of its joints do not decouple, and its gate is a grid of postures, loads and stiffnesses
(`quasilpv.certificate.gate.elastic_grid`).
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np
from flint import fmpq

from quasilpv.certificate.gate.elastic_grid import ElasticGridGate, elastic_grid_gate
from quasilpv.certificate.laws.dob_acceleration import Feedback
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.reading import Shipped
from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.law import RestingLaw
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.strict_model import FieldError, Number, Positive
from quasilpv.documents.tables import PositiveVector, Vector
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate


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


def gate(shipped: Shipped[LinkDampedLaw], delay_samples: fmpq) -> ElasticGridGate:
    """A grid, which proves nothing."""
    law = shipped.law
    frozen = LinkLaw(
        sample_period_s=shipped.artifact.sample_period_s,
        feedback=np.array([law.feedback.kp, law.feedback.kd, law.feedback.ki]),
        observer=np.array(law.observer),
        filter_time_constant_s=law.filter_time_constant_s,
        inertia_scale=law.inertia_scale,
        relative_damping=np.array(law.relative_damping_nm_s),
    )
    return elastic_grid_gate(shipped, delay_samples, partial(link_growth_rate, frozen))


LAW = LawKind(LinkDampedLaw, gate=gate, covers_lag=True)
