"""From a task-space path to a joint-space trajectory: inverse kinematics, then a piecewise quintic fit.

At every knot angle, speed and acceleration are those of the inverse kinematics,

    S = f(theta),    theta' = J^-1 S',    theta'' = J^-1 (S'' - J' theta'),    S = (X, Y, Phi) or (X, Y)

in closed form where the arm has one, by damped Newton (`quasilpv.trajectories.inverse`) otherwise and in space; the
quintic Hermite polynomial between two knots takes both ends' values. The distance from the path is then *measured*
halfway between knots, where the error of the interpolation is largest, and the knots are refined until it is small
enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypeGuard

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.trajectories.document import Reference, Trajectory
from quasilpv.trajectories.inverse import JointPath, PlanarTool, SpatialTool, reached
from quasilpv.trajectories.paths import TaskPath
from quasilpv.trajectories.planned import ClosedForm, Kinematics, PlanarPlan, Planned, SpatialPlan, place_of
from quasilpv.trajectories.quintics import quintic_hermite
from quasilpv.trajectories.spatial_paths import SpatialPath

KNOT_SPACING_S = 0.01
FIT_TOLERANCE_M = 1e-9
MAX_REFINEMENTS = 6


def plan(
    arm: Kinematics,
    path: TaskPath,
    domain: OperatingDomain | None = None,
    *,
    source: str | None = None,
    knot_spacing_s: float = KNOT_SPACING_S,
    posture_rad: Sequence[float] | None = None,
) -> Trajectory:
    """Return the joint-space trajectory that makes the tool of a planar arm follow a path.

    A serial arm without closed form, of any number of joints, is solved by damped Newton from a posture; its spare
    joints stay where a posture term holds them. A path that states no orientation then leaves it free.

    Args:
        arm: kinematics of the robot.
        path: what the tool does.
        domain: modelling box of angles and speeds that the trajectory must not leave, or None.
        source: name of the path in errors (default: its own name).
        knot_spacing_s: largest time between knots to start with.
        posture_rad: angles near which the inverse kinematics is looked for; the middle of the domain by default. It
            decides between elbows, and is not looked at where there is a closed form.

    Returns:
        The trajectory; its ``task`` records the path, the robot, the largest knot spacing and the measured fit errors.

    Raises:
        InputError: the path says nothing of the orientation of a tool that needs one, or states one that it has not;
            somewhere on the path the tool is out of reach, the robot is singular, or a joint leaves the modelling box;
            the message says where, when and by how much. Or the fit does not reach ``FIT_TOLERANCE_M``.
    """
    source = source or path.name
    if _is_solved_by_newton(arm, path):
        return _fitted(_newton_plan(arm, path, domain, source, posture_rad), domain, knot_spacing_s)
    _require_orientation(arm, path, source)
    return _fitted(ClosedForm(path, source, arm), domain, knot_spacing_s)


def plan_in_space(
    tree: KinematicTree,
    path: SpatialPath,
    domain: OperatingDomain | None = None,
    *,
    source: str | None = None,
    knot_spacing_s: float = 2.0 * KNOT_SPACING_S,
) -> Trajectory:
    """Return the joint-space trajectory that makes the tool of a robot in space follow a path.

    Args:
        tree: the robot.
        path: what the tool does, from the posture where it starts.
        domain, source, knot_spacing_s: as those of `plan`.

    Raises:
        InputError: as `plan`; or the path starts in a posture of another number of joints.
    """
    source = source or path.name
    start = np.array(path.start_posture_rad)
    if len(start) != tree.order:
        expected = f"{tree.order}, as {tree.name} has joints"
        raise InputError(source, "start_posture_rad", f"{len(start)} coordinates", expected)
    tool = SpatialTool(tree, 6 if path.orientation == "held" else 3)
    if tree.order < tool.rows:
        expected = f'{tool.rows} or more, or the orientation "free" and 3 or more'
        raise InputError(source, "orientation", f'"{path.orientation}" with {tree.order} joints', expected)
    course = path.from_pose(tree.tool_pose(start))
    return _fitted(SpatialPlan(JointPath.of(tool, start, source), course, source), domain, knot_spacing_s)


def _is_solved_by_newton(arm: Kinematics, path: TaskPath) -> TypeGuard[PlanarSerialArm]:
    """A serial arm of which no formula is known; or one with joints to spare where the path leaves them free."""
    # Not a subclass, which has a tool and a formula of its own.
    return type(arm) is PlanarSerialArm and (arm.joints != 3 or path.tool_angle_rad is None)


def _newton_plan(
    arm: PlanarSerialArm, path: TaskPath, domain: OperatingDomain | None, source: str, posture: Sequence[float] | None
) -> PlanarPlan:
    rows = 2 + len(path.orientation)
    if rows > arm.joints:
        expected = f"{rows} or more, or a path that states no tool_angle_rad"
        raise InputError(source, "tool_angle_rad", f"{arm.joints} joints", expected)
    if posture is None and domain is None:
        raise InputError(source, "posture_rad", "nothing", "angles near which to look, or an operating domain")
    box = () if domain is None else domain.angle_rad
    guess = np.array(posture if posture is not None else [(low + high) / 2.0 for low, high in box])
    if guess.shape != (arm.joints,):
        raise InputError(source, "posture_rad", f"{guess.size} angles", f"{arm.joints}, as {arm.name} has joints")
    tool = PlanarTool(arm, rows)
    pose = np.array([*path.start, *path.orientation])
    start = reached(tool, pose, guess, lambda: (source, place_of(path, 0.0)))
    return PlanarPlan(path, source, JointPath.of(tool, start, source))


def _fitted(planned: Planned, domain: OperatingDomain | None, knot_spacing_s: float) -> Trajectory:
    """The quintic fit, refined until it is close enough."""
    for refinement in range(MAX_REFINEMENTS + 1):
        spacing = knot_spacing_s / 2**refinement
        knots = _knots(planned.segment_times_s, spacing)
        motion = planned.motion(knots)
        if domain is not None:
            _require_inside(domain, planned, knots, motion)
        coefficients = quintic_hermite(knots, motion)
        middles = 0.5 * (knots[:-1] + knots[1:])
        angles = Trajectory(planned.name, knots, coefficients).evaluate(middles).angle
        error_m, error_rad = planned.errors(middles, angles)
        if error_m < FIT_TOLERANCE_M:
            task = {
                **planned.document(),
                "knot_spacing_s": spacing,
                "fit_error_m": error_m,
                "fit_error_rad": error_rad,
            }
            return Trajectory(planned.name, knots, coefficients, task)
    got, expected = f"{error_m:.3g} m with knots {spacing:.3g} s apart", f"below {FIT_TOLERANCE_M} m"
    raise InputError(planned.source, "fit", got, expected)


def _require_orientation(arm: Kinematics, path: TaskPath, source: str) -> None:
    coordinates = arm.joints - len(arm.posture)
    if 2 + len(path.orientation) != coordinates:
        expected = f"a path of the {coordinates} coordinates of {arm.name}: an orientation with 3, none with 2"
        raise InputError(source, "tool_angle_rad", path.tool_angle_rad, expected)


def _knots(times_s: Sequence[float], spacing_s: float) -> FloatArray:
    """Equally spaced in each segment, its ends included."""
    counts = [int(np.ceil((end - start) / spacing_s * (1.0 - 1e-12))) for start, end in pairwise(times_s)]
    pieces = [np.linspace(times_s[i], times_s[i + 1], count + 1)[1:] for i, count in enumerate(counts)]
    return np.concatenate([[0.0], *pieces])


def _require_inside(domain: OperatingDomain, planned: Planned, times_s: FloatArray, motion: Reference) -> None:
    boxes = (("theta", "rad", motion.angle, domain.angle_rad), ("omega", "rad/s", motion.speed, domain.speed_rad_s))
    for symbol, unit, values, box in boxes:
        for joint, (lower, upper) in enumerate(box):
            outside = np.flatnonzero((values[:, joint] < lower) | (values[:, joint] > upper))
            if outside.size:
                first = int(outside[0])
                got = f"{symbol}_{joint + 1} = {values[first, joint]:.4g} {unit}"
                expected = f"within [{lower:.4g}, {upper:.4g}] {unit}, the modelling box"
                raise InputError(planned.source, planned.place(times_s[first]), got, expected)
