"""The operating envelope of the torque-level law; statement and limits: ``docs/concepts/operating-envelope.md``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.invariant_sets import line_search
from quasilpv.conditions.tracking.polytopic_sets import (
    estimation_peak_set,
    feedback_system,
    polytopic_level_set,
    polytopic_peak_set,
)
from quasilpv.lmi import Problem
from quasilpv.synthesis.acceleration.envelope import (
    DECAY_SHARE,
    ROUNDING,
    SPARE,
    TORQUE_SHARE,
    reference_margin,
    verified_solution,
)
from quasilpv.systems.robots.registry import Robot

MULTIPLIERS = (0.02, 1.0)
"""Interval of the multipliers searched, over half the radius of the pole disk."""

PEAK = 0.05
"""Second derivative of the disturbance, in the units of the observer's inequalities, whose set is of order one."""


class VertexTables(NamedTuple):
    """The vertices of a law's tables, SI: inertia (N, n, n), feedback (N, n, 3n), observer (N, 4n, n)."""

    inertia: FloatArray
    feedback: FloatArray
    observer: FloatArray


def torque_envelope(robot: Robot, tables: VertexTables, witness: Mapping[str, Any]) -> dict[str, Any]:
    """The envelope of a `dob-torque` law.

    Args:
        robot: its operating domain and torque limits.
        tables: of the law.
        witness: of the law: disks, which set the units of the inequalities, and decay rate.

    Raises:
        InfeasibleError: no verified set was found.
    """
    inertia, feedback, _ = tables
    n = robot.model.joints
    unit = 2.0 ** round(math.log2(float(np.mean(np.linalg.eigvalsh(inertia)))))
    rate = witness["feedback"]["disk_rad_s"] / 2.0
    units, torque = np.repeat([1.0, rate, 1.0 / rate], n), unit * rate**2
    E, A, B = feedback_system(inertia / unit, feedback * units / torque)
    margin = reference_margin(robot)
    most = TORQUE_SHARE * np.array(robot.limits.torque_nm)
    angle = np.eye(n, 3 * n) / margin[:, None]
    directions = np.eye(3 * n)[:, : 2 * n] * np.tile(margin, 2)
    effort = np.concatenate(list(feedback * units / most[:, None]))
    decay = DECAY_SHARE * witness["feedback"]["decay_per_s"]

    def shipped(scaled: FloatArray) -> dict[str, Any]:
        X = scaled * np.outer(units, units)
        X = (X + X.T) / 2.0
        return {"X": X.tolist(), "bounds": _bounds(X, feedback)}

    def level_set(outputs: FloatArray) -> dict[str, Any]:
        # Unit outputs and directions: their sizes differ by orders of magnitude between the two sets.
        size = float(np.abs(outputs @ directions).max())
        problem, X = polytopic_level_set(E, A, outputs / size, directions, decay / rate)
        return {**shipped(verified_solution(problem, robot.id).values[X]), "decay_per_s": decay * (1.0 - ROUNDING)}

    def feedback_set(multiplier: float) -> Problem:
        return polytopic_peak_set(E, A, B, angle, multiplier)[0]

    box, effortless = level_set(angle), level_set(effort)
    multiplier = _best(feedback_set)
    problem, X = polytopic_peak_set(E, A, B, angle, multiplier)
    residual = shipped(verified_solution(problem, robot.id).values[X] / torque**2)
    return {
        "condition": "polytopic-envelope",
        "reference_margin_rad": margin.tolist(),
        "torque_share": TORQUE_SHARE,
        "box_set": {**box, "level": _largest(margin, box["bounds"]["angle_rad"])},
        "torque_set": {**effortless, "level": _largest(most, effortless["bounds"]["torque_nm"])},
        "residual_set": {
            **residual,
            "multiplier": multiplier * rate,
            "peak": _largest(margin, residual["bounds"]["angle_rad"]),
        },
        "observer_set": _observer_set(robot, tables, witness["observer"]["disk_rad_s"] / 2.0, unit),
    }


def _observer_set(robot: Robot, tables: VertexTables, rate: float, unit: float) -> dict[str, Any]:
    """The estimation errors a disturbance can cause; inequalities in units of time 1/rate and of inertia, result SI."""
    inertia, feedback, observer = tables
    n = robot.model.joints
    torque = unit * rate**2
    units = np.repeat([1.0, rate, torque, torque * rate], n)
    effort = np.concatenate([feedback[:, :, : 2 * n], np.zeros_like(feedback[:, :, : 2 * n])], axis=2)
    outputs = [np.eye(4 * n)[2 * n : 3 * n], *(effort * units / torque)]
    gains = observer / (units[:, None] * rate)
    scaled = inertia / unit
    multiplier = _best(lambda multiplier: estimation_peak_set(scaled, gains, outputs, multiplier, PEAK)[0])
    problem, Q, F = estimation_peak_set(scaled, gains, outputs, multiplier, PEAK)
    solution = verified_solution(problem, robot.id)
    shipped = solution.values[Q] / np.outer(units, units)
    extended = np.concatenate([units, np.full(n, rate**2)])
    covariance = np.linalg.inv(solution.values[Q])
    reach = [np.sqrt(np.linalg.eigvalsh(C @ covariance @ C.T)[-1]) * torque for C in outputs]
    return {
        "Q": ((shipped + shipped.T) / 2.0).tolist(),
        "F": (solution.values[F] * rate / torque / extended[:, None]).tolist(),
        "multiplier": multiplier * rate,
        "peak_nm_per_s2": PEAK * torque * rate**2,
        "bounds": {
            "disturbance_nm": float(reach[0]) * (1.0 + SPARE),
            "feedback_nm": float(max(reach[1:])) * (1.0 + SPARE),
        },
    }


def _best(problem_at: Callable[[float], Problem]) -> float:
    """The multiplier, on a logarithmic scale, whose problem has the smallest objective."""

    def objective(logarithm: float) -> float:
        solution = problem_at(math.exp(logarithm)).solve()
        return math.log(solution.objective) if solution.values and solution.objective > 0.0 else 1e3 + logarithm

    low, high = (math.log(bound) for bound in MULTIPLIERS)
    return math.exp(line_search(objective, low, high, 0.05))


def _bounds(X: FloatArray, feedback: FloatArray) -> dict[str, list[float]]:
    """Largest angle and speed errors and torques of every joint in ``x' X^-1 x <= 1``, SI."""
    n = feedback.shape[1]
    extent = np.sqrt(X.diagonal())
    effort = np.sqrt(np.einsum("ijk,kl,ijl->ij", feedback, X, feedback).max(axis=0))
    return {
        "angle_rad": (extent[:n] * (1.0 + SPARE)).tolist(),
        "speed_rad_s": (extent[n : 2 * n] * (1.0 + SPARE)).tolist(),
        "torque_nm": (effort * (1.0 + SPARE)).tolist(),
    }


def _largest(allowed: FloatArray, bounds: list[float]) -> float:
    """The scale at which the first joint's bound reaches what it is allowed."""
    return float(np.min(allowed / np.array(bounds))) * (1.0 - ROUNDING)
