"""The planar five-bar linkage as a constrained system: four coordinates, two closure equations, two motors.

Two active links (length a) turn about one axis through the origin, driven by motors; a passive link (length b) hangs
on each, and the free ends of the passive links are pinned together at the tool. Coordinates are the *absolute* angles
``phi = (theta_1, theta_2, q_1, q_2)`` of the active and passive links from the downward vertical. With
``e(x) = (sin x, -cos x)`` the tool is at ``S = a e(theta_i) + b e(q_i)`` for i = 1 and 2, and

    M phi'' + N phi' + G = B (Gamma + Gamma_ext) + J^T lambda,    h(phi) = 0

    M = [c_4 I, c_3 diag(cos d_1, cos d_2); ., c_5 I],   d_i = q_i - theta_i,   B = [I; 0]
    N phi' = (-c_3 q_i'^2 sin d_i; +c_3 theta_i'^2 sin d_i) + (f theta'; 0)
    G = (c_1 sin theta_i; c_2 sin q_i)
    h = [a (cos theta_1 - cos theta_2) + b (cos q_1 - cos q_2); a (sin theta_1 - sin theta_2) + b (sin q_1 - sin q_2)]

    c_1 = g (m_a r_a + m_b a),  c_2 = g m_b r_b,  c_3 = m_b r_b a,  c_4 = I_a + m_b a^2,  c_5 = I_b

with moments of inertia about the joint axes. The joint velocities that the constraint allows are
``phi' = T theta'``, ``T = [I; -J_q^-1 J_theta]``, which eliminates lambda and the passive angles.

Reference: Dehak 2022, IV.5.2 (its constants c_4, c_5 add m r^2 once more to moments of inertia that are about the joint
axes, and its N has the opposite sign); Merlet (2006), Parallel Robots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix, Vector
from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import Link

BAUMGARTE_PER_S = 50.0
"""Rate at which simulated linkages are drawn back to h = 0."""


@dataclass(frozen=True)
class FiveBarLinkage:
    """Geometry, mass distribution and assembly of a five-bar linkage with coaxial motors.

    Attributes:
        name: identifier.
        active: each link on the motor axis, and the friction of that axis.
        passive: each link from an elbow to the tool; elbows and tool pin are free of friction.
        gravity_m_s2: gravitational acceleration g >= 0.
        assembly: sign of theta_2 - theta_1, which picks one of the two solutions of the inverse kinematics.

    Raises:
        InputError: gravity or friction outside these ranges.
    """

    name: str
    active: Link
    passive: Link
    gravity_m_s2: float = 9.81
    assembly: Literal["+", "-"] = "+"

    def __post_init__(self) -> None:
        """Refuse linkages that are not well defined."""
        if not (isfinite(self.gravity_m_s2) and self.gravity_m_s2 >= 0):
            raise InputError(self.name, "gravity_m_s2", self.gravity_m_s2, "a finite number >= 0")
        if self.passive.friction_nm_s != 0:
            raise InputError(
                self.name, "passive.friction_nm_s", self.passive.friction_nm_s, "0: passive joints are free"
            )
        if self.assembly not in ("+", "-"):
            raise InputError(self.name, "assembly", self.assembly, "+ or -")

    @cached_property
    def constants(self) -> tuple[float, float, float, float, float]:
        """(c_1, ..., c_5): two in N m, three in kg m^2."""
        a, b, g = self.active, self.passive, self.gravity_m_s2
        return (
            g * (a.mass_kg * a.com_m + b.mass_kg * a.length_m),
            g * b.mass_kg * b.com_m,
            b.mass_kg * b.com_m * a.length_m,
            a.inertia_kg_m2 + b.mass_kg * a.length_m**2,
            b.inertia_kg_m2,
        )

    # ---- constrained dynamics --------------------------------------------------------------------------------------

    def mass_matrix(self, phi: ArrayLike) -> Matrix:
        """M(phi), 4 x 4 symmetric positive definite, kg m^2."""
        _, _, c3, c4, c5 = self.constants
        theta, q = np.split(np.asarray(phi, dtype=float), 2)
        coupling = np.diag(c3 * np.cos(q - theta))
        return np.block([[c4 * np.eye(2), coupling], [coupling, c5 * np.eye(2)]])

    def speed_torque(self, phi: ArrayLike, rate: ArrayLike) -> Vector:
        """N(phi, phi') phi', 4, N m: centrifugal torques and friction of the motor axes."""
        theta, q = np.split(np.asarray(phi, dtype=float), 2)
        driven, passive = np.split(np.asarray(rate, dtype=float), 2)
        pull = self.constants[2] * np.sin(q - theta)
        friction = self.active.friction_nm_s * driven
        return np.concatenate([-pull * passive**2 + friction, pull * driven**2])

    def gravity_torque(self, phi: ArrayLike) -> Vector:
        """G(phi), 4, N m."""
        c1, c2, *_ = self.constants
        torque: Vector = np.array([c1, c1, c2, c2]) * np.sin(np.asarray(phi, dtype=float))
        return torque

    def closure(self, phi: ArrayLike) -> Vector:
        """h(phi), 2, m: distance between the two ends that meet at the tool."""
        signed = self._signed_lengths
        phi = np.asarray(phi, dtype=float)
        return np.array([signed @ np.cos(phi), signed @ np.sin(phi)])

    def closure_jacobian(self, phi: ArrayLike) -> Matrix:
        """J = dh/dphi, 2 x 4, m."""
        phi = np.asarray(phi, dtype=float)
        J: Matrix = self._signed_lengths * np.array([-np.sin(phi), np.cos(phi)])
        return J

    def closure_drift(self, phi: ArrayLike, rate: ArrayLike) -> Vector:
        """(dJ/dt) phi', 2, m/s^2, so that ``h'' = J phi'' + drift``."""
        phi, rate = np.asarray(phi, dtype=float), np.asarray(rate, dtype=float)
        pull = self._signed_lengths * rate**2
        return np.array([-pull @ np.cos(phi), -pull @ np.sin(phi)])

    def constrained_dynamics(self, phi: ArrayLike, rate: ArrayLike, torque: ArrayLike) -> tuple[Vector, Vector]:
        """Accelerations phi'' (4) and multipliers lambda (2, N) from one linear system.

            [M, -J^T; J, 0] [phi''; lambda] = [B Gamma - N phi' - G; -(dJ/dt) phi']

        Raises:
            numpy.linalg.LinAlgError: singular configuration, sin(q_1 - q_2) = 0 and theta_1 - theta_2 likewise.
        """
        J = self.closure_jacobian(phi)
        load = np.concatenate([np.asarray(torque, dtype=float), np.zeros(2)])
        right = [load - self.speed_torque(phi, rate) - self.gravity_torque(phi), -self.closure_drift(phi, rate)]
        matrix = np.block([[self.mass_matrix(phi), -J.T], [J, np.zeros((2, 2))]])
        solution = np.linalg.solve(matrix, np.concatenate(right))
        return solution[:4], solution[4:]

    # ---- reduction to the driven angles ----------------------------------------------------------------------------

    def passive_angles(self, theta: ArrayLike) -> Vector:
        """(q_1, q_2) in the same turn as theta: the tool on the far side of the line between the elbows.

        With ``psi = (theta_1 + theta_2)/2`` and ``sin(gamma) = (a/b) sin((theta_2 - theta_1)/2)`` they are
        ``psi + gamma`` and ``psi - gamma``.

        Raises:
            InputError: the elbows are farther apart than two passive links reach.
        """
        first, second = np.asarray(theta, dtype=float)
        sine = self.active.length_m * np.sin((second - first) / 2) / self.passive.length_m
        if not abs(sine) <= 1.0:
            got = f"{2 * abs(sine) * self.passive.length_m:.4g} m between the elbows"
            raise InputError(self.name, "theta_2 - theta_1", got, f"at most {2 * self.passive.length_m:.4g} m")
        middle, half = (first + second) / 2, np.arcsin(sine)
        return np.array([middle + half, middle - half])

    def coordinates(self, theta: ArrayLike) -> Vector:
        """phi of the assembled linkage, 4."""
        return np.concatenate([np.asarray(theta, dtype=float), self.passive_angles(theta)])

    def velocity_map(self, phi: ArrayLike) -> Matrix:
        """T = [I; -J_q^-1 J_theta], 4 x 2: ``phi' = T theta'``."""
        J = self.closure_jacobian(phi)
        return np.vstack([np.eye(2), -np.linalg.solve(J[:, 2:], J[:, :2])])

    def acceleration_drift(self, phi: ArrayLike, rate: ArrayLike) -> Vector:
        """s, 4, rad/s^2: ``phi'' = T theta'' + s`` with ``s = [0; -J_q^-1 (dJ/dt) phi']``."""
        J = self.closure_jacobian(phi)
        return np.concatenate([np.zeros(2), -np.linalg.solve(J[:, 2:], self.closure_drift(phi, rate))])

    def reduced_dynamics(self, theta: ArrayLike, omega: ArrayLike) -> tuple[Matrix, Vector, Vector]:
        """M_r (2 x 2), b_r and G_r (2) of ``M_r theta'' + b_r + G_r = Gamma``, for any link lengths.

        ``M_r = T^T M T``, ``b_r = T^T (M s + N phi')``, ``G_r = T^T G``.
        """
        phi = self.coordinates(theta)
        T = self.velocity_map(phi)
        rate = T @ np.asarray(omega, dtype=float)
        M = self.mass_matrix(phi)
        bias = M @ self.acceleration_drift(phi, rate) + self.speed_torque(phi, rate)
        return T.T @ M @ T, T.T @ bias, T.T @ self.gravity_torque(phi)

    # ---- kinematics ------------------------------------------------------------------------------------------------

    def tool_position(self, theta: ArrayLike) -> Vector:
        """(X, Y) of the tool, m."""
        phi = self.coordinates(theta)
        return self.active.length_m * _towards(phi[0]) + self.passive.length_m * _towards(phi[2])

    def skeleton(self, theta: ArrayLike) -> Matrix:
        """Motors, first elbow, tool, second elbow, motors: 5 x 2, m."""
        motors = np.zeros(2)
        first, second = (self.active.length_m * _towards(angle) for angle in np.asarray(theta, dtype=float))
        return np.array([motors, first, self.tool_position(theta), second, motors])

    def driven_angles(self, position: ArrayLike) -> Vector:
        """(theta_1, theta_2) that put the tool at (X, Y), in this linkage's assembly.

        With the tool at the distance d in the direction psi from the downward vertical,
        ``cos(alpha) = (a^2 + d^2 - b^2)/(2 a d)`` and ``theta = psi -+ alpha`` (assembly "+": theta_1 < theta_2).

        Raises:
            InputError: the tool is out of reach or at the border of the workspace, where the linkage is singular.
        """
        X, Y = np.asarray(position, dtype=float)
        a, b, d = self.active.length_m, self.passive.length_m, float(np.hypot(X, Y))
        if not abs(a - b) < d < a + b:
            raise InputError(
                self.name,
                f"tool position ({X:.4g} m, {Y:.4g} m)",
                f"{d:.4g} m from the motors",
                f"a distance strictly between {abs(a - b):.4g} and {a + b:.4g} m",
            )
        half = np.arccos((a**2 + d**2 - b**2) / (2 * a * d))
        middle = np.arctan2(X, -Y)
        signed = half if self.assembly == "+" else -half
        return np.array([middle - signed, middle + signed])

    def tool_jacobian(self, theta: ArrayLike) -> Matrix:
        """d(X, Y)/d(theta_1, theta_2), 2 x 2, m: of the tool at the end of the first chain."""
        phi = self.coordinates(theta)
        T = self.velocity_map(phi)
        return self._chain_jacobian(phi) @ T[[0, 2]]

    def tool_drift(self, theta: ArrayLike, omega: ArrayLike) -> Vector:
        """(dJ/dt) omega of the tool Jacobian, 2, m/s^2."""
        phi = self.coordinates(theta)
        rate = self.velocity_map(phi) @ np.asarray(omega, dtype=float)
        a, b = self.active.length_m, self.passive.length_m
        centripetal = a * rate[0] ** 2 * _towards(phi[0]) + b * rate[2] ** 2 * _towards(phi[2])
        drift: Vector = self._chain_jacobian(phi)[:, 1] * self.acceleration_drift(phi, rate)[2] - centripetal
        return drift

    def singularity(self, theta: ArrayLike) -> tuple[str, float]:
        """The sine of the smallest angle between links that must not align, with its name.

        ``sin(q_1 - q_2) = 0``: the passive links align and the motors lose hold of the tool.
        ``sin(q_i - theta_i) = 0``: a chain is straight or folded, the border of the workspace.
        """
        theta = np.asarray(theta, dtype=float)
        q = self.passive_angles(theta)
        sines = {
            "|sin(q_1 - q_2)|": q[0] - q[1],
            "|sin(q_1 - theta_1)|": q[0] - theta[0],
            "|sin(q_2 - theta_2)|": q[1] - theta[1],
        }
        return min(((name, float(abs(np.sin(angle)))) for name, angle in sines.items()), key=lambda entry: entry[1])

    # ---- perturbation and files ------------------------------------------------------------------------------------

    def perturbed(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> FiveBarLinkage:
        """Masses and centres of mass of (active, passive) links scaled, inertias about the centres of mass unchanged.

        Raises:
            InputError: not two factors each, or a factor that leaves no rigid body.
        """
        for field, scales in (("mass_scale", mass_scale), ("com_scale", com_scale)):
            if len(scales) != 2:
                raise InputError(self.name, field, f"{len(scales)} factors", "2: active and passive links")
        return replace(
            self,
            active=self.active.perturbed(mass_scale[0], com_scale[0]),
            passive=self.passive.perturbed(mass_scale[1], com_scale[1]),
        )

    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters as a document of kind ``five-bar``, see `FiveBar` of the documents."""
        return {
            "kind": "five-bar",
            "gravity_m_s2": self.gravity_m_s2,
            "assembly": self.assembly,
            "active": asdict(self.active),
            "passive": asdict(self.passive),
        }

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file, whose linkages are assembled with theta_1 < theta_2.

        Raises:
            InputError: this linkage is assembled the other way.
        """
        if self.assembly != "+":
            raise InputError(self.name, "assembly", self.assembly, "+, the only one a scenario describes")
        document = self.parameters_document()
        del document["assembly"]
        return {
            "label": label,
            **document,
            "spring_nm_rad": 0.0,
            "spring_rest_rad": [0.0, 0.0],
            "formulation": "index1",
            "baumgarte_per_s": BAUMGARTE_PER_S,
        }

    @cached_property
    def _signed_lengths(self) -> Vector:
        a, b = self.active.length_m, self.passive.length_m
        return np.array([a, -a, b, -b])

    def _chain_jacobian(self, phi: Vector) -> Matrix:
        """d(X, Y)/d(theta_1, q_1), 2 x 2."""
        a, b = self.active.length_m, self.passive.length_m
        return np.column_stack([a * _across(phi[0]), b * _across(phi[2])])


def _towards(angle: float) -> Vector:
    """Unit vector at an angle from the downward vertical, e(x) = (sin x, -cos x)."""
    return np.array([np.sin(angle), -np.cos(angle)])


def _across(angle: float) -> Vector:
    """Its derivative, (cos x, sin x)."""
    return np.array([np.cos(angle), np.sin(angle)])
