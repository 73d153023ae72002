"""One sample of every control law, from the formulas.

n joints, T the sample period, y and w_y the measured angles and speeds, (r, r', r'') the reference, M and G the design
inertia and gravity at y. Every law ends in the same output stage: saturate, then limit the change against the last
torque (the first torque has none), and the integral of joint j is frozen while the limits cut off what its integral
action is pushing towards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from quasilpv.arrays import FloatArray

Model = Callable[[FloatArray], FloatArray]
SpeedModel = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Sample:
    """Input of one step."""

    angle: FloatArray
    speed: FloatArray
    reference_angle: FloatArray
    reference_speed: FloatArray
    reference_acceleration: FloatArray


@dataclass(frozen=True)
class Answer:
    """Output of one step; ``summands`` are the terms of the torque, whose largest magnitude scales tolerances."""

    torque_commanded: FloatArray
    torque_applied: FloatArray
    estimated_disturbance: FloatArray
    summands: tuple[FloatArray, ...]

    @property
    def scale(self) -> float:
        return max(float(np.max(np.abs(term))) for term in self.summands)


@dataclass
class OutputStage:
    """gamma = clip(clip(u, +-limit), last +- slew T)."""

    torque_nm: FloatArray
    slew_nm_per_s: FloatArray
    T: float
    last: FloatArray | None = None

    def apply(self, torque: FloatArray) -> FloatArray:
        limited = np.clip(torque, -self.torque_nm, self.torque_nm)
        if self.last is not None:
            change = self.slew_nm_per_s * self.T
            limited = np.clip(limited, self.last - change, self.last + change)
        self.last = limited
        return limited


def integrate(integral: FloatArray, error: FloatArray, gain: FloatArray, T: float, cut_off: FloatArray) -> FloatArray:
    """e_I + T e, except where the torque cut off by the limits has the direction of gain * e."""
    winds_up = cut_off * gain * error > 0.0
    return np.where(winds_up, integral, integral + T * error)


@dataclass
class DobAcceleration:
    """Feedback, disturbance observer and exact prediction, all in acceleration coordinates."""

    kp: float
    kd: float
    ki: float
    observer: tuple[float, float, float, float]
    T_f: float
    inertia: Model
    gravity: Model
    output: OutputStage
    compensate: bool = True
    x: list[FloatArray] = field(default_factory=list)

    def step(self, s: Sample) -> Answer:
        T, (l1, l2, l3, l4), y = self.output.T, self.observer, s.angle
        if not self.x:
            self.x = [y.copy(), *(np.zeros_like(y) for _ in range(5))]
        th, w, a_d, j_d, d_f, e_I = self.x
        innovation = y - th
        th, w = th + l1 * innovation, w + l2 * innovation
        a_d, j_d = a_d + l3 * innovation, j_d + l4 * innovation
        q = np.exp(-T / self.T_f)
        d_f = q * d_f + (1.0 - q) * a_d
        M, G = self.inertia(y), self.gravity(y)
        terms = [
            s.reference_acceleration,
            -d_f if self.compensate else np.zeros_like(d_f),
            self.kp * (th - s.reference_angle),
            self.kd * (w - s.reference_speed),
            self.ki * e_I,
        ]
        commanded = M @ np.asarray(sum(terms)) + G
        applied = self.output.apply(commanded)
        estimate = a_d
        e_I = integrate(e_I, y - s.reference_angle, np.full_like(y, self.ki), T, commanded - applied)
        a = np.linalg.solve(M, applied - G) + a_d
        th = th + T * w + T**2 / 2 * a + T**3 / 6 * j_d
        w = w + T * a + T**2 / 2 * j_d
        self.x = [th, w, a_d + T * j_d, j_d, d_f, e_I]
        summands = (*(np.abs(M) @ np.abs(term) for term in terms), np.abs(M) @ np.abs(l3 * innovation), G)
        return Answer(commanded, applied, estimate, summands)


@dataclass
class DobTorque:
    """Scheduled feedback K = [Kp Kd KI], scheduled observer L and exact prediction, in torque coordinates.

    The correction is the linear equation it solves, x - x_hat = T L (y - C x); the prediction is the exponential of the
    nilpotent chain th' = w, w' = M^-1 (gamma - G) + (beta M)^-1 d, d' = dd: the equations of motion times beta, where
    u = beta (gamma - G) is designed.
    """

    feedback: Model
    observer: Model
    T_f: float
    inertia: Model
    gravity: Model
    output: OutputStage
    premultiplication: Model | None = None
    x: FloatArray | None = None
    d_f: FloatArray | None = None
    integral: FloatArray | None = None

    def step(self, s: Sample) -> Answer:
        T, y, n = self.output.T, s.angle, s.angle.size
        zero = np.zeros(n)
        x = np.concatenate([y, zero, zero, zero]) if self.x is None else self.x
        d_f, e_I = (zero if held is None else held for held in (self.d_f, self.integral))
        M, G, K, L = self.inertia(y), self.gravity(y), self.feedback(y), self.observer(y)
        implicit = np.eye(4 * n)
        implicit[:, :n] += T * L
        correction = np.linalg.solve(implicit, T * L @ (y - x[:n]))
        x = x + correction
        q = np.exp(-T / self.T_f)
        d_f = q * d_f + (1.0 - q) * x[2 * n : 3 * n]
        error = np.concatenate([x[:n] - s.reference_angle, x[n : 2 * n] - s.reference_speed, e_I])
        beta = np.eye(n) if self.premultiplication is None else self.premultiplication(y)
        terms = (beta @ M @ s.reference_acceleration, -d_f, K @ error, beta @ G)
        to_joints = np.linalg.inv(beta)
        commanded = to_joints @ np.asarray(sum(terms))
        applied = self.output.apply(commanded)
        estimate = to_joints @ x[2 * n : 3 * n]
        integral_gain = np.diag(to_joints @ K[:, 2 * n :])
        self.integral = integrate(e_I, y - s.reference_angle, integral_gain, T, commanded - applied)
        A = np.zeros((4 * n, 4 * n))
        A[:n, n : 2 * n] = A[2 * n : 3 * n, 3 * n :] = np.eye(n)
        mobility = np.linalg.inv(M)
        A[n : 2 * n, 2 * n : 3 * n] = np.linalg.inv(beta @ M)
        x = x + T * A @ x + T**2 / 2 * A @ A @ x + T**3 / 6 * A @ A @ A @ x
        x[:n] += T**2 / 2 * mobility @ (applied - G)
        x[n : 2 * n] += T * mobility @ (applied - G)
        self.x, self.d_f = x, d_f
        # What solving with beta makes of rounding: |beta^-1| |beta| |x| (Skeel 1979), x = beta^-1 summand.
        solved = np.abs(to_joints) @ np.abs(beta) @ np.abs(to_joints)
        joint_terms = (solved @ np.abs(term) for term in (*terms, np.abs(K) @ np.abs(error)))
        summands = (*joint_terms, np.abs(correction))
        return Answer(commanded, applied, estimate, summands)


@dataclass
class SpeedFilter:
    """Low-pass filter of the measured speed from the first sample on: w <- q w + (1 - q) w_y, q = exp(-T/T_f)."""

    q: float
    w: FloatArray | None = None

    def apply(self, measured: FloatArray) -> FloatArray:
        self.w = measured if self.w is None else self.q * self.w + (1.0 - self.q) * measured
        return self.w


@dataclass
class HinfTracking:
    """u = K (y - r, w - r', int (y - r)), K = Y E^-T P^-1, E = diag(I, M, I) (Dehak 2022, III.39 and III.43)."""

    numerator: Model
    lyapunov: FloatArray
    inertia: Model
    speed_filter: SpeedFilter
    output: OutputStage
    integral: FloatArray | None = None

    def step(self, s: Sample) -> Answer:
        w, n = self.speed_filter.apply(s.speed), s.angle.size
        integral = np.zeros_like(w) if self.integral is None else self.integral
        E = np.eye(3 * n)
        E[n : 2 * n, n : 2 * n] = self.inertia(s.angle)
        K = self.numerator(s.angle) @ np.linalg.inv(self.lyapunov @ E)  # E = E', so E^-T P^-1 = (P E)^-1
        error = s.angle - s.reference_angle
        state = np.concatenate([error, w - s.reference_speed, integral])
        commanded = K @ state
        applied = self.output.apply(commanded)
        self.integral = integrate(integral, error, np.diag(K[:, 2 * n :]), self.output.T, commanded - applied)
        return Answer(commanded, applied, np.zeros_like(w), (np.abs(K) @ np.abs(state),))


@dataclass
class StateFeedback:
    """u = K(z) x with x = (y - r, w - r'), z of angles and filtered speeds; K may depend on the past of z.

    ``gain`` is called once per sample, in order, with (y, w).
    """

    gain: SpeedModel
    speed_filter: SpeedFilter
    output: OutputStage

    def step(self, s: Sample) -> Answer:
        w = self.speed_filter.apply(s.speed)
        state = np.concatenate([s.angle - s.reference_angle, w - s.reference_speed])
        K = self.gain(s.angle, w)
        commanded = K @ state
        applied = self.output.apply(commanded)
        return Answer(commanded, applied, np.zeros_like(w), (np.abs(K) @ np.abs(state),))


@dataclass
class Window:
    """The last N + 1 weights: their mean by the trapezoidal rule over N sample periods, and the first of them.

    N = 0 is the limit of a short window. Before the first sample the weights count as constant.
    """

    periods: int
    past: list[FloatArray] = field(default_factory=list)

    def moved(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.past = [*(self.past or [weights] * (self.periods + 1)), weights][-self.periods - 1 :]
        if self.periods == 0:
            return weights, weights
        return np.asarray(np.trapezoid(self.past, axis=0) / self.periods), self.past[0]


@dataclass
class Pid:
    """u = kp e + kd (r' - w) + ki int e + M r'' + N(y, w) r' + G with e = r - y (Dehak 2022, III.54)."""

    kp: FloatArray
    kd: FloatArray
    ki: FloatArray
    inertia: Model
    coriolis_reference: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    gravity: Model
    speed_filter: SpeedFilter
    output: OutputStage
    integral: FloatArray | None = None

    def step(self, s: Sample) -> Answer:
        w = self.speed_filter.apply(s.speed)
        integral = np.zeros_like(w) if self.integral is None else self.integral
        error = s.reference_angle - s.angle
        summands = (
            self.kp * error,
            self.kd * (s.reference_speed - w),
            self.ki * integral,
            self.inertia(s.angle) @ s.reference_acceleration,
            self.coriolis_reference(s.angle, w, s.reference_speed),
            self.gravity(s.angle),
        )
        commanded = np.asarray(sum(summands))
        applied = self.output.apply(commanded)
        self.integral = integrate(integral, error, self.ki, self.output.T, commanded - applied)
        return Answer(commanded, applied, np.zeros_like(w), summands)


@dataclass
class ComputedTorque:
    """u = M (r'' + gp e + gd (r' - w) + gi int e - a_hat) + N(y, w) w + G with e = r - y.

    Dehak 2022, III.56, with the sign of the estimate corrected. The disturbance observer of bandwidth c compares the
    speed reached with the speed the model predicts over one sample:
    a_hat+ = q a_hat + (1 - q) ((w+ - w)/T - M^-1 (gamma_applied - N w - G)), q = exp(-c T), from a_hat = 0.
    """

    gp: FloatArray
    gd: FloatArray
    gi: FloatArray
    bandwidth: float
    inertia: Model
    coriolis: SpeedModel
    gravity: Model
    speed_filter: SpeedFilter
    output: OutputStage
    integral: FloatArray | None = None
    a_hat: FloatArray | None = None
    before: tuple[FloatArray, FloatArray] | None = None

    def step(self, s: Sample) -> Answer:
        T = self.output.T
        w = self.speed_filter.apply(s.speed)
        integral = np.zeros_like(w) if self.integral is None else self.integral
        a_hat = self._observe(w)
        error = s.reference_angle - s.angle
        M, bias = self.inertia(s.angle), self.coriolis(s.angle, w) + self.gravity(s.angle)
        terms = [
            s.reference_acceleration,
            self.gp * error,
            self.gd * (s.reference_speed - w),
            self.gi * integral,
            -a_hat,
        ]
        commanded = M @ np.asarray(sum(terms)) + bias
        applied = self.output.apply(commanded)
        self.integral = integrate(integral, error, self.gi, T, commanded - applied)
        self.a_hat, self.before = a_hat, (w, np.asarray(np.linalg.solve(M, applied - bias), dtype=np.float64))
        summands = (*(np.abs(M) @ np.abs(term) for term in terms), bias)
        return Answer(commanded, applied, M @ a_hat, summands)

    def _observe(self, w: FloatArray) -> FloatArray:
        if self.a_hat is None or self.before is None:
            return np.zeros_like(w)
        w_before, predicted = self.before
        q = np.exp(-self.bandwidth * self.output.T)
        reached = (w - w_before) / self.output.T
        return np.asarray(q * self.a_hat + (1.0 - q) * (reached - predicted))
