"""What is tracked by which robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from quasilpv.scenarios.schema import SineTorque, Vector
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import AnyRobot
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.trajectories import Trajectory, plan, plan_in_space, read_path, read_spatial_path

Planner: TypeAlias = Callable[[Any, OperatingDomain | None], Trajectory]
"""From a robot's model and operating domain to a reference."""


@dataclass(frozen=True, eq=False)
class TrackingExperiment:
    """A robot, the reference it tracks, and what disturbs it.

    Attributes:
        name: id of an entry of the registry, or the name in the path file.
        robot: what tracks.
        reference: the reference, or what plans it for the robot when it is first asked for.
        external_torque: sines on the joints; none unless stated.
        initial_angle_rad: angles of the plant at t = 0; None to start on the reference.
        initial_speed_rad_s: its speeds then; None for rest. Only with angles.
        summary: one line for a listing.
    """

    name: str
    robot: AnyRobot
    reference: Trajectory | Planner
    external_torque: tuple[SineTorque, ...] = ()
    initial_angle_rad: Vector | None = None
    initial_speed_rad_s: Vector | None = None
    summary: str = ""

    @classmethod
    def from_path_file(cls, path: Path | str, robot: AnyRobot) -> TrackingExperiment:
        """The experiment in which a robot follows the task-space path of a file.

        Raises:
            InputError: the file is not a path, or the path is unreachable, singular, or outside the modelling box.
        """
        if isinstance(robot, SpatialRobot):
            trajectory = plan_in_space(robot.tree, read_spatial_path(path), robot.domain, source=str(path))
        else:
            trajectory = plan(robot.model, read_path(path), robot.domain, source=str(path))
        return cls(trajectory.name, robot, trajectory)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The reference in joint space."""
        if isinstance(self.reference, Trajectory):
            return self.reference
        return self.reference(self.robot.model, self.robot.domain)

    def by(self, robot: AnyRobot) -> TrackingExperiment:
        """The same tracked by another robot."""
        return replace(self, robot=robot)
