"""Choice of the gains of `dob-torque`: two sets of inequalities solved once, then a search inside the robust gate.

The inequalities of Theorem IV.11 in reduced form have no time or inertia scale. They are solved once, in the time unit
in which the pole disk has radius 2, with decay rates in fixed ratios to it; every feedback disk, observer disk and
scale of the design inertia is a change of units of that one point. The search is over these three numbers and the
filter time constant: for every observer disk, filter and scale, the largest feedback disk whose sampled loops are
stable on a coarse grid; of these, the one that rejects disturbances best within the bound on torque activity and
passes the gate on the full grid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.iv11_reduced import (
    FeedbackPoint,
    ObserverPoint,
    feedback_condition,
    observer_condition,
)
from quasilpv.errors import InfeasibleError
from quasilpv.lmi import to_rational
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.torque.schedule import ScheduledLaw, ScheduledPlants, schedule
from quasilpv.systems.robots.registry import Robot

FEEDBACK_DECAY = 1.0 / 30.0
"""Decay rate of the tracking error over the radius of its pole disk."""

OBSERVER_DECAY = 1.0 / 16.0
"""The same for the estimation error."""

OBSERVER_NOISE = 0.1
"""Weight of measurement noise against the second derivative of the disturbance, in the observer's own units."""

BACK_OFFS = (0.02, 0.1, 0.3)

# Search grid, in units of the sample rate (disks), of the sample period (filter) and of the nominal inertia (scale).
FEEDBACK_DISKS = tuple(float(w) for w in np.geomspace(0.01, 0.08, 16))
OBSERVER_DISKS = (0.3, 0.4, 0.5, 0.65, 0.8)
FILTER_TIMES = (2.0, 4.0)
INERTIA_SCALES = (0.6, 0.7, 0.8, 0.9, 1.0)


@dataclass(frozen=True, eq=False)
class TorqueDesign:
    """The chosen law with its evidence.

    Attributes:
        schedule: premises and nominal vertices.
        law: vertex tables as shipped.
        feedback, observer: the points of the inequalities, SI, for the design inertia as shipped; verified exactly.
        inertia_scale: s, the design inertia over the nominal one.
        growth_rates: worst on the full grid by case, 1/s: ``no_delay``, ``specified_delay``, and ``larger_inertia`` and
            ``smaller_inertia`` by the spare factor, both with that delay.
        disturbance_gain: worst |theta / d| over the grid at the specified frequency, rad/(N m).
        torque_increment_nm: predicted rms torque increment per sample due to encoder quantisation.
        candidates_tried: how many loops were screened.
    """

    schedule: Schedule
    law: ScheduledLaw
    feedback: FeedbackPoint
    observer: ObserverPoint
    inertia_scale: float
    growth_rates: dict[str, float]
    disturbance_gain: float
    torque_increment_nm: float
    candidates_tried: int

    def report(self) -> dict[str, Any]:
        """The numbers a person asks for, JSON-able."""
        return {
            "scheduled_premises": [str(premise.expression) for premise in self.schedule.premises],
            "vertices": len(self.law.inertia),
            "inertia_spread": self.schedule.spread,
            "inertia_scale": self.inertia_scale,
            "feedback_disk_rad_s": self.feedback.disk,
            "feedback_decay_per_s": self.feedback.decay,
            "feedback_gamma": self.feedback.gamma,
            "l2_gain_rad_per_nm": math.sqrt(self.feedback.gamma),
            "observer_disk_rad_s": self.observer.disk,
            "observer_decay_per_s": self.observer.decay,
            "observer_gamma": self.observer.gamma,
            "filter_time_constant_s": self.law.filter_time_constant_s,
            "disturbance_gain_rad_per_nm": self.disturbance_gain,
            "predicted_torque_increment_nm": self.torque_increment_nm,
            "candidates_tried": self.candidates_tried,
            "inequalities_verified_exactly": True,
            "worst_growth_rate_per_s": max(self.growth_rates[case] for case in ("no_delay", "specified_delay")),
            "growth_rates_per_s": self.growth_rates,
        }


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A point of the search and what the coarse grid says of it."""

    feedback_disk: float
    observer_disk: float
    filter_time_constant_s: float
    scale: float
    disturbance_gain: float
    torque_increment_nm: float


@dataclass(eq=False)
class _Search:
    """The two unit points and the coarse grid, with all that one point of the search needs."""

    robot: Robot
    specification: Specification
    schedule: Schedule
    feedback: FeedbackPoint
    observer: ObserverPoint
    inertia_unit: float
    screen: ScheduledPlants
    tried: int = 0

    def points(self, feedback_disk: float, observer_disk: float, scale: float) -> tuple[FeedbackPoint, ObserverPoint]:
        """The unit points in SI, for given disks (rad/s) and scale of the design inertia."""
        unit = self.inertia_unit * scale
        return self.feedback.scaled(feedback_disk / 2.0, unit), self.observer.scaled(observer_disk / 2.0, unit)

    def law(self, feedback_disk: float, observer_disk: float, filter_time_s: float, scale: float) -> ScheduledLaw:
        """Vertex tables of one point."""
        feedback, observer = self.points(feedback_disk, observer_disk, scale)
        return ScheduledLaw(
            self.schedule.polytope,
            scale * self.schedule.inertia,
            feedback.gains,
            observer.gains,
            self.specification.sample_period_s,
            filter_time_s,
            self.schedule.premultiplication,
        )

    def is_stable(self, law: ScheduledLaw) -> bool:
        """Whether the coarse grid is stable with the specified delay, with and without the spare factor."""
        self.tried += 1
        loops, spare = self.screen.loops(law), self.specification.margin_spare
        return all(loops.is_stable(factor, self.specification.delay_s) for factor in (1.0 / spare, 1.0, spare))

    def widest(self, observer_disk: float, filter_time_s: float, scale: float) -> _Candidate | None:
        """The largest feedback disk of the grid that is stable, by bisection; None if the smallest is not."""
        rate = self.specification.rate_hz
        disks = [float(round(disk * rate)) for disk in FEEDBACK_DISKS]
        low, high = -1, len(disks)
        while high - low > 1:
            middle = (low + high) // 2
            stable = self.is_stable(self.law(disks[middle], observer_disk, filter_time_s, scale))
            low, high = (middle, high) if stable else (low, middle)
        if low < 0:
            return None
        law = self.law(disks[low], observer_disk, filter_time_s, scale)
        return _Candidate(disks[low], observer_disk, filter_time_s, scale, *self.performance(law, self.screen))

    def performance(self, law: ScheduledLaw, plants: ScheduledPlants) -> tuple[float, float]:
        """Worst disturbance gain, rad/(N m), and worst torque increment from encoder quantisation, N m, on a grid."""
        loops = plants.loops(law)
        gain = loops.disturbance_gain(self.specification.disturbance_frequency_rad_s)
        return gain, loops.torque_activity([self.specification.angle_noise_rad])

    def growth_rates(self, law: ScheduledLaw, plants: ScheduledPlants) -> dict[str, float]:
        """Worst growth rate by case, see `TorqueDesign`."""
        loops, delay, spare = plants.loops(law), self.specification.delay_s, self.specification.margin_spare
        cases = {
            "no_delay": (1.0, 0.0),
            "specified_delay": (1.0, delay),
            "larger_inertia": (spare, delay),
            "smaller_inertia": (1.0 / spare, delay),
        }
        return {name: loops.worst(*case).growth_rate_per_s for name, case in cases.items()}

    def candidates(self, progress: Progress) -> Iterator[_Candidate]:
        """Every stable combination with its largest feedback disk."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        grid = list(itertools.product(OBSERVER_DISKS, FILTER_TIMES, INERTIA_SCALES))
        for done, (disk, filter_samples, scale) in enumerate(grid, start=1):
            candidate = self.widest(float(round(disk * rate)), filter_samples * period, scale)
            progress(done, len(grid))
            if candidate is not None:
                yield candidate


def design_torque_law(
    robot: Robot, specification: Specification, progress: Progress = no_progress, scheduled: Schedule | None = None
) -> TorqueDesign:
    """Choose disks, filter and design inertia of `dob-torque`, and return the gains with their evidence.

    Args:
        robot: nominal model, operating domain, limits and payload set.
        specification: what is asked for.
        progress: called with (points done, points in all).
        scheduled: what the gains depend on (default: `schedule`).

    Raises:
        InfeasibleError: the inequalities have no verified solution, or no point of the search passes the gate within
            the torque activity.
    """
    about = f"{robot.id}: no dob-torque design at {specification.rate_hz:g} Hz"
    for back_off in BACK_OFFS:
        search = _search(robot, specification, scheduled or schedule(robot), back_off, about)
        design = _best(search, progress, about)
        if holds_exactly(design.law, design.feedback, design.observer):
            return design
    raise InfeasibleError(f"{about}: the gains as shipped do not satisfy the inequalities in exact arithmetic")


@dataclass(frozen=True)
class TorqueBandwidth:
    """What `design_torque_law` searches over.

    Attributes:
        feedback_disk_rad_s, observer_disk_rad_s: radii of the pole disks; the decay rates are fixed fractions of them.
        filter_time_constant_s: T_f.
        inertia_scale: s, the design inertia over the nominal one.
    """

    feedback_disk_rad_s: float
    observer_disk_rad_s: float
    filter_time_constant_s: float
    inertia_scale: float


def torque_design_at(
    robot: Robot, specification: Specification, scheduled: Schedule, bandwidth: TorqueBandwidth
) -> TorqueDesign:
    """The design of one bandwidth and one schedule, whatever its growth rates: for comparisons, not for release.

    Raises:
        InfeasibleError: the inequalities have no verified solution.
    """
    about = f"{robot.id}: no dob-torque gains on {len(scheduled.premises)} premises"
    search = _search(robot, specification, scheduled, BACK_OFFS[0], about)
    disks, scale = (bandwidth.feedback_disk_rad_s, bandwidth.observer_disk_rad_s), bandwidth.inertia_scale
    law = search.law(*disks, bandwidth.filter_time_constant_s, scale)
    plants = ScheduledPlants.of(robot, scheduled, PlantGrid.full(robot))
    rates = search.growth_rates(law, plants)
    performance = search.performance(law, plants) if max(rates.values()) < 0.0 else (math.nan, math.nan)
    return TorqueDesign(scheduled, law, *search.points(*disks, scale), scale, rates, *performance, 1)


def holds_exactly(law: ScheduledLaw, feedback: FeedbackPoint, observer: ObserverPoint) -> bool:
    """Whether the inequalities hold, in rational arithmetic, for the inertia and gains of the tables as they are."""
    inertia = to_rational(law.inertia)
    if law.premultiplication is not None:
        inertia = to_rational(law.premultiplication) @ inertia
    return feedback_condition(inertia, Fraction(feedback.decay), Fraction(feedback.disk)).holds_at(
        feedback
    ) and observer_condition(
        inertia, Fraction(observer.decay), Fraction(observer.disk), Fraction(observer.noise)
    ).holds_at(observer)


def _search(robot: Robot, specification: Specification, scheduled: Schedule, back_off: float, about: str) -> _Search:
    """The unit points of a schedule, solved, with the coarse grid."""
    unit = 2.0 ** round(math.log2(float(np.mean(np.linalg.eigvalsh(scheduled.inertia)))))
    return _Search(
        robot,
        specification,
        scheduled,
        _unit_feedback(scheduled.model_inertia / unit, back_off, about),
        _unit_observer(scheduled.model_inertia / unit, back_off, about),
        unit,
        ScheduledPlants.of(robot, scheduled, PlantGrid.screen(robot)),
    )


def _unit_feedback(inertia: FloatArray, back_off: float, about: str) -> FeedbackPoint:
    condition = feedback_condition(inertia, 2.0 * FEEDBACK_DECAY, 2.0)
    solution = condition.problem.solve_inside(back_off)
    if not solution.verified:
        raise InfeasibleError(f"{about}: feedback inequalities: {solution.outcome.value}")
    return condition.point(solution)


def _unit_observer(inertia: FloatArray, back_off: float, about: str) -> ObserverPoint:
    condition = observer_condition(inertia, 2.0 * OBSERVER_DECAY, 2.0, OBSERVER_NOISE)
    solution = condition.problem.solve_inside(back_off)
    if not solution.verified:
        raise InfeasibleError(f"{about}: observer inequalities: {solution.outcome.value}")
    return condition.point(solution)


def _best(search: _Search, progress: Progress, about: str) -> TorqueDesign:
    """The best candidate within the torque activity that passes the gate on the full grid."""
    specification, robot = search.specification, search.robot
    bound = specification.torque_activity * float(np.linalg.norm(robot.limits.torque_nm))
    candidates = sorted(search.candidates(progress), key=lambda candidate: candidate.disturbance_gain)
    if not candidates:
        raise InfeasibleError(
            f"{about}: no feedback disk is stable with every payload and {specification.delay_s:g} s delay"
        )
    quiet = [candidate for candidate in candidates if candidate.torque_increment_nm <= bound]
    if not quiet:
        least = min(candidate.torque_increment_nm for candidate in candidates)
        raise InfeasibleError(
            f"{about}: encoder quantisation may cause torque increments of {bound:.3g} N m rms, "
            f"the quietest stable design has {least:.3g}"
        )
    plants = ScheduledPlants.of(robot, search.schedule, PlantGrid.full(robot))
    for candidate in quiet:
        at = candidate.feedback_disk, candidate.observer_disk
        law = search.law(*at, candidate.filter_time_constant_s, candidate.scale)
        rates = search.growth_rates(law, plants)
        if max(rates.values()) < 0.0:
            points = search.points(*at, candidate.scale)
            performance = search.performance(law, plants)
            return TorqueDesign(search.schedule, law, *points, candidate.scale, rates, *performance, search.tried)
    raise InfeasibleError(f"{about}: every candidate of the coarse grid is unstable somewhere on the full one")
