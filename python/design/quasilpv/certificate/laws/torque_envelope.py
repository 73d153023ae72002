"""Exact check of the operating envelope of `dob-torque`, from the artifact's data and witness alone.

Design model and notation are those of `laws.dob_torque` (SI, blocks n x n, ``E_i = diag(I, M_i, I)``):

* feedback, ``E(z) xi' = (A + B K(z)) xi + B d``. Level sets, ``|xi| = sqrt(xi' X^-1 xi)``, and the set the residual d
  can reach from 0 while ``|d| <= 1``, ``xi' X^-1 xi <= 1``. Claims: ``X > 0`` and, as double sums over i, j,

      He((A + B K_i) X E_j') + 2 alpha E_i X E_j' < 0  (level sets: |xi| decays like exp(-alpha t))
      He((A + B K_i) X E_j') + lambda E_i X E_j' + B B' / lambda < 0  (residual set)

  ``X_jj < c^2`` for the angle and the speed of each joint, ``K_ij X K_ij' < c^2`` for its torque at every vertex i;
  ``level c_j < margin_j`` (box), ``level c_j < share * limit_j`` (torques), ``peak c_j < margin_j`` (residual).
* observer, ``eps' = (A - L(z) C) eps + G v + H d''``: from 0 the error stays in ``eps' Q eps <= 1`` while
  ``|d''| <= p``, p the peak in the witness. Claims: ``Q > 0`` and for every i, with ``c_i = [D, -M_i]``,
  ``[He(Q (A - L_i C)) + lambda Q, Q G, p Q H; *, 0, 0; *, *, -lambda I] + He([F; 0] [c_i, 0]) < 0``;
  ``[[Q, C'], [*, c^2 I]] > 0``, so that ``|C eps| <= c``, for the disturbance, C = D, and for the torque it makes at
  each vertex, ``C = [Kp_i, Kd_i, 0, 0]``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.claims import Claim, all_positive
from quasilpv.certificate.exact.double_sum import double_sum, he
from quasilpv.certificate.exact.matrices import identity, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.documents.artifact import Domain

Matrices = Sequence[fmpq_mat]


class Bounds(WitnessDocument):
    """Largest errors of a set at level or peak 1, per joint; the last for the feedback torque."""

    angle_rad: tuple[float, ...]
    speed_rad_s: tuple[float, ...]
    torque_nm: tuple[float, ...]


class ErrorSet(WitnessDocument):
    """``xi' X^-1 xi``."""

    X: Rows
    bounds: Bounds


class LevelSet(ErrorSet):
    """How fast it decays, and the level that is allowed."""

    decay_per_s: float
    level: float


class ResidualSet(ErrorSet):
    """What a residual of at most 1 N m can reach, and the largest one."""

    multiplier: float
    peak: float


class ObserverBounds(WitnessDocument):
    """Largest errors of the disturbance and of the torque it makes."""

    disturbance_nm: float
    feedback_nm: float


class ObserverSet(WitnessDocument):
    """``eps' Q eps <= 1`` while the second derivative of the disturbance is at most a peak."""

    Q: Rows
    F: Rows
    multiplier: float
    peak_nm_per_s2: float
    bounds: ObserverBounds


class PolytopicEnvelope(WitnessDocument):
    """The member ``envelope`` of the witness."""

    reference_margin_rad: tuple[float, ...]
    torque_share: float
    box_set: LevelSet
    torque_set: LevelSet
    residual_set: ResidualSet
    observer_set: ObserverSet


def torque_envelope_claims(
    shipped: Shipped[Any], envelope: PolytopicEnvelope, inertia: Matrices, feedback: Matrices, observer: Matrices
) -> Iterator[Claim]:
    """Claims of the envelope of a `dob-torque` artifact.

    Args:
        shipped: the artifact.
        envelope: of its witness.
        inertia, feedback, observer: vertices of the law's tables.

    Raises:
        ValueError, ZeroDivisionError: the witness is not of the documented form.
    """
    margins = [rational(margin) for margin in envelope.reference_margin_rad]
    share = rational(envelope.torque_share)
    torques = [share * rational(limit) for limit in shipped.artifact.limits.torque_nm]
    loop = FeedbackLoop.of(inertia, feedback)
    yield room_claim(shipped.artifact.domain, margins)
    yield all_positive("envelope: torque share", [share, 1 - share])
    for name, witness, bounds, allowed in (
        ("box set", envelope.box_set, envelope.box_set.bounds.angle_rad, margins),
        ("torque set", envelope.torque_set, envelope.torque_set.bounds.torque_nm, torques),
    ):
        decay = rational(witness.decay_per_s)
        yield all_positive(f"envelope: {name}, decay rate", [decay])
        yield from _feedback_claims(f"envelope: {name}", witness, loop, (2 * decay, fmpq(0)))
        yield _scale_claim(f"envelope: {name}, level", allowed, witness.level, bounds)
    residual = envelope.residual_set
    multiplier = rational(residual.multiplier)
    yield all_positive("envelope: residual set, multiplier", [multiplier])
    yield from _feedback_claims("envelope: residual set", residual, loop, (multiplier, 1 / multiplier))
    yield _scale_claim("envelope: residual set, peak", margins, residual.peak, residual.bounds.angle_rad)
    yield from _observer_claims(envelope.observer_set, inertia, feedback, observer)


def room_claim(domain: Domain, margins: Sequence[fmpq]) -> Claim:
    """The claim that the margins are positive and leave a part of the operating domain to the reference."""
    left = [
        rational(high) - rational(low) - 2 * margin
        for (low, high), margin in zip(domain.angle_rad, margins, strict=True)
    ]
    return all_positive("envelope: margins leave room for a reference", [*margins, *left])


def _scale_claim(name: str, allowed: Sequence[fmpq], scale: float, bounds: Sequence[float]) -> Claim:
    """The claim that a set of this scale exceeds what is allowed at no joint: ``scale c_j < allowed_j``."""
    spare = [most - rational(scale) * rational(bound) for most, bound in zip(allowed, bounds, strict=True)]
    return all_positive(name, [rational(scale), *spare])


@dataclass(frozen=True, eq=False)
class FeedbackLoop:
    """Vertices of ``E(z) xi' = A(z) xi + B d``, and the gains.

    Attributes:
        E, A: N matrices of 3n x 3n each.
        B: 3n x n.
        gains: N matrices of n x 3n.
    """

    E: Matrices
    A: Matrices
    B: fmpq_mat
    gains: Matrices

    @classmethod
    def of(cls, inertia: Matrices, gains: Matrices) -> FeedbackLoop:
        """The loop of these tables."""
        n = inertia[0].nrows()
        one, none = identity(n), zero(n, n)
        A = stack([[none, one, none], [none, none, none], [one, none, none]])
        B = stack([[none], [one], [none]])
        E = [stack([[one, none, none], [none, M, none], [none, none, one]]) for M in inertia]
        return cls(E, [A + B * K for K in gains], B, gains)


def _feedback_claims(name: str, witness: ErrorSet, loop: FeedbackLoop, weights: tuple[fmpq, fmpq]) -> Iterator[Claim]:
    """Invariance, ``He(A_i X E_j') + a E_i X E_j' + b B B' < 0`` with weights (a, b), and the bounds."""
    X = matrix(witness.X)
    rate, reached = weights[0], weights[1] * (loop.B * loop.B.transpose())
    following, held = [A * X for A in loop.A], [E * X for E in loop.E]

    def decrease(i: int, j: int) -> fmpq_mat:
        return he(following[i] * loop.E[j].transpose()) + rate * held[i] * loop.E[j].transpose() + reached

    yield Claim.positive(f"{name}, X", X)
    yield from double_sum(f"{name}, decrease", decrease, len(loop.A))
    yield all_positive(f"{name}, bounds", _spares(witness.bounds, X, loop.gains))


def _spares(bounds: Bounds, X: fmpq_mat, gains: Matrices) -> Iterator[fmpq]:
    """The bounds, and by how much their squares exceed the squares of what ``xi' X^-1 xi <= 1`` reaches."""
    n = gains[0].nrows()
    efforts = [K * X * K.transpose() for K in gains]
    for j in range(n):
        reached = {
            "angle_rad": X[j, j],
            "speed_rad_s": X[n + j, n + j],
            "torque_nm": max(effort[j, j] for effort in efforts),
        }
        for quantity, square in reached.items():
            stated = getattr(bounds, quantity)
            if len(stated) != n:
                raise ValueError("one bound per joint")
            bound = rational(stated[j])
            yield from (bound, bound**2 - square)


def _observer_claims(
    witness: ObserverSet, inertia: Matrices, feedback: Matrices, observer: Matrices
) -> Iterator[Claim]:
    n = inertia[0].nrows()
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none, none], [none] * 4, [none, none, none, one], [none] * 4])
    G, H = stack([[none], [one], [none], [none]]), stack([[none], [none], [none], [one]])
    C, D = stack([[one, none, none, none]]), stack([[none, none, one, none]])
    Q, F = matrix(witness.Q), matrix(witness.F)
    multiplier, peak = rational(witness.multiplier), rational(witness.peak_nm_per_s2)
    disturbance, torque = rational(witness.bounds.disturbance_nm), rational(witness.bounds.feedback_nm)
    yield all_positive("envelope: observer set, multiplier and bounds", [multiplier, peak, disturbance, torque])
    yield Claim.positive("envelope: observer set, Q", Q)
    yield Claim.positive(
        "envelope: observer set, disturbance", symmetric([[Q, D.transpose()], [None, disturbance**2 * one]])
    )
    to_state = stack([[one, none, none, none], [none, one, none, none], [none] * 4])
    for i, (M, K, L) in enumerate(zip(inertia, feedback, observer, strict=True)):
        top = symmetric([[he(Q * (A - L * C)) + multiplier * Q, Q * G], [None, none]]) + he(F * stack([[D, -M]]))
        drive = stack([[peak * Q * H], [none]])
        decrease = symmetric([[top, drive], [None, -multiplier * one]])
        yield Claim.positive(f"envelope: observer set, decrease {i}", -decrease)
        effort = (K * to_state).transpose()
        yield Claim.positive(f"envelope: observer set, torque {i}", symmetric([[Q, effort], [None, torque**2 * one]]))
