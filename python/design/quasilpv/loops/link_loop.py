"""The frozen sampled loop of `link-damped` on an arm with elastic joints: all joints together, exactly.

The plant is that of `quasilpv.loops.elastic_loop`, its commands the motors' torques.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.loops.elastic_loop import ElasticPlant


@dataclass(frozen=True, eq=False)
class LinkLaw:
    """The numbers of `link-damped` that decide its loop.

    Attributes:
        sample_period_s: T.
        feedback: (kp, kd, ki), acting on x - x_r.
        observer: (l1, l2, l3, l4).
        filter_time_constant_s: of the disturbance.
        inertia_scale: s.
        relative_damping: D_s, (n,).
    """

    sample_period_s: float
    feedback: FloatArray
    observer: FloatArray
    filter_time_constant_s: float
    inertia_scale: float
    relative_damping: FloatArray


SLIP_SAMPLES = 1000
"""After which a motor that slips has turned back."""


def link_growth_rate(law: LinkLaw, plant: ElasticPlant, inertia: FloatArray, delay_s: float) -> float:
    """``log(spectral radius) / T`` of the frozen loop, 1/s; negative when stable. See `link_matrix`."""
    matrix = link_matrix(law, plant, inertia, delay_s)
    return float(np.log(np.abs(np.linalg.eigvals(matrix)).max()) / law.sample_period_s)


def slips(law: LinkLaw, plant: ElasticPlant, inertia: FloatArray, delay_s: float) -> FloatArray:
    """How far a motor goes that breaks away, until it turns back and can stick again, rad/(N m), (n,).

    Friction falls when a motor breaks away: that is a step of torque at this motor, to which the frozen loop of all
    joints responds. Arguments are those of `link_matrix`.
    """
    n = len(plant.rotors)
    matrix = link_matrix(law, plant, inertia, delay_s)
    pushed = np.zeros((len(matrix), n))
    pushed[: 4 * n] = replace(plant, lag_s=0.0).held(law.sample_period_s, np.ones(n))[1]
    states, reached, going = np.zeros_like(pushed), np.zeros(n), np.ones(n, dtype=bool)
    for _ in range(SLIP_SAMPLES):
        states = matrix @ states + pushed
        motors = states[n : 2 * n].diagonal()
        going &= motors >= reached
        reached = np.where(going, motors, reached)
        if not going.any():
            break
    return reached


def link_matrix(law: LinkLaw, plant: ElasticPlant, inertia: FloatArray, delay_s: float) -> FloatArray:
    """The map of all states from a sample to the next.

    States: the plant's; predicted angle, speed, disturbance and its rate, filtered disturbance, integral, and how far
    the gears were wound; torques on their way, the youngest first.

    Args:
        law: the scalars.
        plant: the arm.
        inertia: M of the law at the posture, links and rotors, (n, n).
        delay_s: transport delay.
    """
    n, T, own = len(plant.rotors), law.sample_period_s, plant.order
    whole = math.floor(delay_s / T + 1e-12)
    late = max(0.0, delay_s - whole * T)
    ones = np.ones(n)
    before, by_old = plant.held(late, ones)
    after, by_new = plant.held(T - late, ones)
    size = own + 7 * n + n * (whole + 1)
    rows = np.eye(size)
    angle, motor = rows[:n], rows[n : 2 * n]
    predicted = [rows[own + i * n : own + (i + 1) * n] for i in range(4)]
    filtered, integral, was_wound = (rows[own + i * n : own + (i + 1) * n] for i in (4, 5, 6))
    waiting = rows[own + 7 * n :].reshape(whole + 1, n, size)
    corrected = [x + gain * (angle - predicted[0]) for x, gain in zip(predicted, law.observer, strict=True)]
    pole = math.exp(-T / law.filter_time_constant_s)
    filtered = pole * filtered + (1.0 - pole) * corrected[2]
    kp, kd, ki = law.feedback
    fed_back = kp * corrected[0] + kd * corrected[1] + ki * integral - filtered
    wound = motor - angle
    damping = law.relative_damping[:, None] * (wound - was_wound) / T
    torque = law.inertia_scale * inertia @ fed_back - damping
    applied = fed_back + corrected[2]
    on_its_way = [torque, *waiting]
    moved = after @ before @ rows[:own] + by_new @ on_its_way[whole] + after @ by_old @ on_its_way[whole + 1]
    following = [
        moved,
        corrected[0] + T * corrected[1] + T**2 / 2.0 * applied + T**3 / 6.0 * corrected[3],
        corrected[1] + T * applied + T**2 / 2.0 * corrected[3],
        corrected[2] + T * corrected[3],
        corrected[3],
        filtered,
        integral + T * angle if ki != 0.0 else 0.0 * integral,  # a sum that nothing reads
        wound,
        *on_its_way[: whole + 1],
    ]
    return np.vstack(following)
