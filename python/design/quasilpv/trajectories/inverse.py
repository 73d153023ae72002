"""Inverse kinematics by damped Newton, for arms without a closed form and arms with joints to spare.

A *tool map* says what the tool of an arm does at joint coordinates q: m rows of position and orientation, of n >= m
joints. Its spare joints are held by a posture term: with Z a basis of the null space of J at the start,

    F(q) = (pose(q), Z' (q - q_start))

is a square system, and where it is regular the motion of the tool fixes that of the joints with all its derivatives,

    [J; Z'] q' = (S', 0),    [J; Z'] q'' = (S'' - J' q', 0).

A closed path of the tool is a closed path of the joints (as for any function of q that is held, Baillieul 1985).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Protocol, TypeAlias

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.spatial import Placement
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.trajectories.document import Reference

MOST_STEPS = 60
SMALLEST_STEP = 2.0**-12
CONVERGED = 1e-13
"""Of the scaled residual, in lengths of the arm and rad."""

ACCEPTED = 1e-10
"""A residual that no longer shrinks is accepted below this."""

LARGEST_TURN = 0.5
"""Of a joint in one step, rad or m."""

LEAST_REGULAR = 0.01
"""Smallest over largest singular value of [J; Z'], lengths in units of the arm: below, the arm counts as singular."""


@dataclass(frozen=True, eq=False)
class ToolTask:
    """What the tool is to do at one instant: a pose in the map's own form, and its first two derivatives (m,)."""

    pose: Any
    velocity: FloatArray
    acceleration: FloatArray


class ToolMap(Protocol):
    """What the tool does at joint coordinates: m rows, positions in m, orientations in rad."""

    @property
    def name(self) -> str:
        """Of the arm, in errors."""

    @property
    def joints(self) -> int:
        """n."""

    @property
    def scale(self) -> FloatArray:
        """Units of the rows, (m,): the length of the arm for positions, 1 for angles."""

    def missing(self, q: FloatArray, pose: Any) -> FloatArray:
        """What separates the tool from a pose, (m,): zero where it is there, J dq to first order elsewhere."""

    def jacobian(self, q: FloatArray) -> FloatArray:
        """J, (m, n)."""

    def drift(self, q: FloatArray, speed: FloatArray) -> FloatArray:
        """J' q', (m,)."""


@dataclass(frozen=True, eq=False)
class PlanarTool:
    """The tool of a planar mechanism: (X, Y), and its orientation where that is stated."""

    mechanism: PlanarMechanism
    rows: int

    @property
    def name(self) -> str:
        """See `ToolMap`."""
        return self.mechanism.name

    @property
    def joints(self) -> int:
        """See `ToolMap`."""
        return self.mechanism.joints

    @cached_property
    def scale(self) -> FloatArray:
        """See `ToolMap`."""
        steps = np.diff(self.mechanism.skeleton(np.zeros(self.joints)), axis=0)
        reach = float(np.linalg.norm(steps, axis=1).sum())
        return np.array([reach, reach, 1.0][: self.rows])

    def missing(self, q: FloatArray, pose: FloatArray) -> FloatArray:
        """See `ToolMap`."""
        return np.asarray(pose - self.mechanism.forward_kinematics(q)[: self.rows])

    def jacobian(self, q: FloatArray) -> FloatArray:
        """See `ToolMap`."""
        return self.mechanism.jacobian(q)[: self.rows]

    def drift(self, q: FloatArray, speed: FloatArray) -> FloatArray:
        """See `ToolMap`."""
        return self.mechanism.jacobian_rate_times_speed(q, speed)[: self.rows]


@dataclass(frozen=True, eq=False)
class SpatialTool:
    """The tool of a robot in space: position, and orientation where that is held, in the axes of the base."""

    tree: KinematicTree
    rows: int = 6

    @property
    def name(self) -> str:
        """See `ToolMap`."""
        return self.tree.name

    @property
    def joints(self) -> int:
        """See `ToolMap`."""
        return self.tree.order

    @cached_property
    def scale(self) -> FloatArray:
        """See `ToolMap`."""
        return np.array([*[self.tree.reach_m] * 3, 1.0, 1.0, 1.0][: self.rows])

    def missing(self, q: FloatArray, pose: Placement) -> FloatArray:
        """See `ToolMap`."""
        own = self.tree.tool_pose(q)
        away = pose.translation_m - own.translation_m
        return np.concatenate([away, rotation_vector(pose.rotation @ own.rotation.T)])[: self.rows]

    def jacobian(self, q: FloatArray) -> FloatArray:
        """See `ToolMap`."""
        return self.tree.tool_jacobian(q)[: self.rows]

    def drift(self, q: FloatArray, speed: FloatArray) -> FloatArray:
        """See `ToolMap`."""
        return self.tree.tool_drift(q, speed)[: self.rows]


def rotation_vector(rotation: FloatArray) -> FloatArray:
    """Axis times angle, in [0, pi], of a rotation."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = np.linalg.norm(skew) / 2.0, (np.trace(rotation) - 1.0) / 2.0
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-9:
        return np.asarray(skew / 2.0 * (angle / sine))
    if cosine > 0.0:
        return np.asarray(skew / 2.0)
    axis = np.sqrt(np.maximum((np.diag(rotation) + 1.0) / 2.0, 0.0))  # half a turn: R = 2 a a' - I
    first = int(np.argmax(axis))
    signs = np.where((rotation[first] >= 0.0) | (np.arange(3) == first), 1.0, -1.0)
    return np.asarray(axis * signs * angle)


Where: TypeAlias = Callable[[], tuple[str, str]]
"""Path and place in words, for a refusal."""


def reached(tool: ToolMap, pose: Any, start: FloatArray, where: Where) -> FloatArray:
    """Joint coordinates that put the tool at a pose, reached from others; spare joints stay near those.

    Raises:
        InputError: out of reach, or reached through a singular posture only; the message says where.
    """
    q = start
    for _ in range(MOST_STEPS):
        J = tool.jacobian(q) / tool.scale[:, None]
        gap = tool.missing(q, pose) / tool.scale
        back = start - q
        step = np.linalg.pinv(J, rcond=1e-6) @ (gap - J @ back) + back  # nearest to the start, to first order
        size = float(np.abs(step).max())
        if size < 1e-14 or (np.linalg.norm(gap) < CONVERGED and size < 1e-9):
            break
        q = q + step * min(1.0, LARGEST_TURN / size)
    return _solved(tool, pose, q, (np.zeros((0, tool.joints)), q), where)


@dataclass(frozen=True, eq=False)
class JointPath:
    """The joints' part of a path of the tool: see the module.

    Attributes:
        tool: the arm.
        start: joint coordinates at the start.
        held: Z', (n - m, n).
        source: name of the path in errors.
    """

    tool: ToolMap
    start: FloatArray
    held: FloatArray
    source: str

    @classmethod
    def of(cls, tool: ToolMap, start: FloatArray, source: str) -> JointPath:
        """The path that starts at these joint coordinates."""
        scaled = tool.jacobian(start) / tool.scale[:, None]
        return cls(tool, start, np.linalg.svd(scaled)[2][len(scaled) :], source)

    def motion(self, tasks: Sequence[ToolTask], place: Callable[[int], str]) -> Reference:
        """Angles, speeds and accelerations (times, n) of the joints while the tool does what is asked.

        Args:
            tasks: at times close enough for each to be found from the one before; the first at the start.
            place: says in words where task i is.

        Raises:
            InputError: somewhere the tool is out of reach, or the arm is singular.
        """
        angles, speeds, accelerations = [], [], []
        q, none = self.start, np.zeros(len(self.held))
        for i, task in enumerate(tasks):
            where = partial(self._where, place, i)
            q = _solved(self.tool, task.pose, q, (self.held, self.start), where)
            matrix = self._regular(q, where)
            speed = np.linalg.solve(matrix, np.concatenate([task.velocity, none]))
            drift = self.tool.drift(q, speed)
            angles.append(q)
            speeds.append(speed)
            accelerations.append(np.linalg.solve(matrix, np.concatenate([task.acceleration - drift, none])))
        return Reference(np.array(angles), np.array(speeds), np.array(accelerations))

    def _where(self, place: Callable[[int], str], i: int) -> tuple[str, str]:
        return self.source, place(i)

    def _regular(self, q: FloatArray, where: Where) -> FloatArray:
        """[J; Z']. InputError: singular."""
        J = self.tool.jacobian(q)
        values = np.linalg.svd(np.vstack([J / self.tool.scale[:, None], self.held]), compute_uv=False)
        if not values[-1] >= LEAST_REGULAR * values[0]:
            got = f"singular values of the scaled Jacobian in a ratio of {values[-1] / values[0]:.3g}"
            expected = f"at least {LEAST_REGULAR} (near a singular posture joints have to move without bound)"
            raise InputError(*where(), got, expected)
        return np.vstack([J, self.held])


def _solved(
    tool: ToolMap, pose: Any, guess: FloatArray, held: tuple[FloatArray, FloatArray], where: Where
) -> FloatArray:
    """Newton's method on F, Z' and q_start given, each step halved until the residual shrinks (Deuflhard 2011)."""
    q, (rows, start) = guess, held

    def residual(at: FloatArray) -> FloatArray:
        return np.concatenate([tool.missing(at, pose) / tool.scale, rows @ (start - at)])

    gap = residual(q)
    size = float(np.linalg.norm(gap))
    for _ in range(MOST_STEPS):
        if size < CONVERGED:
            return q
        matrix = np.vstack([tool.jacobian(q) / tool.scale[:, None], rows])
        step = np.linalg.pinv(matrix, rcond=1e-9) @ gap
        share = min(1.0, LARGEST_TURN / max(float(np.abs(step).max()), 1e-300))
        while share >= SMALLEST_STEP:
            trial = q + share * step
            gap_there = residual(trial)
            if np.linalg.norm(gap_there) < size:
                break
            share /= 2.0
        else:
            break
        q, gap, size = trial, gap_there, float(np.linalg.norm(gap_there))
    if size < ACCEPTED:
        return q
    away = tool.missing(q, pose)
    got = (
        f"the tool {float(np.linalg.norm(away[: min(3, len(away))])):.3g} m (or rad) away at the nearest posture found"
    )
    raise InputError(*where(), got, "a pose in reach")
