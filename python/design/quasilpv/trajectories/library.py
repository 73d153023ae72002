"""The references of the tracking experiments.

Dehak (2022, III.3.3, IV.5.1 and IV.5.2) says only that the tool of the serial arm follows a square and three quarters
of a circle in the vertical plane within 3 s, and that of the five-bar robot a spiral; places, sizes, time law and tool
orientation are this project's choice. The orientation of 45 degrees lets errors of the last joint show in both X and Y.
"""

from __future__ import annotations

import math

import numpy as np

from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from quasilpv.trajectories.document import Trajectory
from quasilpv.trajectories.paths import ArcSegment, LineSegment, Segment, SpiralSegment, TaskPath
from quasilpv.trajectories.planned import Kinematics
from quasilpv.trajectories.planning import plan, plan_in_space
from quasilpv.trajectories.spatial_paths import SpatialArc, SpatialLine, SpatialPath, SpatialSegment

SQUARE = TaskPath(
    name="serial-square",
    tool_angle_rad=math.pi / 4,
    start=(1.3, -1.75),
    segments=tuple(
        Segment(line=LineSegment(to=corner, duration_s=0.75))
        for corner in ((1.7, -1.75), (1.7, -1.35), (1.3, -1.35), (1.3, -1.75))
    ),
)
"""A square of side 0.4 m about (1.5, -1.55), from its lower left corner counter-clockwise, 0.75 s a side."""

CIRCLE = TaskPath(
    name="serial-circle",
    tool_angle_rad=math.pi / 4,
    start=(1.7, -1.55),
    segments=(Segment(arc=ArcSegment(centre=(1.5, -1.55), angle_rad=1.5 * math.pi, duration_s=3.0)),),
)
"""Three quarters of the circle of radius 0.2 m about (1.5, -1.55), from angle 0 counter-clockwise, in 3 s."""

SPIRAL = TaskPath(
    name="fivebar-spiral",
    start=(0.0, -0.22),
    segments=(Segment(spiral=SpiralSegment(radius=0.06, angle_rad=6.0 * math.pi, duration_s=5.0)),),
)
"""Three turns of a spiral from (0, -0.22) outwards to a radius of 0.06 m, in 5 s."""


UR5_START_RAD = (0.2, -1.7, 2.0, -1.87, -1.5708, 0.3)
"""Elbow up, the flange down, in front of the base."""

UR5_SQUARE = SpatialPath(
    name="ur5-square",
    start_posture_rad=UR5_START_RAD,
    segments=tuple(
        SpatialSegment(line=SpatialLine(by=by, duration_s=1.0))
        for by in ((0.0, 0.3, 0.0), (0.0, 0.0, 0.3), (0.0, -0.3, 0.0), (0.0, 0.0, -0.3))
    ),
)
"""An upright square of side 0.3 m with the orientation held, 1 s a side."""

UR5_CIRCLE = SpatialPath(
    name="ur5-circle",
    start_posture_rad=UR5_START_RAD,
    segments=(
        SpatialSegment(
            arc=SpatialArc(centre_by=(0.0, 0.15, 0.0), axis=(-1.0, 0.0, 0.0), angle_rad=2.0 * math.pi, duration_s=4.0)
        ),
    ),
)
"""An upright circle of diameter 0.3 m with the orientation held, in 4 s: up to 0.52 m/s."""


def serial_square(arm: Kinematics, domain: OperatingDomain | None = None) -> Trajectory:
    """Return the trajectory of the 3-DoF arm along ``SQUARE``.

    Raises:
        InputError: as ``plan``.
    """
    return plan(arm, SQUARE, domain)


def serial_circle(arm: Kinematics, domain: OperatingDomain | None = None) -> Trajectory:
    """Return the trajectory of the 3-DoF arm along ``CIRCLE``.

    Raises:
        InputError: as ``plan``.
    """
    return plan(arm, CIRCLE, domain)


def fivebar_spiral(robot: Kinematics, domain: OperatingDomain | None = None) -> Trajectory:
    """Return the trajectory of the five-bar robot along ``SPIRAL``.

    Raises:
        InputError: as ``plan``.
    """
    return plan(robot, SPIRAL, domain)


def ur5_square(robot: TreeMechanism, domain: OperatingDomain | None = None) -> Trajectory:
    """Return the trajectory of the UR5 along ``UR5_SQUARE``.

    Raises:
        InputError: as ``plan_in_space``.
    """
    return plan_in_space(robot.tree, UR5_SQUARE, domain)


def ur5_circle(robot: TreeMechanism, domain: OperatingDomain | None = None) -> Trajectory:
    """Return the trajectory of the UR5 along ``UR5_CIRCLE``.

    Raises:
        InputError: as ``plan_in_space``.
    """
    return plan_in_space(robot.tree, UR5_CIRCLE, domain)


def rest(name: str, joints: int, duration_s: float) -> Trajectory:
    """Return the reference theta = 0 for a time, s."""
    return Trajectory(name, np.array([0.0, duration_s]), np.zeros((1, joints, 6)))
