"""The tracking law `hinf-tracking`: Theorem III.10 of Dehak 2022 with gain limits, inside the robust gate.

Premises of the inertia are measured and scheduled. Coriolis torque, gravity and friction are unknown terms, bounded
over the operating domain for every payload (`unknown_torques`); the inertia is the nominal one, which the theorem
takes as known, so what a payload does to it is the business of the gate.

The inequalities are solved in the time unit 1/w of a bandwidth w, once for each gain limit, at the lowest bandwidth of
the search: in the units of a higher one the unknown terms are smaller, so the same point serves them all. Of the
largest bandwidths that are stable with every payload, the one that rejects disturbances best within the bound on torque
activity is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.laws.hinf_tracking import HinfTrackingLaw
from quasilpv.conditions.tracking.iii10_reduced import TrackingPoint, UnknownTorques, reduced_tracking_condition
from quasilpv.errors import InfeasibleError
from quasilpv.loops.hinf_law import hinf_tracking_law
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.specification import VELOCITY_NOISE_RAD_S, Specification
from quasilpv.synthesis.torque.schedule import ScheduledPlants, full_schedule
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import Robot

DECAY = 0.4
"""Decay rate over the bandwidth."""

BACK_OFF = 0.05

# Search grid: gain limits in the units of the bandwidth and of the mean inertia, bandwidths in units of the sample
# rate, filter of the measured speed in sample periods.
GAIN_LIMITS = (120.0, 160.0, 200.0, 240.0)
BANDWIDTHS = tuple(float(w) for w in np.geomspace(0.006, 0.016, 21))
FILTER_TIMES = (1.5, 2.0)


FRICTION_BOUND_NM_S = 10.0
"""Largest viscous friction coefficient of a joint that the law has to withstand, N m s/rad (Dehak 2022, III.3.3)."""

FRICTION_BOUNDS_NM_S = {"fivebar": 0.01}
"""By robot, where it is another one: friction that takes 0.4 s to stop a link."""


def friction_bound_nm_s(robot: Robot) -> float:
    """Largest viscous friction coefficient of a joint of a robot, N m s/rad; the model itself may have none."""
    return FRICTION_BOUNDS_NM_S.get(robot.id, FRICTION_BOUND_NM_S)


def unknown_torques(robot: Robot) -> UnknownTorques:
    """Bounds on Coriolis torque, gravity and friction over the operating domain and the payload set.

    With absolute angles ``alpha = S theta`` and speeds ``W = S omega`` (s_k the rows of S) the torques are
    ``sum_k!=l D_kl sin(alpha_k - alpha_l) W_l s_k s_l' w``, ``sum_k g_k sinc(alpha_k) s_k s_k' theta`` and
    ``sum_k f_k e_k e_k' w``: every term has rank one, and |sin| and |sinc| are at most 1. D and g grow with masses and
    centres of mass, so their largest values are those of the arm with the larger of each.
    """
    payload = robot.payloads
    heaviest = robot.model.perturbed(
        [max(1.0, scale) for scale in payload.mass_scale], [max(1.0, scale) for scale in payload.com_scale]
    )
    n = robot.model.joints
    S, e, none = heaviest.absolute_map, np.eye(n), np.zeros(n)
    speed = S @ [max(map(abs, interval)) for interval in robot.domain.speed_rad_s]
    D = heaviest.inertia_constants
    coriolis = [(S[k], [none, S[j], none], abs(D[k, j]) * speed[j]) for k in range(n) for j in range(n) if k != j]
    gravity = [(S[k], [S[k], none, none], heaviest.gravity_constants[k]) for k in range(n)]
    friction = [(e[k], [none, e[k], none], friction_bound_nm_s(robot)) for k in range(n)]
    torque, state, radius = zip(*coriolis, *gravity, *friction, strict=True)
    return UnknownTorques(np.array(torque), np.array([np.concatenate(c) for c in state]), np.array(radius))


@dataclass(frozen=True, eq=False)
class HinfTables:
    """The law as vertex tables.

    Attributes:
        schedule: premises and nominal inertia.
        point: P and the vertices of Y, SI.
        sample_period_s: T.
        filter_time_constant_s: of the measured speed.
    """

    schedule: Schedule
    point: TrackingPoint
    sample_period_s: float
    filter_time_constant_s: float

    def at(self, premises: FloatArray) -> VelocityLaw:
        """The law frozen at B premise vectors, (B, p), clamped to the box as the run-time side does."""
        polytope = self.schedule.polytope
        weights = polytope.weights(polytope.saturate(premises)[0])
        numerator, inertia = (np.tensordot(weights, table, axes=1) for table in (self.point.Y, self.schedule.inertia))
        return hinf_tracking_law(self.sample_period_s, self.filter_time_constant_s, numerator, inertia, self.point.P)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A point of the search and what the coarse grid says of it."""

    tables: HinfTables
    disturbance_gain: float
    torque_increment_nm: float


@dataclass(eq=False)
class _Search:
    """What one point of the search needs."""

    robot: Robot
    specification: Specification
    schedule: Schedule
    screen: ScheduledPlants
    tried: int = 0

    @property
    def inertia_unit(self) -> float:
        """A power of two near the mean inertia, kg m^2."""
        return float(2.0 ** round(math.log2(float(np.mean(np.linalg.eigvalsh(self.schedule.inertia))))))

    def unit_point(self, unknown: UnknownTorques, gain_limit: float) -> TrackingPoint | None:
        """The inequalities solved for one gain limit; None without a verified solution."""
        lowest = BANDWIDTHS[0] * self.specification.rate_hz
        condition = reduced_tracking_condition(
            self.schedule.inertia / self.inertia_unit,
            unknown.in_units(lowest, self.inertia_unit),
            decay=DECAY,
            gain_limit=gain_limit,
        )
        solution = condition.problem.solve_inside(BACK_OFF)
        return condition.point(solution) if solution.verified else None

    def is_stable(self, loops: LoopGrid) -> bool:
        """Whether all loops are stable with the specified delay, with and without the spare factor."""
        self.tried += 1
        spare = self.specification.margin_spare
        return all(loops.is_stable(factor, self.specification.delay_s) for factor in (1.0 / spare, 1.0, spare))

    def performance(self, loops: LoopGrid) -> tuple[float, float]:
        """Worst disturbance gain, rad/(N m), and worst torque increment from sensor noise, N m."""
        noise = [self.specification.angle_noise_rad, VELOCITY_NOISE_RAD_S]
        return loops.disturbance_gain(self.specification.disturbance_frequency_rad_s), loops.torque_activity(noise)

    def stable_bandwidths(
        self, unit: TrackingPoint, unknown: UnknownTorques, filter_time: float
    ) -> Iterator[_Candidate]:
        """From the largest bandwidth of the grid down, those that are stable on the coarse grid."""
        rate, period = self.specification.rate_hz, self.specification.sample_period_s
        for bandwidth in reversed(BANDWIDTHS):
            point = unit.scaled(round(bandwidth * rate, 3), self.inertia_unit, unknown)
            tables = HinfTables(self.schedule, point, period, filter_time * period)
            loops = self.screen.loops(tables)
            if self.is_stable(loops):
                yield _Candidate(tables, *self.performance(loops))

    def candidates(self, progress: Progress) -> Iterator[_Candidate]:
        """Every gain limit and filter with its largest stable bandwidth that is quiet enough."""
        unknown = unknown_torques(self.robot)
        bound = self.specification.torque_activity * float(np.linalg.norm(self.robot.limits.torque_nm))
        for done, gain_limit in enumerate(GAIN_LIMITS, start=1):
            unit = self.unit_point(unknown, gain_limit)
            if unit is not None:
                for filter_time in FILTER_TIMES:
                    stable = self.stable_bandwidths(unit, unknown, filter_time)
                    yield from islice((found for found in stable if found.torque_increment_nm <= bound), 1)
            progress(done, len(GAIN_LIMITS))


def hinf_tracking(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `hinf-tracking`.

    Args:
        robot: nominal model, operating domain, limits and payload set.
        specification: what is asked for.
        progress: called with (gain limits done, gain limits in all).

    Raises:
        InfeasibleError: the robot holds a spring, the inequalities have no verified solution, or no point of the search
            is stable with every payload and delay within the torque activity.
    """
    if robot.model.holds_spring:
        raise InfeasibleError(f"{robot.id}: no hinf-tracking design: the bounds of its terms know gravity, no spring")
    chosen = full_schedule(robot)
    screen = ScheduledPlants.of(robot, chosen, PlantGrid.screen(robot))
    search = _Search(robot, specification, chosen, screen)
    full = ScheduledPlants.of(robot, chosen, PlantGrid.full(robot))
    for candidate in sorted(search.candidates(progress), key=lambda candidate: candidate.disturbance_gain):
        loops = full.loops(candidate.tables)
        if search.is_stable(loops):
            return _tracking_design(search, candidate.tables, loops)
    raise InfeasibleError(
        f"{robot.id}: no hinf-tracking design at {specification.rate_hz:g} Hz: no gain limit and bandwidth is stable "
        f"with every payload and {specification.delay_s:g} s delay within the torque activity"
    )


def _tracking_design(search: _Search, tables: HinfTables, loops: LoopGrid) -> TrackingDesign:
    """What is shipped, with the numbers a person asks for."""
    robot, specification, schedule, point = search.robot, search.specification, tables.schedule, tables.point
    polytope = schedule.polytope
    return TrackingDesign(
        controller=HinfTrackingLaw.tag(),
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law={
            "kind": HinfTrackingLaw.tag(),
            "numerator": polytope.to_document(point.Y),
            "lyapunov": point.P.tolist(),
            "velocity_filter_time_constant_s": tables.filter_time_constant_s,
            "inertia": polytope.to_document(schedule.inertia),
        },
        expressions={
            "premises": tuple(premise.expression for premise in schedule.premises),
            "gravity": tuple(robot.model.symbolic.gravity),
        },
        inputs={"controller": HinfTrackingLaw.tag(), "specification": specification.to_document()},
        report=_report(search, tables, loops),
        witness={
            "feedback": {
                "condition": "III.10-reduced",
                "decay_per_s": point.decay,
                "gamma": point.gamma,
                "gain_limit": point.gain_limit,
                "beta": point.beta,
                "bandwidth_rad_s": point.rate,
                "inertia_unit_kg_m2": point.inertia_unit,
                "friction_nm_s": friction_bound_nm_s(robot),
                "tau": point.tau.tolist(),
            }
        },
    )


def _report(search: _Search, tables: HinfTables, loops: LoopGrid) -> dict[str, Any]:
    """The numbers a person asks for, JSON-able."""
    point, law = tables.point, loops.law
    assert isinstance(law, VelocityLaw)
    gains = {"proportional": law.proportional, "derivative": law.derivative, "integral": law.integral}
    disturbance_gain, increment = search.performance(loops)
    delays = {"no_delay": 0.0, "specified_delay": search.specification.delay_s}
    rates = {case: loops.worst(delay_s=delay).growth_rate_per_s for case, delay in delays.items()}
    return {
        "scheduled_premises": [str(premise.expression) for premise in tables.schedule.premises],
        "vertices": len(point.Y),
        "unknown_terms": len(point.tau),
        "bandwidth_rad_s": point.rate,
        "decay_per_s": point.decay,
        "gain_limit": point.gain_limit,
        "gamma": point.gamma,
        "l2_gain_rad_per_nm": math.sqrt(point.gamma),
        "largest_gains": {name: float(np.abs(gain).max()) for name, gain in gains.items()},
        "velocity_filter_time_constant_s": tables.filter_time_constant_s,
        "disturbance_gain_rad_per_nm": disturbance_gain,
        "predicted_torque_increment_nm": increment,
        "candidates_tried": search.tried,
        "worst_growth_rate_per_s": max(rates.values()),
        "growth_rates_per_s": rates,
    }
