"""The planar serial arm with n revolute joints: dynamics and kinematics in closed form.

Notation of every formula here: theta, omega the relative joint angles and speeds; ``alpha_k = theta_1 + ... + theta_k``
the absolute angle of link k and W_k its speed, that is ``alpha = S theta`` with S the lower triangle of ones. In
absolute angles the kinetic energy is ``1/2 sum_kl D_kl cos(alpha_k - alpha_l) W_k W_l`` with

    D_kk = I_k + L_k^2 sum_{l>k} m_l          (I_k about the joint axis)
    D_kl = L_k (m_l r_l + L_l sum_{p>l} m_p)  for k < l

so that ``M(theta) = S^T [D_kl cos(alpha_k - alpha_l)] S``, and the potential energy is ``-sum_k g_k cos(alpha_k)`` with
``g_k = g (m_k r_k + L_k sum_{l>k} m_l)`` when theta = 0 hangs.
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
from quasilpv.systems.robots.mechanism import PlanarMechanism


@dataclass(frozen=True)
class PlanarSerialArm(PlanarMechanism):
    """A chain of n rigid links in a vertical plane: ``M(theta) theta'' + N(theta, omega) omega + G(theta) = Gamma``.

    Frames: X to the right, Y up, gravity along -Y; angles are positive counter-clockwise.

    Attributes:
        name: identifier, e.g. ``"arm3"``.
        links: the n links, base to tool.
        gravity_m_s2: gravitational acceleration g >= 0.
        equilibrium: what theta = 0 is: ``"hanging"`` (stable, link k points to (sin alpha_k, -cos alpha_k)) or
            ``"upright"`` (unstable, the same arm with theta_1 counted from the upward vertical).

    Raises:
        InputError: no links, or a negative or non-finite gravity.

    Reference: Spong, Hutchinson and Vidyasagar (2006), chapter 7; Dehak 2022, Examples I.2 and I.4.
    """

    name: str
    links: tuple[Link, ...]
    gravity_m_s2: float = 9.81
    equilibrium: Literal["hanging", "upright"] = "hanging"

    def __post_init__(self) -> None:
        """Refuse arms that are not well defined."""
        if not self.links:
            raise InputError(self.name, "links", "none", "at least one link")
        if not (isfinite(self.gravity_m_s2) and self.gravity_m_s2 >= 0):
            raise InputError(self.name, "gravity_m_s2", self.gravity_m_s2, "a finite number >= 0")
        if self.equilibrium not in ("hanging", "upright"):
            raise InputError(self.name, "equilibrium", self.equilibrium, "hanging or upright")

    # ---- constants -------------------------------------------------------------------------------------------------

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.links)

    @property
    def equilibrium_sign(self) -> float:
        """+1 if theta = 0 hangs, -1 if it is upright: the sign of gravity torques and of the tool's position."""
        return 1.0 if self.equilibrium == "hanging" else -1.0

    @cached_property
    def absolute_map(self) -> Matrix:
        """The lower triangle of ones: ``alpha_k = theta_1 + ... + theta_k``."""
        return np.tri(self.joints)

    @cached_property
    def length_m(self) -> Vector:
        """The n link lengths L."""
        return np.array([link.length_m for link in self.links])

    @cached_property
    def friction_nm_s(self) -> Vector:
        """The n viscous friction coefficients f."""
        return np.array([link.friction_nm_s for link in self.links])

    @cached_property
    def inertia_constants(self) -> Matrix:
        """The symmetric n x n matrix D (kg m^2) of the module's formula."""
        n = self.joints
        D = np.zeros((n, n))
        for k, link in enumerate(self.links):
            outer_mass = sum(outer.mass_kg for outer in self.links[k + 1 :])
            D[k, k] = link.inertia_kg_m2 + link.length_m**2 * outer_mass
            first_moment = link.mass_kg * link.com_m + link.length_m * outer_mass
            for j in range(k):
                D[j, k] = D[k, j] = self.links[j].length_m * first_moment
        return D

    @property
    def driven_inertia(self) -> Vector:
        """Largest diagonal entries of M, those of the stretched arm."""
        return np.diag(self.inertia(np.zeros(self.joints)))

    @cached_property
    def gravity_constants(self) -> Vector:
        """The n constants g_k = g (m_k r_k + L_k sum_{l>k} m_l), N m."""
        return np.array(
            [
                self.gravity_m_s2
                * (link.mass_kg * link.com_m + link.length_m * sum(outer.mass_kg for outer in self.links[k + 1 :]))
                for k, link in enumerate(self.links)
            ]
        )

    # ---- kinematics ------------------------------------------------------------------------------------------------

    def forward_kinematics(self, theta: ArrayLike) -> Vector:
        """Tool pose (X, Y, Phi): metres in the base frame, rad.

        ``X = sum L_k sin(alpha_k)``, ``Y = -sum L_k cos(alpha_k)`` (both negated when upright), ``Phi = alpha_n``.
        """
        return np.array([*self.skeleton(theta)[-1], self.absolute(theta)[-1]])

    def skeleton(self, theta: ArrayLike) -> Matrix:
        """Base, joints and tool, (n + 1) x 2, m: partial sums of ``L_k (sin(alpha_k), -cos(alpha_k))``."""
        alpha = self.absolute(theta)
        links = self.equilibrium_sign * self.length_m * np.array([np.sin(alpha), -np.cos(alpha)])
        return np.vstack([np.zeros(2), np.cumsum(links.T, axis=0)])

    def jacobian(self, theta: ArrayLike) -> Matrix:
        """Tool Jacobian, 3 x n: d(X, Y, Phi)/dt = J omega. For n = 3, det J = L_1 L_2 sin(theta_2)."""
        alpha = self.absolute(theta)
        arms = self.equilibrium_sign * self.length_m * np.array([np.cos(alpha), np.sin(alpha)])
        return np.vstack([np.cumsum(arms[:, ::-1], axis=1)[:, ::-1], np.ones(self.joints)])

    def jacobian_rate_times_speed(self, theta: ArrayLike, omega: ArrayLike) -> Vector:
        """The velocity part of the tool acceleration, (dJ/dt) omega, 3: m/s^2, m/s^2, rad/s^2."""
        alpha, W = self.absolute(theta), self.absolute(omega)
        pull = self.equilibrium_sign * self.length_m * W**2
        return np.array([-pull @ np.sin(alpha), pull @ np.cos(alpha), 0.0])

    def inverse_kinematics(self, pose: ArrayLike) -> Vector:
        """Joint angles of the 3-DoF arm that put its tool at (X, Y, Phi), with the elbow at theta_2 in (0, pi).

        With W the position of the third joint, ``cos(theta_2) = (|W|^2 - L_1^2 - L_2^2) / (2 L_1 L_2)``,
        ``theta_1 = atan2(W_x, -W_y) - atan2(L_2 sin(theta_2), L_1 + L_2 cos(theta_2))``,
        ``theta_3 = Phi - theta_1 - theta_2``.

        Raises:
            InputError: the arm has not three joints, or the pose is out of reach or singular (arm straight or folded).
        """
        if self.joints != 3:
            raise InputError(self.name, "joints", self.joints, "3 for the inverse kinematics of (X, Y, Phi)")
        X, Y, Phi = np.asarray(pose, dtype=float)
        L1, L2, L3 = self.length_m
        wrist_x = self.equilibrium_sign * X - L3 * np.sin(Phi)
        wrist_y = self.equilibrium_sign * Y + L3 * np.cos(Phi)
        cosine = (wrist_x**2 + wrist_y**2 - L1**2 - L2**2) / (2.0 * L1 * L2)
        if not abs(cosine) < 1.0:
            distance = float(np.hypot(wrist_x, wrist_y))
            raise InputError(
                self.name,
                f"tool pose ({X:.4g} m, {Y:.4g} m, {Phi:.4g} rad)",
                f"third joint at {distance:.4g} m from the base",
                f"a distance strictly between {abs(L1 - L2):.4g} and {L1 + L2:.4g} m",
            )
        theta2 = np.arccos(cosine)
        theta1 = np.arctan2(wrist_x, -wrist_y) - np.arctan2(L2 * np.sin(theta2), L1 + L2 * np.cos(theta2))
        return np.array([theta1, theta2, Phi - theta1 - theta2])

    def singularity(self, theta: ArrayLike) -> tuple[str, float]:
        """`|sin(theta_2)|`: the 3-DoF arm is singular when its first two links are in line."""
        return "|sin(theta_2)|", float(abs(np.sin(np.asarray(theta, dtype=float)[1])))

    # ---- perturbation ----------------------------------------------------------------------------------------------

    def perturbed(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> PlanarSerialArm:
        """The arm with link masses and centres of mass scaled, inertias about the centres of mass unchanged.

        Raises:
            InputError: not n factors each, or a factor that leaves no rigid body.
        """
        for field, scales in (("mass_scale", mass_scale), ("com_scale", com_scale)):
            if len(scales) != self.joints:
                raise InputError(self.name, field, f"{len(scales)} factors", f"{self.joints} factors")
        links = (link.perturbed(mass, com) for link, mass, com in zip(self.links, mass_scale, com_scale, strict=True))
        return replace(self, links=tuple(links))

    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters as a document of kind ``serial-arm``, see `SerialArm` of the documents."""
        return {
            "kind": "serial-arm",
            "gravity_m_s2": self.gravity_m_s2,
            "equilibrium": self.equilibrium,
            "links": [asdict(link) for link in self.links],
        }

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file, whose arms hang at theta = 0 for gravity > 0.

        An arm whose angles count from the upward vertical is, in those angles, one that hangs in the opposite gravity.
        """
        document = self.parameters_document()
        del document["equilibrium"]
        document["gravity_m_s2"] *= self.equilibrium_sign
        return {"label": label, **document}
