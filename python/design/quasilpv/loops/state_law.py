"""The stabilising laws, frozen (``docs/reference/formats.md``, law kinds): ``Gamma = Kp y + Kd w_f``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class StateLaw:
    """A law at B configurations, SI. Its one signal is the filtered speed, ``w_f <- q w_f + (1 - q) w``.

    Attributes:
        sample_period_s: T.
        gain: K = [Kp Kd], (B, n, 2n).
        filter_time_constant_s: of the measured speed; 0 for none.
    """

    sample_period_s: float
    gain: FloatArray
    filter_time_constant_s: float

    @property
    def states(self) -> int:
        """The filtered speed."""
        return 1

    @property
    def measured(self) -> int:
        """Angles and speeds."""
        return 2

    def step(self, theta: FloatArray, omega: FloatArray, state: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """One sample (see `FrozenLaw`)."""
        T = self.sample_period_s
        pole = math.exp(-T / self.filter_time_constant_s) if self.filter_time_constant_s > 0.0 else 0.0
        filtered = pole * state[:, 0] + (1.0 - pole) * omega
        proportional, derivative = np.split(self.gain, 2, axis=2)
        return T**2 * proportional @ theta + T * derivative @ filtered, [filtered]


def descriptor_gain(numerator: FloatArray, inertia: FloatArray, lyapunov: FloatArray) -> FloatArray:
    """``F diag(I, M)^-1 P^-1``, (..., n, 2n), of one configuration or of many.

    Args:
        numerator: F, (..., n, 2n).
        inertia: design inertia M, (..., n, n), kg m^2.
        lyapunov: P, (..., 2n, 2n).
    """
    n = inertia.shape[-1]
    mixed = np.array(numerator)
    mixed[..., n:] = np.linalg.solve(inertia, mixed[..., n:].swapaxes(-1, -2)).swapaxes(-1, -2)
    return np.asarray(np.linalg.solve(lyapunov, mixed.swapaxes(-1, -2)).swapaxes(-1, -2))
