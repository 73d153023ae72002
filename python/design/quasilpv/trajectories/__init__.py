"""References: task-space paths, the joint-space trajectories planned from them, and their files."""

from quasilpv.trajectories.document import Reference, Trajectory, read_trajectory, write_trajectory
from quasilpv.trajectories.library import (
    fivebar_spiral,
    rest,
    serial_circle,
    serial_square,
    ur5_circle,
    ur5_square,
)
from quasilpv.trajectories.paths import TaskPath, read_path
from quasilpv.trajectories.planning import plan, plan_in_space
from quasilpv.trajectories.spatial_paths import SpatialPath, read_spatial_path

__all__ = [
    "Reference",
    "SpatialPath",
    "TaskPath",
    "Trajectory",
    "fivebar_spiral",
    "plan",
    "plan_in_space",
    "read_path",
    "read_spatial_path",
    "read_trajectory",
    "rest",
    "serial_circle",
    "serial_square",
    "ur5_circle",
    "ur5_square",
    "write_trajectory",
]
