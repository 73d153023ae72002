"""The experiments known by name: those of Dehak (2022, III.3.3, IV.5.1 and IV.5.2), and the stabilisation problems.

The tool of the 3-DoF arm follows a square or three quarters of a circle while sinusoidal torques (III.53) act on the
joints, that of the five-bar robot a spiral under those of (IV.77), of which the print gives the second frequency as 5 t
or 50 t; on the nominal robot or with the payload of chapter IV.
"""

from __future__ import annotations

import math

import numpy as np

from quasilpv.errors import look_up
from quasilpv.scenarios.experiment import Planner, TrackingExperiment
from quasilpv.scenarios.schema import sine_torques
from quasilpv.synthesis.actuator_demand import Motion
from quasilpv.systems.robots.registry import AnyRobot, any_robot, robot
from quasilpv.trajectories import fivebar_spiral, rest, serial_circle, serial_square, ur5_circle, ur5_square

EXTERNAL_TORQUE = sine_torques((450.0, 15.0), (375.0, 15.0), (300.0, 15.0))
"""The disturbance of Dehak 2022 (III.53): joint torques, added to the control torque as they are."""


def _serial(name: str, summary: str, planner: Planner) -> TrackingExperiment:
    """A path of the 3-DoF arm under (III.53)."""
    return TrackingExperiment(name, robot("arm3"), planner, EXTERNAL_TORQUE, summary=summary)


def _stabilisation(name: str, summary: str, robot_id: str, joints: int) -> TrackingExperiment:
    """From rest with the first joint at 22.5 degrees (Dehak 2022, fig. I.2), the reference being theta = 0 for 5 s."""
    start = (math.pi / 8.0,) + (0.0,) * (joints - 1)
    return TrackingExperiment(
        name, robot(robot_id), lambda _, __: rest(name, joints, 5.0), initial_angle_rad=start, summary=summary
    )


def _spiral(name: str, disturbance: str, *terms: tuple[float, float]) -> TrackingExperiment:
    """The spiral of the five-bar robot under one reading of (IV.77), or a stronger disturbance."""
    summary = f"the five-bar robot draws a spiral in 5 s, disturbed by {disturbance}"
    return TrackingExperiment(name, robot("fivebar"), fivebar_spiral, sine_torques(*terms), summary=summary)


def _in_space(name: str, summary: str, planner: Planner) -> TrackingExperiment:
    """A path of the UR5 with its load; only friction disturbs it."""
    return TrackingExperiment(name, any_robot("ur5"), planner, summary=summary)


def tracking_experiments() -> tuple[TrackingExperiment, ...]:
    """Return all tracking experiments, in a fixed order; none is planned before its trajectory is asked for."""
    return (
        _serial("serial-square", "the 3-DoF arm draws a square of 0.4 m in 3 s", serial_square),
        _serial("serial-circle", "the 3-DoF arm draws 3/4 of a circle of 0.2 m in 3 s", serial_circle),
        _spiral("fivebar-spiral", "15 N m at 50 and 5 rad/s", (15.0, 50.0), (15.0, 5.0)),
        _spiral("fivebar-spiral-fast", "15 N m at 50 rad/s on both joints", (15.0, 50.0), (15.0, 50.0)),
        _spiral("fivebar-spiral-strong", "100 N m at 50 rad/s on both joints", (100.0, 50.0), (100.0, 50.0)),
        _stabilisation("stabilise-arm2", "the hanging 2-DoF arm comes to rest from 22.5 degrees", "arm2", 2),
        _stabilisation("stabilise-arm2-upright", "the same around its upper equilibrium", "arm2-upright", 2),
        _stabilisation("stabilise-arm3", "the light 3-DoF arm comes to rest from 22.5 degrees", "arm3-light", 3),
        TrackingExperiment(
            "stabilise-spring-disc",
            robot("spring-disc"),
            lambda _, __: rest("stabilise-spring-disc", 1, 10.0),
            initial_angle_rad=(-2.5,),
            initial_speed_rad_s=(5.0,),
            summary="the disc comes to rest from x_1 = -5 m, x_2 = 10 m/s (Dehak 2022, fig. III.4)",
        ),
        _in_space("ur5-square", "the UR5 draws an upright square of 0.3 m in 4 s", ur5_square),
        _in_space("ur5-circle", "the UR5 draws an upright circle of 0.3 m in 4 s", ur5_circle),
    )


def tracking_experiment(name: str) -> TrackingExperiment:
    """Return the tracking experiment of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {experiment.name: experiment for experiment in tracking_experiments()}
    return look_up(known, name, "scenarios", "scenario")


def motions_of(source: AnyRobot, sample_period_s: float = 0.02) -> tuple[Motion, ...]:
    """What the registered experiments ask of a robot: their references and the peaks of their external torques."""
    motions = []
    for experiment in tracking_experiments():
        if experiment.robot.id != source.id:
            continue
        trajectory = experiment.by(source).trajectory
        reference = trajectory.evaluate(np.arange(0.0, trajectory.duration_s, sample_period_s))
        peak, rate = np.zeros((2, source.model.joints))
        for term in experiment.external_torque:
            peak[term.joint] += abs(term.amplitude_nm)
            rate[term.joint] += abs(term.amplitude_nm * term.frequency_rad_s)
        motions.append(
            Motion(
                experiment.name, reference.angle, reference.speed, reference.acceleration, peak, rate, sample_period_s
            )
        )
    return tuple(motions)
