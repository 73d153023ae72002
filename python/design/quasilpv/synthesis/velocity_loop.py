"""The frozen sampled closed loop of the laws that read measured speeds, for many configurations and plants at once.

At a fixed configuration PID and computed torque, with or without disturbance observer, are linear: with the measured
angle y, the measured speed w and its filtered value w_f,

    w_f <- q w_f + (1 - q) w,   a_hat = zeta + kappa w_f,   Gamma = -Kp y - Kd w_f + Ki e_I - M a_hat
    e_I <- e_I - T y,           zeta <- q_o zeta - (1 - q_o) (M^-1 Gamma + kappa w_f)

(``docs/reference/formats.md``, law kinds). With diagonal gains the joints do not decouple, so nothing here assumes it.
Coriolis torque and the gradient of the mismatch of gravity are left out: they are disturbances. Time is counted in
samples inside, so torques are in kg m^2 rad per sample squared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
_DOUBLINGS = 18


@dataclass(frozen=True, eq=False)
class VelocityFeedback:
    """A law at B configurations, SI.

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


@dataclass(frozen=True, eq=False)
class VelocityLoop:
    """The law against plants of inertia ``plant_inertia`` with the torque delayed by ``delay_s``.

    The state is (theta, omega; w_f, e_I, zeta if there is an observer; the ``floor(delay/T) + 1`` torques on their
    way, newest first), n entries each.

    Attributes:
        law: at B configurations.
        plant_inertia: M_t, (B, n, n), kg m^2.
        delay_s: transport delay.
        transition: per-sample map, (B, S, S).
        drive: effect of a constant disturbance torque (SI) over one sample, (B, S, n).
        noise: effect of errors of the measured angles (rad) and speeds (rad/s), (B, S, 2n).
        torque: the commanded torque (SI) as a function of the state, (B, n, S); of measured angles and speeds in its
            first 2n columns.
    """

    law: VelocityFeedback
    plant_inertia: FloatArray
    delay_s: float = 0.0
    transition: FloatArray = field(init=False)
    drive: FloatArray = field(init=False)
    noise: FloatArray = field(init=False)
    torque: FloatArray = field(init=False)
    _newest: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compose one sample from the equations of the law and of the plant."""
        batch, n, _ = self.plant_inertia.shape
        T = self.law.sample_period_s
        samples = self.delay_s / T
        queue = math.floor(samples + 1e-12)
        late = max(0.0, samples - queue)
        own = 3 if self.law.observer_bandwidth_rad_s > 0.0 else 2
        count = 3 + own + queue
        size = n * count
        signals = np.broadcast_to(np.eye(size).reshape(count, n, size), (batch, count, n, size))
        theta, omega = signals[:, 0], signals[:, 1]
        command, following = self._controller(signals, own)
        torques = [command, *(signals[:, 2 + own + k] for k in range(queue + 1))]
        mobility = np.linalg.inv(self.plant_inertia)
        new, old = mobility @ torques[queue], mobility @ torques[queue + 1]
        position = theta + omega + (1.0 - late) ** 2 / 2.0 * new + (late - late**2 / 2.0) * old
        speed = omega + (1.0 - late) * new + late * old
        transition = np.concatenate([position, speed, *following, *torques[: queue + 1]], axis=1)
        drive = np.zeros((batch, size, n))
        drive[:, :n], drive[:, n : 2 * n] = mobility * T**2 / 2.0, mobility * T**2
        noise = transition[:, :, : 2 * n].copy()  # errors enter the controller where theta and omega do, not the plant
        noise[:, : 2 * n] -= np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(n))
        noise[:, :, n:] *= T
        values = {"transition": transition, "drive": drive, "noise": noise, "torque": command / T**2}
        for name, value in {**values, "_newest": slice(n * (2 + own), n * (3 + own))}.items():
            object.__setattr__(self, name, value)

    def _controller(self, signals: FloatArray, own: int) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Torque and next controller state (``own`` signals) of one step, as maps of the loop's state."""
        law, T = self.law, self.law.sample_period_s
        y, omega, filtered, integral = signals[:, 0], signals[:, 1], signals[:, 2], signals[:, 3]
        pole = math.exp(-T / law.filter_time_constant_s) if law.filter_time_constant_s > 0.0 else 0.0
        filtered = pole * filtered + (1.0 - pole) * omega
        command = T**3 * law.integral @ integral - T**2 * law.proportional @ y - T * law.derivative @ filtered
        if own == 2:
            return command, (filtered, integral - y)
        zeta = signals[:, 4]
        observer_pole = math.exp(-law.observer_bandwidth_rad_s * T)
        gain = 1.0 - observer_pole
        command = command - law.inertia @ (zeta + gain * filtered)
        known = np.linalg.solve(law.inertia, command)
        return command, (filtered, integral - y, observer_pole * zeta - gain * (known + gain * filtered))

    def growth_rates(self) -> FloatArray:
        """``log(spectral radius) / T`` of every loop, (B,), 1/s; negative when stable."""
        radius = np.abs(np.linalg.eigvals(self.transition)).max(axis=1)
        return np.asarray(np.log(radius) / self.law.sample_period_s)

    def disturbance_gains(self, frequency_rad_s: float, unit: FloatArray) -> FloatArray:
        """Gain from disturbance to angle at one frequency, (B,), s^2.

        The disturbance is counted as an acceleration of a reference inertia ``M = F F'``: largest singular value of
        ``F' H F``, H the response of theta to a torque. For a law that decouples against M this is the largest of the
        scalar gains ``|theta / a|``.

        Args:
            frequency_rad_s: of a sampled sine.
            unit: F, lower triangular, (B, n, n).
        """
        z = np.exp(1j * frequency_rad_s * self.law.sample_period_s)
        response = np.linalg.solve(z * np.eye(self.transition.shape[-1]) - self.transition, self.drive)
        weighted = unit.swapaxes(1, 2) @ response[:, : self.plant_inertia.shape[-1]] @ unit
        return np.asarray(np.linalg.norm(weighted, ord=2, axis=(1, 2)))

    def torque_activity(self, angle_noise_rad: float, speed_noise_rad_s: float) -> FloatArray:
        """Rms torque increment per sample (Euclidean norm over the joints), (B,), N m; only for a stable loop.

        Angles and speeds of all joints carry independent white noise of these standard deviations. The covariance
        ``X = sum_k A^k b b' A'^k`` is summed by doubling.
        """
        n = self.plant_inertia.shape[-1]
        deviation = np.repeat([angle_noise_rad, speed_noise_rad_s], n)
        noise = self.noise * deviation
        covariance, power = noise @ noise.swapaxes(1, 2), self.transition
        increment = self.torque.copy()
        increment[:, :, self._newest] -= np.eye(n) / self.law.sample_period_s**2
        for _ in range(_DOUBLINGS):
            covariance = covariance + power @ covariance @ power.swapaxes(1, 2)
            power = power @ power
        per_unit = np.repeat([1.0, self.law.sample_period_s], n)  # omega is counted per sample inside
        direct = self.torque[:, :, : 2 * n] * per_unit * deviation
        variance = np.einsum("bij,bjk,bik->b", increment, covariance, increment) + (direct**2).sum(axis=(1, 2))
        return np.asarray(np.sqrt(variance))
