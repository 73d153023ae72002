"""The frozen sampled closed loop of the acceleration-level law, and what can be read off it.

With torque ``M_n(z) a`` on a plant of inertia ``M_t``, the loop of n joints decouples exactly, in the coordinates that
diagonalise ``M_t^-1 M_n``, into n copies of one scalar loop

    theta'' = mu a,    mu an eigenvalue of M_t^-1 M_n,

so every question about the robust stability of the frozen loop is a question about the single number ``mu``. The
controller (estimator, disturbance filter, integral, feedback) is a fixed linear system from theta to a; the plant is
the exact zero-order-hold double integrator, its command delayed by any time, behind drives that may lag.

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
    """One scalar loop: the law against ``theta'' = mu b`` with the command delayed by ``delay_s``.

    Here b = a, or ``lag_s b' = a - b``. The state is (theta, theta', b if the drives lag, the controller's states, the
    ``floor(delay/T) + 1`` commands still on their way).
    """

    law: AccelerationLaw
    delay_s: float = 0.0
    lag_s: float = 0.0

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
        coasting, by_new, by_old = self._plant(ratio, late)
        moving = len(coasting)
        first = moving + c.order  # of the commands
        size = first + whole + 1
        command = np.zeros(size)
        command[0], command[moving:first] = c.D, c.C
        commands = [command, *np.eye(size)[first:]]  # newest first; commands[i] was issued i samples ago
        new, old = commands[whole], commands[whole + 1]
        following = np.zeros((size, size))
        following[:moving, :moving] = coasting
        following[:moving] += np.outer(by_new, new) + np.outer(by_old, old)
        following[moving:first, 0], following[moving:first, moving:first] = c.B, c.A
        for i in range(whole + 1):
            following[first + i] = commands[i]
        return following

    def _plant(self, ratio: float, late: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One sample of the plant: its own map, and what the new and the old command do (from and until `late`)."""
        if self.lag_s == 0.0:
            new, old = np.array([(1.0 - late) ** 2 / 2, 1.0 - late]), np.array([late - late**2 / 2, late])
            return np.array([[1.0, 1.0], [0.0, 1.0]]), ratio * new, ratio * old
        (first, by_old), (then, by_new) = (self._held(ratio, time) for time in (late, 1.0 - late))
        return then @ first, by_new, then @ by_old

    def _held(self, ratio: float, time: float) -> tuple[FloatArray, FloatArray]:
        """(theta, theta', b) after some samples of time, and what a constant command adds to it."""
        s = self.lag_s / self.law.sample_period_s
        decay = math.exp(-time / s)
        speed = s * (1.0 - decay)  # of theta, for b = 1 that decays
        angle = s * (time - speed)
        free = np.array([[1.0, time, ratio * angle], [0.0, 1.0, ratio * speed], [0.0, 0.0, decay]])
        return free, np.array([ratio * (time**2 / 2 - angle), ratio * (time - speed), 1.0 - decay])

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

    def open_loop(self, phase: FloatArray, radius: float = 1.0) -> ComplexArray:
        """Loop transfer L at ``z = radius e^{j phase}`` per unit mu: there is a pole at z where ``mu L = 1``."""
        whole, late = self._delay
        z: ComplexArray = np.asarray(radius * np.exp(1j * phase), dtype=complex)
        shift = z - 1.0
        position = (1.0 - late) ** 2 / 2 + (late - late**2 / 2) / z
        speed = (1.0 - late) + late / z
        plant = (position * shift + speed) / shift**2 / z**whole + self._lagging(z, late) / z**whole
        c = self._controller
        system = z[:, None, None] * np.eye(c.order) - c.A
        response = np.linalg.solve(system, np.broadcast_to(c.B, (z.size, c.order))[..., None])[..., 0]
        return np.asarray(plant * (response @ c.C + c.D))

    def _lagging(self, z: ComplexArray, late: float) -> ComplexArray:
        """What the lag adds to the transfer of the plant: ``1/(p^2 (1 + s p)) - 1/p^2 = s^2/(1 + s p) - s/p``, held."""
        if self.lag_s == 0.0:
            return np.zeros_like(z)
        s, early = self.lag_s / self.law.sample_period_s, 1.0 - late
        pole, left = math.exp(-1.0 / s), math.exp(-early / s)
        return np.asarray(
            s**2 * ((1.0 - left) * z + left - pole) / (z * (z - pole)) - s * (early * z + late) / (z * (z - 1.0))
        )

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
        drive[:2] = ratio / 2, ratio  # the disturbance acts on the arm, not through the drives
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
        newest = len(A) - 1 - self._delay[0]
        increment = A[newest].copy()
        increment[newest] -= 1.0
        covariance, power = np.outer(noise, noise), A
        for _ in range(DOUBLINGS):
            covariance = covariance + power @ covariance @ power.T
            power = power @ power
        variance = increment @ covariance @ increment + A[newest, 0] ** 2
        return float(np.sqrt(variance) / self.law.sample_period_s**2)
