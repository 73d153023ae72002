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
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError
from quasilpv.systems.arm_parameters import Link, OperatingDomain
from quasilpv.systems.arm_symbols import SymbolicArm
from quasilpv.systems.premise import AffineMatrix, Premise

if TYPE_CHECKING:
    from quasilpv.systems.descriptor import DescriptorSystem

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class PlanarSerialArm:
    """A chain of n rigid links in a vertical plane: ``M(theta) theta'' + N(theta, omega) omega + G(theta) = Gamma``.

    Frames: X to the right, Y up, gravity along -Y; angles are positive counter-clockwise.

    Attributes:
        name: identifier, e.g. ``"arm3"``.
        links: the n links, base to tool.
        gravity_m_s2: gravitational acceleration g >= 0.
        equilibrium: what theta = 0 is: ``"hanging"`` (stable, link k points to (sin alpha_k, -cos alpha_k)) or
            ``"upright"`` (unstable, the same arm with theta_1 counted from the upward vertical).
        coriolis_factorisation: which matrix N with the right N omega is meant: ``"christoffel"`` (dM/dt - 2 N is
            skew-symmetric) or ``"printed"`` (Dehak 2022, Examples I.2 and I.4 with their signs corrected; only
            omega^T (dM/dt - 2 N) omega = 0 holds; defined for n = 2 and 3).

    Raises:
        InputError: no links, a negative or non-finite gravity, or the printed factorisation for another n.

    Reference: Spong, Hutchinson and Vidyasagar (2006), chapter 7; Dehak 2022, Examples I.2 and I.4.
    """

    name: str
    links: tuple[Link, ...]
    gravity_m_s2: float = 9.81
    equilibrium: Literal["hanging", "upright"] = "hanging"
    coriolis_factorisation: Literal["christoffel", "printed"] = "christoffel"

    def __post_init__(self) -> None:
        """Refuse arms that are not well defined."""
        if not self.links:
            raise InputError(self.name, "links", "none", "at least one link")
        if not (isfinite(self.gravity_m_s2) and self.gravity_m_s2 >= 0):
            raise InputError(self.name, "gravity_m_s2", self.gravity_m_s2, "a finite number >= 0")
        if self.equilibrium not in ("hanging", "upright"):
            raise InputError(self.name, "equilibrium", self.equilibrium, "hanging or upright")
        if self.coriolis_factorisation == "printed" and self.joints not in (2, 3):
            raise InputError(self.name, "coriolis_factorisation", "printed", "christoffel unless n = 2 or 3")

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
    def printed_coriolis_shift(self) -> float:
        """Sign of what separates the printed N from the skew one, 0 for other factorisations.

        ``N_printed = N_christoffel + shift D_12 sin(theta_2) e_1 [omega_2, -omega_1, 0 ...]``: the thesis moves the
        term omega_1 omega_2 of the first row from one column to the other, which leaves N omega as it is.
        """
        return {2: -1.0, 3: +1.0}[self.joints] if self.coriolis_factorisation == "printed" else 0.0

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

    # ---- dynamics --------------------------------------------------------------------------------------------------

    def absolute(self, theta: ArrayLike) -> Vector:
        """Absolute angles ``alpha_k = theta_1 + ... + theta_k`` (or speeds) of n joint angles (or speeds)."""
        values = np.asarray(theta, dtype=float)
        if values.shape != (self.joints,):
            raise InputError(self.name, "joint vector", f"shape {values.shape}", f"shape ({self.joints},)")
        return np.cumsum(values)

    def inertia(self, theta: ArrayLike) -> Matrix:
        """Inertia matrix M(theta), n x n symmetric positive definite, kg m^2."""
        alpha = self.absolute(theta)
        return _relative(self.inertia_constants * np.cos(alpha[:, None] - alpha[None, :]))

    def coriolis_matrix(self, theta: ArrayLike, omega: ArrayLike) -> Matrix:
        """Matrix N(theta, omega), n x n, friction included: N omega is the torque due to speeds.

        In absolute angles ``N_kl = D_kl sin(alpha_k - alpha_l) W_l``; ``coriolis_factorisation`` says which N.
        """
        alpha, W = self.absolute(theta), self.absolute(omega)
        D = self.inertia_constants
        N = _relative(D * np.sin(alpha[:, None] - alpha[None, :]) * W[None, :])
        if self.printed_coriolis_shift:
            shift = self.printed_coriolis_shift * D[0, 1] * np.sin(alpha[1] - alpha[0])
            N[0, 0] += shift * (W[1] - W[0])
            N[0, 1] -= shift * W[0]
        return N + np.diag(self.friction_nm_s)

    def coriolis(self, theta: ArrayLike, omega: ArrayLike, along: ArrayLike | None = None) -> Vector:
        """Torque N(theta, omega) v, n, N m, with v = ``along`` (default omega): Coriolis, centrifugal and friction."""
        v = np.asarray(omega if along is None else along, dtype=float)
        torque: Vector = self.coriolis_matrix(theta, omega) @ v
        return torque

    def gravity(self, theta: ArrayLike) -> Vector:
        """Gravity torque G(theta), n, N m: ``G_i = +-sum_{k>=i} g_k sin(alpha_k)``, + when theta = 0 hangs."""
        terms = self.equilibrium_sign * self.gravity_constants * np.sin(self.absolute(theta))
        return np.cumsum(terms[::-1])[::-1].copy()

    def inverse_dynamics(self, theta: ArrayLike, omega: ArrayLike, acceleration: ArrayLike) -> Vector:
        """Torque Gamma = M theta'' + N omega + G, n, N m."""
        acceleration = np.asarray(acceleration, dtype=float)
        torque: Vector = self.inertia(theta) @ acceleration + self.coriolis(theta, omega) + self.gravity(theta)
        return torque

    def forward_dynamics(self, theta: ArrayLike, omega: ArrayLike, torque: ArrayLike) -> Vector:
        """Acceleration theta'' = M^-1 (Gamma - N omega - G), n, rad/s^2."""
        load = np.asarray(torque, dtype=float) - self.coriolis(theta, omega) - self.gravity(theta)
        return np.asarray(np.linalg.solve(self.inertia(theta), load), dtype=float)

    def energy(self, theta: ArrayLike, omega: ArrayLike) -> float:
        """Kinetic plus potential energy, J; the potential is 0 with every link horizontal."""
        omega = np.asarray(omega, dtype=float)
        kinetic = 0.5 * omega @ self.inertia(theta) @ omega
        return float(kinetic - self.equilibrium_sign * self.gravity_constants @ np.cos(self.absolute(theta)))

    # ---- kinematics ------------------------------------------------------------------------------------------------

    def forward_kinematics(self, theta: ArrayLike) -> Vector:
        """Tool pose (X, Y, Phi): metres in the base frame, rad.

        ``X = sum L_k sin(alpha_k)``, ``Y = -sum L_k cos(alpha_k)`` (both negated when upright), ``Phi = alpha_n``.
        """
        alpha = self.absolute(theta)
        sign = self.equilibrium_sign
        return np.array(
            [sign * self.length_m @ np.sin(alpha), -sign * self.length_m @ np.cos(alpha), alpha[-1]],
        )

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

    # ---- symbolic model and premises -------------------------------------------------------------------------------

    @cached_property
    def symbolic(self) -> SymbolicArm:
        """The same model as sympy expressions of theta_i and omega_i."""
        return SymbolicArm.of(self)

    def inertia_premises(self, domain: OperatingDomain) -> tuple[Premise, ...]:
        """The measured premises ``cos(theta_{k+1} + ... + theta_l)`` the inertia is affine in, with guaranteed bounds.

        Order: neighbouring links first, then further apart, base to tool; for n = 3: cos theta_2, cos theta_3,
        cos(theta_2 + theta_3).
        """
        return self.symbolic.inertia_premises(domain)

    def inertia_affine(self) -> AffineMatrix:
        """M as ``M_0 + sum_p z_p M_p`` in the premises of `inertia_premises`, kg m^2."""
        n, D = self.joints, self.inertia_constants

        def term(k: int, j: int) -> Matrix:
            basis = np.zeros((n, n))
            basis[k, j] = basis[j, k] = D[k, j]
            return _relative(basis)

        pairs = [(k, k + gap) for gap in range(1, n) for k in range(n - gap)]
        coefficients = np.array([term(k, j) for k, j in pairs]).reshape(len(pairs), n, n)
        return AffineMatrix(_relative(np.diag(np.diag(D))), coefficients)

    def as_descriptor_system(self, domain: OperatingDomain) -> DescriptorSystem:
        """The descriptor model E(z) x' = A(z) x + B u, y = theta, with x = (theta, omega), u = Gamma.

        ``E = diag(I, M)``, ``A = [0, I; -H, -N]``, ``B = [0; I]``, ``C = [I, 0]``, where G(theta) = H(theta) theta. The
        premises are those of Dehak 2022 (Example I.2 for n = 2, Table I.3 for n = 3) for the printed factorisation of
        N; otherwise cos(alpha_l - alpha_k), sin(alpha_l - alpha_k) W_k and W_l, and sinc(alpha_k).
        """
        return self.symbolic.descriptor_system(self.name, domain)

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
        """The physical parameters as JSON-able data: gravity_m_s2, equilibrium and links."""
        return {
            "gravity_m_s2": self.gravity_m_s2,
            "equilibrium": self.equilibrium,
            "links": [asdict(link) for link in self.links],
        }

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file, whose arms hang at theta = 0.

        Raises:
            InputError: this arm counts its angles from the upward vertical.
        """
        if self.equilibrium != "hanging":
            raise InputError(self.name, "equilibrium", self.equilibrium, "hanging, the only one a scenario describes")
        document = self.parameters_document()
        del document["equilibrium"]
        return {"kind": "serial-arm", "label": label, **document}


def _relative(absolute: Matrix) -> Matrix:
    """A form in absolute speeds written in relative ones, S^T X S: entry (i, j) sums X over rows >= i, columns >= j."""
    return np.cumsum(np.cumsum(absolute[::-1, ::-1], axis=0), axis=1)[::-1, ::-1].copy()
