"""The search behind the tuned baselines: a coarse grid, then constrained descent from its best points.

The best points lie where several constraints meet, and a law may have several of them. So the descent is one that
handles constraints (COBYLA, Powell 1994: linear models of objective and constraints, no derivatives), in the logarithms
of the numbers, and it starts from the best admissible point of each of several branches of the grid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.optimize

from quasilpv.arrays import FloatArray
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.progress import Progress
from quasilpv.synthesis.acceleration import design as acceleration_design
from quasilpv.synthesis.baselines.printed import Tuning
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.specification import VELOCITY_NOISE_RAD_S, Specification
from quasilpv.systems.robots.registry import AnyRobot

Axes = Mapping[str, tuple[float, ...]]
"""Values by name, in units of the sample rate (bandwidths), of the sample period (filter), of the nominal inertia."""

SCALES_PER_CANDIDATE = 3
SEARCH_BUDGET = SCALES_PER_CANDIDATE * acceleration_design.LARGEST_SEARCH
"""The default design tries three scales of the design inertia at every point of its search."""

LARGEST = {"integral_ratio": 1.0, "payload_fraction": 1.0}
BRANCHES = 3
FIRST_STEP = 0.15
LAST_STEP = 1e-4
FARTHEST = 10.0
"""From where a descent began, in logarithms: after degenerate steps COBYLA asks for points without bounds."""
SLACK = 1e-4
GROWTH_UNIT = 0.003
"""Growth rates, in units of this part of the sample rate, are constraints as their hyperbolic tangents."""


@dataclass(frozen=True)
class Candidate:
    """An admissible point of the search, and what the grid says of it.

    Attributes:
        point: by axis.
        tuning: the same numbers, SI.
        disturbance_gain: worst over the plants, s^2.
        torque_increment_nm: rms per sample from sensor noise, worst over the plants.
    """

    point: Mapping[str, float]
    tuning: Tuning
    disturbance_gain: float
    torque_increment_nm: float


@dataclass(eq=False)
class TuningSearch:
    """Evaluates points of one baseline; remembers every admissible one.

    Attributes:
        law: the baseline frozen at the configurations of nominal inertias, for a sample period.
        axes: its coarse grid; the last axis tells the branches apart.
        plants: the screening grid.
        largest: bounds of the descent, in the units of the axes.
    """

    robot: AnyRobot
    specification: Specification
    law: Callable[[Any, Tuning, FloatArray, float], VelocityLaw]
    axes: Axes
    plants: PlantGrid
    progress: Progress
    largest: Mapping[str, float] = field(default_factory=LARGEST.copy)
    tried: int = 0
    admissible: list[Candidate] = field(default_factory=list)

    @property
    def activity_bound_nm(self) -> float:
        """Largest admissible rms torque increment."""
        return self.specification.torque_activity * float(np.linalg.norm(self.robot.limits.torque_nm))

    @property
    def _cases(self) -> tuple[tuple[float, float], ...]:
        """Factors on the true inertia and delays that must leave every loop stable."""
        spare, delay = self.specification.margin_spare, self.specification.delay_s
        return (1.0, 0.0), (spare, delay), (1.0 / spare, delay), (1.0, delay)

    def tuning(self, point: Mapping[str, float]) -> Tuning:
        """The numbers of a point, SI."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        return Tuning(
            bandwidth_rad_s=point["bandwidth"] * rate,
            integral_ratio=point.get("integral_ratio", 0.0),
            velocity_filter_time_constant_s=point["filter_time"] * period,
            observer_bandwidth_rad_s=point.get("observer_bandwidth", 0.0) * rate,
            inertia_scale=point["inertia_scale"],
            payload_fraction=point.get("payload_fraction", 0.0),
        )

    def loops(self, tuning: Tuning, plants: PlantGrid) -> LoopGrid:
        """The law of a point against the plants of a grid."""
        return plants.loops(self.law(self.robot, tuning, plants.nominal, self.specification.sample_period_s))

    def is_robust(self, loops: LoopGrid) -> bool:
        """Whether all loops are stable: without delay, and with delay and spare factor."""
        return all(loops.is_stable(*case) for case in self._cases)

    def disturbance_gain(self, loops: LoopGrid, plants: PlantGrid) -> float:
        """Worst over the plants, s^2."""
        unit = np.asarray(np.linalg.cholesky(plants.nominal), dtype=np.float64)
        return loops.disturbance_gain(self.specification.disturbance_frequency_rad_s, unit)

    def torque_increment(self, loops: LoopGrid) -> float:
        """Worst over the plants, N m."""
        return loops.torque_activity([self.specification.angle_noise_rad, VELOCITY_NOISE_RAD_S])

    def run(self) -> list[Candidate]:
        """Spend the budget; all admissible points found, the best first."""
        starts = self._coarse()
        for left in range(len(starts), 0, -1):
            self._descend(starts[len(starts) - left], (SEARCH_BUDGET - self.tried) // left)
        return sorted(self.admissible, key=lambda candidate: candidate.disturbance_gain)

    def _count(self) -> None:
        self.tried += 1
        self.progress(self.tried, SEARCH_BUDGET)

    def _coarse(self) -> list[Candidate]:
        """The grid; the best admissible point of each branch, the best `BRANCHES` of them."""
        best: dict[float, Candidate] = {}
        for values in itertools.product(*self.axes.values()):
            self._count()
            point, branch = dict(zip(self.axes, values, strict=True)), values[-1]
            tuning = self.tuning(point)
            loops = self.loops(tuning, self.plants)
            gain = self.disturbance_gain(loops, self.plants)
            if (branch in best and gain >= best[branch].disturbance_gain) or not self.is_robust(loops):
                continue
            activity = self.torque_increment(loops)
            if activity <= self.activity_bound_nm:
                best[branch] = Candidate(point, tuning, gain, activity)
                self.admissible.append(best[branch])
        return sorted(best.values(), key=lambda candidate: candidate.disturbance_gain)[:BRANCHES]

    def _descend(self, start: Candidate, budget: int) -> None:
        """Constrained descent from an admissible point with a number of evaluations."""
        known: dict[bytes, tuple[float, FloatArray]] = {}
        origin = np.log([start.point[name] for name in self.axes])

        def measured(x: FloatArray) -> tuple[float, FloatArray]:
            key = x.tobytes()  # objective and constraints are asked for one after the other
            if key not in known:
                known[key] = self._measure(np.exp(np.clip(x, origin - FARTHEST, origin + FARTHEST)))
            return known[key]

        upper = [math.log(self.largest[name]) if name in self.largest else math.inf for name in self.axes]
        scipy.optimize.minimize(
            lambda x: measured(x)[0],
            origin,
            method="COBYLA",
            bounds=[(-math.inf, high) for high in upper],
            constraints=[{"type": "ineq", "fun": lambda x: measured(x)[1] - SLACK}],
            options={"rhobeg": FIRST_STEP, "tol": LAST_STEP, "maxiter": budget},
        )

    def _measure(self, values: FloatArray) -> tuple[float, FloatArray]:
        """Logarithm of the disturbance gain, and the constraints, satisfied where they are positive."""
        self._count()
        named = zip(self.axes, values.tolist(), strict=True)
        point = {name: min(value, self.largest.get(name, math.inf)) for name, value in named}
        tuning = self.tuning(point)
        loops = self.loops(tuning, self.plants)
        gain = self.disturbance_gain(loops, self.plants)
        rates = np.array([loops.worst(*case).growth_rate_per_s for case in self._cases])
        stable = -np.tanh(rates / (GROWTH_UNIT * self.specification.rate_hz))
        if rates[0] >= 0.0:  # no stationary torque activity to speak of
            return math.log(gain), np.append(stable, -1.0)
        activity = self.torque_increment(loops)
        if rates.max() < 0.0 and activity <= self.activity_bound_nm:
            self.admissible.append(Candidate(point, tuning, gain, activity))
        return math.log(gain), np.append(stable, math.log(self.activity_bound_nm / activity))
