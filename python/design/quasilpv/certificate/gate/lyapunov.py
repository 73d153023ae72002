"""The Lyapunov function itself of the acceleration-level law on a robot that moves, and its bound at run time.

`gate_motion` proves that a P exists; here one is given and checked. Time is counted in samples (T = 1), so that all
signals of one joint are angles: ``s = (theta, theta', predicted angle, speed, disturbance and its rate, filtered
disturbance, integral, what the command of the sample before does)``. One sample at a gain ``mu = c + delta`` of the
disc is ``s+ = (A + b delta k) s``, with A and b quadratic in the share ``e = 1 - delay`` of the sample in which the new
command acts. With P linear in the delay, ``V(s) = s' (P x Y^-1) s`` decreases whatever sequence of X in the disc occurs
if

    [ P - t k'k      0      A'P ]
    [     0       t / r^2   b'P ]  >  0                                                           (decrease)
    [    P A        P b      P  ]

at every delay in [0, d]. Its left side is a cubic polynomial of the delay; its Bernstein coefficients on [0, d] must be
positive definite. If P is the same at both ends, the delay may change from sample to sample as well.

Of s only ``z = C s`` is known at run time (`SampledSignals`). The law ships R and W, and

    P - C' R C > 0  at both ends,    R > 0,    Y - Y W Y > 0                                           (bound)

give ``z' (R x W) z <= V(s - s*)`` for all s with these z and all steady states s*: what is not in z is minimised over.
``C s* = 0`` because the filtered disturbance is compensated, so that only the integral of a zero error is left.

The law and the plant are written from their formulas, not from the design's own loop: the two are compared by tests.

References: Boyd et al. (1994), Linear Matrix Inequalities in System and Control Theory, section 5.1; Farouki (2012),
The Bernstein polynomial basis, Computer Aided Geometric Design 29, 379.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.matrices import (
    identity,
    is_positive_definite,
    matrix,
    rational,
    stack,
    symmetric,
    zero,
)
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.gate.motion import InertiaDisc, LyapunovDocument, MotionDocument, symmetric_matrix
from quasilpv.documents.tables import Matrix

SIGNALS = 9
KNOWN = 5


class Bound(Protocol):
    """What a law ships of the bound at run time: R, 5 x 5, and W, n x n."""

    @property
    def signals(self) -> Matrix:
        """R."""

    @property
    def joints(self) -> Matrix:
        """W."""


def is_function_proved(
    claimed: MotionDocument, bound: Bound | None, loop: AccelerationLoopData, joints: int, source: str = "artifact"
) -> bool:
    """Whether the function that an artifact carries, if any, is proved for the disc of its claim.

    P is a member of the witness, the bound one of the law: either both are there, or none.

    Args:
        claimed: the member ``motion`` of the witness.
        bound: ``lyapunov_bound`` of the law.
        loop: the law.
        joints: n.
        source: what to call it in errors.

    Raises:
        InputError: a value is not of the documented form.
    """
    if claimed.lyapunov is None or bound is None:
        return claimed.lyapunov is None and bound is None
    disc = InertiaDisc.of(claimed, joints, source)
    claim = LyapunovClaim.of(claimed.lyapunov, bound, joints, source)
    return claim.is_proved(loop, disc, rational(claimed.longest_delay_samples))


@dataclass(frozen=True)
class LyapunovClaim:
    """What an artifact claims of V.

    Attributes:
        no_delay, longest_delay: P at both ends, 9 x 9, time in samples.
        multiplier: t.
        signals: R, 5 x 5.
        joints: W, n x n.
    """

    no_delay: fmpq_mat
    longest_delay: fmpq_mat
    multiplier: fmpq
    signals: fmpq_mat
    joints: fmpq_mat

    @classmethod
    def of(cls, member: LyapunovDocument, bound: Bound, joints: int, source: str = "artifact") -> LyapunovClaim:
        """The members ``motion.lyapunov`` of a witness and ``lyapunov_bound`` of a law, exactly.

        Raises:
            InputError: a value is not of the documented form.
        """
        return cls(
            symmetric_matrix(member.no_delay, SIGNALS, "witness.motion.lyapunov.no_delay", source),
            symmetric_matrix(member.longest_delay, SIGNALS, "witness.motion.lyapunov.longest_delay", source),
            rational(member.multiplier),
            symmetric_matrix(bound.signals, KNOWN, "law.lyapunov_bound.signals", source),
            symmetric_matrix(bound.joints, joints, "law.lyapunov_bound.joints", source),
        )

    def is_proved(self, data: AccelerationLoopData, disc: InertiaDisc, longest_delay_samples: fmpq) -> bool:
        """Whether (decrease) and (bound) hold for both neighbours of the filter pole.

        Args:
            data: the law as shipped.
            disc: c, r and Y.
            longest_delay_samples: d in [0, 1].
        """
        shape = disc.shape
        loops = [SampledSignals.of(data, pole) for pole in data.filter_poles()]
        return (
            data.disturbance_compensation
            and is_positive_definite(self.signals)
            and is_positive_definite(shape - shape * self.joints * shape)
            and all(self._bounds(loop) and self._decreases(loop, disc, longest_delay_samples) for loop in loops)
        )

    def _bounds(self, loop: SampledSignals) -> bool:
        known = loop.known.transpose() * self.signals * loop.known
        return all(is_positive_definite(P - known) for P in (self.no_delay, self.longest_delay))

    def _decreases(self, loop: SampledSignals, disc: InertiaDisc, longest: fmpq) -> bool:
        t, k = self.multiplier, loop.command
        # The Bernstein coefficients on [0, d] of e and of its square, and with them those of A and b.
        early = ((fmpq(1), fmpq(1)), (1 - longest / 2, 1 - longest), (1 - longest, (1 - longest) ** 2))
        samples = [loop.sample(e, square) for e, square in early]
        # With r b for b the corner is t, and nothing is divided by r.
        drive = self._times([disc.radius * b for _, b in samples])
        transition = self._times([A + disc.centre * b * k for A, b in samples])
        none, corner = zero(SIGNALS, 1), matrix([[t]])
        for P, PA, Pb in zip(self._times([identity(SIGNALS)] * 3), transition, drive, strict=True):
            margin = P - t * k.transpose() * k
            decrease = symmetric([[margin, none, PA.transpose()], [None, corner, Pb.transpose()], [None, None, P]])
            if not is_positive_definite(decrease):
                return False
        return True

    def _times(self, factor: Sequence[fmpq_mat]) -> list[fmpq_mat]:
        """Bernstein coefficients of the cubic P A from those of the quadratic A."""
        first, second = self.no_delay, self.longest_delay
        low, middle, high = factor
        return [
            first * low,
            (2 * first * middle + second * low) / 3,
            (first * high + 2 * second * middle) / 3,
            second * high,
        ]


@dataclass(frozen=True)
class SampledSignals:
    """One sample of the loop of one joint, as rows of s.

    Attributes:
        command: k, 1 x 9: the command of the sample.
        controller: its next predicted angle, speed, disturbance and rate, filtered disturbance and integral, 6 x 9.
        known: C, 5 x 9: the angle; the innovation; the corrected speed; the corrected disturbance less the filtered
            one; the integral.
    """

    command: fmpq_mat
    controller: fmpq_mat
    known: fmpq_mat

    @classmethod
    def of(cls, data: AccelerationLoopData, filter_pole: fmpq) -> SampledSignals:
        """The law (``docs/concepts/acceleration-law.md``) with zero reference, for one filter pole q."""
        T = rational(data.sample_period_s)
        kp, kd, ki = rational(data.kp) * T**2, rational(data.kd) * T, rational(data.ki) * T**3
        l1, l2, l3, l4 = (rational(gain) * T**power for power, gain in enumerate(data.observer))
        angle, _, p1, p2, p3, p4, filtered, integral, _ = _unit_rows()
        innovation = angle - p1
        e1, e2, e3, e4 = p1 + l1 * innovation, p2 + l2 * innovation, p3 + l3 * innovation, p4 + l4 * innovation
        filtered = filter_pole * filtered + (1 - filter_pole) * e3
        command = kp * e1 + kd * e2 + ki * integral
        if data.disturbance_compensation:
            command = command - filtered
        applied = command + e3
        following = (e1 + e2 + applied / 2 + e4 / 6, e2 + applied + e4 / 2, e3 + e4, e4, filtered, integral + angle)
        known = (angle, innovation, e2, e3 - filtered, integral)
        return cls(command, *(stack([[row] for row in rows]) for rows in (following, known)))

    def sample(self, early: fmpq, square: fmpq) -> tuple[fmpq_mat, fmpq_mat]:
        """``(A, b)`` of ``s+ = (A + mu b k) s`` where the new command acts for the share e of the sample.

        Args:
            early: e.
            square: what stands for e^2.
        """
        angle, speed, *_, on_its_way = _unit_rows()
        plant = (angle + speed + (1 - square) / 2 * on_its_way, speed + (1 - early) * on_its_way)
        free = stack([[plant[0]], [plant[1]], [self.controller], [zero(1, SIGNALS)]])
        return free, matrix([[square / 2], [early], *[[0]] * 6, [1]])


def _unit_rows() -> list[fmpq_mat]:
    return [fmpq_mat(1, SIGNALS, [int(i == j) for j in range(SIGNALS)]) for i in range(SIGNALS)]
