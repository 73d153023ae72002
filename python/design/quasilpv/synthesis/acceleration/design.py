"""The default design: the acceleration-level law with the largest bandwidth its margins and its torque activity allow.

For every pair of bandwidths the gains come from the conditions of `quasilpv.conditions.tracking.sampled_chains`;
the search is only over four numbers: feedback bandwidth, observer bandwidth, filter time constant, and the scale of the
design inertia ``M_n = s M_nominal``. The scale costs nothing to optimise: the admissible ones are an interval
(`quasilpv.synthesis.acceleration.tolerance`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from quasilpv.conditions.tracking.sampled_chains import ChainGains, feedback_gains, observer_gains
from quasilpv.errors import InfeasibleError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.inertia_range import InertiaRange, largest_inertia_norm, needed_inertia_range
from quasilpv.synthesis.acceleration.moving_inertia import InertiaDisc, needed_disc
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.synthesis.acceleration.tolerance import FrozenTolerance, MovingTolerance, Tolerance
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.synthesis.specification import Specification
from quasilpv.systems.robots.registry import Robot

# Search grid, in units of the sample rate (bandwidths) and of the sample period (filter).
FEEDBACK_BANDWIDTHS = tuple(float(w) for w in np.geomspace(0.02, 0.28, 12))
OBSERVER_BANDWIDTHS = tuple(float(w) for w in np.geomspace(0.4, 2.6, 10))
FILTER_TIMES = (0.3, 0.6, 1.0, 1.5)
REFINEMENTS = 2
NEIGHBOURS = 3**3 - 1
LARGEST_SEARCH = len(FEEDBACK_BANDWIDTHS) * len(OBSERVER_BANDWIDTHS) * len(FILTER_TIMES) + REFINEMENTS * NEIGHBOURS
INTERIOR_RATIOS = 5


@dataclass(frozen=True, eq=False)
class Candidate:
    """One point of the search and what it achieves.

    Attributes:
        law: the scalars.
        inertia_scale: s, the design inertia over the nominal one.
        inertia_margin: interval of ``M_t / M_n`` on which the loop with the specified delay is stable.
        needed_range: interval of ``M_t / M_n`` that occurs (margin contains it with the specified spare factor).
        disturbance_gain: worst |theta / d| over the needed range at the specified frequency, for d an acceleration of
            the *nominal* inertia, s^2.
        torque_increment_nm: predicted rms torque increment per sample due to encoder quantisation.
        bandwidths: feedback and observer bandwidth, rad/s.
    """

    law: AccelerationLaw
    inertia_scale: float
    inertia_margin: tuple[float, float]
    needed_range: tuple[float, float]
    disturbance_gain: float
    torque_increment_nm: float
    bandwidths: tuple[float, float]


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
            "predicted_torque_increment_nm": chosen.torque_increment_nm,
            "candidates_tried": self.candidates_tried,
        }


@dataclass(eq=False)
class _Search:
    """Gains and evaluations of one specification, each computed once."""

    robot: Robot
    specification: Specification
    needed: InertiaRange
    tolerance: Tolerance
    activity_bound_nm: float
    noise_nm: float
    feedback: dict[float, ChainGains] = field(default_factory=dict)
    observer: dict[float, ChainGains] = field(default_factory=dict)
    tried: int = 0
    best: Candidate | None = None
    best_point: tuple[float, float, float] | None = None
    widest_span: float = 0.0
    quietest_nm: float = math.inf

    def gains(self, wc: float, wo: float) -> tuple[ChainGains, ChainGains] | None:
        """Verified gains of a pair of bandwidths (per sample), or None."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        if wc not in self.feedback:
            self.feedback[wc] = feedback_gains(wc * rate, period)
        if wo not in self.observer:
            self.observer[wo] = observer_gains(wo * rate, period)
        pair = self.feedback[wc], self.observer[wo]
        return pair if all(chain.solution.verified for chain in pair) else None

    def visit(self, wc: float, wo: float, filter_samples: float) -> None:
        """Evaluate one point; remember it if it is admissible and better than the best so far."""
        self.tried += 1
        gains = self.gains(wc, wo)
        if gains is None:
            return
        period = self.specification.sample_period_s
        law = AccelerationLaw(period, gains[0].gains, gains[1].gains, filter_samples * period)
        for candidate in self._better_candidates(law, (wc / period, wo / period)):
            self.best, self.best_point = candidate, (wc, wo, filter_samples)

    def _better_candidates(self, law: AccelerationLaw, bandwidths: tuple[float, float]) -> Iterator[Candidate]:
        """Admissible candidates of one law, over the scale of the design inertia, that beat the best so far."""
        found = self.tolerance.tolerated(law)
        if found is None:
            return
        self.widest_span = max(self.widest_span, found.span)
        if found.scales is None:
            return
        smallest, largest = found.scales
        loop = SampledLoop(law)
        for scale in (smallest, math.sqrt(smallest * largest), largest):
            needed = (self.needed.lowest / scale, self.needed.highest / scale)
            ratios = [1.0 / r for r in np.geomspace(*needed, INTERIOR_RATIOS)]
            frequency = self.specification.disturbance_frequency_rad_s
            gain = max(loop.disturbance_gain(ratio, frequency) for ratio in ratios) / scale
            if self.best is not None and gain >= self.best.disturbance_gain:
                continue
            torque = max(loop.command_activity(ratio) for ratio in ratios) * self.noise_nm * scale
            self.quietest_nm = min(self.quietest_nm, torque)
            if torque <= self.activity_bound_nm:
                yield Candidate(law, scale, found.margin, needed, gain, torque, bandwidths)


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
    search = _Search(
        robot,
        specification,
        needed,
        frozen if disc is None else MovingTolerance(frozen, disc),
        activity_bound_nm=specification.torque_activity * float(np.linalg.norm(robot.limits.torque_nm)),
        noise_nm=specification.angle_noise_rad * largest_inertia_norm(robot),
    )
    grid = list(product(FEEDBACK_BANDWIDTHS, OBSERVER_BANDWIDTHS, FILTER_TIMES))
    for point in grid:
        search.visit(*point)
        progress(search.tried, LARGEST_SEARCH)
    step = (_ratio(FEEDBACK_BANDWIDTHS), _ratio(OBSERVER_BANDWIDTHS), 1.5)
    for _ in range(REFINEMENTS):
        step = tuple(math.sqrt(s) for s in step)  # type: ignore[assignment]
        if search.best_point is not None:
            for point in _neighbours(search.best_point, step):
                search.visit(*point)
                progress(search.tried, LARGEST_SEARCH)
    if search.best is None or search.best_point is None:
        raise InfeasibleError(_why_not(search))
    wc, wo, _ = search.best_point
    return AccelerationDesign(
        search.best,
        search.feedback[wc],
        search.observer[wo],
        needed,
        _growth_rates(search.best, specification),
        search.tried,
        None if disc is None else disc.scaled(search.best.inertia_scale),
    )


def _why_not(search: _Search) -> str:
    """One line: which requirement no point of the search met, wanted and found."""
    wanted = search.specification
    about = f"{search.robot.id}: no acceleration-level design at {wanted.rate_hz:g} Hz"
    if math.isinf(search.quietest_nm):
        spans = f"must span {search.tolerance.span:.3g} to 1, the widest found spans {search.widest_span:.3g}"
        return f"{about}: the tolerated inertias {spans}"
    return (
        f"{about}: encoder quantisation may cause torque increments of {search.activity_bound_nm:.3g} N m rms, "
        f"the quietest design inside the margin has {search.quietest_nm:.3g}"
    )


def _growth_rates(candidate: Candidate, specification: Specification) -> dict[str, tuple[float, float]]:
    """Worst growth rate and where, without and with the specified delay."""
    delays = {"no_delay": 0.0, "specified_delay": specification.delay_s}
    return {
        name: SampledLoop(candidate.law, d).worst_growth_rate(*candidate.needed_range) for name, d in delays.items()
    }


def _ratio(grid: tuple[float, ...]) -> float:
    return float(grid[1] / grid[0])


def _neighbours(
    point: tuple[float, float, float], step: tuple[float, float, float]
) -> Iterator[tuple[float, float, float]]:
    for shift in product((-1, 0, 1), repeat=3):
        if any(shift):
            wc, wo, filter_samples = (p * s**d for p, s, d in zip(point, step, shift, strict=True))
            yield wc, wo, filter_samples
