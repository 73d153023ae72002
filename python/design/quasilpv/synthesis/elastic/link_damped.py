"""The law `link-damped` for elastic arms with encoders on both sides of their gears.

The default law on the links' angles: its observer finds what nobody foresaw, the load above all, where the tool is.
Above the resonance with its link a motor feels its rotor alone, ten times and more what the feedback multiplies by; so
the motors damp the gears by ``D_s = 2 zeta sqrt(K B)``, and the inverse dynamics of the reference is fed forward.

Its loops do not decouple, and motors' and links' angles are both fed back: a grid is looked at, each loop exactly. It
proves nothing between its points, and the artifact claims nothing. There is no integral: the observer integrates.

A motor that sticks far above Coulomb's torque makes this observer hunt: when the motor breaks away, the link goes too
far before it is noticed. How far, the worst loop of the grid tells (`slips`); where a link is as near as that and its
reference rests, what compensates the disturbance waits, so that no motor is made to break away that would go farther.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.laws.link_damped import LinkDampedLaw
from quasilpv.conditions.tracking.sampled_chains import feedback_gains, observer_gains
from quasilpv.errors import InfeasibleError
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate, slips
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.tree_law import design_inertia
from quasilpv.synthesis.elastic.arms import elastic_drives, grid_arms
from quasilpv.synthesis.elastic.classes import Reach
from quasilpv.synthesis.rest import dead_zone_members
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.spatial_robot import SpatialRobot

POSTURES = 40
DAMPING_RATIO = 0.5
"""zeta of the motor on its gear, the link held."""

BREAKAWAY = 1.8
"""Over Coulomb's torque, of motors of which nobody states the torque at which they break away."""


@dataclass(frozen=True)
class LinkGains:
    """Bandwidths of feedback and observer, rad/s; time constant of the disturbance filter, s; scale of the inertia."""

    feedback: float
    observer: float
    filter_s: float
    scale: float


CHOICES = (
    LinkGains(30.0, 1200.0, 0.01, 0.8),
    LinkGains(25.0, 1200.0, 0.01, 0.8),
    LinkGains(20.0, 1200.0, 0.01, 0.8),
    LinkGains(15.0, 840.0, 0.01, 0.8),
    LinkGains(10.0, 400.0, 0.015, 0.8),
    LinkGains(7.0, 250.0, 0.02, 0.8),
)
"""Tried in this order: the first that is stable on the grid is taken."""


def link_damped(robot: SpatialRobot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `link-damped`.

    Args:
        robot: all of its joints give, with encoders on both sides.
        specification: its rate and delay count; activity and margins do not.
        progress: called with (choices tried, choices in all).

    Raises:
        InputError: a joint is rigid, has encoders on one side only, or rings above the loop's lead undamped.
        InfeasibleError: no choice of gains is stable on the whole grid.
    """
    drives = elastic_drives(robot, LinkDampedLaw.tag(), ("both",))
    reach = Reach.of(robot, specification)
    arms = list(grid_arms(robot, drives, POSTURES))
    inertias = robot.tree.inertia(np.array([arm.posture for arm in arms]))
    stiffness = np.array([sqrt(drive.stiffness_nm_rad[0] * drive.stiffness_nm_rad[1]) for drive in drives])
    rates = []
    for tried, choice in enumerate(CHOICES):
        law = _law(robot, choice, stiffness, specification.sample_period_s)
        found = [
            link_growth_rate(law, arm.plant, inertia, delay)
            for arm, inertia in zip(arms, inertias, strict=True)
            for delay in {0.0, specification.delay_s}
        ]
        progress(tried + 1, len(CHOICES))
        rates.append(max(found))
        if rates[-1] < 0.0:
            grid = {**reach.to_document(), "loops": len(found), "worst_growth_rate_per_s": rates[-1]}
            far = [slips(law, arm.plant, own, specification.delay_s) for arm, own in zip(arms, inertias, strict=True)]
            rest = dead_zone_members(robot, specification, _excess_nm(robot) * np.max(far, axis=0))
            return _design(robot, specification, (choice, law, stiffness), grid, rest)
    raise InfeasibleError(
        f"{robot.id}: no link-damped at {specification.rate_hz:g} Hz: of {len(CHOICES)} choices of gains the best "
        f"grows by {min(rates):.3g} 1/s in a posture of the grid"
    )


def _excess_nm(robot: SpatialRobot) -> FloatArray:
    """By how much friction falls when a motor breaks away, (n,)."""
    coulomb = np.array([joint.friction_coulomb_nm for joint in robot.joints])
    stated = np.array([joint.friction_breakaway_nm for joint in robot.joints])
    return np.asarray(np.where(stated > 0.0, stated, BREAKAWAY * coulomb) - coulomb)


def _law(robot: SpatialRobot, choice: LinkGains, stiffness: FloatArray, period_s: float) -> LinkLaw:
    rotors = np.array([joint.rotor_inertia_kg_m2 for joint in robot.joints])
    return LinkLaw(
        sample_period_s=period_s,
        feedback=np.asarray(feedback_gains(choice.feedback, period_s, integral=False).gains),
        observer=np.asarray(observer_gains(choice.observer, period_s).gains),
        filter_time_constant_s=choice.filter_s,
        inertia_scale=choice.scale,
        relative_damping=2.0 * DAMPING_RATIO * np.sqrt(stiffness * rotors),
    )


def _design(
    robot: SpatialRobot,
    specification: Specification,
    chosen: tuple[LinkGains, LinkLaw, FloatArray],
    grid: dict[str, Any],
    rest: dict[str, list[float]],
) -> TrackingDesign:
    choice, law, stiffness = chosen
    kp, kd, ki = (float(gain) for gain in law.feedback)
    members: dict[str, Any] = {
        "kind": LinkDampedLaw.tag(),
        "feedback": {"kp": kp, "kd": kd, "ki": ki},
        "observer": [float(gain) for gain in law.observer],
        "filter_time_constant_s": law.filter_time_constant_s,
        "inertia_scale": law.inertia_scale,
        "rotor_inertia_kg_m2": [joint.rotor_inertia_kg_m2 for joint in robot.joints],
        "stiffness_nm_rad": stiffness.tolist(),
        "relative_damping_nm_s": law.relative_damping.tolist(),
        "friction_viscous_nm_s": [joint.friction_viscous_nm_s for joint in robot.joints],
        "friction_coulomb_nm": [joint.friction_coulomb_nm for joint in robot.joints],
        **rest,
        **design_inertia(robot, 1.0),
    }
    return TrackingDesign(
        controller=LinkDampedLaw.tag(),
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law=members,
        expressions={},
        inputs={"controller": LinkDampedLaw.tag(), "specification": specification.to_document()},
        report={
            "arm_class": str(robot.arm_class),
            "evidence": "gridded",
            **grid,
            "feedback_bandwidth_rad_s": choice.feedback,
            "observer_bandwidth_rad_s": choice.observer,
            "filter_time_constant_s": choice.filter_s,
            "inertia_scale": choice.scale,
            "damping_ratio": DAMPING_RATIO,
        },
    )
