"""The search of the acceleration-level law: bandwidths, filter and scale of the design inertia.

What is demanded of a candidate, and what its noise costs, the caller says; so the same search serves planar mechanisms,
whose activity is one number in N m, and robots in space, whose joints are judged each by its own limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from quasilpv.conditions.tracking.sampled_chains import ChainGains, feedback_gains, observer_gains
from quasilpv.errors import InfeasibleError
from quasilpv.progress import Progress
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.synthesis.acceleration.tolerance import Range, Tolerance
from quasilpv.synthesis.specification import Specification

REFINEMENTS = 2
NEIGHBOURS = 3**3 - 1
INTERIOR_RATIOS = 5


@dataclass(frozen=True)
class Grid:
    """Points of a search: bandwidths in units of the sample rate, filter times in units of the sample period."""

    feedback: tuple[float, ...]
    observer: tuple[float, ...]
    filter_samples: tuple[float, ...]

    @property
    def evaluations(self) -> int:
        """Most evaluations, refinements included."""
        return len(self.feedback) * len(self.observer) * len(self.filter_samples) + REFINEMENTS * NEIGHBOURS

    def points(self) -> Iterator[tuple[float, float, float]]:
        """All of them."""
        return product(self.feedback, self.observer, self.filter_samples)


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
        torque_increment: predicted rms torque increment per sample due to encoder quantisation, in the search's unit.
        bandwidths: feedback and observer bandwidth, rad/s.
    """

    law: AccelerationLaw
    inertia_scale: float
    inertia_margin: tuple[float, float]
    needed_range: tuple[float, float]
    disturbance_gain: float
    torque_increment: float
    bandwidths: tuple[float, float]


@dataclass(eq=False)
class BandwidthSearch:
    """Gains and evaluations of one specification, each computed once.

    Attributes:
        robot_id: for messages.
        specification: what is asked for.
        needed: range of ``M_t / M_nominal``.
        tolerance: the demand on candidates.
        activity_bound: largest admissible torque increment, N m or a share of a limit: see `unit`.
        noise: what an encoder's rounding, rad, makes of a unit of the command's activity at s = 1, in the same unit.
        unit: of torque increments.
        integral: whether the feedback has integral action.
        lag_s: time constant of the drives that gain and activity are evaluated with.
    """

    robot_id: str
    specification: Specification
    needed: Range
    tolerance: Tolerance
    activity_bound: float
    noise: float
    unit: str = "N m rms"
    integral: bool = True
    lag_s: float = 0.0
    feedback: dict[float, ChainGains] = field(default_factory=dict)
    observer: dict[float, ChainGains] = field(default_factory=dict)
    tried: int = 0
    best: Candidate | None = None
    best_point: tuple[float, float, float] | None = None
    widest_span: float = 0.0
    quietest: float = math.inf

    def gains(self, wc: float, wo: float) -> tuple[ChainGains, ChainGains] | None:
        """Verified gains of a pair of bandwidths (per sample), or None."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        if wc not in self.feedback:
            self.feedback[wc] = feedback_gains(wc * rate, period, integral=self.integral)
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
        loop = SampledLoop(law, lag_s=self.lag_s)
        for scale in (smallest, math.sqrt(smallest * largest), largest):
            needed = (self.needed.lowest / scale, self.needed.highest / scale)
            ratios = [1.0 / r for r in np.geomspace(*needed, INTERIOR_RATIOS)]
            frequency = self.specification.disturbance_frequency_rad_s
            gain = max(loop.disturbance_gain(ratio, frequency) for ratio in ratios) / scale
            if self.best is not None and gain >= self.best.disturbance_gain:
                continue
            torque = max(loop.command_activity(ratio) for ratio in ratios) * self.noise * scale
            self.quietest = min(self.quietest, torque)
            if torque <= self.activity_bound:
                yield Candidate(law, scale, found.margin, needed, gain, torque, bandwidths)

    def run(self, grid: Grid, progress: Progress) -> Candidate:
        """The best candidate of a grid and of two refinements around its best point.

        Raises:
            InfeasibleError: no point meets the margins and the torque activity.
        """
        for point in grid.points():
            self.visit(*point)
            progress(self.tried, grid.evaluations)
        step = (_ratio(grid.feedback), _ratio(grid.observer), 1.5)
        for _ in range(REFINEMENTS):
            step = tuple(math.sqrt(s) for s in step)  # type: ignore[assignment]
            if self.best_point is not None:
                for point in _neighbours(self.best_point, step):
                    self.visit(*point)
                    progress(self.tried, grid.evaluations)
        if self.best is None:
            raise InfeasibleError(self._why_not())
        return self.best

    def gains_of_best(self) -> tuple[ChainGains, ChainGains]:
        """Feedback and observer of the best candidate."""
        assert self.best_point is not None
        wc, wo, _ = self.best_point
        return self.feedback[wc], self.observer[wo]

    def _why_not(self) -> str:
        """One line: which requirement no point of the search met, wanted and found."""
        wanted = self.specification
        about = f"{self.robot_id}: no acceleration-level design at {wanted.rate_hz:g} Hz"
        if math.isinf(self.quietest):
            spans = f"must span {self.tolerance.span:.3g} to 1, the widest found spans {self.widest_span:.3g}"
            return f"{about}: the tolerated inertias {spans}"
        return (
            f"{about}: encoder quantisation may cause torque increments of {self.activity_bound:.3g} {self.unit}, "
            f"the quietest design inside the margin has {self.quietest:.3g}"
        )


def growth_rates(
    candidate: Candidate, specification: Specification, lag_s: float = 0.0
) -> dict[str, tuple[float, float]]:
    """Worst growth rate and where, without and with the specified delay."""
    delays = {"no_delay": 0.0, "specified_delay": specification.delay_s}
    return {
        name: SampledLoop(candidate.law, d, lag_s).worst_growth_rate(*candidate.needed_range)
        for name, d in delays.items()
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
