"""The law `motor-pid` of one joint as exact polynomials, and its loop with one elastic joint as a matrix of balls.

Time is counted in samples, ``zeta = z - 1``. From the motor's angle y and the correction c_2 of its reference the law
commands the acceleration

    D a = N y - R c_2,    c_2 = Lambda u,    Lambda = (1 - p)^2 z / (z - p)^2,    p = exp(-w_c T)

with u how far the gear is wound: ``u = beta a`` by the motor's torque, beta = B/K as the law has them, ``u = beta f``
by a sensor of the torque B f of the joint, ``u = y - q`` by encoders on both sides. By the motor's torque that makes it
``(D + beta R Lambda) a = N y``. D, N and R are those of its whole realisation:
nothing is cancelled, and what a root of the loop hides in is in D.

Written from the formulas of the law, not from the design's own loop: the two are compared by tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Literal, TypeAlias

from flint import arb, arb_mat, fmpq, fmpq_mat, fmpq_poly

from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.polynomials import is_schur_enclosed
from quasilpv.certificate.gate.loop import exponential_poles

ANCHOR_BITS = 512
Z_OF_ZETA = fmpq_poly([1, 1])

CorrectionSource: TypeAlias = Literal["motor-torque", "joint-torque", "deflection"]

Realisation: TypeAlias = tuple[fmpq_mat, fmpq_mat, fmpq_mat, fmpq_mat, tuple[fmpq, fmpq]]
"""A, its columns for y and c_2, the row of a, and what a takes of y and c_2 at once."""


@dataclass(frozen=True)
class MotorLoopData:
    """The numbers of `motor-pid` that decide its frozen loop, as shipped.

    Attributes:
        sample_period_s: T > 0.
        feedback: (kp, kd, ki).
        observer: (l1, l2, l3, l4).
        correction_rad_s: w_c; 0 for no correction.
        rotors, stiffness: B and K of every joint.
        source: what tells the correction.
    """

    sample_period_s: float
    feedback: tuple[float, float, float]
    observer: tuple[float, float, float, float]
    correction_rad_s: float
    rotors: tuple[float, ...]
    stiffness: tuple[float, ...]
    source: CorrectionSource = "motor-torque"

    @property
    def period(self) -> fmpq:
        """T, exactly."""
        return rational(self.sample_period_s)

    @property
    def windings(self) -> tuple[fmpq, ...]:
        """beta of every joint, in samples squared; 0 without correction."""
        if self.correction_rad_s == 0.0:
            return (fmpq(0),) * len(self.rotors)
        pairs = zip(self.rotors, self.stiffness, strict=True)
        return tuple(rational(B) / rational(K) / self.period**2 for B, K in pairs)

    @cached_property
    def correction_poles(self) -> tuple[fmpq, ...]:
        """The doubles on either side of p, one of which any C library returns: what is proved is proved for both."""
        if self.correction_rad_s == 0.0:
            return (fmpq(1),)
        return exponential_poles(-self.correction_rad_s * self.sample_period_s)

    @cached_property
    def realisation(self) -> Realisation:
        """States: predicted angle, speed, disturbance and its rate, and the integral if anything reads it."""
        T = self.period
        kp, kd, ki = (rational(gain) * T**power for gain, power in zip(self.feedback, (2, 1, 3), strict=True))
        l1, l2, l3, l4 = (rational(gain) * T**power for power, gain in enumerate(self.observer))
        n = 4 if ki == 0 else 5

        def unit(k: int) -> list[fmpq]:
            return [fmpq(int(i == k)) for i in range(n + 2)]  # the states, then y and c_2

        def total(*parts: tuple[fmpq | int, list[fmpq]]) -> list[fmpq]:
            return [sum((share * row[i] for share, row in parts), fmpq(0)) for i in range(n + 2)]

        y, c2 = unit(n), unit(n + 1)
        innovation = total((1, y), (-1, unit(0)))
        angle, speed, disturbance, rate = (
            total((1, unit(k)), (gain, innovation)) for k, gain in enumerate((l1, l2, l3, l4))
        )
        integral = [unit(4)] if n == 5 else []
        command = total((kp, angle), (-kp, c2), (kd, speed), *((ki, row) for row in integral))
        applied = total((1, command), (1, disturbance))
        rows = [
            total((1, angle), (1, speed), (fmpq(1, 2), applied), (fmpq(1, 6), rate)),
            total((1, speed), (1, applied), (fmpq(1, 2), rate)),
            total((1, disturbance), (1, rate)),
            rate,
            *(total((1, row), (1, y), (-1, c2)) for row in integral),
        ]
        A = fmpq_mat([row[:n] for row in rows])
        columns = [fmpq_mat([[row[k]] for row in rows]) for k in (n, n + 1)]
        return A, columns[0], columns[1], fmpq_mat([command[:n]]), (command[n], command[n + 1])

    @cached_property
    def polynomials(self) -> tuple[fmpq_poly, fmpq_poly, fmpq_poly]:
        """D, N and R in zeta, by ``det(z - A + b c) = det(z - A) (1 + c (z - A)^-1 b)``."""
        A, by_angle, by_correction, row, (direct, corrected) = self.realisation
        D = A.charpoly()
        N = (A - by_angle * row).charpoly() - D + D * direct
        R = D - (A - by_correction * row).charpoly() - D * corrected
        return D(Z_OF_ZETA), N(Z_OF_ZETA), R(Z_OF_ZETA)

    def is_stable_with(self, plant: OneJoint) -> bool:
        """Whether the loop of every joint with this plant is proved stable; False where balls are too wide."""
        cases = product(dict.fromkeys(self.windings), self.correction_poles)
        return all(is_schur_enclosed(self.loop(plant, beta, pole).charpoly()) for beta, pole in cases)

    def loop(self, plant: OneJoint, winding: fmpq, pole: fmpq) -> arb_mat:
        """The map of all states from a sample to the next.

        States: plant, law, both lags of the correction, commands on their way, the youngest first.

        Args:
            plant: a joint; its rotor is the law's.
            winding: beta.
            pole: p.
        """
        A, by_angle, by_correction, row, (direct, corrected) = self.realisation
        whole = int(plant.delay.floor())
        late = plant.delay - whole
        before, by_old = plant.held(late)
        after, by_new = plant.held(1 - late)
        own, inner, waiting = before.nrows(), A.nrows(), whole + 1
        size = own + inner + 2 + waiting
        lags, queue = own + inner, own + inner + 2
        command = arb_mat(1, size)
        command[0, 1] = arb(direct)
        for i in range(inner):
            command[0, own + i] = arb(row[0, i])
        command[0, lags + 1] = arb(corrected)
        late_command, early_command = arb_mat(1, size), command
        late_command[0, queue + whole] = arb(1)
        if whole > 0:
            early_command = arb_mat(1, size)
            early_command[0, queue + whole - 1] = arb(1)
        first = _placed(after * before, size) + by_new * early_command + after * by_old * late_command
        angle = arb_mat(1, size)
        angle[0, 1] = arb(1)
        correction = arb_mat(1, size)
        correction[0, lags + 1] = arb(1)
        law = _placed(arb_mat(A), size, own) + arb_mat(by_angle) * angle + arb_mat(by_correction) * correction
        lagging = self._told(plant, winding, command) * arb(1 - pole)
        lagging[0, lags] = lagging[0, lags] + arb(pole)
        follows = lagging * arb(1 - pole)
        follows[0, lags + 1] = follows[0, lags + 1] + arb(pole)
        shifted = [command, *(_unit(queue + i, size) for i in range(waiting - 1))]
        return _stacked([first, law, lagging, follows, *shifted])

    def _told(self, plant: OneJoint, winding: fmpq, command: arb_mat) -> arb_mat:
        """The row of u."""
        told = arb_mat(1, command.ncols())
        if self.source == "motor-torque":
            return command * arb(winding)
        told[0, 0], told[0, 1] = arb(-1), arb(1)
        if self.source == "joint-torque":
            told[0, 2], told[0, 3] = arb(-plant.damping), arb(plant.damping)
            told *= arb(winding / plant.winding)
        # Without correction nothing is told: its pole is 1.
        return told


@dataclass(frozen=True)
class OneJoint:
    """Link, gear and motor of one joint over the motor's inertia, in samples.

    Attributes:
        link: M / B.
        winding: B / K.
        damping: D / K.
        delay, lag: of the drive.
    """

    link: fmpq
    winding: fmpq
    damping: fmpq
    delay: fmpq
    lag: fmpq

    def held(self, time: fmpq) -> tuple[arb_mat, arb_mat]:
        """Transition of (q, th, w, v, the drive's acceleration) over a time, and what a held command adds."""
        lags = self.lag > 0
        n = 5 if lags else 4
        flow = fmpq_mat(n + 1, n + 1)
        flow[0, 2] = flow[1, 3] = fmpq(1)
        for row, inertia in ((2, self.link), (3, fmpq(1))):
            sign = 1 if row == 2 else -1
            for column, share in ((0, fmpq(-1)), (1, fmpq(1)), (2, -self.damping), (3, self.damping)):
                flow[row, column] = sign * share / self.winding / inertia
        if lags:
            flow[3, 4] = fmpq(1)
            flow[4, 4], flow[4, 5] = -1 / self.lag, 1 / self.lag
        else:
            flow[3, 4] = fmpq(1)
        moved = (arb_mat(flow) * arb(time)).exp()
        transition = arb_mat(n, n, [moved[i, j] for i in range(n) for j in range(n)])
        return transition, arb_mat(n, 1, [moved[i, n] for i in range(n)])


def _placed(block: arb_mat, columns: int, at: int = 0) -> arb_mat:
    wide = arb_mat(block.nrows(), columns)
    for i in range(block.nrows()):
        for j in range(block.ncols()):
            wide[i, at + j] = block[i, j]
    return wide


def _unit(at: int, size: int) -> arb_mat:
    row = arb_mat(1, size)
    row[0, at] = arb(1)
    return row


def _stacked(parts: Sequence[arb_mat]) -> arb_mat:
    columns = parts[0].ncols()
    entries = [part[i, j] for part in parts for i in range(part.nrows()) for j in range(columns)]
    return arb_mat(sum(part.nrows() for part in parts), columns, entries)
