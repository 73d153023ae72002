"""Estimates of joint speeds along a known motion: velocity torque scheduled with the estimate, or lumped.

The plant follows a reference exactly; its torque is the inverse dynamics. Four observers see angles and torque:

    theta^' = w^ + L_1 e,   w^' = M(y)^-1 (Gamma - s N(y, w^) w^ - G(y)) + L_2 e + a^,   a^' = L_3 e + j^,  j^' = L_4 e

with e = y - theta^, s = 1 (premises of N estimated) or 0 (lumped), and a disturbance acceleration a^ that is observed
or left out (L_3 = L_4 = 0). Estimates that schedule N are clamped to the operating domain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.mechanism import PlanarMechanism

Motion = Callable[[float], tuple[FloatArray, FloatArray, FloatArray]]
"""From time to angles, speeds and accelerations."""


@dataclass(frozen=True, eq=False)
class Observer:
    """One of the four observers.

    Attributes:
        scheduled: s = 1.
        gain: from theta to ``[L_1; L_2]`` or ``[L_1; L_2; L_3; L_4]``, (2n or 4n, n).
    """

    scheduled: bool
    gain: Callable[[FloatArray], FloatArray]


def speed_errors(
    observers: Mapping[str, Observer],
    model: PlanarMechanism,
    plant: PlanarMechanism,
    motion: Motion,
    *,
    speed_box: FloatArray,
    time_s: FloatArray,
    first_error_rad_s: float,
) -> dict[str, FloatArray]:
    """Error of the estimated speeds, true minus estimate, (N, n), by name; classical Runge-Kutta of order 4.

    Args:
        observers: by name.
        model: what the observers know.
        plant: what moves.
        motion: of the plant.
        speed_box: (2, n), bounds of the estimates that schedule N.
        time_s: equally spaced, (N,).
        first_error_rad_s: of every estimated speed at the start; angles start right.
    """
    n = model.joints
    theta, speed, _ = motion(float(time_s[0]))
    start = np.concatenate([theta, speed - first_error_rad_s, np.zeros(2 * n)])
    states = {name: start.copy() for name in observers}

    def slopes(t: float, at: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        y, w, a = motion(t)
        torque, inertia, gravity = plant.inverse_dynamics(y, w, a), model.inertia(y), model.gravity(y)
        return {name: _slope(one, at[name], y, torque - gravity, inertia) for name, one in observers.items()}

    def _slope(one: Observer, x: FloatArray, y: FloatArray, net: FloatArray, inertia: FloatArray) -> FloatArray:
        angle, estimate, disturbance, rate = x.reshape(4, n)
        load = net - model.coriolis(y, np.clip(estimate, *speed_box)) if one.scheduled else net
        correction = np.zeros(4 * n)
        gain = one.gain(y)
        correction[: len(gain)] = gain @ (y - angle)
        drift = np.concatenate([estimate, np.linalg.solve(inertia, load) + disturbance, rate, np.zeros(n)])
        return np.asarray(drift + correction)

    errors: dict[str, list[FloatArray]] = {name: [] for name in observers}
    for k, t in enumerate(time_s):
        true = motion(float(t))[1]
        for name, x in states.items():
            errors[name].append(true - x[n : 2 * n])
        if k + 1 == len(time_s):
            break
        h = float(time_s[k + 1] - t)
        k1 = slopes(t, states)
        k2 = slopes(t + h / 2, {name: x + h / 2 * k1[name] for name, x in states.items()})
        k3 = slopes(t + h / 2, {name: x + h / 2 * k2[name] for name, x in states.items()})
        k4 = slopes(t + h, {name: x + h * k3[name] for name, x in states.items()})
        states = {name: x + h / 6 * (k1[name] + 2 * k2[name] + 2 * k3[name] + k4[name]) for name, x in states.items()}
    return {name: np.array(values) for name, values in errors.items()}
