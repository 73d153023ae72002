"""The frozen sampled closed loop of a linear law and a plant with transport delay, for many configurations at once.

At a fixed configuration a law against a plant of inertia M_t is a linear map from one sample to the next. Coriolis
torque and the gradient of the mismatch of gravity are left out: they are disturbances. A law that does not compensate
gravity has it in its loop, as a stiffness H with G(theta) = H theta. The joints need not decouple.
Time is counted in samples inside, so torques are in kg m^2 rad per sample squared.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from quasilpv.arrays import FloatArray

_DOUBLINGS = 18
_SERIES_TERMS = 10  # of the motion under a stiffness; enough while its fastest mode is slower than the sample rate


class FrozenLaw(Protocol):
    """A tracking law with zero reference, frozen at B configurations."""

    @property
    def sample_period_s(self) -> float:
        """T."""

    @property
    def states(self) -> int:
        """How many signals of n entries the law keeps from one sample to the next."""

    @property
    def measured(self) -> int:
        """1 if it reads the angles, 2 if it reads angles and speeds."""

    def step(self, theta: FloatArray, omega: FloatArray, state: FloatArray, /) -> tuple[FloatArray, list[FloatArray]]:
        """One sample, time counted in samples.

        Args:
            theta: measured angles, as maps of the state of the loop, (B, n, S).
            omega: measured speeds, likewise; ignored by a law that reads angles only.
            state: the law's signals, (B, states, n, S).

        Returns:
            The torque, (B, n, S), and the next signals, (B, n, S) each.
        """


@dataclass(frozen=True, eq=False)
class FrozenLoop:
    """A law against plants of inertia ``plant_inertia`` with the torque delayed by ``delay_s``.

    The state is (theta, omega; the signals of the law; the ``floor(delay/T) + 1`` torques on their way, newest first),
    n entries each. The plant ``M_t theta'' = Gamma - H theta`` is sampled exactly; without H it is a double integrator.

    Attributes:
        law: at B configurations.
        plant_inertia: M_t, (B, n, n), kg m^2.
        delay_s: transport delay.
        stiffness: H, (B, n, n), N m/rad; None for none.
        transition: per-sample map, (B, S, S).
        drive: effect of a constant disturbance torque (SI) over one sample, (B, S, n).
        noise: effect of errors of what is measured, angles (rad) and then speeds (rad/s), (B, S, measured n).
        torque: the commanded torque (SI) as a function of the state, (B, n, S); of what is measured in its first
            columns.
    """

    law: FrozenLaw
    plant_inertia: FloatArray
    delay_s: float = 0.0
    stiffness: FloatArray | None = None
    transition: FloatArray = field(init=False)
    drive: FloatArray = field(init=False)
    noise: FloatArray = field(init=False)
    torque: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Compose one sample from the equations of the law and of the plant."""
        batch, n, _ = self.plant_inertia.shape
        T, first_torque = self.law.sample_period_s, 2 + self.law.states
        samples = self.delay_s / T
        queue = math.floor(samples + 1e-12)
        late = max(0.0, samples - queue)
        count = first_torque + 1 + queue
        size = n * count
        signals = np.broadcast_to(np.eye(size).reshape(count, n, size), (batch, count, n, size))
        theta, omega = signals[:, 0], signals[:, 1]
        command, following = self.law.step(theta, omega, signals[:, 2:first_torque])
        torques = [command, *(signals[:, first_torque + k] for k in range(queue + 1))]
        mobility = np.linalg.inv(self.plant_inertia)
        new, old = mobility @ torques[queue], mobility @ torques[queue + 1]
        free, forced = self._motion(1.0)
        after, by_new = self._motion(1.0 - late)
        _, by_old = self._motion(late)
        motion = free @ np.concatenate([theta, omega], axis=1) + by_new @ new + after @ by_old @ old
        transition = np.concatenate([motion, *following, *torques[: queue + 1]], axis=1)
        drive = np.zeros((batch, size, n))
        drive[:, : 2 * n] = forced @ mobility * T**2
        # Errors enter the law where theta and omega do, and not the plant.
        noise = transition[:, :, : self.law.measured * n].copy()
        noise[:, : 2 * n] -= free[:, :, : noise.shape[2]]
        noise *= self._per_unit_measured
        for name, value in (("transition", transition), ("drive", drive), ("noise", noise), ("torque", command / T**2)):
            object.__setattr__(self, name, value)

    def _motion(self, duration: float) -> tuple[FloatArray, FloatArray]:
        """(theta, omega) after a time, in samples, as maps of what they were and of a constant acceleration."""
        batch, n, _ = self.plant_inertia.shape
        if self.stiffness is None:
            free = np.kron([[1.0, duration], [0.0, 1.0]], np.eye(n))
            forced = np.kron([[duration**2 / 2.0], [duration]], np.eye(n))
            return np.broadcast_to(free, (batch, *free.shape)), np.broadcast_to(forced, (batch, *forced.shape))
        # cos and sin of the square root of X = M^-1 H, and the integral of the latter, by their power series in X.
        X = np.linalg.solve(self.plant_inertia, self.stiffness) * (self.law.sample_period_s * duration) ** 2
        term = np.broadcast_to(np.eye(n), X.shape)
        cosine, sine, integral = np.zeros((3, *X.shape))
        for k in range(_SERIES_TERMS):
            cosine = cosine + term / math.factorial(2 * k)
            sine = sine + duration * term / math.factorial(2 * k + 1)
            integral = integral + duration**2 * term / math.factorial(2 * k + 2)
            term = -term @ X
        slope = -X @ sine / duration**2 if duration > 0.0 else np.zeros(X.shape)
        return np.block([[cosine, sine], [slope, cosine]]), np.concatenate([integral, sine], axis=1)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.plant_inertia.shape[-1])

    @property
    def _per_unit_measured(self) -> FloatArray:
        """Radians, and radians per sample, of one unit of each measured quantity, (measured n,)."""
        return np.repeat([1.0, self.law.sample_period_s][: self.law.measured], self.joints)

    def growth_rates(self) -> FloatArray:
        """``log(spectral radius) / T`` of every loop, (B,), 1/s; negative when stable."""
        radius = np.abs(np.linalg.eigvals(self.transition)).max(axis=1)
        return np.asarray(np.log(radius) / self.law.sample_period_s)

    def disturbance_gains(self, frequency_rad_s: float, unit: FloatArray | None = None) -> FloatArray:
        """Largest singular value of ``F' H F`` at one frequency, (B,), H the response of theta to a torque.

        Without F this is |theta / d| in rad/(N m). With F a factor of a reference inertia ``M = F F'`` the disturbance
        is counted as an acceleration of that inertia: for a law that decouples against M the result is the largest of
        the scalar gains ``|theta / a|``, s^2.

        Args:
            frequency_rad_s: of a sampled sine.
            unit: F, (B, n, n).
        """
        z = np.exp(1j * frequency_rad_s * self.law.sample_period_s)
        response = np.linalg.solve(z * np.eye(self.transition.shape[-1]) - self.transition, self.drive)
        gains = response[:, : self.joints]
        if unit is not None:
            gains = unit.swapaxes(1, 2) @ gains @ unit
        return np.asarray(np.linalg.norm(gains, ord=2, axis=(1, 2)))

    def torque_activity(self, deviations: Sequence[float]) -> FloatArray:
        """Rms torque increment per sample (Euclidean norm over the joints), (B,), N m; only for a stable loop.

        All joints carry independent white noise. The covariance ``X = sum_k A^k b b' A'^k`` is summed by doubling.

        Args:
            deviations: standard deviations of the measured angles (rad) and, if the law reads them, speeds (rad/s).
        """
        n = self.joints
        deviation = np.repeat(np.asarray(deviations, dtype=float), n)
        noise = self.noise * deviation
        covariance, power = noise @ noise.swapaxes(1, 2), self.transition
        newest = slice(n * (2 + self.law.states), n * (3 + self.law.states))
        increment = self.torque.copy()
        increment[:, :, newest] -= np.eye(n) / self.law.sample_period_s**2
        for _ in range(_DOUBLINGS):
            covariance = covariance + power @ covariance @ power.swapaxes(1, 2)
            power = power @ power
        direct = self.torque[:, :, : deviation.size] * self._per_unit_measured * deviation
        variance = np.einsum("bij,bjk,bik->b", increment, covariance, increment) + (direct**2).sum(axis=(1, 2))
        return np.asarray(np.sqrt(variance))
