"""A robot with elastic joints in numpy: the equations of Spong (1987), and Runge-Kutta of fourth order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.tree import KinematicTree

COULOMB_SPEED_RAD_S = 0.05


@dataclass(frozen=True, eq=False)
class ElasticArm:
    """Links and motors; friction is the motors'.

    Attributes:
        tree: its rotors belong to the motors.
        stiffness, damping, viscous, coulomb: per joint, (n,).
    """

    tree: KinematicTree
    stiffness: FloatArray
    damping: FloatArray
    viscous: FloatArray
    coulomb: FloatArray

    @property
    def rotors(self) -> FloatArray:
        """B, (n,)."""
        return self.tree.rotor_inertias

    def links_inertia(self, q: FloatArray) -> FloatArray:
        """M without the rotors."""
        return self.tree.inertia(q) - np.diag(self.rotors)

    def spring(self, q: FloatArray, th: FloatArray, w: FloatArray, v: FloatArray) -> FloatArray:
        """K (th - q) + D (v - w)."""
        return self.stiffness * (th - q) + self.damping * (v - w)

    def friction(self, v: FloatArray) -> FloatArray:
        """Of the motors."""
        return self.viscous * v + self.coulomb * np.tanh(v / COULOMB_SPEED_RAD_S)

    def derivative(self, y: FloatArray, torque: FloatArray, external: FloatArray) -> FloatArray:
        """y' of y = (q, th, w, v)."""
        q, th, w, v = y.reshape(4, -1)
        spring = self.spring(q, th, w, v)
        moving = self.tree.inverse_dynamics(q, w, np.zeros_like(q))
        links = np.linalg.solve(self.links_inertia(q), spring + external - moving)
        return np.concatenate([w, v, links, (torque - self.friction(v) - spring) / self.rotors])

    def residual(self, y: FloatArray, y_dot: FloatArray, torque: FloatArray, external: FloatArray) -> FloatArray:
        """F(y, y'), without solving for anything."""
        q, th, w, v = y.reshape(4, -1)
        _, _, a, b = y_dot.reshape(4, -1)
        spring = self.spring(q, th, w, v)
        links = self.tree.inverse_dynamics(q, w, a) - self.rotors * a - spring - external
        motors = self.rotors * b + self.friction(v) + spring - torque
        return np.concatenate([y_dot[: 2 * len(q)] - y[2 * len(q) :], links, motors])

    def run(
        self, y: FloatArray, torques: FloatArray, T: float, steps: int, external: Callable[[float], FloatArray]
    ) -> FloatArray:
        """States at the samples, (N + 1, 4 n), under held torques (N, n); `steps` of Runge-Kutta a sample."""
        h = T / steps
        states = [y]
        for k, torque in enumerate(torques):
            for i in range(steps):
                t = k * T + i * h
                k1 = self.derivative(y, torque, external(t))
                k2 = self.derivative(y + h / 2 * k1, torque, external(t + h / 2))
                k3 = self.derivative(y + h / 2 * k2, torque, external(t + h / 2))
                k4 = self.derivative(y + h * k3, torque, external(t + h))
                y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            states.append(y)
        return np.array(states)

    def plant_document(self, encoder_side: str = "motor") -> dict[str, Any]:
        """The ``plant`` member of a scenario."""
        document = self.tree.parameters_document()
        joints = [
            {
                **joint,
                "friction_viscous_nm_s": float(self.viscous[k]),
                "friction_coulomb_nm": float(self.coulomb[k]),
                "coulomb_speed_rad_s": COULOMB_SPEED_RAD_S,
                "stiffness_nm_rad": float(self.stiffness[k]),
                "damping_nm_s": float(self.damping[k]),
            }
            for k, joint in enumerate(document["joints"])
        ]
        return {**document, "kind": "elastic-tree", "label": "elastic", "encoder_side": encoder_side, "joints": joints}
