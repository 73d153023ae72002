"""Feedback and observer gains for the exactly sampled integrator chains of the acceleration-level law.

With the design inertia cancelled, each joint is a double integrator driven by a held acceleration command plus a
disturbance acceleration. Its exact zero-order-hold model is identity plus nilpotent, so the matrices below are
polynomials in the sample period, and the conditions hold for the sampled loop itself, not for an approximation of it.

Both problems are written in the time unit ``1/w`` (w: the bandwidth asked for), in which the unknowns are of order
one; only ``t = w T`` enters. Own statement (discrete time, acceleration coordinates): not a case of Dehak 2022,
Theorem IV.11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.forms.blocks import pole_disk
from quasilpv.lmi import Problem, Solution, Variable, block, to_rational, zeros
from quasilpv.lmi.exact import Matrix

FEEDBACK_DISK = Fraction(3, 5)
"""Radius of the feedback pole disk, as a fraction of the distance of its centre from 1."""

OBSERVER_DISK = Fraction(2, 5)
"""The same for the observer; a wider disk lets the noise objective slow the estimate down."""


@dataclass(frozen=True)
class ChainGains:
    """Gains of one chain and the evidence for them.

    Attributes:
        gains: feedback ``(kp, kd, ki)``, ki = 0 without integral action, or observer ``(l1, l2, l3, l4)``, SI units.
        solution: point of the inequalities the gains were read from, in the time unit 1/w.
        lyapunov: value of the Lyapunov variable (P of the feedback, Q of the observer).
        objective: value of the H2 objective in that time unit.
        disk: centre and radius of the pole disk in the z plane.
    """

    gains: npt.NDArray[np.float64]
    solution: Solution
    lyapunov: npt.NDArray[np.float64]
    objective: float
    disk: tuple[float, float]

    def point(self, name: str) -> dict[str, Any]:
        """The witness of the inequalities, JSON-able, the Lyapunov variable under its name."""
        return {
            name: self.lyapunov.tolist(),
            "disk_centre": self.disk[0],
            "disk_radius": self.disk[1],
            "objective": self.objective,
        }


def disk_of(bandwidth: float, sample_period_s: float, width: Fraction) -> tuple[Fraction, Fraction]:
    """Pole disk of a bandwidth: centre ``c = exp(-w T)`` and radius ``width * (1 - c)``, exact rationals.

    In continuous time it bounds the decay rate from below (about ``(1 - width) w``), the fastest pole from above (about
    ``(1 + width) w``) and the damping (the angle seen from z = 1 is at most ``asin(width)``).
    """
    centre = Fraction(math.exp(-bandwidth * sample_period_s))
    return centre, width * (1 - centre)


def feedback_chain(t: float, *, integral: bool = True) -> tuple[Matrix, Matrix]:
    """Exact sampled chain of (angle, speed, integral of the angle), held acceleration: A (3x3), B (3x1), rational.

    The integral is the forward sum the runtime computes; without it the chain has two states.
    """
    period = Fraction(t)
    if not integral:
        return to_rational([[1, period], [0, 1]]), to_rational([[period**2 / 2], [period]])
    transition = to_rational([[1, period, 0], [0, 1, 0], [period, 0, 1]])
    return transition, to_rational([[period**2 / 2], [period], [0]])


def observer_chain(t: float) -> tuple[Matrix, Matrix, Matrix]:
    """Exact sampled chain of (angle, speed, disturbance, its rate): A (4x4), G (4x1), C (1x4), rational.

    G is the effect of a constant second derivative of the disturbance over one sample.
    """
    h = Fraction(t)
    transition = to_rational([[1, h, h**2 / 2, h**3 / 6], [0, 1, h, h**2 / 2], [0, 0, 1, h], [0, 0, 0, 1]])
    return transition, to_rational([[h**4 / 24], [h**3 / 6], [h**2 / 2], [h]]), to_rational([[1, 0, 0, 0]])


def feedback_problem(
    bandwidth: float, sample_period_s: float, *, integral: bool = True
) -> tuple[Problem, Variable, Variable]:
    """State feedback ``a = kp e + kd e' + ki int e`` that least amplifies a white disturbance acceleration.

    Unknowns ``P = P' > 0`` (3x3), ``Y`` (1x3), of order 2 without integral action; ``K = Y P^-1``; minimise ``C P C'``
    subject to

    * pole disk of ``A + B K`` (`disk_of`, width `FEEDBACK_DISK`),
    * ``[[P, A P + B Y, B], [*, P, 0], [*, *, 1]] > 0`` (P bounds the covariance of the state).

    Args:
        bandwidth: w, rad/s.
        sample_period_s: T.
        integral: False for ki = 0, two states.

    Returns:
        The problem, P and Y.
    """
    transition, drive = feedback_chain(bandwidth * sample_period_s, integral=integral)
    size = len(transition)
    centre, radius = disk_of(bandwidth, sample_period_s, FEEDBACK_DISK)
    P = Variable("P", size, symmetric=True)
    Y = Variable("Y", 1, size)
    closed = transition @ P + drive @ Y
    problem = Problem()
    problem.positive("pole disk", pole_disk(P, closed, centre, radius))
    problem.positive(
        "covariance", block([[P, closed, drive], [None, P, zeros(size, 1)], [None, None, np.array([[1]])]])
    )
    angle = to_rational([[1, *[0] * (size - 1)]])
    problem.minimise(angle @ P @ angle.T)
    return problem, P, Y


def feedback_gains(bandwidth: float, sample_period_s: float, *, integral: bool = True) -> ChainGains:
    """Gains (kp, kd, ki) from an interior point of `feedback_problem`; none positive: they act on ``x - x_r``."""
    problem, P, Y = feedback_problem(bandwidth, sample_period_s, integral=integral)
    centre, radius = disk_of(bandwidth, sample_period_s, FEEDBACK_DISK)
    solution = problem.solve_inside()
    if not solution.values:
        return _no_gains(3, solution, centre, radius)
    gains = np.zeros(3)
    found = np.linalg.solve(solution.values[P], solution.values[Y].T)[:, 0]
    gains[: len(found)] = found
    gains = gains * bandwidth ** np.array([2.0, 1.0, 3.0])
    return ChainGains(gains, solution, solution.values[P], solution.objective, (float(centre), float(radius)))


def observer_problem(bandwidth: float, sample_period_s: float) -> tuple[Problem, Variable, Variable]:
    """Current-estimator gains that trade measurement noise against a moving disturbance.

    Estimate ``x+ = A (x + l (y - C x))``, predictor gain ``A l = Q^-1 W``. Unknowns ``Q = Q' > 0`` (4x4), ``W`` (4x1),
    ``N = N'`` (2x2); minimise ``trace N`` subject to

    * pole disk of ``A - Q^-1 W C`` (width `OBSERVER_DISK`),
    * ``[[Q, Q A - W C], [*, Q - c3' c3]] > 0`` (Q bounds the observability Gramian of the disturbance estimate c3 x),
    * ``[[N, [W, Q G]'], [*, Q]] > 0`` (N bounds the variance due to unit noise on y and unit white second derivative of
      the disturbance).

    Args:
        bandwidth: w, rad/s.
        sample_period_s: T.

    Returns:
        The problem, Q and W.
    """
    transition, drive, output = observer_chain(bandwidth * sample_period_s)
    centre, radius = disk_of(bandwidth, sample_period_s, OBSERVER_DISK)
    Q = Variable("Q", 4, symmetric=True)
    W = Variable("W", 4, 1)
    N = Variable("N", 2, symmetric=True)
    error = Q @ transition - W @ output
    estimate = to_rational([[0, 0, 1, 0]])
    problem = Problem()
    problem.positive("pole disk", pole_disk(Q, error, centre, radius))
    problem.positive("Gramian", block([[Q, error], [None, Q - estimate.T @ estimate]]))
    inputs = W @ to_rational([[1, 0]]) + Q @ (drive @ to_rational([[0, 1]]))
    problem.positive("variance", block([[Q, inputs], [None, N]]))
    unit = [to_rational([[1, 0]]), to_rational([[0, 1]])]
    problem.minimise(unit[0] @ N @ unit[0].T + unit[1] @ N @ unit[1].T)
    return problem, Q, W


def observer_gains(bandwidth: float, sample_period_s: float) -> ChainGains:
    """Gains (l1, l2, l3, l4), the same for every joint, from an interior point of `observer_problem`."""
    problem, Q, W = observer_problem(bandwidth, sample_period_s)
    transition, _, _ = observer_chain(bandwidth * sample_period_s)
    centre, radius = disk_of(bandwidth, sample_period_s, OBSERVER_DISK)
    solution = problem.solve_inside()
    if not solution.values:
        return _no_gains(4, solution, centre, radius)
    predictor = np.linalg.solve(solution.values[Q], solution.values[W])
    gains = np.linalg.solve(transition.astype(float), predictor)[:, 0]
    gains = gains * bandwidth ** np.arange(4.0)
    return ChainGains(gains, solution, solution.values[Q], solution.objective, (float(centre), float(radius)))


def _no_gains(size: int, solution: Solution, centre: Fraction, radius: Fraction) -> ChainGains:
    nothing = np.full(size, np.nan)
    return ChainGains(nothing, solution, np.full((size, size), np.nan), math.nan, (float(centre), float(radius)))
