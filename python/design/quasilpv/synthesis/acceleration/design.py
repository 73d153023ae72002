"""The default design: the acceleration-level law with the largest bandwidth its margins and its torque activity allow.

For every pair of bandwidths the gains come from the conditions of `quasilpv.conditions.tracking.sampled_chains`;
the search is only over four numbers: feedback bandwidth, observer bandwidth, filter time constant, and the scale of the
design inertia ``M_n = s M_nominal``. The scale costs nothing to optimise: the admissible ones are an interval
(`quasilpv.synthesis.acceleration.tolerance`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.conditions.tracking.sampled_chains import ChainGains
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.inertia_range import InertiaRange, largest_inertia_norm, needed_inertia_range
from quasilpv.synthesis.acceleration.moving_inertia import InertiaDisc, needed_disc
from quasilpv.synthesis.acceleration.search import BandwidthSearch, Candidate, Grid, growth_rates
from quasilpv.synthesis.acceleration.tolerance import FrozenTolerance, MovingTolerance
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.synthesis.specification import Specification
from quasilpv.systems.robots.registry import Robot

GRID = Grid(
    feedback=tuple(float(w) for w in np.geomspace(0.02, 0.28, 12)),
    observer=tuple(float(w) for w in np.geomspace(0.4, 2.6, 10)),
    filter_samples=(0.3, 0.6, 1.0, 1.5),
)
LARGEST_SEARCH = GRID.evaluations


@dataclass(frozen=True, eq=False)
class AccelerationDesign:
    """The chosen candidate with its evidence; the disc of its design inertia if a moving robot was asked for."""

    candidate: Candidate
    feedback: ChainGains
    observer: ChainGains
    inertia_range: InertiaRange
    growth_rates: dict[str, tuple[float, float]]
    candidates_tried: int
    disc: InertiaDisc | None = None

    def report(self) -> dict[str, Any]:
        """The numbers a person asks for, JSON-able."""
        chosen = self.candidate
        worst, where = max(self.growth_rates.values())
        return {
            "feedback_bandwidth_rad_s": chosen.bandwidths[0],
            "observer_bandwidth_rad_s": chosen.bandwidths[1],
            "filter_time_constant_s": chosen.law.filter_time_constant_s,
            "inertia_scale": chosen.inertia_scale,
            "inertia_margin": list(chosen.inertia_margin),
            "needed_range": list(chosen.needed_range),
            "worst_growth_rate_per_s": worst,
            "worst_growth_rate_at_inertia_ratio": where,
            "growth_rates_per_s": {name: rate for name, (rate, _) in self.growth_rates.items()},
            "disturbance_gain_s2": chosen.disturbance_gain,
            "predicted_torque_increment_nm": chosen.torque_increment,
            "candidates_tried": self.candidates_tried,
        }


def design_acceleration_law(
    robot: Robot,
    specification: Specification,
    progress: Progress = no_progress,
    *,
    scheduled: Schedule | None = None,
    moving: bool = False,
) -> AccelerationDesign:
    """Choose bandwidths, filter and design inertia, and return the gains with their evidence.

    Args:
        robot: nominal model, operating domain, limits and payload set.
        specification: what is asked for.
        progress: called with (points done, points in all).
        scheduled: the design inertia by only some of its premises; None for all of them.
        moving: demand a Lyapunov function common to all postures and payloads (`MovingTolerance`), not only stability
            in each of them.

    Raises:
        InfeasibleError: no point of the search meets the margins and the torque activity.
    """
    needed = needed_inertia_range(robot, scheduled=scheduled)
    frozen = FrozenTolerance(specification, needed)
    disc = needed_disc(robot, scheduled) if moving else None
    search = BandwidthSearch(
        robot.id,
        specification,
        needed,
        frozen if disc is None else MovingTolerance(frozen, disc),
        activity_bound=specification.torque_activity * float(np.linalg.norm(robot.limits.torque_nm)),
        noise=specification.angle_noise_rad * largest_inertia_norm(robot),
    )
    best = search.run(GRID, progress)
    return AccelerationDesign(
        best,
        *search.gains_of_best(),
        needed,
        growth_rates(best, specification),
        search.tried,
        None if disc is None else disc.scaled(best.inertia_scale),
    )
