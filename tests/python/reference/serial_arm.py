"""Planar serial arm with n links, from the velocities of the centres of mass.

Joint angles are relative, theta = 0 hangs, gravity points along -Y. Link k has length L_k, its centre of mass at
distance r_k from its joint, and inertia I_k about its joint axis, so I_k - m_k r_k^2 about the centre of mass. With
alpha_k = theta_1 + ... + theta_k the centre of mass of link k is at

    p_k = sum_{i<k} L_i (sin alpha_i, -cos alpha_i) + r_k (sin alpha_k, -cos alpha_k)

and, with J_k = dp_k/dtheta and s_k = dalpha_k/dtheta,

    M = sum_k m_k J_k' J_k + (I_k - m_k r_k^2) s_k' s_k,   c = sum_k m_k J_k' (dJ_k/dt) w,   G = g sum_k m_k (J_k)_y'.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray


@dataclass(frozen=True)
class Link:
    length_m: float
    mass_kg: float
    com_m: float
    inertia_kg_m2: float
    friction_nm_s: float


@dataclass(frozen=True)
class Sine:
    joint: int
    amplitude_nm: float
    frequency_rad_s: float
    phase_rad: float


@dataclass(frozen=True)
class SerialArm:
    links: tuple[Link, ...]
    gravity_m_s2: float
    external_torque: tuple[Sine, ...] = ()

    def _jacobians(self, angle: FloatArray, speed: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """(J_k, dJ_k/dt) of every centre of mass."""
        n = len(self.links)
        alpha, omega = np.cumsum(angle), np.cumsum(speed)
        pairs = []
        for k in range(n):
            J, J_dot = np.zeros((2, n)), np.zeros((2, n))
            for i in range(k + 1):
                arm = self.links[i].length_m if i < k else self.links[k].com_m
                J[:, : i + 1] += arm * np.array([[np.cos(alpha[i])], [np.sin(alpha[i])]])
                J_dot[:, : i + 1] += arm * omega[i] * np.array([[-np.sin(alpha[i])], [np.cos(alpha[i])]])
            pairs.append((J, J_dot))
        return pairs

    def mass_matrix(self, angle: FloatArray) -> FloatArray:
        n = len(self.links)
        M = np.zeros((n, n))
        for k, (link, (J, _)) in enumerate(zip(self.links, self._jacobians(angle, np.zeros(n)), strict=True)):
            s = (np.arange(n) <= k).astype(float)
            M += link.mass_kg * J.T @ J + (link.inertia_kg_m2 - link.mass_kg * link.com_m**2) * np.outer(s, s)
        return M

    def coriolis_torque(self, angle: FloatArray, speed: FloatArray, along: FloatArray | None = None) -> FloatArray:
        """sum_k m_k J_k' (dJ_k/dt) v, v = ``along`` (default: the speed); without friction."""
        pairs, v = self._jacobians(angle, speed), speed if along is None else along
        terms = (link.mass_kg * J.T @ (J_dot @ v) for link, (J, J_dot) in zip(self.links, pairs, strict=True))
        return np.asarray(sum(terms))

    def gravity_torque(self, angle: FloatArray) -> FloatArray:
        pairs = self._jacobians(angle, np.zeros(len(self.links)))
        terms = (self.gravity_m_s2 * link.mass_kg * J[1] for link, (J, _) in zip(self.links, pairs, strict=True))
        return np.asarray(sum(terms))

    def friction_torque(self, speed: FloatArray) -> FloatArray:
        return np.array([link.friction_nm_s for link in self.links]) * speed

    def disturbance_torque(self, time_s: float) -> FloatArray:
        torque = np.zeros(len(self.links))
        for sine in self.external_torque:
            torque[sine.joint] += sine.amplitude_nm * np.sin(sine.frequency_rad_s * time_s + sine.phase_rad)
        return torque

    def residual(self, time_s: float, state: FloatArray, derivative: FloatArray, torque: FloatArray) -> FloatArray:
        """F(t, x, x') = [th' - w; M w' + c + fv w + G - Gamma - Gamma_ext(t)] with x = (th, w)."""
        n = len(self.links)
        return np.concatenate([derivative[:n] - state[n:], sum(self.torque_terms(time_s, state, derivative, torque))])

    def torque_terms(
        self, time_s: float, state: FloatArray, derivative: FloatArray, torque: FloatArray
    ) -> list[FloatArray]:
        """The summands of the second half of the residual, for tolerances relative to the largest of them."""
        n = len(self.links)
        angle, speed = state[:n], state[n:]
        return [
            self.mass_matrix(angle) @ derivative[n:],
            self.coriolis_torque(angle, speed),
            self.friction_torque(speed),
            self.gravity_torque(angle),
            -torque,
            -self.disturbance_torque(time_s),
        ]

    def acceleration(self, time_s: float, state: FloatArray, torque: FloatArray) -> FloatArray:
        rest = self.torque_terms(time_s, state, np.zeros_like(state), torque)
        return np.linalg.solve(self.mass_matrix(state[: len(self.links)]), -np.asarray(sum(rest)))
