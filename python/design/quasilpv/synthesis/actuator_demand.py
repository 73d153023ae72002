"""What a design asks of its actuators, against what they deliver.

A limit that acts opens the loop: every certificate and every gate speaks of the loop while none does. So a design that
cannot stay within its limits is not one. The torque limits must carry gravity in every posture of the domain with every
payload, if the law is to hold any of them, and each motion that is asked for, with its disturbance. The slew limits
must let pass, from one sample to the next, what motion and disturbance change, and twice the rms increment that the
design predicts from the noise of its sensors (of a normal distribution 95 % of the samples).

What is found here is evidence against a design: postures on a grid, times at samples. Nothing is proved of one that
passes; the runs count the samples at a limit (`share_at_limit`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate import LAWS
from quasilpv.loops.loop_grid import configurations
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import AnyRobot
from quasilpv.systems.robots.spatial_robot import SpatialRobot

PAYLOAD_FRACTIONS = (0.0, 0.5, 1.0)
POSTURES = 200
SEED = 20220315
INCREMENT_FACTOR = 2.0
"""So many times the predicted rms increment must fit into the slew limit of a sample."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion that is asked for, N samples, and the disturbance that acts on it.

    Attributes:
        name: of the scenario.
        angle_rad, speed_rad_s, acceleration_rad_s2: the reference, (N, n).
        disturbance_nm: largest external torque of each joint, (n,).
        disturbance_rate_nm_per_s: its largest rate, (n,).
        sample_period_s: between two rows.
    """

    name: str
    angle_rad: FloatArray
    speed_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    disturbance_nm: FloatArray
    disturbance_rate_nm_per_s: FloatArray
    sample_period_s: float

    def torques(self, robot: AnyRobot, fraction: float) -> FloatArray:
        """What the reference itself takes with a payload, (N, n), N m."""
        plant = robot.with_payload_fraction(fraction)
        rows = zip(self.angle_rad, self.speed_rad_s, self.acceleration_rad_s2, strict=True)
        return np.array([plant.inverse_dynamics(*row) for row in rows])


MotionsOf = Callable[[AnyRobot], Sequence[Motion]]


def no_motions(_: AnyRobot) -> Sequence[Motion]:
    """Ask for nothing but standing still."""
    return ()


def unmet_demands(design: TrackingDesign, motions_of: MotionsOf = no_motions) -> Iterator[str]:
    """What the limits of the design's robot cannot deliver, one line each, with the numbers; joints count from 0.

    Args:
        design: any; the increments are those of its report, if it predicts them.
        motions_of: what is asked of a robot beside standing still.
    """
    robot = design.robot
    torque_limit = np.array(robot.limits.torque_nm)
    step_limit = np.array(robot.limits.slew_nm_per_s) * design.sample_period_s
    noise = INCREMENT_FACTOR * predicted_increments(design)
    if not LAWS[design.law["kind"]].document.STABILISES:
        gravity = largest_gravity(robot)
        yield from _beyond("torque limit", "N m", torque_limit, gravity, "gravity in the operating domain")
    yield from _beyond("slew limit", "N m per sample", step_limit, noise, _NOISE)
    for motion in motions_of(robot):
        torques = [motion.torques(robot, fraction) for fraction in PAYLOAD_FRACTIONS]
        largest = np.max([np.abs(rows).max(axis=0) for rows in torques], axis=0) + motion.disturbance_nm
        about = f"reference, gravity and disturbance of {motion.name}"
        yield from _beyond("torque limit", "N m", torque_limit, largest, about)
        rate = np.max([np.abs(np.diff(rows, axis=0)).max(axis=0) for rows in torques], axis=0) / motion.sample_period_s
        increment = (rate + motion.disturbance_rate_nm_per_s) * design.sample_period_s + noise
        about = f"reference, gravity and disturbance of {motion.name}, and {_NOISE}"
        yield from _beyond("slew limit", "N m per sample", step_limit, increment, about)


_NOISE = f"{INCREMENT_FACTOR:g} times the predicted rms increment"


def largest_gravity(robot: AnyRobot) -> FloatArray:
    """Largest gravity torque of each joint over postures of the operating domain and payloads, (n,), N m."""
    if isinstance(robot, SpatialRobot):
        low, high = np.array(robot.domain.angle_rad).T  # too many joints for a grid
        postures = np.random.default_rng(SEED).uniform(low, high, (POSTURES, len(low)))
    else:
        postures = configurations(robot.domain.angle_rad, POSTURES, every_joint=True)
    plants = [robot.with_payload_fraction(fraction) for fraction in PAYLOAD_FRACTIONS]
    return np.asarray(np.max([np.abs(plant.gravity(theta)) for plant in plants for theta in postures], axis=0))


def predicted_increments(design: TrackingDesign) -> FloatArray:
    """Rms torque increment of each joint from sensor noise, (n,), N m; zero if the design predicts none.

    A design for a robot in space predicts the largest share of a joint's limit; others predict the norm over all
    joints. The noise of the joints is independent and goes through gains in proportion to the inertia, so that the
    joints share it as the norms of the rows of M do.
    """
    robot = design.robot
    if isinstance(robot, SpatialRobot):
        return np.array(robot.limits.torque_nm) * float(design.report.get("predicted_torque_activity", 0.0))
    total = float(design.report.get("predicted_torque_increment_nm", 0.0))
    postures = configurations(robot.domain.angle_rad, POSTURES, every_joint=not robot.model.turns_as_one)
    largest = max(
        (robot.model.inertia(theta) for theta in postures), key=lambda inertia: float(np.linalg.norm(inertia))
    )
    rows = np.linalg.norm(largest, axis=1)
    return np.asarray(total * rows / np.linalg.norm(largest))


def _beyond(limit: str, unit: str, allowed: FloatArray, needed: FloatArray, what: str) -> Iterator[str]:
    """The joint whose limit is exceeded most, if one is."""
    joint = int(np.argmax(needed / allowed))
    if needed[joint] > allowed[joint]:
        yield f"{limit} of joint {joint}: {allowed[joint]:.4g} {unit}, needed {needed[joint]:.4g}: {what}"
