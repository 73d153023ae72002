"""The frozen sampled loop of `motor-pid` on an arm with elastic joints: all joints together, for they do not decouple.

At a posture, without gravity's gradient and Coulomb friction, links and motors are

    M q'' = K (th - q) + D (v - w),    B th'' = B a(t - d) - K (th - q) - D (v - w)

with a the commanded acceleration, held over a sample; its zero-order hold is exact, by the matrix exponential. The law
of one joint is a fixed linear system from the motor's angle to a.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import block_diag, expm

from quasilpv.arrays import FloatArray

STATES = 7
"""Of the law of one joint."""


@dataclass(frozen=True, eq=False)
class MotorLaw:
    """The numbers of `motor-pid` that decide its loop.

    Attributes:
        sample_period_s: T.
        feedback: (kp, kd, ki), acting on x - x_r.
        observer: (l1, l2, l3, l4).
        rotors, stiffness: B and K as the law has them, (n,).
        correction_rad_s: bandwidth of the correction of the motors' reference.
        source: what tells it: "motor-torque", "joint-torque" or "deflection".
    """

    sample_period_s: float
    feedback: FloatArray
    observer: FloatArray
    rotors: FloatArray
    stiffness: FloatArray
    correction_rad_s: float
    source: Literal["motor-torque", "joint-torque", "deflection"] = "motor-torque"

    def state_space(self, joint: int) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """``x+ = A x + b th``, ``a = c x + d th`` of a joint; what sensors tell of its gear comes on top (`sensed`).

        States: predicted angle, speed, disturbance and its rate, integral, and both lags of the correction.
        """
        T, rows = self.sample_period_s, np.eye(STATES + 1)
        predicted, integral, lagging, correction, angle = rows[:4], rows[4], rows[5], rows[6], rows[7]
        corrected = predicted + np.outer(self.observer, angle - predicted[0])
        kp, kd, ki = self.feedback
        command = kp * (corrected[0] - correction) + kd * corrected[1] + ki * integral
        applied = command + corrected[2]
        share = 1.0 - math.exp(-self.correction_rad_s * T)
        told = self.rotors[joint] / self.stiffness[joint] * command if self.source == "motor-torque" else 0.0 * command
        lagging = lagging + share * (told - lagging)
        following = np.array(
            [
                corrected[0] + T * corrected[1] + T**2 / 2.0 * applied + T**3 / 6.0 * corrected[3],
                corrected[1] + T * applied + T**2 / 2.0 * corrected[3],
                corrected[2] + T * corrected[3],
                corrected[3],
                integral + T * (angle - correction) if ki != 0.0 else 0.0 * integral,  # a sum that nothing reads
                lagging,
                correction + share * (lagging - correction),
            ]
        )
        return following[:, :STATES], following[:, STATES], command[:STATES], float(command[STATES])

    @property
    def sensed(self) -> FloatArray:
        """What a joint's states take of how far its gear is wound, as sensors tell it, (7,)."""
        share = 1.0 - math.exp(-self.correction_rad_s * self.sample_period_s)
        entries = np.zeros(STATES)
        if self.source != "motor-torque":
            entries[5:] = share, share**2
        return entries


@dataclass(frozen=True, eq=False)
class ElasticPlant:
    """An arm at a posture.

    Attributes:
        links: M, (n, n).
        rotors, stiffness, damping: B, K, D, (n,).
        lag_s: time constant of the drives.
        torque_gain: s of drives that control the torque in their joints, whose torque follows
            ``s command + (1 - s) spring``; 1: their torque is their command.
    """

    links: FloatArray
    rotors: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    lag_s: float = 0.0
    torque_gain: float = 1.0

    def wound(self, law: MotorLaw) -> FloatArray:
        """How far the gears are wound, as the law's sensors tell it, from the states, (n, order)."""
        n = len(self.rotors)
        rows = np.zeros((n, self.order))
        if law.source == "deflection":
            rows[:, : 2 * n] = np.hstack([-np.eye(n), np.eye(n)])
        elif law.source == "joint-torque":
            pull, drag = np.diag(self.stiffness / law.stiffness), np.diag(self.damping / law.stiffness)
            rows[:, : 4 * n] = np.hstack([-pull, pull, -drag, drag])
        return rows

    @property
    def order(self) -> int:
        """Number of states."""
        return (4 if self.lag_s == 0.0 else 5) * len(self.rotors)

    def held(self, time_s: float, assumed_rotors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transition of (q, th, w, v) over a time, and what a held command adds, (4 n, 4 n) and (4 n, n).

        Of drives that lag the accelerations by which they drive are states too, (5 n, 5 n) and (5 n, n).
        """
        n = len(self.rotors)
        pull, drag = np.diag(self.stiffness), np.diag(self.damping)
        from_springs = np.block([[-pull, pull, -drag, drag], [pull, -pull, drag, -drag]])
        inverse = np.linalg.inv(self.links)
        accelerations = np.vstack([inverse @ from_springs[:n], from_springs[n:] / self.rotors[:, None]])
        size = self.order
        extended = np.zeros((size + n, size + n))
        extended[: 2 * n, 2 * n : 4 * n] = np.eye(2 * n)
        extended[2 * n : 4 * n, : 4 * n] = accelerations
        # Drives follow `wanted`, of the plant's states and the command.
        wanted = np.zeros((n, 5 * n))
        wanted[:, : 4 * n] = (self.torque_gain - 1.0) * from_springs[n:] / assumed_rotors[:, None]
        wanted[:, 4 * n :] = self.torque_gain * np.eye(n)
        driven = np.diag(assumed_rotors / self.rotors)
        if self.lag_s > 0.0:
            extended[3 * n : 4 * n, 4 * n : 5 * n] = driven
            extended[4 * n : 5 * n, 4 * n : 5 * n] = -np.eye(n) / self.lag_s
            extended[4 * n : 5 * n, : 4 * n] = wanted[:, : 4 * n] / self.lag_s
            extended[4 * n : 5 * n, 5 * n :] = wanted[:, 4 * n :] / self.lag_s
        else:
            extended[3 * n : 4 * n] += driven @ wanted
        flow = expm(extended * time_s)
        return flow[:size, :size], flow[:size, size:]


def growth_rate(law: MotorLaw, plant: ElasticPlant, delay_s: float) -> float:
    """``log(spectral radius) / T`` of the frozen loop, 1/s; negative when stable. See `loop_matrix`."""
    return float(np.log(np.abs(np.linalg.eigvals(loop_matrix(law, plant, delay_s))).max()) / law.sample_period_s)


def loop_matrix(law: MotorLaw, plant: ElasticPlant, delay_s: float) -> FloatArray:
    """The map of all states from a sample to the next: plant, law joint by joint, commands on their way.

    Args:
        law: the scalars.
        plant: the arm.
        delay_s: transport delay.
    """
    n, T = len(plant.rotors), law.sample_period_s
    whole = math.floor(delay_s / T + 1e-12)
    late = max(0.0, delay_s - whole * T)
    before, by_old = plant.held(late, law.rotors)
    after, by_new = plant.held(T - late, law.rotors)
    A, b, c, d = zip(*(law.state_space(joint) for joint in range(n)), strict=True)
    own = plant.order
    angle = np.zeros((n, own))
    angle[:, n : 2 * n] = np.eye(n)
    states = own + STATES * n
    size = states + n * (whole + 1)
    command = np.zeros((n, size))
    command[:, :own] = np.diag(d) @ angle
    command[:, own:states] = block_diag(*(row[None] for row in c))
    on_its_way = [command, *np.eye(size)[states:].reshape(whole + 1, n, size)]
    following = np.zeros((size, size))
    following[:own, :own] = after @ before
    following[:own] += by_new @ on_its_way[whole] + after @ by_old @ on_its_way[whole + 1]
    following[own:states, :own] = block_diag(*(column[:, None] for column in b)) @ angle
    following[own:states, :own] += np.kron(plant.wound(law), law.sensed[:, None])
    following[own:states, own:states] = block_diag(*A)
    for i in range(whole + 1):
        following[states + i * n : states + (i + 1) * n] = on_its_way[i]
    return following
