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

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.baselines.printed import (
    Tuning,
    computed_torque_design,
    pid_design,
    stretched_inertia,
)
from quasilpv.synthesis.baselines.tuning_search import Axes, Candidate, TuningSearch
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import Robot


def _geometric(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(float(value) for value in np.geomspace(low, high, count))


NEXT_TO_NONE = 1e-4
"""Observer bandwidth, as a part of the sample rate, at which `ctc-dob` is `ctc` for all that can be measured: the law
without observer is a branch of the search for the law with one."""

# Coarse grids.
PID: Axes = {
    "bandwidth": _geometric(0.005, 0.2, 8),
    "integral_ratio": (0.1, 0.3, 1.0),
    "filter_time": (1.0, 3.0, 9.0),
    "inertia_scale": _geometric(0.5, 8.0, 6),
    "payload_fraction": (0.25, 1.0),
}
PD: Axes = {name: values for name, values in PID.items() if name != "integral_ratio"}
COMPUTED_TORQUE: Axes = {
    "bandwidth": _geometric(0.02, 0.3, 10),
    "integral_ratio": (0.1, 0.3, 1.0),
    "filter_time": _geometric(0.5, 16.0, 5),
    "inertia_scale": _geometric(0.5, 4.0, 6),
}
WITH_OBSERVER: Axes = {
    "bandwidth": _geometric(0.03, 0.3, 7),
    "integral_ratio": (0.03, 0.3, 1.0),
    "filter_time": (1.0, 2.5, 6.0),
    "inertia_scale": _geometric(0.5, 2.0, 4),
    "observer_bandwidth": (NEXT_TO_NONE, 0.02, 0.2),
}


def pid_law(robot: Robot, tuning: Tuning, nominal: FloatArray, period: float) -> VelocityLaw:
    """PID frozen at configurations of these nominal inertias, (B, n, n); the period is in s."""
    largest = stretched_inertia(robot, tuning.payload_fraction)
    per_joint = np.broadcast_to(np.diag(tuning.inertia_scale * largest), nominal.shape)
    kp, kd, ki = (gain * per_joint for gain in tuning.unit_gains())
    return VelocityLaw(period, kp, kd, ki, nominal, tuning.velocity_filter_time_constant_s)


def computed_torque_law(robot: Robot, tuning: Tuning, nominal: FloatArray, period: float) -> VelocityLaw:
    """Computed torque, with an observer if the tuning has one, likewise."""
    inertia = tuning.inertia_scale * nominal
    kp, kd, ki = (gain * inertia for gain in tuning.unit_gains())
    filter_time, observer = tuning.velocity_filter_time_constant_s, tuning.observer_bandwidth_rad_s
    return VelocityLaw(period, kp, kd, ki, inertia, filter_time, observer)


def pid_tuned(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PID with feedforward, tuned. InfeasibleError: no point of the search meets the specification."""
    search = TuningSearch(robot, specification, pid_law, PID, PlantGrid.screen(robot), progress)
    return _designed("pid-tuned", search, pid_design)


def pd_tuned(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PD with feedforward, tuned. InfeasibleError: no point of the search meets the specification."""
    search = TuningSearch(robot, specification, pid_law, PD, PlantGrid.screen(robot), progress)
    return _designed("pd-tuned", search, pid_design)


def computed_torque_tuned(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque, tuned. InfeasibleError: no point of the search meets the specification."""
    search = TuningSearch(robot, specification, computed_torque_law, COMPUTED_TORQUE, PlantGrid.screen(robot), progress)
    return _designed("ctc-tuned", search, computed_torque_design)


def computed_torque_with_observer_tuned(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque with observer, tuned. InfeasibleError: no point of the search meets the specification."""
    search = TuningSearch(robot, specification, computed_torque_law, WITH_OBSERVER, PlantGrid.screen(robot), progress)
    return _designed("ctc-dob-tuned", search, computed_torque_design)


def _designed(
    controller: str, search: TuningSearch, build: Callable[[Robot, Specification, Tuning], TrackingDesign]
) -> TrackingDesign:
    """The best candidate that also holds on the full grid, as a design with its report."""
    robot, specification = search.robot, search.specification
    assert isinstance(robot, Robot)
    plants = PlantGrid.full(robot)
    for candidate in search.run():
        loops = search.loops(candidate.tuning, plants)
        if not search.is_robust(loops):
            continue
        gain, activity = search.disturbance_gain(loops, plants), search.torque_increment(loops)
        if activity <= search.activity_bound_nm:
            chosen = replace(candidate, disturbance_gain=gain, torque_increment_nm=activity)
            return replace(
                build(robot, specification, candidate.tuning),
                controller=controller,
                inputs={"controller": controller, "specification": specification.to_document()},
                report=_report(search, chosen, loops),
            )
    about = f"{robot.id}: no {controller} design at {specification.rate_hz:g} Hz"
    raise InfeasibleError(f"{about}: no point of the search is stable with every payload within the torque activity")


def _report(search: TuningSearch, chosen: Candidate, loops: LoopGrid) -> dict[str, Any]:
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
