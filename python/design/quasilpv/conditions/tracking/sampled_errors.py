"""Error dynamics of the acceleration-level law on its design model, exactly sampled, one joint.

Between samples the design model of a joint is ``theta'' = a + d(t)`` with the commanded acceleration a held and a
disturbance d of any shape with a second derivative. With the reference r and the law's estimates the state is, at the
start of a sample,

    x = (e,  e' - T^2/12 d',  int e - c d',  eps_theta, eps_w, eps_d, eps_d',  d - d_f - T/(1 - q) d')

where ``e = theta - r``, eps is the estimation error before the measurement is used, d_f the filtered disturbance of
the sample before, and ``c = -(T/2 + q T/(1 - q) + kd T^2/12) / ki``. The multiples of d' are the steady state under a
disturbance that grows at a constant rate: such a disturbance is followed without angle error, and what drives x is the
second derivative of d only,

    x+ = A x + sum_i N_i int_0^T (T - s)^(3 - i) / (3 - i)! d''(t + s) ds  (+ the same of r''' on e and e').

For ``|d''| <= 1`` the integral v obeys ``v v' <= T int g g' ds`` (Cauchy-Schwarz): no assumption that d'' is held.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.sampled_chains import observer_chain


@dataclass(frozen=True, eq=False)
class SampledErrors:
    """Error dynamics of one joint, in the time unit ``1/w``.

    Attributes:
        transition: A, (8, 8).
        disturbance: W, (8, 8): ``v v' <= W`` for the effect v of any d'' with ``|d''| <= 1`` over one sample.
        reference: (3, 3), the same on (e, e', int e) for the third derivative of the reference.
        acceleration: (1, 8), row of ``theta'' - r''`` at the start of a sample, less ``-T/2 d'``.
        units: (8,), a state in SI is the state here times this.
        rate: w, rad/s.
    """

    transition: FloatArray
    disturbance: FloatArray
    reference: FloatArray
    acceleration: FloatArray
    units: FloatArray
    rate: float


def sampled_errors(
    feedback: FloatArray, observer: FloatArray, filter_time_constant_s: float, sample_period_s: float, rate: float
) -> SampledErrors:
    """The error dynamics of a law.

    Args:
        feedback: (kp, kd, ki), SI.
        observer: (l1, l2, l3, l4), SI.
        filter_time_constant_s: T_f.
        sample_period_s: T.
        rate: w, which sets the time unit; near the bandwidth of the feedback.
    """
    T = sample_period_s * rate
    kp, kd, ki = feedback / rate ** np.array([2.0, 1.0, 3.0])
    gains = observer / rate ** np.arange(4.0)
    q = math.exp(-sample_period_s / filter_time_constant_s)
    chain = observer_chain(T)[0].astype(float)
    rows = np.eye(8)
    error, speed, integral, lag = rows[0], rows[1], rows[2], rows[7]
    corrected = (np.eye(4) - np.outer(gains, np.eye(4)[0])) @ rows[3:7]
    uncompensated = q * lag + (1.0 - q) * corrected[2]
    acceleration = uncompensated + kp * (error - corrected[0]) + kd * (speed - corrected[1]) + ki * integral
    transition = np.vstack(
        [
            error + T * speed + T**2 / 2.0 * acceleration,
            speed + T * acceleration,
            integral + T * error,
            chain @ corrected,
            uncompensated,
        ]
    )
    drive = np.zeros((8, 4))
    drive[0, 0] = drive[1, 1] = drive[7, 2] = 1.0
    drive[3:7] = np.eye(4)
    drive[1, 3] = -(T**2) / 12.0
    drive[2, 3] = (T / 2.0 + q * T / (1.0 - q) + kd * T**2 / 12.0) / ki
    drive[7, 3] = -T / (1.0 - q)
    third = np.zeros((3, 3))
    third[:2, :2] = _gramian(T, (2, 1))
    return SampledErrors(
        transition,
        drive @ _gramian(T, (3, 2, 1, 0)) @ drive.T,
        third,
        acceleration[None],
        rate ** np.array([0.0, 1.0, -1.0, 0.0, 1.0, 2.0, 3.0, 2.0]),
        rate,
    )


def _gramian(period: float, powers: tuple[int, ...]) -> FloatArray:
    """``T int_0^T g g' ds`` with ``g_i = s^p_i / p_i!``."""
    return np.array(
        [
            [period ** (a + b + 2) / ((a + b + 1) * math.factorial(a) * math.factorial(b)) for b in powers]
            for a in powers
        ]
    )
