"""Planar five-bar from the velocities of its centres of mass, and the same mechanism as a Pinocchio model.

Absolute angles phi = (th_1, th_2, q_1, q_2) from the downward vertical, gravity along -Y. Leg i has the active link
th_i and the passive link q_i, with lengths a, b, centres of mass at r_a, r_b from their joints and inertias about their
joint axes. With S_i the end of leg i, the legs meet where S_1 = S_2; the residual has that constraint as
h = ((S_2 - S_1)_Y, (S_1 - S_2)_X).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from quasilpv.arrays import FloatArray
from reference.serial_arm import Link, Sine


def along(angle: float) -> FloatArray:
    """Derivative by the angle of the end of a link of length 1."""
    return np.array([np.cos(angle), np.sin(angle)])


@dataclass(frozen=True)
class FiveBar:
    active: Link
    passive: Link
    gravity_m_s2: float
    spring_nm_rad: float
    spring_rest_rad: tuple[float, float]
    baumgarte_per_s: float
    external_torque: tuple[Sine, ...] = ()

    def _bodies(self, phi: FloatArray, v: FloatArray) -> list[tuple[float, float, FloatArray, FloatArray, int]]:
        """(mass, inertia about the centre of mass, J, dJ/dt, index of its angle) of each of the four links."""
        bodies = []
        for leg in (0, 1):
            for index, link, radii in (
                (leg, self.active, {leg: self.active.com_m}),
                (leg + 2, self.passive, {leg: self.active.length_m, leg + 2: self.passive.com_m}),
            ):
                J, J_dot = np.zeros((2, 4)), np.zeros((2, 4))
                for i, radius in radii.items():
                    J[:, i] = radius * along(phi[i])
                    J_dot[:, i] = radius * v[i] * along(phi[i] + np.pi / 2)
                about_com = link.inertia_kg_m2 - link.mass_kg * link.com_m**2
                bodies.append((link.mass_kg, about_com, J, J_dot, index))
        return bodies

    def mass_matrix(self, phi: FloatArray) -> FloatArray:
        M = np.zeros((4, 4))
        for mass, about_com, J, _, index in self._bodies(phi, np.zeros(4)):
            M += mass * J.T @ J
            M[index, index] += about_com
        return M

    def bias_torques(self, phi: FloatArray, v: FloatArray) -> list[FloatArray]:
        """Coriolis, gravity, friction and spring torques on the four links."""
        bodies = self._bodies(phi, v)
        coriolis = np.asarray(sum(mass * J.T @ (J_dot @ v) for mass, _, J, J_dot, _ in bodies))
        gravity = np.asarray(sum(self.gravity_m_s2 * mass * J[1] for mass, _, J, _, _ in bodies))
        elbow = self.passive.friction_nm_s * (v[2:] - v[:2])
        friction = np.concatenate([self.active.friction_nm_s * v[:2] - elbow, elbow])
        spring = np.concatenate([self.spring_nm_rad * (phi[:2] - np.array(self.spring_rest_rad)), np.zeros(2)])
        return [coriolis, gravity, friction, spring]

    def applied_torque(self, time_s: float, torque: FloatArray) -> FloatArray:
        applied = np.concatenate([torque, np.zeros(2)])
        for sine in self.external_torque:
            applied[sine.joint] += sine.amplitude_nm * np.sin(sine.frequency_rad_s * time_s + sine.phase_rad)
        return applied

    def constraint(self, phi: FloatArray) -> FloatArray:
        a, b = self.active.length_m, self.passive.length_m
        ends = [
            a * np.array([np.sin(t), -np.cos(t)]) + b * np.array([np.sin(q), -np.cos(q)])
            for t, q in phi.reshape(2, 2).T
        ]
        gap = ends[0] - ends[1]
        return np.array([-gap[1], gap[0]])

    def constraint_jacobian(self, phi: FloatArray, turned: float = 0.0) -> FloatArray:
        """dh/dphi, its columns turned by an angle: a right angle gives d2h/dphi2 (h is a sum over the links)."""
        a, b = self.active.length_m, self.passive.length_m
        columns = [length * along(angle + turned) for length, angle in zip((a, -a, b, -b), phi, strict=True)]
        return np.array([[-y, x] for x, y in columns]).T

    def constraint_rows(self, phi: FloatArray, v: FloatArray, acceleration: FloatArray) -> list[FloatArray]:
        """h'' + 2 alpha h' + alpha^2 h in three summands."""
        J, alpha = self.constraint_jacobian(phi), self.baumgarte_per_s
        curvature = self.constraint_jacobian(phi, np.pi / 2) @ v**2
        return [J @ acceleration + curvature, 2 * alpha * J @ v, alpha**2 * self.constraint(phi)]

    def residual(self, time_s: float, state: FloatArray, derivative: FloatArray, torque: FloatArray) -> FloatArray:
        """F(t, y, y') of the form of index 1, y = (phi, v, lambda)."""
        phi, v, force = np.split(state, [4, 8])
        phi_dot, acceleration, _ = np.split(derivative, [4, 8])
        dynamics = (
            self.mass_matrix(phi) @ acceleration
            + sum(self.bias_torques(phi, v))
            - self.applied_torque(time_s, torque)
            - self.constraint_jacobian(phi).T @ force
        )
        return np.concatenate([phi_dot - v, dynamics, sum(self.constraint_rows(phi, v, acceleration))])

    def residual_scale(self, state: FloatArray, derivative: FloatArray, torque: FloatArray) -> float:
        """The largest summand of the residual."""
        phi, v, force = np.split(state, [4, 8])
        acceleration = derivative[4:8]
        terms = [
            self.mass_matrix(phi) @ acceleration,
            *self.bias_torques(phi, v),
            torque,
            self.constraint_jacobian(phi).T @ force,
            *self.constraint_rows(phi, v, acceleration),
            derivative,
            np.array([sine.amplitude_nm for sine in self.external_torque]),
        ]
        return max(float(np.abs(term).max(initial=0.0)) for term in terms)


def closed_chain_acceleration(
    five_bar: FiveBar, time_s: float, phi: FloatArray, v: FloatArray, torque: FloatArray
) -> FloatArray:
    """phi'' of an assembled mechanism by Pinocchio's constrained dynamics: two open chains, their ends pinned."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -five_bar.gravity_m_s2, 0.0])
    ends = []
    for leg in (1, 2):
        parent, placement = 0, pin.SE3.Identity()
        for name, link in (("active", five_bar.active), ("passive", five_bar.passive)):
            parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"{name}{leg}")
            about_com = link.inertia_kg_m2 - link.mass_kg * link.com_m**2
            inertia = pin.Inertia(link.mass_kg, np.array([0.0, -link.com_m, 0.0]), np.diag([0.0, about_com, about_com]))
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
            placement = pin.SE3(np.eye(3), np.array([0.0, -link.length_m, 0.0]))
        ends.append((parent, placement))
    pinned = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *ends[0], *ends[1])
    order = [0, 2, 1, 3]  # joints of Pinocchio: active and passive of leg 1, then of leg 2
    to_relative = np.array([[1, 0, 0, 0], [-1, 1, 0, 0], [0, 0, 1, 0], [0, 0, -1, 1]])
    q, rate = to_relative @ phi[order], to_relative @ v[order]
    absolute = five_bar.applied_torque(time_s, torque) - sum(five_bar.bias_torques(phi, v)[2:])
    tau = np.linalg.solve(to_relative.T, absolute[order])
    models, model_data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    models.append(pinned)
    model_data.append(pinned.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, models, model_data)
    settings = pin.ProximalSettings(1e-14, 1e-10, 100)
    relative = pin.constraintDynamics(model, data, q, rate, tau, models, model_data, settings)
    return np.linalg.solve(to_relative, relative)[order]
