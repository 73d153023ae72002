"""Exact check of the operating envelope of `dob-acceleration`, from the artifact's data and witness alone.

One joint of the design model is ``theta'' = a + d(t)``, a held over a sample. With the reference r, ``e = theta - r``,
the estimation error eps of (theta, w, d, d') before the measurement is used and ``f = d - d_f`` before the filter is,
one sample of the law (``docs/concepts/acceleration-law.md``) is, in this order,

    eps -= l eps_1;   f <- q f + (1 - q) eps_3;   alpha = f + kp (e - eps_1) + kd (e' - eps_2) + ki i
    i += T e;   e += T e' + T^2/2 alpha + T^3/6 d';   e' += T alpha + T^2/2 d';   eps <- exp(N T) eps;   f += T d'

so ``x+ = A x + b d' + v`` for x = (e, e', i, eps, f), and ``d'+ = d' + v_4``. With ``s = A s + b`` (where ``s_1 = 0``,
as i stands still) the state ``x - s d'`` is driven by v alone. A function d'' with ``|d''| <= 1`` has an effect
``v = int_0^T g(T - s) d''(t + s) ds`` with ``v v' <= T int g g' ds`` (Cauchy-Schwarz); D bounds it in ``x - s d'``.
A reference whose third derivative is at most 1 drives (e, e', i) in the same way, as r'' is held over a sample.

Claims, for each output C (angle, speed, acceleration theta'' - r'') and its bound c in the witness:

* level set, ``|x|_P = sqrt(x' P x)``: ``(1 - 2 alpha T) P - A' P A > 0`` with ``alpha > 0``, so that ``|x|_P`` decays
  like exp(-alpha t); ``[[P, C'], [*, c^2]] > 0``: ``|C x| <= c |x|_P``. Of the levels: ``c level_j < margin_j`` keeps
  the angles in the box, ``sum_l |M_jl| c level_l < share * limit_j`` keeps the torques (|M_jl| over the whole table);
* peak set: ``X - A X A' / lambda - D / (1 - lambda) > 0``, ``0 < lambda < 1``: x starting at 0 stays in
  ``x' X^-1 x <= 1`` while ``|d''| <= 1``; ``C X C' < c^2``. Of the peaks: ``c peak_j < margin_j``.

The filter pole q is irrational: what depends on it is claimed for the two doubles around it, one of which the run-time
side computes with.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import factorial
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.claims import Claim, all_positive
from quasilpv.certificate.exact.matrices import identity, matrix, rational, symmetric
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.laws.torque_envelope import room_claim
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.data import inertia_table

OUTPUTS = ("angle_rad", "speed_rad_s", "acceleration_rad_s2")


@dataclass(frozen=True, eq=False)
class ErrorDynamics:
    """``x+ = A x + v``, exactly.

    Attributes:
        transition: A.
        effects: D, ``v v' <= D``.
        outputs: rows of angle, speed and acceleration, in the order of `OUTPUTS`.
    """

    transition: fmpq_mat
    effects: fmpq_mat
    outputs: tuple[fmpq_mat, ...]

    @classmethod
    def of_disturbance(cls, law: AccelerationLoopData, filter_pole: fmpq) -> ErrorDynamics:
        """All eight states under ``|d''| <= 1``, for one filter pole.

        Raises:
            ValueError: the law does not compensate the disturbance.
            ZeroDivisionError: there is no steady state under a rising disturbance.
        """
        if not law.disturbance_compensation:
            raise ValueError("a law that does not compensate its disturbance has no envelope")
        T, q = rational(law.sample_period_s), filter_pole
        e, speed, integral, *predicted, f = _unit_rows(8)
        eps = [row - rational(gain) * predicted[0] for row, gain in zip(predicted, law.observer, strict=True)]
        f = q * f + (1 - q) * eps[2]
        alpha = _feedback(law, e - eps[0], speed - eps[1], integral) + f
        advanced = [_total(T**p / factorial(p) * eps[i + p] for p in range(4 - i)) for i in range(4)]
        following = [e + T * speed + T**2 / 2 * alpha, speed + T * alpha, integral + T * e, *advanced, f]
        A = matrix([row.table()[0] for row in following])
        rising = matrix([[T**3 / 6], [T**2 / 2], *[[0]] * 5, [T]])
        steady = (identity(8) - A).solve(rising)
        none = matrix([[0, 0, 0, 0]])
        v = _unit_rows(4)
        direct = matrix([row.table()[0] for row in (v[0], v[1], none, *v, v[2])])
        drive = direct - steady * v[3]
        return cls(A, drive * _held_effects(T, (3, 2, 1, 0)) * drive.transpose(), (e, speed, alpha))

    @classmethod
    def of_reference(cls, law: AccelerationLoopData) -> ErrorDynamics:
        """The states (e, e', i) under ``|r'''| <= 1``: the observer knows the command and sees nothing."""
        T = rational(law.sample_period_s)
        e, speed, integral = _unit_rows(3)
        alpha = _feedback(law, e, speed, integral)
        following = [e + T * speed + T**2 / 2 * alpha, speed + T * alpha, integral + T * e]
        drive = matrix([[1, 0], [0, 1], [0, 0]])
        effects = drive * _held_effects(T, (2, 1)) * drive.transpose()
        return cls(matrix([row.table()[0] for row in following]), effects, (e, speed, alpha))


class Bounds(WitnessDocument):
    """Largest errors of a set at level or peak 1."""

    angle_rad: float
    speed_rad_s: float
    acceleration_rad_s2: float


class LevelSet(WitnessDocument):
    """``x' P x`` and how fast it decays; one level per joint."""

    P: Rows
    decay_per_s: float
    level: tuple[float, ...]
    bounds: Bounds


class ReachSet(WitnessDocument):
    """``x' X^-1 x <= 1``: what an input of at most 1 can reach."""

    X: Rows
    multiplier: float
    bounds: Bounds


class PeakSet(ReachSet):
    """And the largest input of each joint."""

    peak: tuple[float, ...]


class SampledEnvelope(WitnessDocument):
    """The member ``envelope`` of the witness."""

    reference_margin_rad: tuple[float, ...]
    torque_share: float
    box_set: LevelSet
    torque_set: LevelSet
    disturbance_set: PeakSet
    reference_set: ReachSet


def sampled_envelope_claims(
    shipped: Shipped[Any], law: AccelerationLoopData, envelope: SampledEnvelope
) -> Iterator[Claim]:
    """Claims of the envelope of a `dob-acceleration` artifact.

    Raises:
        ValueError, ZeroDivisionError: the witness is not of the documented form.
    """
    period = rational(shipped.artifact.sample_period_s)
    loops = [ErrorDynamics.of_disturbance(law, pole) for pole in law.filter_poles()]
    margins = [rational(margin) for margin in envelope.reference_margin_rad]
    yield room_claim(shipped.artifact.domain, margins)

    box, torque = envelope.box_set, envelope.torque_set
    yield from _level_claims("box set", loops, period, box)
    yield within_margins("envelope: box set, levels", margins, box.level, box.bounds)
    yield from _level_claims("torque set", loops, period, torque)
    yield _within_torque(shipped, torque, rational(envelope.torque_share))

    disturbance = envelope.disturbance_set
    yield from _peak_claims("disturbance set", loops, disturbance)
    yield within_margins("envelope: disturbance set, peaks", margins, disturbance.peak, disturbance.bounds)
    yield from _peak_claims("reference set", [ErrorDynamics.of_reference(law)], envelope.reference_set)


def within_margins(name: str, margins: Sequence[fmpq], scales: Sequence[float], bounds: Bounds) -> Claim:
    """The claim that sets of the given positive scales leave no joint's margin: ``c scale_j < margin_j``."""
    bound = rational(bounds.angle_rad)
    spare = [margin - bound * rational(scale) for margin, scale in zip(margins, scales, strict=True)]
    return all_positive(name, [*spare, *map(rational, scales)])


def _level_claims(name: str, loops: Sequence[ErrorDynamics], period: fmpq, witness: LevelSet) -> Iterator[Claim]:
    P, decay, bounds = matrix(witness.P), rational(witness.decay_per_s), _bounds(witness.bounds)
    shrink = 1 - 2 * decay * period
    yield all_positive(f"envelope: {name}, decay rate and bounds", [decay, *bounds])
    transitions = [loop.transition for loop in loops]
    yield _positive_at_all(f"envelope: {name}, decrease", [shrink * P - A.transpose() * P * A for A in transitions])
    for k, (output, bound) in enumerate(zip(OUTPUTS, bounds, strict=True)):
        square = matrix([[bound**2]])
        bounded = [symmetric([[P, loop.outputs[k].transpose()], [None, square]]) for loop in loops]
        yield _positive_at_all(f"envelope: {name}, bound of {output}", bounded)


def _peak_claims(name: str, loops: Sequence[ErrorDynamics], witness: ReachSet) -> Iterator[Claim]:
    X, multiplier, bounds = matrix(witness.X), rational(witness.multiplier), _bounds(witness.bounds)
    yield all_positive(f"envelope: {name}, multiplier and bounds", [multiplier, 1 - multiplier, *bounds])
    yield Claim.positive(f"envelope: {name}, X", X)
    following = [
        loop.transition * X * loop.transition.transpose() * (1 / multiplier) + loop.effects * (1 / (1 - multiplier))
        for loop in loops
    ]
    yield _positive_at_all(f"envelope: {name}, invariance", [X - reached for reached in following])
    reached = [(C * X * C.transpose())[0, 0] for loop in loops for C in loop.outputs]
    squares = [bound**2 for _ in loops for bound in bounds]
    spare = [square - extent for square, extent in zip(squares, reached, strict=True)]
    yield all_positive(f"envelope: {name}, outputs within their bounds", spare)


def _bounds(bounds: Bounds) -> list[fmpq]:
    return [rational(getattr(bounds, output)) for output in OUTPUTS]


def _positive_at_all(name: str, matrices: Sequence[fmpq_mat]) -> Claim:
    """The claim that all these matrices, one per filter pole, are positive definite."""
    return Claim.all_of(name, [Claim.positive(name, exact) for exact in matrices])


def _within_torque(shipped: Shipped[Any], witness: LevelSet, share: fmpq) -> Claim:
    """The claim that ``M alpha`` takes at most a share of every torque limit, alpha anywhere in the sets."""
    largest = largest_entries(VertexTable.of(inertia_table(shipped)))
    limits = shipped.artifact.limits.torque_nm
    levels = [rational(level) for level in witness.level]
    bound = rational(witness.bounds.acceleration_rad_s2)
    if len(levels) != len(limits):
        raise ValueError("one level per joint")
    taken = [bound * sum((m * c for m, c in zip(row, levels, strict=True)), fmpq(0)) for row in largest]
    spare = [share * rational(limit) - torque for limit, torque in zip(limits, taken, strict=True)]
    return all_positive("envelope: torque set, levels", [*spare, *levels, share, 1 - share])


def largest_entries(table: VertexTable) -> list[list[fmpq]]:
    """Bound of every ``|X_ij|`` over the box: the mean over the blocks of the largest entry of their vertices."""
    rows, columns = len(table.doubles[0]), len(table.doubles[0][0])
    total = [[fmpq(0)] * columns for _ in range(rows)]
    start = 0
    for block in table.blocks:
        vertices = table.doubles[start : start + 2 ** len(block)]
        start += len(vertices)
        for i in range(rows):
            for j in range(columns):
                total[i][j] += max(abs(rational(vertex[i][j])) for vertex in vertices) / len(table.blocks)
    return total


def _feedback(law: AccelerationLoopData, e: fmpq_mat, speed: fmpq_mat, integral: fmpq_mat) -> fmpq_mat:
    return rational(law.kp) * e + rational(law.kd) * speed + rational(law.ki) * integral


def _held_effects(period: fmpq, powers: Sequence[int]) -> fmpq_mat:
    """``T int_0^T g g' ds`` with ``g_i = s^p_i / p_i!``."""
    return matrix(
        [[period ** (a + b + 2) / ((a + b + 1) * factorial(a) * factorial(b)) for b in powers] for a in powers]
    )


def _unit_rows(size: int) -> list[fmpq_mat]:
    return [matrix([[int(i == j) for j in range(size)]]) for i in range(size)]


def _total(rows: Iterable[fmpq_mat]) -> fmpq_mat:
    first, *others = rows
    for row in others:
        first = first + row
    return first
