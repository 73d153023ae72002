"""The tracking law `dob-acceleration` for robots in space.

The design inertia is ``M_n = s M(empty)``: then ``c2/c1`` is the least there is, for ``c1 M_n < M_t < c2 M_n`` over all
postures and loads needs at least the largest eigenvalue of ``M(empty)^-1 M(loaded)``. Gravity is that of the robot with
half its load, which is independent of the inertia and halves what the observer has to find out at the start.

Torque activity is judged joint by joint, since the limits of wrists and shoulders differ several times: the rounding of
all encoders goes through a row of M_n to a joint's torque. Where Coulomb friction is stated there is no integral
action: the observer integrates already, and two integrators make an arm that sticks hunt.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quasilpv.certificate.laws.dob_acceleration import DobAccelerationLaw
from quasilpv.conditions.tracking.sampled_chains import ChainGains
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.search import BandwidthSearch, Candidate, Grid, growth_rates
from quasilpv.synthesis.acceleration.tolerance import FrozenTolerance, MovingTolerance
from quasilpv.synthesis.chain_range import ChainRange, find_range
from quasilpv.synthesis.rate_storages import RateStorages, find_rate
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.systems.robots.tree_mechanism import TreeMechanism

GRID = Grid(
    feedback=tuple(float(w) for w in np.geomspace(0.01, 0.28, 13)),
    observer=tuple(float(w) for w in np.geomspace(0.2, 2.6, 12)),
    filter_samples=(0.15, 0.3, 0.6, 1.2),
)
GRAVITY_SHARE = 0.5
"""Of the load, in the middle of its box, that the law's gravity torque carries."""

POSTURES = 4000
SEED = 20220315


@dataclass(frozen=True)
class _Range:
    """Of ``M_t / M(empty)``."""

    lowest: float
    highest: float

    @property
    def disc(self) -> _Disc:
        """Of the eigenvalues of ``M_t^-1 M(empty)``, which is symmetric in the coordinates of the root of M(empty)."""
        fast, slow = 1.0 / self.lowest, 1.0 / self.highest
        return _Disc((fast + slow) / 2.0, (fast - slow) / 2.0)


@dataclass(frozen=True)
class _Disc:
    centre: float
    radius: float


def tree_acceleration_law(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress, grid: Grid = GRID
) -> TrackingDesign:
    """Design `dob-acceleration` for a robot in space.

    Args:
        robot: what it is for.
        specification: what is asked for; its torque activity is a share of each joint's own limit.
        progress: called with (points done, points in all).
        grid: of the search.

    Raises:
        InfeasibleError: no bounds of the inertia were found, or no design meets the specification.
    """
    return _law(robot, specification, progress, None, grid)


def moving_tree_acceleration_law(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Design `dob-moving` for a robot in space: the same, and a function that falls in motion, within stated limits.

    Arguments and errors are those of `tree_acceleration_law`, and

    Raises:
        InputError: the drives lag.
        InfeasibleError: no bound of how fast the inertia changes was found for these limits.
    """
    if robot.lag_s[1] > 0.0:
        expected = "0 for dob-moving: the proof in motion knows no lag (dob-acceleration does)"
        raise InputError(robot.source, "lag", list(robot.lag_s), expected)
    return _law(robot, specification, progress, MotionBound.of(robot))


@dataclass(frozen=True, eq=False)
class MotionBound:
    """How fast the inertia changes within limits of angles and speeds.

    Attributes:
        angle_rad, speed_rad_s: the limits.
        found: rate and storages of the empty robot.
        seconds_to_find: how long that took.
    """

    angle_rad: tuple[tuple[float, float], ...]
    speed_rad_s: tuple[float, ...]
    found: RateStorages
    seconds_to_find: float

    @classmethod
    def of(cls, robot: SpatialRobot) -> MotionBound:
        """For the motions a robot states.

        Raises:
            InfeasibleError: the solver has no answer.
        """
        began = time.perf_counter()
        angles, speeds = robot.motion
        limits = zip(robot.tree.joints, angles, strict=True)
        within = replace(robot.tree, joints=tuple(replace(j, lower=low, upper=high) for j, (low, high) in limits))
        found = find_rate(within, np.array(speeds))
        if found is None:
            advice = "state smaller ones: joints.NAME.motion_angle, joints.NAME.motion_speed"
            raise InfeasibleError(
                f"{robot.id}: no bound was found of how fast the inertia changes over these angles; {advice}"
            )
        return cls(angles, speeds, found, time.perf_counter() - began)

    def limits_document(self) -> dict[str, Any]:
        """The member ``motion_limits`` of a law."""
        return {"angle_rad": [list(interval) for interval in self.angle_rad], "speed_rad_s": list(self.speed_rad_s)}

    def to_document(self, scale: float, longest_delay_samples: float) -> dict[str, Any]:
        """The member ``motion`` of a witness, for s times the empty robot as design inertia."""
        return {
            "rate_per_s": self.found.rate_per_s,
            "storages": [(scale * storage).tolist() for storage in self.found.matrices],
            "longest_delay_samples": longest_delay_samples,
            "seconds_to_find": self.seconds_to_find,
        }


def _law(
    robot: SpatialRobot,
    specification: Specification,
    progress: Progress,
    moving: MotionBound | None,
    grid: Grid = GRID,
) -> TrackingDesign:
    found = find_range(robot, robot.tree)
    needed = _Range(found.lowest.bound, found.highest.bound)
    frozen = FrozenTolerance(specification, needed, robot.lag_s)
    search = BandwidthSearch(
        robot.id,
        specification,
        needed,
        frozen if moving is None else MovingTolerance(frozen, needed.disc, moving.found.rate_per_s),
        activity_bound=specification.torque_activity,
        noise=specification.angle_noise_rad * largest_row(robot),
        unit="of a joint's torque limit, rms",
        integral=not robot.rubs,
        lag_s=robot.lag_s[1],
    )
    best = search.run(grid, progress)
    feedback, observer = search.gains_of_best()
    kp, kd, ki = (float(gain) for gain in best.law.feedback)
    controller = DobAccelerationLaw.tag() if moving is None else "dob-moving"
    motion = {} if moving is None else {"motion": moving.to_document(best.inertia_scale, specification.delay_samples)}
    return TrackingDesign(
        controller=controller,
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law={
            "kind": DobAccelerationLaw.tag(),
            "feedback": {"kp": kp, "kd": kd, "ki": ki},
            "observer": [float(gain) for gain in best.law.observer],
            "filter_time_constant_s": best.law.filter_time_constant_s,
            "disturbance_compensation": True,
            **design_inertia(robot, best.inertia_scale),
            **({} if moving is None else {"motion_limits": moving.limits_document()}),
        },
        expressions={},
        inputs={
            "controller": controller,
            "specification": specification.to_document(),
            **({} if moving is None else {"motion_limits": moving.limits_document()}),
        },
        report={
            **_report(best, specification, found, search.tried, robot.lag_s[1]),
            **({} if moving is None else {"motion_rate_per_s": moving.found.rate_per_s}),
        },
        witness={**_witness(best, feedback, observer, found), **motion},
    )


def design_inertia(robot: SpatialRobot, scale: float) -> dict[str, Any]:
    """The members ``inertia`` and ``gravity_load`` of a law: ``M_n a + G_n`` in one sweep over one chain.

    The bodies of the chain are s times the empty robot's, its gravity is 1/s of the true one, so that the gravity
    torque of the bodies is the empty robot's own; and the last body carries ``gravity_load`` more, for gravity only.
    """
    scaled = robot.tree.scaled(scale, scale)
    tree = KinematicTree(scaled.name, scaled.joints, scaled.tool, robot.tree.gravity_m_s2 / scale)
    nothing = (0.0,) * tree.order
    members: dict[str, Any] = {"inertia": TreeMechanism(tree, nothing, nothing).parameters_document()}
    if robot.payload is not None:
        load = robot.payload.central(GRAVITY_SHARE).seen_from(robot.tree.tool)
        members["gravity_load"] = {
            "mass_kg": load.mass_kg * scale,
            "first_moment_kg_m": (load.first_moment_kg_m * scale).tolist(),
        }
    return members


def largest_row(robot: SpatialRobot) -> float:
    """Largest norm of a row of M(empty) over the limit of its joint, at random postures of the domain, 1/(rad/s^2)."""
    rng = np.random.default_rng(SEED)
    low, high = np.array(robot.domain.angle_rad).T
    inertia = robot.tree.inertia(rng.uniform(low, high, (POSTURES, len(low))))
    return float((np.linalg.norm(inertia, axis=2) / np.array(robot.limits.torque_nm)).max())


def _report(
    best: Candidate, specification: Specification, found: ChainRange, tried: int, lag_s: float
) -> dict[str, Any]:
    """The numbers a person asks for, JSON-able."""
    rates = growth_rates(best, specification, lag_s)
    worst, where = max(rates.values())
    return {
        "feedback_bandwidth_rad_s": best.bandwidths[0],
        "observer_bandwidth_rad_s": best.bandwidths[1],
        "filter_time_constant_s": best.law.filter_time_constant_s,
        "integral_action": bool(best.law.feedback[2] != 0.0),
        "inertia_scale": best.inertia_scale,
        "inertia_margin": list(best.inertia_margin),
        "needed_range": list(best.needed_range),
        "worst_growth_rate_per_s": worst,
        "worst_growth_rate_at_inertia_ratio": where,
        "growth_rates_per_s": {name: rate for name, (rate, _) in rates.items()},
        "disturbance_gain_s2": best.disturbance_gain,
        "predicted_torque_activity": best.torque_increment,
        "candidates_tried": tried,
    }


def _witness(best: Candidate, feedback: ChainGains, observer: ChainGains, found: ChainRange) -> dict[str, Any]:
    """The points of the two conditions, and bounds and storages of the inertia."""
    wc, wo = best.bandwidths
    return {
        "feedback": {"condition": "sampled-feedback", "bandwidth_rad_s": wc, **feedback.point("P")},
        "observer": {"condition": "sampled-observer", "bandwidth_rad_s": wo, **observer.point("Q")},
        "chain": found.for_scaled_design(best.inertia_scale),
    }
