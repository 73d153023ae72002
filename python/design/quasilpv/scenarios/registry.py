"""The experiments known by name: those of Dehak (2022, III.3.3, IV.5.1 and IV.5.2), and the stabilisation problems.

The tool of the 3-DoF arm follows a square or three quarters of a circle while sinusoidal torques (III.53) act on the
joints, that of the five-bar robot a spiral under those of (IV.77), of which the print gives the second frequency as 5 t
or 50 t; on the nominal robot or with the payload of chapter IV.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from quasilpv.errors import InputError, one_of
from quasilpv.scenarios.schema import SineTorque, Vector, sine_torques
from quasilpv.synthesis.actuator_demand import Motion
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import Robot
from quasilpv.trajectories import Trajectory, fivebar_spiral, rest, serial_circle, serial_square
from quasilpv.trajectories.planned import Kinematics

EXTERNAL_TORQUE = sine_torques((450.0, 15.0), (375.0, 15.0), (300.0, 15.0))
"""The disturbance of Dehak 2022 (III.53): joint torques, added to the control torque as they are."""


@dataclass(frozen=True)
class TrackingTask:
    """An entry of the registry: a robot by name and the reference it tracks.

    Attributes:
        id: its name.
        summary: one line for a listing.
        robot: id of a robot.
        trajectory: from the robot and its operating domain to the reference.
        external_torque: sines on the joints.
        initial_angle_rad: angles of the plant at t = 0; None to start on the reference.
        initial_speed_rad_s: its speeds then; None for rest. Only with angles.
    """

    id: str
    summary: str
    robot: str
    trajectory: Callable[[Kinematics, OperatingDomain | None], Trajectory]
    external_torque: tuple[SineTorque, ...] = ()
    initial_angle_rad: Vector | None = None
    initial_speed_rad_s: Vector | None = None


def _serial(name: str, summary: str, trajectory: Callable[..., Trajectory]) -> TrackingTask:
    """A path of the 3-DoF arm under (III.53)."""
    return TrackingTask(name, summary, "arm3", trajectory, EXTERNAL_TORQUE)


def _stabilisation(name: str, summary: str, robot_id: str, joints: int) -> TrackingTask:
    """From rest with the first joint at 22.5 degrees (Dehak 2022, fig. I.2), the reference being theta = 0 for 5 s."""
    start = (math.pi / 8.0,) + (0.0,) * (joints - 1)
    return TrackingTask(name, summary, robot_id, lambda _, __: rest(name, joints, 5.0), (), start)


def _spiral(name: str, disturbance: str, *terms: tuple[float, float]) -> TrackingTask:
    """The spiral of the five-bar robot under one reading of (IV.77), or a stronger disturbance."""
    summary = f"the five-bar robot draws a spiral in 5 s, disturbed by {disturbance}"
    return TrackingTask(name, summary, "fivebar", fivebar_spiral, sine_torques(*terms))


def tracking_tasks() -> tuple[TrackingTask, ...]:
    """Return all tracking experiments, in a fixed order."""
    return (
        _serial("serial-square", "the 3-DoF arm draws a square of 0.4 m in 3 s", serial_square),
        _serial("serial-circle", "the 3-DoF arm draws 3/4 of a circle of 0.2 m in 3 s", serial_circle),
        _spiral("fivebar-spiral", "15 N m at 50 and 5 rad/s", (15.0, 50.0), (15.0, 5.0)),
        _spiral("fivebar-spiral-fast", "15 N m at 50 rad/s on both joints", (15.0, 50.0), (15.0, 50.0)),
        _spiral("fivebar-spiral-strong", "100 N m at 50 rad/s on both joints", (100.0, 50.0), (100.0, 50.0)),
        _stabilisation("stabilise-arm2", "the hanging 2-DoF arm comes to rest from 22.5 degrees", "arm2", 2),
        _stabilisation("stabilise-arm2-upright", "the same around its upper equilibrium", "arm2-upright", 2),
        _stabilisation("stabilise-arm3", "the light 3-DoF arm comes to rest from 22.5 degrees", "arm3-light", 3),
        TrackingTask(
            "stabilise-spring-disc",
            "the disc comes to rest from x_1 = -5 m, x_2 = 10 m/s (Dehak 2022, fig. III.4)",
            "spring-disc",
            lambda _, __: rest("stabilise-spring-disc", 1, 10.0),
            (),
            initial_angle_rad=(-2.5,),
            initial_speed_rad_s=(5.0,),
        ),
    )


def tracking_task(name: str) -> TrackingTask:
    """Return the tracking experiment of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {task.id: task for task in tracking_tasks()}
    if name not in known:
        raise InputError("scenarios", "scenario", name, one_of(known, name))
    return known[name]


def motions_of(robot: Robot, sample_period_s: float = 0.02) -> tuple[Motion, ...]:
    """What the registered experiments ask of a robot: their references and the peaks of their external torques."""
    motions = []
    for task in tracking_tasks():
        if task.robot != robot.id:
            continue
        trajectory = task.trajectory(robot.model, robot.domain)
        reference = trajectory.evaluate(np.arange(0.0, trajectory.duration_s, sample_period_s))
        peak, rate = np.zeros((2, robot.model.joints))
        for term in task.external_torque:
            peak[term.joint] += abs(term.amplitude_nm)
            rate[term.joint] += abs(term.amplitude_nm * term.frequency_rad_s)
        motions.append(
            Motion(task.id, reference.angle, reference.speed, reference.acceleration, peak, rate, sample_period_s)
        )
    return tuple(motions)
