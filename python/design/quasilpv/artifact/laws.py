"""The law kinds of an artifact, one class each (``docs/reference/formats.md``, "Law kinds")."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from quasilpv.documents.design_inertia import DesignInertia
from quasilpv.documents.strict_model import FieldError, NonNegative, Number, Positive, StrictModel
from quasilpv.documents.tables import Matrix, PolytopeTable, Vector, require_lyapunov, require_shape, require_size

MIN_WINDOW_SAMPLES = 5
"""A shorter moving window has no mean to speak of; 0 stands for its limit."""

KNOWN_SIGNALS = 5
"""Of one joint: what of the loop is known at run time."""

MAX_WINDOW_SAMPLES = 4096
MAX_DELAYED_VERTICES = 16


class Feedback(StrictModel):
    """Acceleration-level feedback ``kp e + kd e' + ki int e`` with e = x - x_r: stabilising gains are negative."""

    kp: Number
    kd: Number
    ki: Number


class _Law(StrictModel):
    """What every law has: the design inertia, a table over the premises of the program ``premises`` or a robot."""

    inertia: DesignInertia

    def check(self, joints: int) -> None:
        """Raise ``FieldError`` unless gains and tables fit a robot of n joints."""

    def premises_of(self, program: str) -> int | None:
        """How many premises a program of this law has to compute; None for a program of torques."""
        inertia = self.inertia
        return inertia.premises if program == "premises" and isinstance(inertia, PolytopeTable) else None

    @property
    def premise_box(self) -> tuple[Vector, Vector]:
        """Lower and upper bounds the premises of the inertia are clamped to; a robot has no premises."""
        inertia = self.inertia
        return (inertia.lower, inertia.upper) if isinstance(inertia, PolytopeTable) else ((), ())

    @property
    def reads_programs(self) -> bool:
        """Whether premises and gravity are programs; a robot as design inertia has its own."""
        return isinstance(self.inertia, PolytopeTable)


class _VelocityLaw(_Law):
    """A law that reads measured speeds through a low-pass filter."""

    inertia: PolytopeTable
    velocity_filter_time_constant_s: NonNegative


class _ScheduledLaw(_VelocityLaw):
    """A law whose gains have premises of their own, of angles and speeds: the program ``schedule``."""

    scheduled: ClassVar[str]
    """The field that holds the table over these premises."""

    def premises_of(self, program: str) -> int | None:
        """See `_Law.premises_of`."""
        table: PolytopeTable = getattr(self, self.scheduled)
        return table.premises if program == "schedule" else super().premises_of(program)


class _OptionalMemberLaw(_Law):
    """A law with a member that may be absent, but is not null: a document without it has no such member."""

    optional: ClassVar[tuple[str, str]]
    """The member and what it is, for messages."""

    @model_validator(mode="after")
    def _refuse_null(self) -> Self:
        name, meaning = self.optional
        if getattr(self, name) is None and name in self.model_fields_set:
            raise FieldError(name, "null", f"{meaning}, or no member of this name")
        return self

    @model_serializer(mode="wrap")
    def _leave_out_absent(self, serialise: SerializerFunctionWrapHandler) -> dict[str, Any]:
        members: dict[str, Any] = serialise(self)
        return {name: member for name, member in members.items() if member is not None}


class LyapunovBound(StrictModel):
    """A proved lower bound of a Lyapunov function, ``tr(joints Z' signals Z)`` with Z the known signals, 5 x n."""

    signals: Matrix
    joints: Matrix


class DobAccelerationLaw(_OptionalMemberLaw):
    """Tracking at the acceleration level with a disturbance observer, the same scalars for every joint.

    With ``disturbance_compensation`` false the observer runs but its filtered disturbance is not fed back.
    ``lyapunov_bound`` is for the monitor (``docs/concepts/motion.md``).
    """

    optional: ClassVar[tuple[str, str]] = ("lyapunov_bound", "two matrices")

    kind: Literal["dob-acceleration"]
    feedback: Feedback
    observer: tuple[Number, Number, Number, Number]
    filter_time_constant_s: Positive
    disturbance_compensation: bool
    lyapunov_bound: LyapunovBound | None = None

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        if self.lyapunov_bound is None:
            return
        require_lyapunov("law.lyapunov_bound.signals", self.lyapunov_bound.signals, KNOWN_SIGNALS)
        require_lyapunov("law.lyapunov_bound.joints", self.lyapunov_bound.joints, joints)
        if self.observer[0] == 1.0:
            raise FieldError("law.observer[0]", 1, "another number with law.lyapunov_bound")


class DobTorqueLaw(_OptionalMemberLaw):
    """Tracking in torque coordinates with a disturbance observer and scheduled gains (Dehak 2022, Theorem IV.11).

    ``feedback`` holds [Kp Kd KI], n x 3n, acting on x - x_r; ``observer`` holds [L1; L2; L3; L4], 4n x n. With
    ``premultiplication`` beta, n x n, they belong to beta(z) times the equations of motion.
    """

    optional: ClassVar[tuple[str, str]] = ("premultiplication", "a block polytope")

    kind: Literal["dob-torque"]
    inertia: PolytopeTable
    feedback: PolytopeTable
    observer: PolytopeTable
    filter_time_constant_s: Positive
    premultiplication: PolytopeTable | None = None

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        self.feedback.require_gains("law.feedback", joints, 3 * joints, self.inertia)
        self.observer.require_gains("law.observer", 4 * joints, joints, self.inertia)
        if self.premultiplication is not None:
            self.premultiplication.require_gains("law.premultiplication", joints, joints, self.inertia)


class HinfTrackingLaw(_VelocityLaw):
    """H-infinity PI tracking (Dehak 2022, Theorem III.10): ``Gamma = Y(z) diag(I, M, I)^-1 P^-1 (e, e', int e)``.

    ``numerator`` holds Y, n x 3n; ``lyapunov`` is P, 3n x 3n; e = x - x_r.
    """

    kind: Literal["hinf-tracking"]
    numerator: PolytopeTable
    lyapunov: Matrix

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        self.numerator.require_gains("law.numerator", joints, 3 * joints, self.inertia)
        require_lyapunov("law.lyapunov", self.lyapunov, 3 * joints)


class StateFeedbackLaw(_ScheduledLaw):
    """Scheduled state feedback (Dehak 2022, Theorem I.2 and (III.25)): ``Gamma = K(z) (y - r, w - r')``.

    ``gain`` holds K, n x 2n, over the premises of the program ``schedule``.
    """

    scheduled: ClassVar[str] = "gain"

    kind: Literal["state-feedback"]
    gain: PolytopeTable

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        self.gain.require_shape("law.gain", joints, 2 * joints)


class DescriptorFeedbackLaw(_ScheduledLaw):
    """Descriptor feedback (Dehak 2022, II.38): ``Gamma = F(z) diag(I, M)^-1 P^-1 (y - r, w - r')``.

    ``numerator`` holds F, n x 2n, over the premises of the program ``schedule``; ``lyapunov`` is P, 2n x 2n.
    """

    scheduled: ClassVar[str] = "numerator"

    kind: Literal["descriptor-feedback"]
    numerator: PolytopeTable
    lyapunov: Matrix

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        self.numerator.require_shape("law.numerator", joints, 2 * joints)
        require_lyapunov("law.lyapunov", self.lyapunov, 2 * joints)


class DelayedFeedbackLaw(_ScheduledLaw):
    """Feedback with a moving window (Dehak 2022, II.49 and II.69): ``Gamma = F diag(I, M)^-1 P(varpi)^-1 x``.

    ``lyapunov`` holds P, 2n x 2n, over the premises of the program ``schedule``; ``numerators`` the F_jkm, n x 2n, m
    fastest; ``window_samples`` is tau/T, or 0 for the limit of a short window; without ``descriptor`` diag(I, M) is
    left out.
    """

    scheduled: ClassVar[str] = "lyapunov"

    kind: Literal["delayed-feedback"]
    lyapunov: PolytopeTable
    numerators: tuple[Matrix, ...]
    window_samples: int = Field(ge=0, le=MAX_WINDOW_SAMPLES)
    descriptor: bool

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        self.lyapunov.require_lyapunov("law.lyapunov", 2 * joints)
        count = self.lyapunov.vertex_count
        if count > MAX_DELAYED_VERTICES:
            raise FieldError("law.lyapunov", f"{count} vertices", f"at most {MAX_DELAYED_VERTICES}")
        if len(self.numerators) != count**3:
            expected = f"{count**3}, the cube of the number of vertices"
            raise FieldError("law.numerators", f"{len(self.numerators)} matrices", expected)
        for i, numerator in enumerate(self.numerators):
            require_shape(f"law.numerators[{i}]", numerator, joints, 2 * joints)
        if 0 < self.window_samples < MIN_WINDOW_SAMPLES:
            expected = f"0 (the limit of a short window) or at least {MIN_WINDOW_SAMPLES} sample periods"
            raise FieldError("law.window_samples", self.window_samples, expected)


class PidLaw(_VelocityLaw):
    """PID with feedforward (Dehak 2022, III.54): gains act on r - y, one per joint."""

    kind: Literal["pid"]
    kp: Vector
    kd: Vector
    ki: Vector

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        for name, gains in (("kp", self.kp), ("kd", self.kd), ("ki", self.ki)):
            require_size(f"law.{name}", gains, joints)


class _ComputedTorque(_VelocityLaw):
    gp: Vector
    gd: Vector
    gi: Vector
    disturbance_observer_bandwidth_rad_s: NonNegative

    def check(self, joints: int) -> None:
        """See `_Law.check`."""
        for name, gains in (("gp", self.gp), ("gd", self.gd), ("gi", self.gi)):
            require_size(f"law.{name}", gains, joints)


class CtcLaw(_ComputedTorque):
    """Computed torque (Dehak 2022, III.56) without disturbance observer: its bandwidth is 0."""

    kind: Literal["ctc"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        bandwidth = self.disturbance_observer_bandwidth_rad_s
        if bandwidth != 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", bandwidth, "0 for kind ctc")
        return self


class CtcDobLaw(_ComputedTorque):
    """Computed torque (Dehak 2022, III.56, sign of the estimate corrected) with a disturbance observer."""

    kind: Literal["ctc-dob"]

    @model_validator(mode="after")
    def _check_bandwidth(self) -> Self:
        if self.disturbance_observer_bandwidth_rad_s == 0:
            raise FieldError("disturbance_observer_bandwidth_rad_s", 0, "more than 0 for kind ctc-dob")
        return self


Law = Annotated[
    DobAccelerationLaw
    | DobTorqueLaw
    | HinfTrackingLaw
    | StateFeedbackLaw
    | DescriptorFeedbackLaw
    | DelayedFeedbackLaw
    | PidLaw
    | CtcLaw
    | CtcDobLaw,
    Field(discriminator="kind"),
]
