"""The dynamics that all planar mechanisms share.

The n joint angles theta determine n *absolute* angles ``alpha = S theta`` (S of zeros and ones), in which both energies
are sums over cosines, W the absolute speeds:

    kinetic    1/2 sum_kl D_kl cos(alpha_k - alpha_l) W_k W_l
    potential  -sum_k g_k cos(alpha_k)

so that, with ``C_kl = D_kl cos(alpha_k - alpha_l)``,

    M(theta) = S^T C S,    N(theta, omega) = S^T [D_kl sin(alpha_k - alpha_l) W_l] S + diag(f)
    G(theta) = S^T [g_k sin(alpha_k)]

For a serial arm S is the lower triangle of ones, for a five-bar linkage with equal links the identity. A new mechanism
says what S, D, g and f are, and how its tool moves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix, Vector
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix


class PlanarDynamics(ABC):
    """``M(theta) theta'' + N(theta, omega) omega + G(theta) = Gamma``, from S, D, g and f: see the module.

    Attributes:
        name: identifier, e.g. ``"arm3"``.
    """

    name: str

    # ---- what a mechanism states ------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def joints(self) -> int:
        """Number of actuated joints n."""

    @property
    @abstractmethod
    def absolute_map(self) -> Matrix:
        """S, n x n, zeros and ones: ``alpha = S theta``."""

    @property
    def turns_as_one(self) -> bool:
        """Whether the first joint turns all links alike, so that the inertia does not depend on it."""
        return bool(np.all(self.absolute_map[:, 0] == 1.0))

    @property
    @abstractmethod
    def inertia_constants(self) -> Matrix:
        """The symmetric n x n matrix D, kg m^2."""

    @property
    @abstractmethod
    def gravity_constants(self) -> Vector:
        """The n constants g, N m."""

    @property
    @abstractmethod
    def friction_nm_s(self) -> Vector:
        """The n viscous friction coefficients f of the joints, N m s/rad."""

    @property
    @abstractmethod
    def driven_inertia(self) -> Vector:
        """The n inertias that decoupled gains per joint are proportional to, kg m^2."""

    @property
    def equilibrium_sign(self) -> float:
        """+1 if theta = 0 hangs, -1 if it is upright: the sign of gravity torques."""
        return 1.0

    @property
    def holds_spring(self) -> bool:
        """Whether G holds the torque of a spring as well as that of gravity."""
        return False

    # ---- what follows -----------------------------------------------------------------------------------------------

    def absolute(self, theta: ArrayLike) -> Vector:
        """Absolute angles ``alpha = S theta`` (or speeds) of n joint angles (or speeds)."""
        values = np.asarray(theta, dtype=float)
        if values.shape != (self.joints,):
            raise InputError(self.name, "joint vector", f"shape {values.shape}", f"shape ({self.joints},)")
        absolute: Vector = self.absolute_map @ values
        return absolute

    def inertia(self, theta: ArrayLike) -> Matrix:
        """Inertia matrix M(theta), n x n symmetric positive definite, kg m^2."""
        alpha = self.absolute(theta)
        return self._in_joint_angles(self.inertia_constants * np.cos(alpha[:, None] - alpha[None, :]))

    def coriolis_matrix(self, theta: ArrayLike, omega: ArrayLike) -> Matrix:
        """Matrix N(theta, omega), n x n, friction included: N omega is the torque due to speeds."""
        alpha, W = self.absolute(theta), self.absolute(omega)
        N = self._in_joint_angles(self.inertia_constants * np.sin(alpha[:, None] - alpha[None, :]) * W[None, :])
        return N + np.diag(self.friction_nm_s)

    def coriolis(self, theta: ArrayLike, omega: ArrayLike, along: ArrayLike | None = None) -> Vector:
        """Torque N(theta, omega) v, n, N m, with v = ``along`` (default omega): Coriolis, centrifugal and friction."""
        v = np.asarray(omega if along is None else along, dtype=float)
        torque: Vector = self.coriolis_matrix(theta, omega) @ v
        return torque

    def gravity(self, theta: ArrayLike) -> Vector:
        """Gravity torque G(theta), n, N m."""
        torque: Vector = self.absolute_map.T @ (
            self.equilibrium_sign * self.gravity_constants * np.sin(self.absolute(theta))
        )
        return torque

    def gravity_stiffness(self, theta: ArrayLike) -> Matrix:
        """Matrix H(theta), n x n symmetric, N m/rad, with G(theta) = H(theta) theta: sin(alpha) = sinc(alpha) alpha."""
        sinc = np.sinc(self.absolute(theta) / np.pi)
        return self._in_joint_angles(np.diag(self.equilibrium_sign * self.gravity_constants * sinc))

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
        """Kinetic plus potential energy, J; the potential is 0 with every absolute angle horizontal."""
        omega = np.asarray(omega, dtype=float)
        kinetic = 0.5 * omega @ self.inertia(theta) @ omega
        return float(kinetic - self.equilibrium_sign * self.gravity_constants @ np.cos(self.absolute(theta)))

    def _in_joint_angles(self, absolute: Matrix) -> Matrix:
        """A form in absolute speeds written in joint speeds, S^T X S."""
        return np.asarray(self.absolute_map.T @ absolute @ self.absolute_map)

    def inertia_affine(self) -> AffineMatrix:
        """M as ``M_0 + sum_p z_p M_p`` in the premises of `inertia_premises`, kg m^2."""
        n, D = self.joints, self.inertia_constants

        def term(k: int, j: int) -> Matrix:
            basis = np.zeros((n, n))
            basis[k, j] = basis[j, k] = D[k, j]
            return self._in_joint_angles(basis)

        pairs = [(k, k + gap) for gap in range(1, n) for k in range(n - gap)]
        coefficients = np.array([term(k, j) for k, j in pairs]).reshape(len(pairs), n, n)
        return AffineMatrix(self._in_joint_angles(np.diag(np.diag(D))), coefficients)
