"""The law `dob-acceleration` for arms whose drives control the torque in their joints.

Where the torque in a joint follows its command through the arm's lag, whatever the link does, the link feels of the
rotor what the gain of the drive's loop leaves, ``B / sigma``, and the arm is rigid for the law: the same design, the
same claims and the same gate, on that condition. The law reads the links' angles.

Gears give all the same: a grid of elastic arms with such drives, at both ends of their lag, is looked at beside the
proof. It is what bounds the bandwidths, so that a few are tried, the fastest first, instead of a search.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from quasilpv.certificate.gate.proof import ON_CONDITION
from quasilpv.certificate.laws.dob_acceleration import DobAccelerationLaw
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.search import Grid
from quasilpv.synthesis.acceleration.tree_law import design_inertia, tree_acceleration_law
from quasilpv.synthesis.elastic.arms import elastic_drives, first_stable, grid_arms
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.joint_drive import ArmClass
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree_mechanism import TORQUE_LOOP_GAIN

POSTURES = 20
SIDES = ("link", "both")
NEIGHBOUR = 0.99


@dataclass(frozen=True)
class Bandwidths:
    """Of feedback and observer, rad/s, and the filter's time constant, s."""

    feedback: float
    observer: float
    filter_s: float

    def grid(self, period_s: float) -> Grid:
        """Around this point."""
        feedback, observer = self.feedback * period_s, self.observer * period_s
        return Grid((NEIGHBOUR * feedback, feedback), (NEIGHBOUR * observer, observer), (self.filter_s / period_s,))


CHOICES = (
    Bandwidths(20.0, 300.0, 0.005),
    Bandwidths(15.0, 200.0, 0.01),
    Bandwidths(10.0, 200.0, 0.01),
    Bandwidths(7.0, 200.0, 0.01),
)
"""Tried in this order: the first that is stable on the grid is taken."""


def acceleration_in_space(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Design `dob-acceleration` for a rigid or a torque-controlled arm.

    Arguments and errors are those of `tree_acceleration_law`, and

    Raises:
        InputError: of a torque-controlled arm a joint is rigid, or has no encoder on its link.
        InfeasibleError: no choice of bandwidths is stable on a grid of elastic arms with such drives, at both ends of
            their lag.
    """
    if robot.arm_class is not ArmClass.TORQUE_CONTROLLED:
        return tree_acceleration_law(robot, specification, progress)
    elastic_drives(robot, DobAccelerationLaw.tag(), SIDES)
    stiff, designs = as_rigid(robot), {}

    def growth_rates(choice: Bandwidths) -> Iterator[float]:
        made = tree_acceleration_law(stiff, specification, grid=choice.grid(specification.sample_period_s))
        designs[choice] = _with_least_inertia(made, stiff, specification)
        return _growth_rates(robot, stiff, designs[choice], specification)

    choice, grid = first_stable(
        f"{robot.id}: no dob-acceleration at {specification.rate_hz:g} Hz",
        CHOICES,
        growth_rates,
        progress,
        f"where gears give and torque loops have a gain of {TORQUE_LOOP_GAIN:g}{_of_lag(robot)}",
    )
    design = designs[choice]
    report = {
        "arm_class": str(robot.arm_class),
        "evidence": "proved on condition",
        "condition": ON_CONDITION,
        "torque_loop_gain": TORQUE_LOOP_GAIN,
        "elastic_loops": grid["loops"],
        "worst_elastic_growth_rate_per_s": grid["worst_growth_rate_per_s"],
        **design.report,
    }
    return replace(design, robot=robot, law={**design.law, "angle_side": "link"}, report=report)


def _of_lag(robot: SpatialRobot) -> str:
    """What lags cost: half a line for refusals.

    A motor behind a link that is held, ``B s^2 (1 + l s) + (K + eta K s) (sigma + l s) = 0``, is stable without the
    spring's own help, for any K, where ``l < eta sigma / (sigma - 1)`` (Routh).
    """
    if robot.lag_s[1] == 0.0:
        return ""
    damping = min(joint.drive.damping_least_s for joint in robot.joints if joint.drive is not None)
    borne = damping * TORQUE_LOOP_GAIN / (TORQUE_LOOP_GAIN - 1.0)
    return (
        f" and lag by {1e3 * robot.lag_s[1]:g} ms (lag): with damping_least {damping:g} s such loops swing with their "
        f"own gears from a lag of {1e3 * borne:.3g} ms on"
    )


def _with_least_inertia(design: TrackingDesign, stiff: SpatialRobot, specification: Specification) -> TrackingDesign:
    """The same gains with the smallest design inertia whose needed range is still inside the margin.

    The search takes the largest, which rejects disturbances best; above the resonances of the gears that is too much.
    """
    low, high = design.report["needed_range"]
    margin = design.report["inertia_margin"]
    ratio = min(1.0, high * specification.margin_spare / margin[1])
    scale = ratio * design.report["inertia_scale"]
    witness = dict(design.witness or {})
    chain = witness["chain"]
    # c M_n = (c / s) (s M_n): storages stay as they are.
    sides = {side: {**chain[side], "bound": chain[side]["bound"] / ratio} for side in ("lowest", "highest")}
    kept = ("feedback_bandwidth_rad_s", "observer_bandwidth_rad_s", "filter_time_constant_s", "integral_action")
    report = {
        **{name: design.report[name] for name in kept},
        "inertia_scale": scale,
        "inertia_margin": margin,
        "needed_range": [low / ratio, high / ratio],
    }
    law = {**design.law, **design_inertia(stiff, scale)}
    return replace(design, law=law, witness={**witness, "chain": {**chain, **sides}}, report=report)


def as_rigid(robot: SpatialRobot) -> SpatialRobot:
    """The arm as its torque loops let it appear: rigid, with what they leave of the rotors."""
    joints = tuple(
        replace(joint, drive=None, rotor_inertia_kg_m2=joint.rotor_inertia_kg_m2 / TORQUE_LOOP_GAIN)
        for joint in robot.joints
    )
    chain = tuple(
        replace(own, rotor_inertia_kg_m2=own.rotor_inertia_kg_m2 / TORQUE_LOOP_GAIN) for own in robot.tree.joints
    )
    return replace(robot, joints=joints, tree=replace(robot.tree, joints=chain))


def _growth_rates(
    robot: SpatialRobot, stiff: SpatialRobot, design: TrackingDesign, specification: Specification
) -> Iterator[float]:
    """Of elastic arms with such drives."""
    gains = design.law["feedback"]
    law = LinkLaw(
        sample_period_s=design.sample_period_s,
        feedback=np.array([gains["kp"], gains["kd"], gains["ki"]]),
        observer=np.array(design.law["observer"]),
        filter_time_constant_s=design.law["filter_time_constant_s"],
        inertia_scale=float(design.report["inertia_scale"]),
        relative_damping=np.zeros(len(robot.joints)),
    )
    drives = elastic_drives(robot, DobAccelerationLaw.tag(), SIDES)
    arms = list(grid_arms(robot, drives, POSTURES))
    inertias = stiff.tree.inertia(np.array([arm.posture for arm in arms]))
    for arm, inertia in zip(arms, inertias, strict=True):
        plant = replace(arm.plant, torque_gain=TORQUE_LOOP_GAIN)
        for delay_s in {0.0, specification.delay_s}:
            yield link_growth_rate(law, plant, inertia, delay_s)
