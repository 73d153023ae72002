"""From a task-space path to a joint-space trajectory: exact inverse kinematics, then a piecewise quintic fit.

At every knot angle, speed and acceleration are those of the exact inverse kinematics,

    S = f(theta),    theta' = J^-1 S',    theta'' = J^-1 (S'' - J' theta'),    S = (X, Y, Phi) or (X, Y)

and the quintic Hermite polynomial between two knots takes both ends' values. The distance from the path is then
*measured* halfway between knots, where the error of the interpolation is largest, and the knots are refined until it is
small enough.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Protocol

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InputError
from quasilpv.systems.arm_parameters import OperatingDomain
from quasilpv.trajectories.document import Reference, Trajectory
from quasilpv.trajectories.paths import TaskPath

Array = npt.NDArray[np.float64]

MIN_SINGULARITY = 0.05
KNOT_SPACING_S = 0.01
FIT_TOLERANCE_M = 1e-9
MAX_REFINEMENTS = 6


class Kinematics(Protocol):
    """What planning needs of a robot.

    A pose is (X, Y), then the orientation Phi if the tool has one of its own, then the posture of a robot with joints
    to spare: as many coordinates as joints.
    """

    @property
    def name(self) -> str:
        """Identifier in errors and in the trajectory file."""

    @property
    def joints(self) -> int:
        """Number of joints n."""

    @property
    def posture(self) -> tuple[float, ...]:
        """What the coordinates of the pose that no path states are kept at."""

    def forward_kinematics(self, theta: npt.ArrayLike) -> Array:
        """Pose of the tool, as many coordinates as joints."""

    def inverse_kinematics(self, pose: npt.ArrayLike) -> Array:
        """Joint angles (n,); ``InputError`` if the pose is out of reach."""

    def jacobian(self, theta: npt.ArrayLike) -> Array:
        """J, (n, n)."""

    def jacobian_rate_times_speed(self, theta: npt.ArrayLike, omega: npt.ArrayLike) -> Array:
        """J' theta', (n,)."""

    def singularity(self, theta: npt.ArrayLike) -> tuple[str, float]:
        """A quantity in [0, 1] that vanishes with det J, with its name."""


def plan(
    arm: Kinematics,
    path: TaskPath,
    domain: OperatingDomain | None = None,
    source: str | None = None,
    knot_spacing_s: float = KNOT_SPACING_S,
) -> Trajectory:
    """Return the joint-space trajectory that makes the tool follow a path.

    Args:
        arm: kinematics of the robot.
        path: what the tool does.
        domain: modelling box of angles and speeds that the trajectory must not leave, or None.
        source: name of the path in errors (default: its own name).
        knot_spacing_s: largest time between knots to start with.

    Returns:
        The trajectory; its ``task`` records the path, the robot, the largest knot spacing and the measured fit errors.

    Raises:
        InputError: the path says nothing of the orientation of a tool that has one, or of one that has none; somewhere
            on the path the tool is out of reach, the robot is singular, or a joint leaves the modelling box; the
            message says where, when and by how much. Or the fit does not reach ``FIT_TOLERANCE_M``.
    """
    source = source or path.name
    _require_orientation(arm, path, source)
    for refinement in range(MAX_REFINEMENTS + 1):
        spacing = knot_spacing_s / 2**refinement
        knots = _knots(path, spacing)
        motion = joint_motion(arm, path, knots, source)
        if domain is not None:
            _require_inside(domain, path, knots, motion, source)
        coefficients = quintic_hermite(knots, motion)
        trajectory = Trajectory(path.name, knots, coefficients)
        error_m, error_rad = fit_errors(arm, path, trajectory)
        if error_m < FIT_TOLERANCE_M:
            task = {
                "path": path.model_dump(mode="json", exclude_none=True),
                "robot": arm.name,
                "knot_spacing_s": spacing,
                "fit_error_m": error_m,
                "fit_error_rad": error_rad,
            }
            return Trajectory(path.name, knots, coefficients, task)
    raise InputError(source, "fit", f"{error_m:.3g} m with knots {spacing:.3g} s apart", f"below {FIT_TOLERANCE_M} m")


def joint_motion(arm: Kinematics, path: TaskPath, times_s: Array, source: str) -> Reference:
    """Return angles, speeds and accelerations (times, n) of the exact inverse kinematics, angles without jumps of 2 pi.

    Raises:
        InputError: out of reach or singular (``singularity`` below ``MIN_SINGULARITY``) at one of the times.
    """
    angles, speeds, accelerations = [], [], []
    held = (*path.orientation, *arm.posture)
    at_rest = [0.0] * len(held)
    for time in times_s:
        task = path.evaluate(float(time))
        try:
            theta = arm.inverse_kinematics([*task.position, *held])
        except InputError as error:
            raise InputError(source, _place(path, time), error.got, error.expected) from error
        measure, value = arm.singularity(theta)
        if not value >= MIN_SINGULARITY:
            expected = f"at least {MIN_SINGULARITY} (the robot is singular when links align)"
            raise InputError(source, _place(path, time), f"{measure} = {value:.3g}", expected)
        J = arm.jacobian(theta)
        omega = np.linalg.solve(J, [*task.velocity, *at_rest])
        drift = arm.jacobian_rate_times_speed(theta, omega)
        angles.append(theta)
        speeds.append(omega)
        accelerations.append(np.linalg.solve(J, [*task.acceleration, *at_rest] - drift))
    return Reference(np.unwrap(np.array(angles), axis=0), np.array(speeds), np.array(accelerations))


def quintic_hermite(knots_s: Array, motion: Reference) -> Array:
    """Return the coefficients (K, n, 6) of the quintics that take the motion of both ends of a segment.

    Differences of nearly equal values are divided by powers of the spacing, which in floating point would spoil the
    continuity of r''; the arithmetic is therefore exact, with one rounding at the end.
    """
    spacing = [Fraction(after) - Fraction(before) for before, after in pairwise(knots_s)]
    states = [[tuple(map(Fraction, state)) for state in zip(*knot, strict=True)] for knot in zip(*motion, strict=True)]
    return np.array(
        [
            [_hermite(h, before, after) for before, after in zip(starts, ends, strict=True)]
            for h, starts, ends in zip(spacing, states[:-1], states[1:], strict=True)
        ]
    )


def fit_errors(arm: Kinematics, path: TaskPath, trajectory: Trajectory) -> tuple[float, float]:
    """Return the largest errors halfway between the knots: distance from the path, m, orientation and posture, rad."""
    middles = 0.5 * (trajectory.knots_s[:-1] + trajectory.knots_s[1:])
    poses = np.array([arm.forward_kinematics(angle) for angle in trajectory.evaluate(middles).angle])
    positions = np.array([path.evaluate(float(time)).position for time in middles])
    distances = np.linalg.norm(poses[:, :2] - positions, axis=1)
    turned = np.abs(poses[:, 2:] - np.array([*path.orientation, *arm.posture]))
    return float(distances.max()), float(turned.max(initial=0.0))


def _require_orientation(arm: Kinematics, path: TaskPath, source: str) -> None:
    coordinates = arm.joints - len(arm.posture)
    if 2 + len(path.orientation) != coordinates:
        expected = f"a path of the {coordinates} coordinates of {arm.name}: an orientation with 3, none with 2"
        raise InputError(source, "tool_angle_rad", path.tool_angle_rad, expected)


def _knots(path: TaskPath, spacing_s: float) -> Array:
    times = path.segment_times_s
    counts = [int(np.ceil((end - start) / spacing_s * (1.0 - 1e-12))) for start, end in pairwise(times)]
    pieces = [np.linspace(times[i], times[i + 1], count + 1)[1:] for i, count in enumerate(counts)]
    return np.concatenate([[0.0], *pieces])


def _hermite(h: Fraction, start: tuple[Fraction, ...], end: tuple[Fraction, ...]) -> list[float]:
    r0, v0, a0 = start
    r1, v1, a1 = end
    # What the motion from the start with constant acceleration leaves to be made up at the end.
    r = (r1 - r0 - h * v0 - h * h * a0 / 2) / h**3
    v = (v1 - v0 - h * a0) / h**2
    a = (a1 - a0) / h
    cubic = 10 * r - 4 * v + a / 2
    quartic = (-15 * r + 7 * v - a) / h
    quintic = (6 * r - 3 * v + a / 2) / h**2
    return [float(c) for c in (r0, v0, a0 / 2, cubic, quartic, quintic)]


def _require_inside(domain: OperatingDomain, path: TaskPath, times_s: Array, motion: Reference, source: str) -> None:
    boxes = (("theta", "rad", motion.angle, domain.angle_rad), ("omega", "rad/s", motion.speed, domain.speed_rad_s))
    for symbol, unit, values, box in boxes:
        for joint, (lower, upper) in enumerate(box):
            outside = np.flatnonzero((values[:, joint] < lower) | (values[:, joint] > upper))
            if outside.size:
                first = int(outside[0])
                got = f"{symbol}_{joint + 1} = {values[first, joint]:.4g} {unit}"
                expected = f"within [{lower:.4g}, {upper:.4g}] {unit}, the modelling box"
                raise InputError(source, _place(path, times_s[first]), got, expected)


def _place(path: TaskPath, time_s: float) -> str:
    x, y = path.evaluate(float(time_s)).position
    return f"segments[{path.segment_at(time_s)}] at t = {time_s:.4g} s, (X, Y) = ({x:.4g}, {y:.4g}) m"
