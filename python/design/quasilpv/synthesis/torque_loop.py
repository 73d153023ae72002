"""The frozen sampled closed loop of the torque-level law `dob-torque`, for many configurations and plants at once.

At a fixed configuration the law with gains K, L and design inertia M, against a plant of inertia M_t, is a linear map
from one sample to the next. Coriolis torque and the gradient of the mismatch of gravity are left out: they are
disturbances. Time is counted in samples here, so torques are in kg m^2 rad per sample squared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
_DOUBLINGS = 18


@dataclass(frozen=True, eq=False)
class FrozenLaw:
    """The law at B configurations.

    Attributes:
        sample_period_s: T.
        filter_time_constant_s: T_f of the disturbance filter.
        inertia: design inertia M, (B, n, n), kg m^2.
        feedback: [Kp Kd KI], (B, n, 3n), SI.
        observer: [L1; L2; L3; L4], (B, 4n, n), SI.
    """

    sample_period_s: float
    filter_time_constant_s: float
    inertia: FloatArray
    feedback: FloatArray
    observer: FloatArray

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.inertia.shape[-1])


@dataclass(frozen=True, eq=False)
class TorqueLoop:
    """The law against plants of inertia ``plant_inertia`` with the torque delayed by ``delay_s``.

    The state is (theta, omega; th_hat, w_hat, d_hat, dd_hat; d_f; e_I; the ``floor(delay/T) + 1`` torques on their way,
    newest first), n entries each.

    Attributes:
        law: at B configurations.
        plant_inertia: M_t, (B, n, n), kg m^2.
        delay_s: transport delay.
        transition: per-sample map, (B, S, S).
        drive: effect of a constant disturbance torque (SI) over one sample, (B, S, n).
        noise: effect of an error of the measured angle, (B, S, n).
        torque: the commanded torque (SI) as a function of the state, (B, n, S); of the measured angle in its first
            n columns.
    """

    law: FrozenLaw
    plant_inertia: FloatArray
    delay_s: float = 0.0
    transition: FloatArray = field(init=False)
    drive: FloatArray = field(init=False)
    noise: FloatArray = field(init=False)
    torque: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Compose one sample from the equations of the law and of the plant."""
        n, T = self.law.joints, self.law.sample_period_s
        samples = self.delay_s / T
        queue = math.floor(samples + 1e-12)
        late = max(0.0, samples - queue)
        size = n * (9 + queue)
        signals = np.broadcast_to(
            np.eye(size).reshape(9 + queue, n, size), (len(self.plant_inertia), 9 + queue, n, size)
        )
        theta, omega = signals[:, 0], signals[:, 1]
        command, estimate = self._controller(signals)
        torques = [command, *(signals[:, 8 + k] for k in range(queue + 1))]
        mobility = np.linalg.inv(self.plant_inertia)
        new, old = mobility @ torques[queue], mobility @ torques[queue + 1]
        position = theta + omega + (1.0 - late) ** 2 / 2.0 * new + (late - late**2 / 2.0) * old
        speed = omega + (1.0 - late) * new + late * old
        transition = np.concatenate([position, speed, *estimate, *torques[: queue + 1]], axis=1)
        drive = np.zeros((len(mobility), size, n))
        drive[:, :n], drive[:, n : 2 * n] = mobility * T**2 / 2.0, mobility * T**2
        noise = transition[:, :, :n].copy()  # the error enters the controller where theta does, and not the plant
        noise[:, :n] -= np.eye(n)
        for name, value in (("transition", transition), ("drive", drive), ("noise", noise), ("torque", command / T**2)):
            object.__setattr__(self, name, value)

    def _controller(self, signals: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Torque and next controller state (six signals) of one step, as maps of the loop's state."""
        law, T, n = self.law, self.law.sample_period_s, self.law.joints
        y, (angle, speed, disturbance, rate, filtered, integral) = signals[:, 0], signals[:, 2:8].swapaxes(0, 1)
        L = law.observer.reshape(-1, 4, n, n) * (T ** np.arange(1.0, 5.0))[:, None, None]
        K = law.feedback.reshape(-1, n, 3, n).swapaxes(1, 2) * np.array([T**2, T, T**3])[:, None, None]
        innovation = np.linalg.solve(np.eye(n) + L[:, 0], y - angle)
        corrections = (gain @ innovation for gain in L.swapaxes(0, 1))
        angle, speed, disturbance, rate = (
            x + dx for x, dx in zip((angle, speed, disturbance, rate), corrections, strict=True)
        )
        pole = math.exp(-T / law.filter_time_constant_s)
        filtered = pole * filtered + (1.0 - pole) * disturbance
        command = K[:, 0] @ angle + K[:, 1] @ speed + K[:, 2] @ integral - filtered
        acceleration = np.linalg.solve(law.inertia, command + disturbance)
        jerk = np.linalg.solve(law.inertia, rate)
        following = (
            angle + speed + acceleration / 2.0 + jerk / 6.0,
            speed + acceleration + jerk / 2.0,
            disturbance + rate,
            rate,
            filtered,
            integral + y,
        )
        return command, following

    def growth_rates(self) -> FloatArray:
        """``log(spectral radius) / T`` of every loop, (B,), 1/s; negative when stable."""
        radius = np.abs(np.linalg.eigvals(self.transition)).max(axis=1)
        return np.asarray(np.log(radius) / self.law.sample_period_s)

    def disturbance_gains(self, frequency_rad_s: float) -> FloatArray:
        """Largest singular value of theta / d for a disturbance torque d at one frequency, (B,), rad/(N m)."""
        z = np.exp(1j * frequency_rad_s * self.law.sample_period_s)
        response = np.linalg.solve(z * np.eye(self.transition.shape[-1]) - self.transition, self.drive)
        return np.asarray(np.linalg.norm(response[:, : self.law.joints], ord=2, axis=(1, 2)))

    def torque_activity(self) -> FloatArray:
        """Rms torque increment per sample (Euclidean norm over the joints) for unit white noise on every angle, (B,).

        In N m per rad. The covariance ``X = sum_k A^k b b' A'^k`` is summed by doubling; meaningless for an unstable
        loop.
        """
        n = self.law.joints
        covariance, power = self.noise @ self.noise.swapaxes(1, 2), self.transition
        newest = slice(8 * n, 9 * n)
        increment = self.torque.copy()
        increment[:, :, newest] -= np.eye(n) / self.law.sample_period_s**2
        for _ in range(_DOUBLINGS):
            covariance = covariance + power @ covariance @ power.swapaxes(1, 2)
            power = power @ power
        direct = self.torque[:, :, :n]
        variance = np.einsum("bij,bjk,bik->b", increment, covariance, increment) + (direct**2).sum(axis=(1, 2))
        return np.asarray(np.sqrt(variance))
