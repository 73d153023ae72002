"""The baselines tuned as the default design is: same search budget, objective and bound on torque activity.

A comparison with gains from somebody else's experiment says little. Here the numbers of each baseline (bandwidth,
velocity filter, scale of the design inertia, observer bandwidth) are searched for with

* as many evaluations as the search of `dob-acceleration` makes;
* its objective: the least worst-case gain from disturbance to angle at the specified frequency, over all payloads;
* its constraints: stability with every payload, with the specified delay and the inertia wrong by the spare factor
  both ways, and rms torque increments per sample from sensor noise within the specified fraction of the torque limits.
  The default law reads angles only; these laws read speeds too, so the noise of both counts.

The loops are the frozen sampled ones of all joints together (`quasilpv.loops`), on a grid of configurations: no proof.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InfeasibleError
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.synthesis import acceleration_design
from quasilpv.synthesis.acceleration_design import Progress, no_progress
from quasilpv.synthesis.baselines import (
    Tuning,
    computed_torque_design,
    pid_design,
    stretched_inertia,
)
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.registry import Robot

FloatArray = npt.NDArray[np.float64]

VELOCITY_NOISE_RAD_S = 0.05
"""Standard deviation of the noise on measured speeds the torque activity is bounded for: that of the scenarios."""

SCALES_PER_CANDIDATE = 3
SEARCH_BUDGET = SCALES_PER_CANDIDATE * acceleration_design.LARGEST_SEARCH
"""The default design tries three scales of the design inertia at every point of its search."""

# Coarse grids, in units of the sample rate (bandwidths), of the sample period (filter) and of the nominal inertia.
Axes = Mapping[str, tuple[float, ...]]


def _geometric(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(float(value) for value in np.geomspace(low, high, count))


PID: Axes = {
    "bandwidth": _geometric(0.005, 0.2, 8),
    "integral_ratio": (0.1, 0.3, 1.0),
    "filter_time": (1.0, 3.0, 9.0),
    "inertia_scale": _geometric(0.5, 8.0, 6),
    "payload_fraction": (0.25, 1.0),
}
COMPUTED_TORQUE: Axes = {
    "bandwidth": _geometric(0.02, 0.3, 10),
    "integral_ratio": (0.1, 0.3, 1.0),
    "filter_time": _geometric(0.5, 16.0, 5),
    "inertia_scale": _geometric(0.5, 4.0, 6),
}
WITH_OBSERVER: Axes = {
    "bandwidth": _geometric(0.03, 0.3, 7),
    "integral_ratio": (0.01, 0.1, 0.5),
    "filter_time": (1.0, 2.5, 6.0),
    "inertia_scale": _geometric(0.5, 2.0, 4),
    "observer_bandwidth": (0.005, 0.02, 0.08, 0.3),
}
LARGEST = {"integral_ratio": 1.0, "payload_fraction": 1.0}

FIRST_STEP = 0.2
STEP_GROWTH = 1.5


@dataclass(frozen=True)
class _Candidate:
    """A point of the search and what the grid says of it."""

    tuning: Tuning
    disturbance_gain: float
    torque_increment_nm: float


@dataclass(eq=False)
class _Search:
    """Evaluates points; remembers every one that is admissible and better than all before."""

    robot: Robot
    specification: Specification
    law: Callable[[Robot, Tuning, FloatArray, float], VelocityLaw]
    axes: Axes
    plants: PlantGrid
    progress: Progress
    tried: int = 0
    improvements: list[tuple[dict[str, float], _Candidate]] = field(default_factory=list)

    @property
    def activity_bound_nm(self) -> float:
        """Largest admissible rms torque increment."""
        return self.specification.torque_activity * float(np.linalg.norm(self.robot.limits.torque_nm))

    def tuning(self, point: Mapping[str, float]) -> Tuning:
        """The numbers of a point, SI."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        return Tuning(
            bandwidth_rad_s=point["bandwidth"] * rate,
            integral_ratio=point["integral_ratio"],
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
        spare, delay = self.specification.margin_spare, self.specification.delay_s
        return all(loops.is_stable(*case) for case in ((1.0, 0.0), (spare, delay), (1.0 / spare, delay), (1.0, delay)))

    def disturbance_gain(self, loops: LoopGrid, plants: PlantGrid) -> float:
        """Worst over the plants, s^2."""
        unit = np.asarray(np.linalg.cholesky(plants.nominal), dtype=np.float64)
        return loops.disturbance_gain(self.specification.disturbance_frequency_rad_s, unit)

    def torque_increment(self, loops: LoopGrid) -> float:
        """Worst over the plants, N m."""
        return loops.torque_activity([self.specification.angle_noise_rad, VELOCITY_NOISE_RAD_S])

    def visit(self, point: dict[str, float]) -> bool:
        """Evaluate one point; returns whether it is the best so far."""
        self.tried += 1
        self.progress(self.tried, SEARCH_BUDGET)
        tuning = self.tuning(point)
        loops = self.loops(tuning, self.plants)
        gain = self.disturbance_gain(loops, self.plants)
        if self.improvements and gain >= self.improvements[-1][1].disturbance_gain:
            return False
        if not self.is_robust(loops):
            return False
        activity = self.torque_increment(loops)
        if activity > self.activity_bound_nm:
            return False
        self.improvements.append((point, _Candidate(tuning, gain, activity)))
        return True

    def run(self) -> None:
        """The coarse grid, then random steps from the best point for the rest of the budget.

        A (1+1) evolution strategy in the logarithms, its step adapted to one success in five (Rechenberg 1973): the
        best points lie where several constraints meet, where steps along single axes get stuck. Seeded.
        """
        for values in itertools.product(*self.axes.values()):
            self.visit(dict(zip(self.axes, values, strict=True)))
        random, step = np.random.default_rng(0), FIRST_STEP
        while self.improvements and self.tried < SEARCH_BUDGET:
            best = self.improvements[-1][0]
            factors = np.exp(step * random.standard_normal(len(best)))
            point = {
                name: min(value * factor, LARGEST.get(name, math.inf))
                for (name, value), factor in zip(best.items(), factors.tolist(), strict=True)
            }
            step *= STEP_GROWTH if self.visit(point) else STEP_GROWTH**-0.25


def _pid_feedback(robot: Robot, tuning: Tuning, nominal: FloatArray, period: float) -> VelocityLaw:
    largest = stretched_inertia(robot, tuning.payload_fraction)
    per_joint = np.broadcast_to(np.diag(tuning.inertia_scale * largest), nominal.shape)
    kp, kd, ki = (gain * per_joint for gain in tuning.unit_gains())
    return VelocityLaw(period, kp, kd, ki, nominal, tuning.velocity_filter_time_constant_s)


def _computed_torque_feedback(robot: Robot, tuning: Tuning, nominal: FloatArray, period: float) -> VelocityLaw:
    inertia = tuning.inertia_scale * nominal
    kp, kd, ki = (gain * inertia for gain in tuning.unit_gains())
    filter_time, observer = tuning.velocity_filter_time_constant_s, tuning.observer_bandwidth_rad_s
    return VelocityLaw(period, kp, kd, ki, inertia, filter_time, observer)


def pid_tuned(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PID with feedforward, tuned. InfeasibleError: no point of the search meets the specification."""
    search = _Search(robot, specification, _pid_feedback, PID, PlantGrid.screen(robot), progress)
    return _designed("pid-tuned", search, pid_design)


def computed_torque_tuned(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque, tuned. InfeasibleError: no point of the search meets the specification."""
    search = _Search(
        robot, specification, _computed_torque_feedback, COMPUTED_TORQUE, PlantGrid.screen(robot), progress
    )
    return _designed("ctc-tuned", search, computed_torque_design)


def computed_torque_with_observer_tuned(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque with observer, tuned. InfeasibleError: no point of the search meets the specification."""
    search = _Search(robot, specification, _computed_torque_feedback, WITH_OBSERVER, PlantGrid.screen(robot), progress)
    return _designed("ctc-dob-tuned", search, computed_torque_design)


def _designed(
    controller: str, search: _Search, build: Callable[[Robot, Specification, Tuning], TrackingDesign]
) -> TrackingDesign:
    """The best candidate that also holds on the full grid, as a design with its report."""
    search.run()
    robot, specification = search.robot, search.specification
    about = f"{robot.id}: no {controller} design at {specification.rate_hz:g} Hz"
    plants = PlantGrid.full(robot)
    for _, candidate in reversed(search.improvements):
        tuning = candidate.tuning
        loops = search.loops(tuning, plants)
        if not search.is_robust(loops):
            continue
        gain, activity = search.disturbance_gain(loops, plants), search.torque_increment(loops)
        if activity <= search.activity_bound_nm:
            return replace(
                build(robot, specification, tuning),
                controller=controller,
                inputs={"controller": controller, "specification": specification.to_document()},
                report=_report(search, _Candidate(tuning, gain, activity), loops),
            )
    raise InfeasibleError(f"{about}: no point of the search is stable with every payload within the torque activity")


def _report(search: _Search, chosen: _Candidate, loops: LoopGrid) -> dict[str, Any]:
    """The numbers a person asks for, JSON-able."""
    delays = {"no_delay": 0.0, "specified_delay": search.specification.delay_s}
    rates = {name: loops.worst(delay_s=delay).growth_rate_per_s for name, delay in delays.items()}
    return {
        **asdict(chosen.tuning),
        "worst_growth_rate_per_s": max(rates.values()),
        "growth_rates_per_s": rates,
        "disturbance_gain_s2": chosen.disturbance_gain,
        "predicted_torque_increment_nm": chosen.torque_increment_nm,
        "candidates_tried": search.tried,
    }
