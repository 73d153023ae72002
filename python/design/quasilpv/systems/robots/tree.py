"""Robots in space: a chain of bodies, each carried by one joint, with rotor inertias and gravity.

Frames stand at the joints. With q_k the coordinate of joint k, S_k its unit twist and X_k(q_k) the motion matrix of its
frame in the frame before, the twist of body k in its own frame is

    v_k = X_k(q_k) v_(k-1) + S_k q_k',    v_0 = 0

and with the inertia I_k (10 parameters) and the rotor inertia r_k reflected to the joint

    M(q) = sum_k J_k' I_k J_k + diag(r),    v_k = J_k q'

so that ``Gamma = M(q) q'' + h(q, q')`` (Featherstone 2008, chapters 5 and 6). A body that a description fixes to
another is part of it: see `KinematicTree`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from math import inf, isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement, SpatialInertia, cross_matrix


class JointKind(StrEnum):
    """How a joint moves."""

    REVOLUTE = "revolute"
    """Turns about its axis, within its limits."""

    CONTINUOUS = "continuous"
    """Turns about its axis without limits."""

    PRISMATIC = "prismatic"
    """Slides along its axis; its coordinate is in m, its torque is a force in N, its rotor inertia a mass in kg."""


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """One joint and the body it carries.

    Attributes:
        name: of the joint.
        kind: see `JointKind`.
        placement: of the joint's frame at coordinate 0 in the frame of the joint before (or of the base).
        axis: unit vector in the joint's frame.
        inertia: of the carried body about the joint's frame.
        rotor_inertia_kg_m2: reflected to the joint, >= 0.
        lower, upper: limits of the coordinate, rad or m; infinite for a continuous joint.

    Raises:
        InputError: the axis has not length 1, limits are reversed or missing, or the rotor inertia is negative.
    """

    name: str
    kind: JointKind
    placement: Placement
    axis: FloatArray
    inertia: SpatialInertia
    rotor_inertia_kg_m2: float = 0.0
    lower: float = -inf
    upper: float = inf

    def __post_init__(self) -> None:
        """Refuse what is no joint."""
        axis = np.array(self.axis, dtype=float).reshape(3)
        length = float(np.linalg.norm(axis))
        if not (isfinite(length) and abs(length - 1.0) < 1e-6):
            raise InputError(self.name, "axis", f"a vector of length {length:.6g}", "a unit vector")
        object.__setattr__(self, "axis", axis / length)
        if not (isfinite(self.rotor_inertia_kg_m2) and self.rotor_inertia_kg_m2 >= 0.0):
            raise InputError(self.name, "rotor_inertia", self.rotor_inertia_kg_m2, "a finite number >= 0, kg m^2")
        if self.kind is JointKind.CONTINUOUS:
            object.__setattr__(self, "lower", -inf)
            object.__setattr__(self, "upper", inf)
        elif not (isfinite(self.lower) and isfinite(self.upper) and self.lower < self.upper):
            raise InputError(self.name, "limits", f"[{self.lower:g}, {self.upper:g}]", "lower < upper, both finite")

    @property
    def turns(self) -> bool:
        """Whether the joint is a rotation."""
        return self.kind is not JointKind.PRISMATIC

    @property
    def is_full_circle(self) -> bool:
        """Whether every angle occurs: a continuous joint, or limits that span a turn."""
        return self.turns and self.upper - self.lower >= 2.0 * pi

    @property
    def twist(self) -> FloatArray:
        """S, (6,): the twist of the body at unit speed, in its own frame."""
        none = np.zeros(3)
        return np.concatenate([none, self.axis] if self.turns else [self.axis, none])

    @cached_property
    def axis_products(self) -> tuple[FloatArray, FloatArray]:
        """[a] and [a]^2, 3 x 3, of the axis a."""
        K = cross_matrix(self.axis)
        return K, K @ K

    def motion_matrices(self, coordinate: FloatArray) -> FloatArray:
        """X(q), (..., 6, 6), at coordinates (...)."""
        K = cross_matrix(self.axis)
        q = np.asarray(coordinate, dtype=float)[..., None, None]
        moved = np.zeros((*q.shape[:-2], 6, 6))
        if self.turns:
            Rt = np.eye(3) - np.sin(q) * K + (1.0 - np.cos(q)) * (K @ K)
            moved[..., :3, :3], moved[..., 3:, 3:] = Rt, Rt
        else:
            moved[...] = np.eye(6)
            moved[..., :3, 3:] = -q * K
        return moved @ self.placement.motion_matrix

    def motion_slopes(self, coordinate: FloatArray) -> FloatArray:
        """dX/dq, (..., 6, 6), at coordinates (...)."""
        K = cross_matrix(self.axis)
        q = np.asarray(coordinate, dtype=float)[..., None, None]
        slope = np.zeros((*q.shape[:-2], 6, 6))
        if self.turns:
            Rt = -np.cos(q) * K + np.sin(q) * (K @ K)
            slope[..., :3, :3], slope[..., 3:, 3:] = Rt, Rt
        else:
            slope[..., :3, 3:] = -K
        return slope @ self.placement.motion_matrix


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """A serial chain of joints: what is left of a description once its fixed bodies are merged and its tip is chosen.

    Attributes:
        name: identifier.
        joints: base to tip, at least one.
        tool: placement of the tool's frame in the frame of the last joint.
        gravity_m_s2: acceleration of gravity in the axes of the base, (3,).

    Raises:
        InputError: there is no joint, or gravity is not finite.
    """

    name: str
    joints: tuple[TreeJoint, ...]
    tool: Placement
    gravity_m_s2: FloatArray

    def __post_init__(self) -> None:
        """Refuse an empty chain."""
        if not self.joints:
            raise InputError(self.name, "joints", "none", "at least one joint that moves")
        gravity = np.array(self.gravity_m_s2, dtype=float).reshape(3)
        if not np.all(np.isfinite(gravity)):
            raise InputError(self.name, "gravity", gravity.tolist(), "three finite numbers, m/s^2")
        object.__setattr__(self, "gravity_m_s2", gravity)

    @property
    def order(self) -> int:
        """Number of joints n."""
        return len(self.joints)

    @property
    def rotor_inertias(self) -> FloatArray:
        """r, (n,), kg m^2 (kg for a prismatic joint)."""
        return np.array([joint.rotor_inertia_kg_m2 for joint in self.joints])

    def carrying(self, payload: SpatialInertia) -> KinematicTree:
        """The robot with a body fixed to its last link; the payload is about the *tool's* frame."""
        last = self.joints[-1]
        loaded = replace(last, inertia=last.inertia.plus(payload.seen_from(self.tool)))
        return replace(self, joints=(*self.joints[:-1], loaded))

    def scaled(self, links: float, rotors: float) -> KinematicTree:
        """The robot with the inertia of every link and of every rotor multiplied."""
        joints = tuple(
            replace(j, inertia=j.inertia.scaled(links), rotor_inertia_kg_m2=j.rotor_inertia_kg_m2 * rotors)
            for j in self.joints
        )
        return replace(self, joints=joints)

    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters as a document of kind ``tree``, without friction, limits and tool."""
        return {
            "kind": "tree",
            "gravity_m_s2": self.gravity_m_s2.tolist(),
            "joints": [
                {
                    "name": joint.name,
                    "kind": joint.kind.value,
                    "rotation": joint.placement.rotation.tolist(),
                    "translation_m": joint.placement.translation_m.tolist(),
                    "axis": joint.axis.tolist(),
                    "mass_kg": joint.inertia.mass_kg,
                    "first_moment_kg_m": joint.inertia.first_moment_kg_m.tolist(),
                    "rotational_kg_m2": joint.inertia.rotational_kg_m2.tolist(),
                    "rotor_inertia_kg_m2": joint.rotor_inertia_kg_m2,
                }
                for joint in self.joints
            ],
        }

    # ---- kinematics ------------------------------------------------------------------------------------------------

    def coordinates(self, q: ArrayLike) -> FloatArray:
        """Joint coordinates as an array (..., n). InputError: another number of them."""
        values = np.asarray(q, dtype=float)
        if values.shape[-1:] != (self.order,):
            raise InputError(self.name, "coordinates", f"shape {values.shape}", f"shape (..., {self.order})")
        return values

    def jacobians(self, q: ArrayLike) -> FloatArray:
        """J_k of every body in its own frame, (n, ..., 6, n), at coordinates (..., n)."""
        values = self.coordinates(q)
        n = self.order
        bodies = np.zeros((n, *values.shape[:-1], 6, n))
        before = np.zeros((*values.shape[:-1], 6, n))
        for k, joint in enumerate(self.joints):
            before = joint.motion_matrices(values[..., k]) @ before
            before[..., :, k] += joint.twist
            bodies[k] = before
        return bodies

    def tool_pose(self, q: ArrayLike) -> Placement:
        """Placement of the tool's frame in the base, at coordinates (n,)."""
        return Placement(*self.frames(q)[-1])

    def tool_jacobian(self, q: ArrayLike) -> FloatArray:
        """J of the tool, (6, n), its twist in the axes of the base and its own origin."""
        frames = self.frames(q)
        tip, J = frames[-1][1], np.zeros((6, self.order))
        for k, (joint, (R, origin)) in enumerate(zip(self.joints, frames[:-1], strict=True)):
            axis = R @ joint.axis
            J[:3, k] = cross_matrix(axis) @ (tip - origin) if joint.turns else axis
            J[3:, k] = axis if joint.turns else 0.0
        return J

    def tool_drift(self, q: ArrayLike, speed: ArrayLike) -> FloatArray:
        """(dJ/dt) q', (6,): the acceleration of the tool's origin and of its orientation while joints keep their speed.

        In the axes of the base. A column (a x p; a) of J, p from the joint to the tool, changes by
        ``(w x a) x p + a x p'`` and ``w x a``, with w the angular velocity of the axis.
        """
        frames, w = self.frames(q), self.coordinates(speed)
        arms = [
            (R @ joint.axis, frames[-1][1] - origin) for joint, (R, origin) in zip(self.joints, frames, strict=False)
        ]
        drift, turning = np.zeros(6), np.zeros(3)
        before = np.zeros(3)  # velocity of the joint's origin relative to the base
        tip = self.tool_jacobian(q)[:3] @ w
        for k, (joint, (axis, arm)) in enumerate(zip(self.joints, arms, strict=True)):
            if k:
                last_axis, last_arm = arms[k - 1]
                before = before + cross_matrix(turning) @ (last_arm - arm)
                if not self.joints[k - 1].turns:
                    before = before + last_axis * w[k - 1]
            turned = cross_matrix(turning) @ axis * w[k]
            if joint.turns:
                drift[:3] += cross_matrix(turned) @ arm + cross_matrix(axis * w[k]) @ (tip - before)
                drift[3:] += turned
                turning = turning + axis * w[k]
            else:
                drift[:3] += turned
        return drift

    def frames(self, q: ArrayLike) -> list[tuple[FloatArray, FloatArray]]:
        """Rotation and origin of every joint's frame in the base, then those of the tool, at coordinates (n,)."""
        frames = []
        R, origin = np.eye(3), np.zeros(3)
        for joint, coordinate in zip(self.joints, self.coordinates(q), strict=True):
            origin = origin + R @ joint.placement.translation_m
            R = R @ joint.placement.rotation
            if joint.turns:
                K, K2 = joint.axis_products
                R = R + R @ (np.sin(coordinate) * K + (1.0 - np.cos(coordinate)) * K2)
            else:
                origin = origin + R @ (joint.axis * coordinate)
            frames.append((R, origin))
        frames.append((R @ self.tool.rotation, origin + R @ self.tool.translation_m))
        return frames

    @property
    def reach_m(self) -> float:
        """Sum of the distances between neighbouring frames, tool included: no point of it is farther from the base."""
        frames = [*(joint.placement for joint in self.joints), self.tool]
        sliding = sum(max(abs(joint.lower), abs(joint.upper)) for joint in self.joints if not joint.turns)
        return float(sum(np.linalg.norm(frame.translation_m) for frame in frames)) + sliding

    # ---- dynamics --------------------------------------------------------------------------------------------------

    def inertia(self, q: ArrayLike) -> FloatArray:
        """M(q), (..., n, n) at coordinates (..., n), kg m^2."""
        bodies = self.jacobians(q)
        M = sum(np.swapaxes(J, -1, -2) @ joint.inertia.matrix @ J for joint, J in zip(self.joints, bodies, strict=True))
        return np.asarray(M + np.diag(self.rotor_inertias))

    def inverse_dynamics(self, q: ArrayLike, speed: ArrayLike, acceleration: ArrayLike) -> FloatArray:
        """``Gamma = M(q) a + h(q, w)``, (n,), N m, without friction: the recursive Newton-Euler sweep."""
        coordinates, w, a = self.coordinates(q), self.coordinates(speed), self.coordinates(acceleration)
        v, vdot = np.zeros(6), np.concatenate([-self.gravity_m_s2, np.zeros(3)])
        matrices, forces = [], []
        for joint, q_k, w_k, a_k in zip(self.joints, coordinates, w, a, strict=True):
            X = joint.motion_matrices(q_k)
            own = joint.twist * w_k
            v = X @ v + own
            vdot = X @ vdot + joint.twist * a_k + _cross(v, own)
            momentum = joint.inertia.matrix @ v
            matrices.append(X)
            forces.append(joint.inertia.matrix @ vdot + _cross_dual(v, momentum))
        torque = np.zeros(self.order)
        carried = np.zeros(6)
        for k in reversed(range(self.order)):
            carried = forces[k] + carried
            torque[k] = self.joints[k].twist @ carried + self.joints[k].rotor_inertia_kg_m2 * a[k]
            carried = matrices[k].T @ carried
        return torque

    def gravity(self, q: ArrayLike) -> FloatArray:
        """G(q), (n,), N m."""
        still = np.zeros(self.order)
        return self.inverse_dynamics(q, still, still)

    def coriolis(self, q: ArrayLike, speed: ArrayLike) -> FloatArray:
        """Torque of Coriolis and centrifugal forces, (n,), N m: h(q, w) - G(q)."""
        return self.inverse_dynamics(q, speed, np.zeros(self.order)) - self.gravity(q)

    def forward_dynamics(self, q: ArrayLike, speed: ArrayLike, torque: ArrayLike) -> FloatArray:
        """Acceleration ``M^-1 (Gamma - h)``, (n,), rad/s^2, without friction."""
        load = np.asarray(torque, dtype=float) - self.inverse_dynamics(q, speed, np.zeros(self.order))
        return np.asarray(np.linalg.solve(self.inertia(q), load))


def _cross(v: FloatArray, twist: FloatArray) -> FloatArray:
    """``v x twist``: how a twist fixed in a frame that moves with v changes."""
    linear = np.cross(v[3:], twist[:3]) + np.cross(v[:3], twist[3:])
    return np.concatenate([linear, np.cross(v[3:], twist[3:])])


def _cross_dual(v: FloatArray, wrench: FloatArray) -> FloatArray:
    """``v x* wrench``: how a momentum fixed in a frame that moves with v changes."""
    angular = np.cross(v[3:], wrench[3:]) + np.cross(v[:3], wrench[:3])
    return np.concatenate([np.cross(v[3:], wrench[:3]), angular])


def merged(bodies: Sequence[tuple[Placement, SpatialInertia]]) -> SpatialInertia:
    """Several bodies that move as one, each with its placement in the common frame, as one inertia about that frame."""
    total = SpatialInertia.zero()
    for placement, inertia in bodies:
        total = total.plus(inertia.seen_from(placement))
    return total
