"""The law `dob-acceleration`: its document, and what is claimed of it, checked from its data and witness alone.

The gains are the doubles of the artifact, taken as the rationals they are; the Lyapunov matrices are the witness. In
the time unit ``1/w`` of each chain (w: the bandwidth in the witness), with ``t = w T``:

* feedback ``K = (kp / w^2, kd / w, ki / w^3)``, chain ``A = [[1, t, 0], [0, 1, 0], [t, 0, 1]]``,
  ``B = [t^2/2, t, 0]'``; claims: with F = A + B K, ``[[r P, (F - c I) P], [*, r P]] > 0`` (poles in the disk
  ``|z - c| < r``) and ``[[P, F P, B], [*, P, 0], [*, *, 1]] > 0`` (P bounds the stationary covariance under unit white
  acceleration). With ki = 0 nothing reads the integral: its row, column and gain are left out.
* observer ``l = (l1, l2 / w, l3 / w^2, l4 / w^3)'``, chain ``A = exp(N t)``, N the nilpotent shift; claims: with
  ``F = A (I - l C)``, ``[[r Q, Q (F - c I)], [*, r Q]] > 0``, ``[[Q, Q F], [*, Q - c3' c3]] > 0``, and
  ``objective > trace(H' Q H)`` with ``H = [A l, G]``: the variance of the disturbance estimate.
* the table of the design inertia, if it is one: what the run-time side collapses it to (`exact.vertex_tables`);
* the operating envelope, if the witness has one (`sampled_envelope`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal, Self

import numpy as np
from flint import fmpq, fmpq_mat
from pydantic import model_validator

from quasilpv.certificate.exact.claims import Claim, Evidence
from quasilpv.certificate.exact.matrices import identity, matrix, rational, symmetric, trace, zero
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.elastic_grid import elastic_grid_gate
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.gate.proof import RobustGate, robust_gate
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.laws.sampled_envelope import SampledEnvelope, sampled_envelope_claims
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.documents.law import ChainLaw
from quasilpv.documents.strict_model import FieldError, Number, Positive, StrictModel
from quasilpv.documents.tables import Intervals, Matrix, PolytopeTable, Vector, require_lyapunov
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate

KNOWN_SIGNALS = 5
"""Of one joint: what of the loop is known at run time."""


class Feedback(StrictModel):
    """Acceleration-level feedback ``kp e + kd e' + ki int e`` with e = x - x_r: stabilising gains are negative."""

    kp: Number
    kd: Number
    ki: Number


class LyapunovBound(StrictModel):
    """A proved lower bound of a Lyapunov function, ``tr(joints Z' signals Z)`` with Z the known signals, 5 x n."""

    signals: Matrix
    joints: Matrix


class MotionLimits(StrictModel):
    """Angles and speeds of the motions that a law for a robot in space was designed for; the run time enforces them."""

    angle_rad: Intervals
    speed_rad_s: Vector

    @model_validator(mode="after")
    def _check(self) -> Self:
        for j, (low, high) in enumerate(self.angle_rad):
            if not low < high:
                raise FieldError(f"angle_rad[{j}]", [low, high], "a lower bound below the upper bound")
        for j, speed in enumerate(self.speed_rad_s):
            if not speed > 0.0:
                raise FieldError(f"speed_rad_s[{j}]", speed, "a number > 0")
        return self

    def require_joints(self, joints: int) -> None:
        """Raise ``FieldError`` unless there is an interval and a speed for every joint."""
        for field in ("angle_rad", "speed_rad_s"):
            if len(getattr(self, field)) != joints:
                expected = f"{joints}, one per joint"
                raise FieldError(f"law.motion_limits.{field}", f"{len(getattr(self, field))} entries", expected)


class DobAccelerationLaw(ChainLaw):
    """Tracking at the acceleration level with a disturbance observer, the same scalars for every joint.

    With ``disturbance_compensation`` false the observer runs but its filtered disturbance is not fed back.
    ``lyapunov_bound`` is for the monitor, ``motion_limits`` for the run time (``docs/concepts/motion.md``);
    ``angle_side`` is for gears whose drives control their torques.
    """

    DISTURBANCE = "acceleration"

    optional: ClassVar[Mapping[str, str]] = {
        **ChainLaw.optional,
        "lyapunov_bound": "two matrices",
        "motion_limits": "limits",
        "angle_side": '"link"',
    }

    kind: Literal["dob-acceleration"]
    feedback: Feedback
    observer: tuple[Number, Number, Number, Number]
    filter_time_constant_s: Positive
    disturbance_compensation: bool
    lyapunov_bound: LyapunovBound | None = None
    motion_limits: MotionLimits | None = None
    angle_side: Literal["link"] | None = None

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        super().check(joints)
        if self.motion_limits is not None:
            self.motion_limits.require_joints(joints)
        if self.lyapunov_bound is None:
            return
        require_lyapunov("law.lyapunov_bound.signals", self.lyapunov_bound.signals, KNOWN_SIGNALS)
        require_lyapunov("law.lyapunov_bound.joints", self.lyapunov_bound.joints, joints)
        if self.observer[0] == 1.0:
            raise FieldError("law.observer[0]", 1, "another number with law.lyapunov_bound")


class FeedbackWitness(WitnessDocument):
    """Time unit 1/w, w the bandwidth."""

    bandwidth_rad_s: float
    P: Rows
    disk_centre: float
    disk_radius: float


class ObserverWitness(WitnessDocument):
    """Likewise; ``objective`` bounds the variance of the estimated disturbance."""

    bandwidth_rad_s: float
    Q: Rows
    disk_centre: float
    disk_radius: float
    objective: float


class DobAccelerationWitness(WitnessDocument):
    """What the claims need beside the law."""

    feedback: FeedbackWitness
    observer: ObserverWitness
    envelope: SampledEnvelope | None = None


def claims(shipped: Shipped[DobAccelerationLaw]) -> Iterator[Claim]:
    """What a `dob-acceleration` artifact claims.

    Raises:
        InputError, ValueError, ZeroDivisionError: the witness is not of the documented form.
    """
    period, law = rational(shipped.artifact.sample_period_s), shipped.law
    witness = shipped.witness(DobAccelerationWitness)
    yield from _feedback_claims(period, law.feedback, witness.feedback)
    yield from _observer_claims(period, law.observer, witness.observer)
    if isinstance(law.inertia, PolytopeTable):
        yield from VertexTable.of(law.inertia).collapse_claim("inertia")
    if witness.envelope is not None:
        shipped.require_no_lag("an artifact without an operating envelope, which knows no lag")
        yield from sampled_envelope_claims(shipped, loop_data(shipped), witness.envelope)


def loop_data(shipped: Shipped[DobAccelerationLaw]) -> AccelerationLoopData:
    """The scalar loop that the loop of n joints decouples into."""
    law = shipped.law
    return AccelerationLoopData(
        sample_period_s=shipped.artifact.sample_period_s,
        kp=law.feedback.kp,
        kd=law.feedback.kd,
        ki=law.feedback.ki,
        observer=law.observer,
        filter_time_constant_s=law.filter_time_constant_s,
        disturbance_compensation=law.disturbance_compensation,
    )


def gate(shipped: Shipped[DobAccelerationLaw], delay_samples: fmpq) -> RobustGate:
    """The proof of the scalar loop for all that `quasilpv.certificate.gate.proof` says.

    Of gears whose drives control their torques a grid of elastic arms is looked at beside it.
    """
    law = shipped.law
    found = robust_gate(shipped, loop_data(shipped), delay_samples, law.lyapunov_bound, law.motion_limits)
    if law.angle_side is None or getattr(shipped.payloads, "gears", None) is None:
        return found
    frozen = LinkLaw(
        sample_period_s=shipped.artifact.sample_period_s,
        feedback=np.array([law.feedback.kp, law.feedback.kd, law.feedback.ki]),
        observer=np.array(law.observer),
        filter_time_constant_s=law.filter_time_constant_s,
        inertia_scale=1.0,
        relative_damping=np.zeros(shipped.artifact.joints),
    )
    return replace(found, elastic=elastic_grid_gate(shipped, delay_samples, partial(link_growth_rate, frozen)))


def _feedback_claims(period: fmpq, gains: Feedback, witness: FeedbackWitness) -> tuple[Claim, ...]:
    w = rational(witness.bandwidth_rad_s)
    t = w * period
    kp, kd, ki = rational(gains.kp), rational(gains.kd), rational(gains.ki)
    if ki == 0:
        transition, drive = matrix([[1, t], [0, 1]]), matrix([[t * t / 2], [t]])
        closed = transition + drive * matrix([[kp / w**2, kd / w]])
    else:
        transition, drive = matrix([[1, t, 0], [0, 1, 0], [t, 0, 1]]), matrix([[t * t / 2], [t], [0]])
        closed = transition + drive * matrix([[kp / w**2, kd / w, ki / w**3]])
    size, P = closed.nrows(), matrix(witness.P)
    c, r = rational(witness.disk_centre), rational(witness.disk_radius)
    disk = symmetric([[r * P, (closed - c * identity(size)) * P], [None, r * P]])
    covariance = symmetric([[P, closed * P, drive], [None, P, zero(size, 1)], [None, None, identity(1)]])
    return (
        Claim.positive("feedback: pole disk", disk),
        Claim.positive("feedback: covariance", covariance),
    )


def _observer_claims(period: fmpq, gains: tuple[float, ...], witness: ObserverWitness) -> tuple[Claim, ...]:
    w = rational(witness.bandwidth_rad_s)
    t = w * period
    transition = matrix([[1, t, t**2 / 2, t**3 / 6], [0, 1, t, t**2 / 2], [0, 0, 1, t], [0, 0, 0, 1]])
    drive = matrix([[t**4 / 24], [t**3 / 6], [t**2 / 2], [t]])
    correction = matrix([[rational(gain) / w**i] for i, gain in enumerate(gains)])
    error = transition * (identity(4) - correction * matrix([[1, 0, 0, 0]]))
    Q = matrix(witness.Q)
    c, r = rational(witness.disk_centre), rational(witness.disk_radius)
    estimate = matrix([[0, 0, 1, 0]])
    disk = symmetric([[r * Q, Q * (error - c * identity(4))], [None, r * Q]])
    gramian = symmetric([[Q, Q * error], [None, Q - estimate.transpose() * estimate]])
    variance = _quadratic(Q, transition * correction) + _quadratic(Q, drive)
    budget = rational(witness.objective) - variance
    return (
        Claim.positive("observer: pole disk", disk),
        Claim.positive("observer: Gramian", gramian),
        Claim.positive("observer: variance", matrix([[budget]])),
    )


def _quadratic(weight: fmpq_mat, columns: fmpq_mat) -> fmpq:
    """``trace(columns' weight columns)``."""
    return trace(columns.transpose() * weight * columns)


LAW = LawKind(DobAccelerationLaw, (claims, check_design_model), gate, Evidence.ENCLOSED, covers_lag=True)
