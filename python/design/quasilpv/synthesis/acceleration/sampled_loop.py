"""The frozen sampled closed loop of the acceleration-level law, and what can be read off it.

With torque ``M_n(z) a`` on a plant of inertia ``M_t``, the loop of n joints decouples exactly, in the coordinates that
diagonalise ``M_t^-1 M_n``, into n copies of one scalar loop

    theta'' = mu a,    mu an eigenvalue of M_t^-1 M_n,

so every question about the robust stability of the frozen loop is a question about the single number ``mu``. The
controller (estimator, disturbance filter, integral, feedback) is a fixed linear system from theta to a; the plant is
the exact zero-order-hold double integrator, its command delayed by any time.

Inside this module time is counted in samples (T = 1), which keeps every matrix well scaled; arguments and results are
SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray

ComplexArray = npt.NDArray[np.complex128]

FREQUENCY_POINTS = 300
BISECTIONS = 20
ROBUST_RATE_POINTS = 41
DOUBLINGS = 30


@dataclass(frozen=True, eq=False)
class AccelerationLaw:
    """The scalars of the law `dob-acceleration`.

    Attributes:
        sample_period_s: T.
        feedback: (kp, kd, ki), acting on x - x_r.
        observer: (l1, l2, l3, l4).
        filter_time_constant_s: T_f of the disturbance filter.
    """

    sample_period_s: float
    feedback: FloatArray
    observer: FloatArray
    filter_time_constant_s: float


@dataclass(frozen=True, eq=False)
class LinearController:
    """State-space form ``x+ = A x + B theta``, ``a = C x + D theta`` of the law with zero reference, time in samples.

    States: predicted (angle, speed, disturbance, its rate), filtered disturbance; with integral action the integral of
    the angle, which otherwise nothing reads.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    @classmethod
    def of(cls, law: AccelerationLaw) -> LinearController:
        """Write the law's recursion (estimate, filter, command, integrate, predict) as matrices."""
        T = law.sample_period_s
        kp, kd, ki = law.feedback * np.array([T**2, T, T**3])
        gains = law.observer * T ** np.arange(4.0)
        forget = math.exp(-T / law.filter_time_constant_s)
        rows = np.eye(7)  # unit rows: six states, then the measured angle
        predicted, filtered, integral, angle = rows[:4], rows[4], rows[5], rows[6]
        estimate = predicted + np.outer(gains, angle - predicted[0])
        filtered = forget * filtered + (1.0 - forget) * estimate[2]
        command = -filtered + kp * estimate[0] + kd * estimate[1] + ki * integral
        applied = command + estimate[2]
        following = np.array(
            [
                estimate[0] + estimate[1] + applied / 2 + estimate[3] / 6,
                estimate[1] + applied + estimate[3] / 2,
                estimate[2] + estimate[3],
                estimate[3],
                filtered,
                integral + angle,
            ]
        )
        kept = 6 if ki != 0.0 else 5
        return cls(following[:kept, :kept], following[:kept, 6], command[:kept], float(command[6]))

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """One scalar loop: the law against ``theta'' = mu a`` with the command delayed by ``delay_s``.

    The state is (theta, theta', the controller's states, the ``floor(delay/T) + 1`` commands still on their way).
    """

    law: AccelerationLaw
    delay_s: float = 0.0

    @cached_property
    def _controller(self) -> LinearController:
        return LinearController.of(self.law)

    @property
    def _delay(self) -> tuple[int, float]:
        """Whole samples and remaining fraction of the delay."""
        samples = self.delay_s / self.law.sample_period_s
        whole = math.floor(samples + 1e-12)
        return whole, max(0.0, samples - whole)

    def transition(self, ratio: float) -> FloatArray:
        """Per-sample map at ``mu = ratio``, square, time in samples."""
        whole, late = self._delay
        c = self._controller
        first = 2 + c.order  # of the commands
        size = first + whole + 1
        command = np.zeros(size)
        command[0], command[2:first] = c.D, c.C
        commands = [command, *np.eye(size)[first:]]  # newest first; commands[i] was issued i samples ago
        new, old = commands[whole], commands[whole + 1]
        following = np.zeros((size, size))
        following[0, 0], following[0, 1], following[1, 1] = 1.0, 1.0, 1.0
        following[0] += ratio * ((1.0 - late) ** 2 / 2 * new + (late - late**2 / 2) * old)
        following[1] += ratio * ((1.0 - late) * new + late * old)
        following[2:first, 0], following[2:first, 2:first] = c.B, c.A
        for i in range(whole + 1):
            following[first + i] = commands[i]
        return following

    def growth_rate(self, ratio: float) -> float:
        """Worst growth rate ``log(spectral radius) / T`` at ``mu = ratio``, 1/s; negative when stable."""
        radius = np.max(np.abs(np.linalg.eigvals(self.transition(ratio))))
        return float(np.log(radius) / self.law.sample_period_s)

    def worst_growth_rate(self, lowest: float, highest: float) -> tuple[float, float]:
        """Worst growth rate over inertia ratios ``M_t / M_n`` in [lowest, highest], and the ratio where it occurs."""
        ratios = np.geomspace(lowest, highest, ROBUST_RATE_POINTS)
        rates = [self.growth_rate(1.0 / ratio) for ratio in ratios]
        worst = int(np.argmax(rates))
        return rates[worst], float(ratios[worst])

    def open_loop(self, phase: FloatArray) -> ComplexArray:
        """Loop transfer L(e^{j phase}) per unit mu: the loop is on its stability limit where ``mu L = 1``."""
        whole, late = self._delay
        z = np.exp(1j * phase)
        shift = z - 1.0
        position = (1.0 - late) ** 2 / 2 + (late - late**2 / 2) / z
        speed = (1.0 - late) + late / z
        plant = (position * shift + speed) / shift**2 / z**whole
        c = self._controller
        system = z[:, None, None] * np.eye(c.order) - c.A
        response = np.linalg.solve(system, np.broadcast_to(c.B, (z.size, c.order))[..., None])[..., 0]
        return np.asarray(plant * (response @ c.C + c.D))

    def inertia_margin(self) -> tuple[float, float] | None:
        """Largest interval of ``M_t / M_n`` around 1 on which the frozen loop is stable; None if it is not stable at 1.

        The limits are crossings of the unit circle, where Im L = 0 and ``M_t / M_n = Re L > 0``. Numerical: crossings
        are bracketed on a grid of frequencies and bisected; the proof is the business of the certificate.
        """
        if self.growth_rate(1.0) >= 0.0:
            return None
        phases = np.geomspace(1e-4, np.pi, FREQUENCY_POINTS, endpoint=False)
        values = self.open_loop(phases).imag
        bracket = np.flatnonzero(values[:-1] * values[1:] < 0)
        low, high, sign = phases[bracket], phases[bracket + 1], np.sign(values[bracket])
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            before = self.open_loop(middle).imag * sign > 0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        ratios = self.open_loop(np.append((low + high) / 2, np.pi)).real
        below, above = ratios[(ratios > 0) & (ratios < 1)], ratios[ratios >= 1]
        return float(np.max(below, initial=0.0)), float(np.min(above, initial=math.inf))

    def disturbance_gain(self, ratio: float, frequency_rad_s: float) -> float:
        """|theta / d| at one frequency for a held disturbance torque d = M_n times unit acceleration, s^2."""
        T = self.law.sample_period_s
        A = self.transition(ratio)
        drive = np.zeros(A.shape[0])
        drive[:2] = ratio / 2, ratio
        z = np.exp(1j * frequency_rad_s * T)
        return float(T**2 * np.abs(np.linalg.solve(z * np.eye(A.shape[0]) - A, drive)[0]))

    def command_activity(self, ratio: float) -> float:
        """Standard deviation of the command's increment per sample for unit white noise on the angle, 1/s^2.

        Infinite when the loop is unstable. The covariance ``X = sum_k A^k b b' A'^k`` is summed by doubling.
        """
        if self.growth_rate(ratio) >= 0.0:
            return math.inf
        A = self.transition(ratio)
        noise = A[:, 0] - np.eye(A.shape[0])[0]  # the noise enters the controller, not the plant
        newest = 2 + self._controller.order
        increment = A[newest].copy()
        increment[newest] -= 1.0
        covariance, power = np.outer(noise, noise), A
        for _ in range(DOUBLINGS):
            covariance = covariance + power @ covariance @ power.T
            power = power @ power
        variance = increment @ covariance @ increment + A[newest, 0] ** 2
        return float(np.sqrt(variance) / self.law.sample_period_s**2)
