"""The law `motor-pid`: PID of the motors of elastic joints, the inverse dynamics of the links fed forward.

An artifact with a witness claims the stability of its frozen loop, correction included, for every arm it states and
every delay up to that of the witness: the chain certificate of the links and the exclusion of
`quasilpv.certificate.gate.two_mass`, in ball arithmetic. One without a witness claims nothing: its gate is a grid of
postures, loads and stiffnesses (`quasilpv.certificate.gate.elastic_grid`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from flint import fmpq

from quasilpv.certificate.exact.claims import Claim, Evidence
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.elastic import WHAT, ElasticGate, elastic_gate
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate, elastic_grid_gate
from quasilpv.certificate.gate.motor_loop import CorrectionSource, MotorLoopData
from quasilpv.certificate.laws.dob_acceleration import Feedback
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.reading import Shipped, WitnessDocument
from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.law import ChainLaw
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.strict_model import FieldError, NonNegative, Number
from quasilpv.documents.tables import PositiveVector, Vector
from quasilpv.loops.elastic_loop import MotorLaw, growth_rate


class MotorPidLaw(ChainLaw):
    """PID of the motors: errors are x - x_r, stabilising gains negative; the tree is that of the links alone.

    Attributes:
        rotor_inertia_kg_m2: B of the motors, reflected to the joints.
        stiffness_nm_rad: K of the gears.
        correction_bandwidth_rad_s: of the correction of the motors' reference; 0 for none.
        correction_source: what tells how far the gears are wound: the motors' torques, sensors of the joints' torques,
            or encoders on both sides.
        friction_viscous_nm_s, friction_coulomb_nm: of the motors, fed forward.
        dead_zone_rad: errors up to this are neither integrated nor corrected: a motor that sticks does not hunt.
    """

    inertia: DesignInertia

    kind: Literal["motor-pid"]
    feedback: Feedback
    observer: tuple[Number, Number, Number, Number]
    rotor_inertia_kg_m2: PositiveVector
    stiffness_nm_rad: PositiveVector
    correction_bandwidth_rad_s: NonNegative
    correction_source: CorrectionSource
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


class ExclusionWitness(WitnessDocument):
    """Up to which delay roots on the unit circle are excluded."""

    longest_delay_samples: float


class MotorPidWitness(WitnessDocument):
    """What the claims need beside the law and the storages of the links."""

    exclusion: ExclusionWitness


def claims(shipped: Shipped[MotorPidLaw]) -> Iterator[Claim]:
    """What a `motor-pid` artifact with a witness claims.

    Raises:
        InputError, ValueError: the witness is not of the documented form.
    """
    longest = rational(shipped.witness(MotorPidWitness).exclusion.longest_delay_samples)
    found = elastic_gate(shipped, loop_data(shipped.law, shipped.artifact.sample_period_s), longest)
    low, high = found.links.sides
    least, most = found.links.sampled
    lowest, highest = to_float(low.bound), to_float(high.bound)
    yield Claim.enclosed("links: at least m1 rotors", low.proof.holds and lowest > 0.0, 1.0 - lowest / least)
    yield Claim.enclosed("links: at most m2 rotors", high.proof.holds, 1.0 - most / highest)
    yield Claim.enclosed(WHAT, found.passed, -1.0 if found.exclusion is None else found.exclusion.spare)


def gate(shipped: Shipped[MotorPidLaw], delay_samples: fmpq) -> ElasticGate | ElasticGridGate:
    """With a witness the exclusion for all that `quasilpv.certificate.gate.elastic` says; without one a grid."""
    if shipped.artifact.witness is None:
        law = _frozen(shipped.law, shipped.artifact.sample_period_s)
        return elastic_grid_gate(shipped, delay_samples, lambda plant, _, delay_s: growth_rate(law, plant, delay_s))
    return elastic_gate(shipped, loop_data(shipped.law, shipped.artifact.sample_period_s), delay_samples)


def _frozen(law: MotorPidLaw, sample_period_s: float) -> MotorLaw:
    """The numbers that decide the loop in doubles."""
    return MotorLaw(
        sample_period_s=sample_period_s,
        feedback=np.array([law.feedback.kp, law.feedback.kd, law.feedback.ki]),
        observer=np.array(law.observer),
        rotors=np.array(law.rotor_inertia_kg_m2),
        stiffness=np.array(law.stiffness_nm_rad),
        correction_rad_s=law.correction_bandwidth_rad_s,
        source=law.correction_source,
    )


def loop_data(law: MotorPidLaw, sample_period_s: float) -> MotorLoopData:
    """The numbers that decide the frozen loop."""
    return MotorLoopData(
        sample_period_s=sample_period_s,
        feedback=(law.feedback.kp, law.feedback.kd, law.feedback.ki),
        observer=law.observer,
        correction_rad_s=law.correction_bandwidth_rad_s,
        source=law.correction_source,
        rotors=tuple(law.rotor_inertia_kg_m2),
        stiffness=tuple(law.stiffness_nm_rad),
    )


LAW = LawKind(MotorPidLaw, (claims,), gate, Evidence.ENCLOSED, covers_lag=True, claims_by_witness=True)
