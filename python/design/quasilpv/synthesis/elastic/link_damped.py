"""The law `link-damped` for elastic arms whose links carry encoders.

The default law on the links' angles: its observer finds what nobody foresaw, the load above all, where the tool is.
Above the resonance with its link a motor feels its rotor alone, ten times and more what the feedback multiplies by.
With encoders on the motors too these damp the gears by ``D_s = 2 zeta sqrt(K B)``. Without (`link-dob`, ``D_s = 0``)
only a law much slower than the gears is stable around them. The inverse dynamics of the reference is fed forward.

Its loops do not decouple, and a link moves after its motor: a grid is looked at, each loop exactly. It proves nothing
between its points, and the artifact claims nothing. There is no integral: the observer integrates.

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
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate, slips
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.tree_law import design_inertia
from quasilpv.synthesis.elastic.arms import elastic_drives, first_stable, grid_arms
from quasilpv.synthesis.elastic.classes import Reach
from quasilpv.synthesis.rest import dead_zone_members
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.joint_drive import EncoderSide
from quasilpv.systems.robots.spatial_robot import SpatialRobot

POSTURES = 40
BREAKAWAY = 1.8
"""Over Coulomb's torque, of motors of which nobody states the torque at which they break away."""


@dataclass(frozen=True)
class LinkGains:
    """Bandwidths of feedback and observer, rad/s; time constant of the disturbance filter, s; scale of the inertia."""

    feedback: float
    observer: float
    filter_s: float
    scale: float


@dataclass(frozen=True)
class LinkKind:
    """A controller with this law.

    Attributes:
        controller: its name.
        side: of the encoders it reads.
        choices: of gains, tried in this order: the first that is stable on the grid is taken.
        damping_ratio: zeta of a motor on its gear, the link held, by relative damping.
    """

    controller: str
    side: EncoderSide
    choices: tuple[LinkGains, ...]
    damping_ratio: float


DAMPED = LinkKind(
    LinkDampedLaw.tag(),
    "both",
    (
        LinkGains(30.0, 1200.0, 0.01, 0.8),
        LinkGains(25.0, 1200.0, 0.01, 0.8),
        LinkGains(20.0, 1200.0, 0.01, 0.8),
        LinkGains(15.0, 840.0, 0.01, 0.8),
        LinkGains(10.0, 400.0, 0.015, 0.8),
        LinkGains(7.0, 250.0, 0.02, 0.8),
    ),
    0.5,
)
ALONE = LinkKind(
    "link-dob",
    "link",
    (
        LinkGains(15.0, 60.0, 0.05, 1.5),
        LinkGains(10.0, 90.0, 0.02, 1.0),
        LinkGains(7.0, 90.0, 0.02, 1.5),
        LinkGains(5.0, 60.0, 0.02, 1.5),
        LinkGains(3.0, 40.0, 0.02, 1.5),
    ),
    0.0,
)


def link_damped(robot: SpatialRobot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `link-damped` for encoders on both sides of the gears: see `_link_law`."""
    return _link_law(DAMPED, robot, specification, progress)


def link_dob(robot: SpatialRobot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design the same law without damping, for encoders on the links alone: see `_link_law`."""
    return _link_law(ALONE, robot, specification, progress)


def _link_law(kind: LinkKind, robot: SpatialRobot, specification: Specification, progress: Progress) -> TrackingDesign:
    """Design one of them.

    Args:
        kind: which.
        robot: all of its joints give, with encoders where the kind reads them.
        specification: its rate and delay count; activity and margins do not.
        progress: called with (choices tried, choices in all).

    Raises:
        InputError: a joint is rigid, has encoders on other sides, or rings above the loop's lead undamped.
        InfeasibleError: no choice of gains is stable on the whole grid.
    """
    drives = elastic_drives(robot, kind.controller, (kind.side,))
    reach = Reach.of(robot, specification)
    arms = list(grid_arms(robot, drives, POSTURES))
    inertias = list(zip(arms, robot.tree.inertia(np.array([arm.posture for arm in arms])), strict=True))
    stiffness = np.array([sqrt(drive.stiffness_nm_rad[0] * drive.stiffness_nm_rad[1]) for drive in drives])
    laws = {
        choice: _law(robot, choice, kind.damping_ratio, stiffness, specification.sample_period_s)
        for choice in kind.choices
    }
    choice, grid = first_stable(
        f"{robot.id}: no {kind.controller} at {specification.rate_hz:g} Hz",
        kind.choices,
        lambda gains: (
            link_growth_rate(laws[gains], arm.plant, inertia, delay)
            for arm, inertia in inertias
            for delay in {0.0, specification.delay_s}
        ),
        progress,
    )
    far = [slips(laws[choice], arm.plant, inertia, specification.delay_s) for arm, inertia in inertias]
    rest = dead_zone_members(robot, specification, _excess_nm(robot) * np.max(far, axis=0))
    report = {**reach.to_document(), **grid, "damping_ratio": kind.damping_ratio}
    return _design(kind.controller, robot, specification, (choice, laws[choice], stiffness), (report, rest))


def _excess_nm(robot: SpatialRobot) -> FloatArray:
    """By how much friction falls when a motor breaks away, (n,)."""
    coulomb = np.array([joint.friction_coulomb_nm for joint in robot.joints])
    stated = np.array([joint.friction_breakaway_nm for joint in robot.joints])
    return np.asarray(np.where(stated > 0.0, stated, BREAKAWAY * coulomb) - coulomb)


def _law(
    robot: SpatialRobot, choice: LinkGains, damping_ratio: float, stiffness: FloatArray, period_s: float
) -> LinkLaw:
    rotors = np.array([joint.rotor_inertia_kg_m2 for joint in robot.joints])
    return LinkLaw(
        sample_period_s=period_s,
        feedback=np.asarray(feedback_gains(choice.feedback, period_s, integral=False).gains),
        observer=np.asarray(observer_gains(choice.observer, period_s).gains),
        filter_time_constant_s=choice.filter_s,
        inertia_scale=choice.scale,
        relative_damping=2.0 * damping_ratio * np.sqrt(stiffness * rotors),
    )


def _design(
    controller: str,
    robot: SpatialRobot,
    specification: Specification,
    chosen: tuple[LinkGains, LinkLaw, FloatArray],
    found: tuple[dict[str, Any], dict[str, list[float]]],
) -> TrackingDesign:
    (choice, law, stiffness), (report, rest) = chosen, found
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
        controller=controller,
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law=members,
        expressions={},
        inputs={"controller": controller, "specification": specification.to_document()},
        report={
            "arm_class": str(robot.arm_class),
            "evidence": "gridded",
            **report,
            "feedback_bandwidth_rad_s": choice.feedback,
            "observer_bandwidth_rad_s": choice.observer,
            "filter_time_constant_s": choice.filter_s,
            "inertia_scale": choice.scale,
        },
    )
