"""The torque-level law `dob-torque`, frozen (``docs/reference/formats.md``, law kinds)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class TorqueLaw:
    """Scheduled feedback and disturbance observer in torque coordinates at B configurations, SI.

    Its signals are (th_hat, w_hat, d_hat, dd_hat; d_f; e_I), predictions included.

    Attributes:
        sample_period_s: T.
        filter_time_constant_s: T_f of the disturbance filter.
        inertia: design inertia M, (B, n, n), kg m^2.
        feedback: [Kp Kd KI], (B, n, 3n).
        observer: [L1; L2; L3; L4], (B, 4n, n).
        premultiplication: beta, (B, n, n): gains and disturbance are those of beta times the equations of motion, a
            torque x there is beta^-1 x at the joints; None for the identity.
    """

    sample_period_s: float
    filter_time_constant_s: float
    inertia: FloatArray
    feedback: FloatArray
    observer: FloatArray
    premultiplication: FloatArray | None = None

    @property
    def states(self) -> int:
        """Six signals."""
        return 6

    @property
    def measured(self) -> int:
        """Angles only."""
        return 1

    def step(self, theta: FloatArray, _omega: FloatArray, state: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """One sample: correct implicitly, filter, command, integrate, predict (see `FrozenLaw`)."""
        T, n = self.sample_period_s, self.inertia.shape[-1]
        angle, speed, disturbance, rate, filtered, integral = state.swapaxes(0, 1)
        L = self.observer.reshape(-1, 4, n, n) * (T ** np.arange(1.0, 5.0))[:, None, None]
        K = self.feedback.reshape(-1, n, 3, n).swapaxes(1, 2) * np.array([T**2, T, T**3])[:, None, None]
        innovation = np.linalg.solve(np.eye(n) + L[:, 0], theta - angle)
        corrections = (gain @ innovation for gain in L.swapaxes(0, 1))
        angle, speed, disturbance, rate = (
            x + dx for x, dx in zip((angle, speed, disturbance, rate), corrections, strict=True)
        )
        pole = math.exp(-T / self.filter_time_constant_s)
        filtered = pole * filtered + (1.0 - pole) * disturbance
        command = self._at_joints(K[:, 0] @ angle + K[:, 1] @ speed + K[:, 2] @ integral - filtered)
        acceleration = np.linalg.solve(self.inertia, command + self._at_joints(disturbance))
        jerk = np.linalg.solve(self.inertia, self._at_joints(rate))
        return command, [
            angle + speed + acceleration / 2.0 + jerk / 6.0,
            speed + acceleration + jerk / 2.0,
            disturbance + rate,
            rate,
            filtered,
            integral + theta,
        ]

    def _at_joints(self, torque: FloatArray) -> FloatArray:
        return torque if self.premultiplication is None else np.asarray(np.linalg.solve(self.premultiplication, torque))
