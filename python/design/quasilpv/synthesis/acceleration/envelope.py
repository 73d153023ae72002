"""The operating envelope of a law on its design model: from which errors it recovers, what it holds against.

For each law two level sets (no disturbance: the errors that never leave a bound) and the peak sets (zero initial error:
what disturbances of unit peak can reach). The witness holds matrices and bounds per unit, so that any reference and any
disturbance can be compared with them, and the levels for one stated margin of the reference to the border of the
operating domain. Statement and limits: ``docs/concepts/operating-envelope.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.invariant_sets import PeakSet, sampled_level_set, sampled_peak_set
from quasilpv.conditions.tracking.sampled_errors import SampledErrors, sampled_errors
from quasilpv.errors import InfeasibleError
from quasilpv.lmi import Problem, Solution
from quasilpv.systems.robots.registry import Robot

REFERENCE_MARGIN = 0.15
"""Stated margin of the reference to the border of the operating domain, over the half width of each interval."""

TORQUE_SHARE = 0.5
"""Share of the torque limits the correction of errors may take; the rest is for reference, gravity and disturbance."""

DECAY_SHARE = 0.1
"""Decay rate of the level sets over that of the slowest pole: the faster, the smaller the set."""

BACK_OFFS = (0.02, 0.05, 0.1, 0.2)
"""Shares of the optimum to give up for room inside the inequalities: the first with which exact arithmetic agrees."""

ROUNDING = 1e-9
SPARE = 1e-3
"""By how much a bound exceeds what its set reaches, relative: room for exact arithmetic, and for the eye."""


def acceleration_envelope(
    robot: Robot, law: Mapping[str, Any], sample_period_s: float, bandwidth_rad_s: float
) -> dict[str, Any]:
    """The envelope of a `dob-acceleration` law, the same matrices for every joint.

    Args:
        robot: its operating domain and torque limits.
        law: the fields of the law.
        sample_period_s: T.
        bandwidth_rad_s: of the feedback; sets the units of the inequalities.

    Raises:
        InfeasibleError: no verified level set was found.
    """
    feedback = np.array([law["feedback"][name] for name in ("kp", "kd", "ki")])
    errors = sampled_errors(
        feedback, np.array(law["observer"]), law["filter_time_constant_s"], sample_period_s, bandwidth_rad_s
    )
    angle = np.eye(8)[:1]
    margin = reference_margin(robot)
    reachable = sampled_peak_set(errors.transition, errors.disturbance, angle)
    scale = np.sqrt(reachable.X.diagonal())
    box = _level_set(robot, errors, angle, scale, sample_period_s)
    torque = _level_set(robot, errors, errors.acceleration, scale, sample_period_s)
    most = TORQUE_SHARE * np.array(robot.limits.torque_nm) / _largest_row_sums(law["inertia"])
    level = float(most.min()) / torque["bounds"]["acceleration_rad_s2"] * (1.0 - ROUNDING)
    disturbance = _peak_set(errors, reachable, 4)
    reference = sampled_peak_set(errors.transition[:3, :3], errors.reference, angle[:, :3])
    return {
        "condition": "sampled-envelope",
        "reference_margin_rad": margin.tolist(),
        "torque_share": TORQUE_SHARE,
        "box_set": {**box, "level": _largest(margin, box)},
        "torque_set": {**torque, "level": [level] * len(margin)},
        "disturbance_set": {**disturbance, "peak": _largest(margin, disturbance)},
        "reference_set": _peak_set(errors, reference, 3),
    }


def reference_margin(robot: Robot) -> FloatArray:
    """The stated margin of every joint, rad."""
    return np.array([REFERENCE_MARGIN * (high - low) / 2.0 for low, high in robot.domain.angle_rad])


def verified_solution(problem: Problem, about: str) -> Solution:
    """A point strictly inside the inequalities of a set.

    Args:
        problem: the inequalities, and what the set is to be best at.
        about: names the robot in the error.

    Raises:
        InfeasibleError: none was found that exact arithmetic confirms.
    """
    for back_off in BACK_OFFS:
        solution = problem.solve_inside(back_off)
        if solution.verified:
            return solution
    raise InfeasibleError(f"{about}: operating envelope: {solution.outcome.value}")


def _level_set(
    robot: Robot, errors: SampledErrors, output: FloatArray, scale: FloatArray, sample_period_s: float
) -> dict[str, Any]:
    """Wide along errors of angle and of speed, and along the step of a disturbance the observer has not seen yet.

    The inequalities are stated for the states over what a disturbance makes of them (``scale``): a fast observer beside
    a slow feedback spreads the states over many orders of magnitude.
    """
    slowest = -float(np.log(np.max(np.abs(np.linalg.eigvals(errors.transition))))) / sample_period_s
    decay = DECAY_SHARE * slowest
    rows = np.eye(8)
    directions = np.column_stack([rows[0], rows[1], rows[5] + rows[7]])
    scaled = errors.transition * scale / scale[:, None]
    shrink = 1.0 - 2.0 * decay * sample_period_s
    problem, P = sampled_level_set(scaled, output * scale, directions * (scale[0] / scale[:, None]), shrink)
    value = verified_solution(problem, robot.id).values[P] / np.outer(scale, scale)
    shipped = value / np.outer(errors.units, errors.units)
    return {
        "P": ((shipped + shipped.T) / 2.0).tolist(),
        "decay_per_s": decay * (1.0 - ROUNDING),
        "bounds": _bounds(errors, np.asarray(np.linalg.inv(value)), 0),
    }


def _peak_set(errors: SampledErrors, found: PeakSet, order: int) -> dict[str, Any]:
    """A peak set in SI; ``order`` is that of the derivative whose peak is 1."""
    units = errors.units[: len(found.X)] / errors.rate**order
    shipped = found.X * np.outer(units, units)
    return {
        "X": ((shipped + shipped.T) / 2.0).tolist(),
        "multiplier": found.multiplier,
        "bounds": _bounds(errors, found.X, order),
    }


def _bounds(errors: SampledErrors, covariance: FloatArray, order: int) -> dict[str, float]:
    """Largest angle, speed and acceleration in the set ``x' covariance^-1 x <= 1``, SI."""
    size = len(covariance)
    rows = np.vstack([np.eye(8)[:2], errors.acceleration])[:, :size]
    extents = np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance, rows)) * errors.rate ** (np.arange(3.0) - order)
    names = ("angle_rad", "speed_rad_s", "acceleration_rad_s2")
    return {name: float(extent) * (1.0 + SPARE) for name, extent in zip(names, extents, strict=True)}


def _largest_row_sums(table: Mapping[str, Any]) -> FloatArray:
    """Per row of the matrix of a table, the sum of the largest magnitudes its entries take over the box."""
    largest = [np.abs(block["vertices"]).max(axis=0) for block in table["blocks"]]
    return np.asarray(np.mean(largest, axis=0).sum(axis=1))


def _largest(margin: FloatArray, found: Mapping[str, Any]) -> list[float]:
    """The scale at which the set's angle bound reaches the margin of each joint."""
    return [float(allowed) / found["bounds"]["angle_rad"] * (1.0 - ROUNDING) for allowed in margin]
