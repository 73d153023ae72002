"""Which inertia ratios a robust design must tolerate: ``M_t / M_n`` over configurations and payloads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.loops.loop_grid import configurations
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.systems.robots.registry import Robot

CONFIGURATIONS = 2000
PAYLOAD_FRACTIONS = 9


@dataclass(frozen=True)
class InertiaRange:
    """Smallest and largest eigenvalue of ``M_n^-1 M_t`` and where they occur (joint angles, payload fraction)."""

    lowest: float
    highest: float
    where_lowest: tuple[tuple[float, ...], float]
    where_highest: tuple[tuple[float, ...], float]


def design_inertia(robot: Robot, postures: FloatArray, scheduled: Schedule | None = None) -> FloatArray:
    """The nominal inertia, or what a schedule by only some of its premises makes of it, at postures, (N, n, n)."""
    if scheduled is not None:
        return scheduled.inertia_at(robot, postures)
    return np.array([robot.model.inertia(theta) for theta in postures])


def needed_inertia_range(robot: Robot, count: int = CONFIGURATIONS, scheduled: Schedule | None = None) -> InertiaRange:
    """Range of ``M_t / M_n`` over a grid of reachable configurations and payloads.

    M_n is the nominal inertia, or what a schedule by only some of its premises makes of it.

    Reachable configurations, not corners of the premise box: the cosines are dependent, and at some corners the inertia
    is not even positive definite. A grid, so a numerical range: the proof is the business of the certificate.
    """
    postures = configurations(robot.domain.angle_rad, count, every_joint=not robot.model.turns_as_one)
    factor = np.linalg.cholesky(design_inertia(robot, postures, scheduled))
    found: list[tuple[float, float, int, int, float]] = []
    for fraction in np.linspace(0.0, 1.0, PAYLOAD_FRACTIONS):
        plant = robot.with_payload_fraction(float(fraction))
        inertia = np.array([plant.inertia(theta) for theta in postures])
        half = np.linalg.solve(factor, inertia)
        ratios = np.linalg.eigvalsh(np.linalg.solve(factor, half.transpose(0, 2, 1)))  # of L^-1 M_t L^-T
        at_low, at_high = int(np.argmin(ratios[:, 0])), int(np.argmax(ratios[:, -1]))
        found.append((ratios[at_low, 0], ratios[at_high, -1], at_low, at_high, float(fraction)))
    low = min(found, key=lambda entry: entry[0])
    high = max(found, key=lambda entry: entry[1])
    return InertiaRange(
        float(low[0]), float(high[1]), (tuple(postures[low[2]]), low[4]), (tuple(postures[high[3]]), high[4])
    )


def largest_inertia_norm(robot: Robot) -> float:
    """Largest Frobenius norm of the nominal inertia over the operating domain, kg m^2."""
    postures = configurations(robot.domain.angle_rad, 200, every_joint=not robot.model.turns_as_one)
    return max(float(np.linalg.norm(robot.model.inertia(theta))) for theta in postures)
