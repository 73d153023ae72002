"""The Lyapunov function of the acceleration-level law on a moving robot, and what of it can be told at run time.

Signals of one joint, time counted in samples, so that all are angles: ``s = (theta, theta', predicted angle, speed,
disturbance and its rate, filtered disturbance, integral, what the command of the sample before does)``. With
``X = M_t^-1 M_n`` in the disc of `moving_inertia`, ``V = s' (P x Y^-1) s`` decreases at every sample if P meets
`quasilpv.conditions.tracking.common_lyapunov`. A gain of the disc is ``c + delta``.

Of s only some combinations are known at run time, ``z = C s``: the angle error, the innovation, the error of the
estimated speed, how much the filter is behind the estimated disturbance, the integral. The least V with these values is
``z' ((C P^-1 C')^-1 x Y^-1) z``. Numerical: the proof is the business of the certificate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, eigh, solve_discrete_are

from quasilpv.arrays import FloatArray, symmetric
from quasilpv.conditions.tracking.common_lyapunov import DelayedLoop, common_lyapunov_problem
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.synthesis.acceleration.moving_inertia import InertiaDisc
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, LinearController

SIGNALS = 9
THETA, SPEED, PREDICTED, DISTURBANCE, FILTERED, INTEGRAL, ON_ITS_WAY = 0, 1, slice(2, 6), 4, 6, 7, 8
FLOORS = 10.0 ** np.arange(2.0, -13.0, -1.0)
"""Of the decrease of V, in the units of the closed loop, tried one after the other for a first P."""

SPARE = 1.0 - 1e-6
"""Factor on what is shipped of V: room for rounding, and for the proof."""


@dataclass(frozen=True, eq=False)
class MovingLyapunov:
    """``V = s' (P x Y^-1) s`` in rad^2, scaled such that ``V >= (theta - r)' Y^-1 (theta - r)``.

    Attributes:
        no_delay, longest_delay: P without delay and at the longest, (9, 9); linear between.
        multiplier: t of the condition.
        signals: R with ``C' R C <= P`` at every delay, (5, 5).
        joints: a little less than Y^-1, (n, n).
    """

    no_delay: FloatArray
    longest_delay: FloatArray
    multiplier: float
    signals: FloatArray
    joints: FloatArray

    def to_document(self) -> dict[str, Any]:
        """JSON-able, a member of the witness."""
        return {
            "no_delay": self.no_delay.tolist(),
            "longest_delay": self.longest_delay.tolist(),
            "multiplier": self.multiplier,
        }

    def bound_document(self) -> dict[str, Any]:
        """JSON-able, a member of the law."""
        return {"signals": self.signals.tolist(), "joints": self.joints.tolist()}


def moving_lyapunov(law: AccelerationLaw, disc: InertiaDisc, longest_delay_samples: float) -> MovingLyapunov | None:
    """Find P for a disc and all constant delays up to the longest; None if none is found.

    Args:
        law: the scalars.
        disc: of the design inertia.
        longest_delay_samples: in [0, 1].
    """
    loop = delayed_loop(law, disc.centre, longest_delay_samples)
    start = _start(loop, disc.radius, _units(law))
    if start is None:
        return None
    change = np.asarray(np.linalg.cholesky(start).T, dtype=np.float64)
    condition = common_lyapunov_problem(loop.in_coordinates(change), disc.radius)
    decision = decide(CompiledProblem.of(condition.problem))
    if not decision.feasible:
        return None
    ends = [change.T @ decision.values[P] @ change for P in (condition.no_delay, condition.longest_delay)]
    unit = max(float(np.linalg.inv(P)[THETA, THETA]) for P in ends)
    no_delay, longest_delay = (symmetric(unit * P) for P in ends)
    multiplier = unit * decision.values[condition.multiplier]
    rounded = common_lyapunov_problem(loop, disc.radius)
    found = {rounded.no_delay: no_delay, rounded.longest_delay: longest_delay, rounded.multiplier: multiplier}
    if not rounded.problem.holds_exactly(found):
        return None
    signals = SPARE * _common_bound([no_delay, longest_delay], known_signals(law))
    joints = SPARE * np.linalg.inv(disc.shape)
    return MovingLyapunov(no_delay, longest_delay, float(multiplier[0, 0]), symmetric(signals), symmetric(joints))


def delayed_loop(law: AccelerationLaw, centre: float, longest_delay_samples: float) -> DelayedLoop:
    """The loop of one joint at mu = c; its Bernstein coefficients in the share of the longest delay.

    With ``e = 1 - delay`` the command of this sample moves the angle by e^2/2 and the speed by e of what it does.
    """
    controller, d = LinearController.of(law), longest_delay_samples
    command = np.zeros((1, SIGNALS))
    command[0, THETA], command[0, PREDICTED.start : ON_ITS_WAY] = controller.D, controller.C
    transition, drive = np.zeros((3, SIGNALS, SIGNALS)), np.zeros((3, SIGNALS, 1))
    for j, (e, square) in enumerate(((1.0, 1.0), (1.0 - d / 2, 1.0 - d), (1.0 - d, (1.0 - d) ** 2))):
        drive[j, [THETA, SPEED, ON_ITS_WAY], 0] = square / 2, e, 1.0
        transition[j, THETA, [THETA, SPEED, ON_ITS_WAY]] = 1.0, 1.0, (1.0 - square) / 2
        transition[j, SPEED, [SPEED, ON_ITS_WAY]] = 1.0, 1.0 - e
        transition[j, PREDICTED.start : ON_ITS_WAY, THETA] = controller.B
        transition[j, PREDICTED.start : ON_ITS_WAY, PREDICTED.start : ON_ITS_WAY] = controller.A
    return DelayedLoop(transition + centre * drive @ command, drive, command)


def known_signals(law: AccelerationLaw) -> FloatArray:
    """C, (5, 9): what is known at run time, of the errors of s.

    Angle error; innovation; error of the corrected speed; corrected less filtered disturbance, q times what it was
    before the sample, with q the filter pole; integral.
    """
    T = law.sample_period_s
    unit = np.eye(SIGNALS)
    innovation = unit[THETA] - unit[PREDICTED.start]
    speed = unit[PREDICTED.start + 1] + law.observer[1] * T * innovation
    disturbance = unit[DISTURBANCE] + law.observer[2] * T**2 * innovation
    pole = np.exp(-T / law.filter_time_constant_s)
    return np.array([unit[THETA], innovation, speed, pole * (disturbance - unit[FILTERED]), unit[INTEGRAL]])


def _start(loop: DelayedLoop, radius: float, units: FloatArray) -> FloatArray | None:
    """A P for the longest delay alone, as units for the search: ``V - V+ >= |k s|^2 - |w|^2/r^2 + floor |s|^2``.

    The stabilising solution of the Riccati equation of the bounded real lemma, with the largest floor that has one.
    """
    scaled = loop.in_coordinates(units)
    A, b, k = scaled.transition[-1], scaled.drive[-1], scaled.output
    for floor in FLOORS:
        try:
            P = solve_discrete_are(A, b, k.T @ k + floor * np.eye(SIGNALS), np.array([[-1.0 / radius**2]]))
            np.linalg.cholesky(P)
        except LinAlgError:
            continue
        if float((b.T @ P @ b)[0, 0]) < 1.0 / radius**2:
            return units @ symmetric(P) @ units
    return None


def _units(law: AccelerationLaw) -> FloatArray:
    """From time in samples to time in ``kd/kp``, near the time constant of the feedback: all signals of like size."""
    unit = float(law.feedback[1] / law.feedback[0] / law.sample_period_s)
    return np.diag(unit ** np.array([0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 2.0, -1.0, 2.0]))


def _common_bound(lyapunov: Sequence[FloatArray], known: FloatArray) -> FloatArray:
    """The largest of the R with ``C' R C <= P`` for both P that leaves least: R^-1 is at least every ``C P^-1 C'``."""
    first, second = (known @ np.linalg.solve(P, known.T) for P in lyapunov)
    values, vectors = eigh(first, second)
    return np.asarray(vectors @ np.diag(1.0 / np.maximum(values, 1.0)) @ vectors.T)
