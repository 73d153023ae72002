"""The laws that read measured speeds, frozen: PID and computed torque, with or without disturbance observer.

With the measured angle y, the measured speed w and its filtered value w_f,

    w_f <- q w_f + (1 - q) w,   a_hat = zeta + kappa w_f,   Gamma = -Kp y - Kd w_f + Ki e_I - M a_hat
    e_I <- e_I - T y,           zeta <- q_o zeta - (1 - q_o) (M^-1 Gamma + kappa w_f)

(``docs/reference/formats.md``, law kinds). With diagonal gains the joints do not decouple, so nothing here assumes it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class VelocityLaw:
    """A law at B configurations, SI. Its signals are (w_f, e_I, and zeta if there is an observer).

    Attributes:
        sample_period_s: T.
        proportional, derivative, integral: Kp, Kd, Ki as torques, (B, n, n).
        inertia: design inertia M, (B, n, n), kg m^2; only the observer needs it here.
        filter_time_constant_s: of the measured speed; 0 for none.
        observer_bandwidth_rad_s: of the disturbance observer; 0 for none.
    """

    sample_period_s: float
    proportional: FloatArray
    derivative: FloatArray
    integral: FloatArray
    inertia: FloatArray
    filter_time_constant_s: float
    observer_bandwidth_rad_s: float = 0.0

    @property
    def states(self) -> int:
        """Two signals, three with an observer."""
        return 3 if self.observer_bandwidth_rad_s > 0.0 else 2

    @property
    def measured(self) -> int:
        """Angles and speeds."""
        return 2

    @property
    def _integrates(self) -> bool:
        return bool(np.any(self.integral))

    def step(self, theta: FloatArray, omega: FloatArray, state: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """One sample (see `FrozenLaw`)."""
        T = self.sample_period_s
        filtered, integral = state[:, 0], state[:, 1]
        pole = math.exp(-T / self.filter_time_constant_s) if self.filter_time_constant_s > 0.0 else 0.0
        filtered = pole * filtered + (1.0 - pole) * omega
        command = T**3 * self.integral @ integral - T**2 * self.proportional @ theta - T * self.derivative @ filtered
        following = [filtered, integral - theta if self._integrates else 0.0 * theta]  # what nothing reads is not kept
        if self.observer_bandwidth_rad_s > 0.0:
            zeta, observer_pole = state[:, 2], math.exp(-self.observer_bandwidth_rad_s * T)
            gain = 1.0 - observer_pole
            command = command - self.inertia @ (zeta + gain * filtered)
            known = np.linalg.solve(self.inertia, command)
            following.append(observer_pole * zeta - gain * (known + gain * filtered))
        return command, following
