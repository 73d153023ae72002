"""Stability of the frozen loop of `motor-pid` on all elastic arms of a set, by exclusion of roots on the unit circle.

At a posture links and motors are, at a frequency w and over the square roots of the motors' inertias B (time in
samples, b = B/K, eta = D/K; f the torques of the springs, a the commanded accelerations, th the motors' angles)

    Z f = c a,    w^2 th = f - c a,    Z = 1 + M^-1 - w^2 Y,    Y = diag(b / (1 + i eta w)),
    c = alpha exp(-i w (1/2 + d)) / (1 + i w s),    alpha = sin(w/2) / (w/2)

for a command that is held over a sample, late by d and through drives that lag by s. A root ``z = exp(i phi)`` of the
sampled loop is such a motion with the frequencies ``w_k = phi + 2 pi k`` together. Its angles at the samples are

    th = g a + c Z^-1 a / phi^2 + E a,    |E| <= sum over k /= 0 of |c_k| / (w_k^2 dist_k)

with g the sampled rotor alone, known exactly, then the springs at k = 0, and dist_k how far the numerical range of Z
keeps from 0 at w_k. With the law ``D a = N th`` and ``P = phi^2 (D - N g)`` this is

    P Z f = c N f + phi^2 N E Z f.

Let f have length one. Then ``zeta = f* Z f`` lies in the numerical range of Z, which lies in a polygon known from
``m1 B <= M <= m2 B`` and the intervals of b and eta; and with n = |Z f|

    |P zeta - c N| <= phi^2 |N E| n,    n <= |c N| / (|P| - phi^2 |N E|).

That no zeta of the polygon does this is decided on cells of (phi, d, s) in ball arithmetic: then no root crosses the
circle anywhere in the set, and one stable member makes all of them stable. What differs between the joints, the
correction by the motors' torques (by B/K) and the true inertia of the motors (by a tolerance), is a diagonal part of D
that counts as E does. A correction by sensors is ``D a = N th - R Lambda u`` with ``u = Y f`` at k = 0 for encoders on
both sides and ``u = beta f`` for sensors of the torque, and ``|u| <= b2 (|f| + sum over k /= 0 of |c_k| / dist_k |a|)``
with the larger of the b of the set and of the law: it adds ``phi^2 |c R Lambda| b2 (1 + n sum / |c|)``.

No modes are formed: the numerical range of a sum lies in the sum of the numerical ranges. As phi -> 0 P and c N become
one, and the polygon keeps from 1 by ``1 / m2``; z = -1 is the end of the last cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import inf

import numpy as np
from flint import acb, acb_poly, arb, ctx, fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.exclusion import (
    Cell,
    by_whole_samples,
    centred,
    interval_ball,
    middle,
    sampled_plant,
    width,
)
from quasilpv.certificate.gate.loop import Interval
from quasilpv.certificate.gate.motor_loop import ANCHOR_BITS, MotorLoopData, OneJoint

BITS = 96
MAX_CELLS = 40_000
ALIASES = 3
"""Terms k = -3 .. 3 of the sum over k are bounded one by one, the others together."""

LOOKED_AT = 120
DIRECTIONS = np.exp(1j * np.linspace(-np.pi, np.pi, 96, endpoint=False))
FINE_DIRECTIONS = np.exp(1j * np.linspace(-1.0, 1.0, 33) * 2.0 * np.pi / 96)
LOWEST_PHASE = 1e-3
"""Frequencies that are looked at alone before cells are made: where nothing is left at a point, no cell ends."""


@dataclass(frozen=True)
class ElasticSet:
    """All elastic arms a law is to be stable on; inertias over those of the rotors as the law has them, in samples.

    Attributes:
        links: m1 and m2 with ``m1 B <= M(q) <= m2 B``; 0 < m1.
        windings: smallest and largest B/K.
        dampings: smallest and largest D/K.
        rotor_tolerance: the largest share by which a true rotor may differ from the law's.
        delay, lag: of the drives.
    """

    links: Interval
    windings: Interval
    dampings: Interval
    rotor_tolerance: fmpq
    delay: Interval
    lag: Interval

    @property
    def compliances(self) -> Interval:
        """Least and largest of ``M^-1``, over the true rotors."""
        low, high = self.links
        return (1 - self.rotor_tolerance) / high, (1 + self.rotor_tolerance) / low

    @property
    def true_windings(self) -> Interval:
        """Of the true rotors."""
        low, high = self.windings
        return low * (1 - self.rotor_tolerance), high * (1 + self.rotor_tolerance)

    def member(self) -> OneJoint:
        """One arm of the set: all joints alike, each on its own."""
        low, high = self.links
        mean = rational(float(np.sqrt(to_float(low) * to_float(high))))
        link = min(max(mean, low), high)
        return OneJoint(link, middle(self.windings), middle(self.dampings), self.delay[1], self.lag[1])


@dataclass(frozen=True)
class Exclusion:
    """What became of it.

    Attributes:
        proved: no root can cross, and a member of the set is stable.
        anchored: that member is stable.
        cells: that were looked at.
        given_up_rad_s: the frequency where a root could not be excluded; None if there is none.
        spare: the least of what was left on a cell of what had to be kept apart, relative.
    """

    proved: bool
    anchored: bool
    cells: int = 0
    given_up_rad_s: float | None = None
    spare: float = 0.0


class TwoMassExclusion:
    """A law against a set.

    Args:
        data: the law.
        plants: the set.
    """

    def __init__(self, data: MotorLoopData, plants: ElasticSet) -> None:
        """Make the law's polynomials."""
        self.data, self.plants = data, plants
        betas = data.windings if data.source == "motor-torque" else (fmpq(0),)
        self.winding, self.spread = (max(betas) + min(betas)) / 2, (max(betas) - min(betas)) / 2
        with ctx.workprec(BITS):
            self.denominator, self.numerator, self.corrected = (acb_poly(part) for part in data.polynomials)
            self.sensed = arb(0)
            if data.source != "motor-torque" and data.correction_rad_s > 0.0:
                widest = (plants.true_windings[1], max(data.windings) * (1 + plants.rotor_tolerance))
                self.sensed = arb(max(widest))
            first, *others = (arb(pole) for pole in data.correction_poles)
            self.pole = first.union(others[0]) if others else first

    def decide(self, budget: int = MAX_CELLS) -> Exclusion:
        """Prove it, or say where it was given up.

        Args:
            budget: cells after which it stays unknown.
        """
        with ctx.workprec(ANCHOR_BITS):
            if not self.data.is_stable_with(self.plants.member()):
                return Exclusion(False, False)
        with ctx.workprec(BITS):
            given_up = self._hopeless()
            if given_up is not None:
                return Exclusion(False, True, 0, self._rate(given_up))
            return self._covered(budget)

    def distances(self, rates_rad_s: FloatArray) -> FloatArray:
        """Numerical: what is left at single frequencies with the longest delay and lag, (N,); 0 for nothing.

        Args:
            rates_rad_s: (N,), up to pi / T.
        """
        delay, lag = self.plants.delay[1], self.plants.lag[1]
        whole = int(delay.floor())
        found = []
        with ctx.workprec(BITS):
            for rate in rates_rad_s.tolist():
                phase = rational(rate) * self.data.period
                cell = Cell((phase, phase), (delay - whole, delay - whole), (lag, lag))
                found.append(_Enclosed(self, cell, whole).spare())
        return np.array(found)

    def _covered(self, budget: int) -> Exclusion:
        """Frequencies [0, pi], all delays and lags."""
        looked_at, least = 0, inf
        for whole, delay in by_whole_samples(self.plants.delay):
            pending = [Cell((fmpq(0), arb.pi().upper().fmpq()), delay, self.plants.lag)]
            while pending:
                cell = pending.pop()
                looked_at += 1
                if looked_at > budget:
                    return Exclusion(False, True, looked_at, self._rate(middle(cell.phase)))
                spare = _Enclosed(self, cell, whole).spare()
                if spare > 0.0:
                    least = min(least, spare)
                else:
                    pending += cell.parts()
        return Exclusion(True, True, looked_at, None, least)

    def _hopeless(self) -> fmpq | None:
        """A frequency at which nothing is left even without a cell around it."""
        phases = [rational(float(phase)) for phase in np.geomspace(LOWEST_PHASE, np.pi, LOOKED_AT)]
        for delay, lag in dict.fromkeys(product(self.plants.delay, self.plants.lag)):
            whole = int(delay.floor())
            for phase in phases:
                cell = Cell((phase, phase), (delay - whole, delay - whole), (lag, lag))
                if _Enclosed(self, cell, whole).spare() <= 0.0:
                    return phase
        return None

    def _rate(self, phase: fmpq) -> float:
        return to_float(phase) / self.data.sample_period_s


class _Enclosed:
    """The terms of the equation over c, enclosed on a cell.

    ``G = phi^2 D / c`` with the mean correction in D, ``-phi^2 g = c (1 + delta)``, ``P / c = G + N (1 + delta)``; then
    ``(P zeta - c N) / c = P (zeta - 1) / c + G + N delta``, whose terms are small at low frequencies.
    """

    def __init__(self, law: TwoMassExclusion, cell: Cell, whole: int) -> None:
        """Enclose them."""
        plants, tolerance = law.plants, law.plants.rotor_tolerance
        centre, radius = middle(cell.phase), width(cell.phase) / 2
        zeta = acb(arb(centre).cos() - 1, arb(centre).sin())
        self.box = zeta + acb(arb(0, arb(radius)), arb(0, arb(radius)))
        self.plants, self.cell, self.phase = plants, cell, interval_ball(cell.phase)
        self.square = self.phase**2
        self.alpha = (self.phase / 2).sinc()
        self.lagging = 1 + acb(0, self.phase * interval_ball(cell.lag))
        turn = acb(0, self.phase * (interval_ball(cell.delay) + whole + fmpq(1, 2))).exp()
        corrected = centred(law.corrected, zeta, radius) * _lags(law.pole, self.box + 1)
        D = centred(law.denominator, zeta, radius) + corrected * arb(law.winding)
        self.N = centred(law.numerator, zeta, radius)
        self.G = D * turn * self.lagging * (self.square / self.alpha)
        self.N_delta = self.N * self._delta()
        self.P = self.G + self.N + self.N_delta
        differs = D.abs_upper() * arb(tolerance) + corrected.abs_upper() * arb(law.spread * (1 + tolerance))
        aliased = self.N.abs_upper() * _aliases(self.phase, plants)
        sensed = corrected.abs_upper() * law.sensed
        told = sensed * _sensed_aliases(self.phase, plants) if sensed > 0 else arb(0)
        self.apart = (self.square * (aliased + told + differs * self.lagging.abs_upper()) / self.alpha).upper()
        self.lost = (self.square * sensed).upper()

    def spare(self) -> float:
        """What is left of the distance between the polygon and what has to be kept, relative; 0 if nothing is.

        Where P keeps from 0 the equation is divided by it: corners far out, as light links have, take nothing from it.
        """
        corners, kept = [corner - 1 for corner in self._polygon()], self.lost + self.apart * self._length()
        if self.P.abs_lower() > 0:
            away = (self.G + self.N_delta) / self.P
            corners, kept = [corner + away for corner in corners], (kept / self.P.abs_lower()).upper()
        else:
            corners = [self.P * corner + self.G + self.N_delta for corner in corners]
        turn = acb(_direction(corners))
        found = min(((turn * corner).real.lower() for corner in corners), key=float) / turn.abs_upper()
        return float((found - kept).lower()) if found > kept else 0.0

    def _length(self) -> arb:
        """A bound of n: from the equation, or that of Z."""
        bound = (1 + arb(self.plants.compliances[1]) + self.square * arb(self.plants.true_windings[1])).upper()
        rest = self.P.abs_lower() - self.apart
        if rest > 0:
            found = ((self.N.abs_upper() + self.lost) / rest).upper()
            return found if found < bound else bound
        return bound

    def _delta(self) -> acb:
        """The rotor's own aliases: bounded by their sum, or from its transfer function, whichever says more."""
        size = (self.square * _aliases(self.phase, None) / self.alpha).upper()
        turn = acb(0, self.phase * (interval_ball(self.cell.delay) - fmpq(3, 2))).exp()
        direct = sampled_plant(self.box, self.cell.delay, self.cell.lag) * turn * self.lagging / self.alpha**3 - 1
        return direct if direct.real.rad() < size else acb(arb(0, size), arb(0, size))

    def _polygon(self) -> list[acb]:
        """Corners around the numerical range of Z, at every frequency of the cell.

        ``1 / (1 + i x)`` runs on a circle; its arc between x1 and x2 lies in the triangle of its ends and of the point
        where the tangents there meet.
        """
        x1, x2 = (arb(end) * self.phase for end in self.plants.dampings)
        ends = [acb(1, -x) / (1 + x**2) for x in (x1, x2)]
        tangents = acb(1, -(x1 + x2) / 2) / (1 + x1 * x2)
        squares = [self.square * arb(b) for b in self.plants.true_windings]
        return [
            1 + arb(mu) - y * square for mu in self.plants.compliances for y in (*ends, tangents) for square in squares
        ]


def _lags(pole: arb, z: acb) -> acb:
    """Lambda; on the unit circle it is at most one."""
    found = z * ((1 - pole) / (z - pole)) ** 2
    return found if found.is_finite() and found.abs_upper() < 2 else acb(arb(0, 1), arb(0, 1))


def _aliases(phase: arb, plants: ElasticSet | None) -> arb:
    """Upper bound of the sum over k /= 0 of ``|sin(phi/2) / (phi/2 + pi k)| / (w_k^2 dist_k)``; dist_k = 1 without set.

    Of ``|k| > ALIASES`` the terms are at most ``|sin| / (4 pi^3 (|k| - 1/2)^3 dist)``, and ``(k - 1/2)^-3``, convex, is
    at most the mean of x^-3 between k - 1 and k.
    """
    pi = arb.pi()
    total = arb(0)
    for k in (*range(-ALIASES, 0), *range(1, ALIASES + 1)):
        rate = abs(phase + 2 * pi * k)
        total += 2 / rate**3 / _kept_from_zero(rate.lower(), plants)
    beyond = _kept_from_zero((pi * (2 * ALIASES + 1)).lower(), plants)
    total += 1 / (4 * pi**3 * ALIASES**2) / beyond
    return (abs((phase / 2).sin()) * total).upper()


def _sensed_aliases(phase: arb, plants: ElasticSet) -> arb:
    """Upper bound of the sum over k /= 0 of ``|sin(phi/2) / (phi/2 + pi k)| / dist_k``.

    Of ``|k| > ALIASES`` the imaginary part grows with the frequency at least as the frequency does, so that the terms
    are at most ``|sin| w_K / (2 pi^2 (|k| - 1/2)^2 dist_K)``, and the sum as in `_aliases`.
    """
    pi = arb.pi()
    total = arb(0)
    for k in (*range(-ALIASES, 0), *range(1, ALIASES + 1)):
        rate = abs(phase + 2 * pi * k)
        total += 2 / rate / _kept_from_zero(rate.lower(), plants)
    first = (pi * (2 * ALIASES + 1)).lower()
    total += first / (pi**2 * ALIASES) / _imaginary_part(first, plants)
    return (abs((phase / 2).sin()) * total).upper()


def _imaginary_part(rate: arb, plants: ElasticSet) -> arb:
    """Lower bound of that of Z."""
    square = arb(plants.true_windings[0]) * rate**2
    parts = [(x / (1 + x**2) * square).lower() for x in (arb(end) * rate for end in plants.dampings)]
    return min(parts, key=float)


def _kept_from_zero(rate: arb, plants: ElasticSet | None) -> arb:
    """Lower bound of the distance of the numerical range of Z from 0 at this frequency and all higher ones.

    Its imaginary part is at least ``b w^2 x / (1 + x^2)``, x = eta w; its real part at most ``1 + 1/m1 - b w^2 / (1 +
    x^2)``; and it lies in the cone of the arguments from 0 to ``pi - atan x``, to the right of 1 along its axis.
    """
    if plants is None:
        return arb(1)
    x1, x2 = (arb(end) * rate for end in plants.dampings)
    square = arb(plants.true_windings[0]) * rate**2
    candidates = [
        _imaginary_part(rate, plants),
        (square / (1 + x2**2) - 1 - arb(plants.compliances[1])).lower(),
        ((x1.atan() / 2).sin()).lower(),
    ]
    return max(candidates, key=float) if max(map(float, candidates)) > 0.0 else arb(0)


def _direction(corners: list[acb]) -> complex:
    """Of a line that parts 0 from the corners, with the most room beside their balls."""
    middles = np.array([complex(corner.mid()) for corner in corners])
    radii = np.array([float(corner.real.rad()) + float(corner.imag.rad()) for corner in corners])
    if not (np.isfinite(middles).all() and np.isfinite(radii).all()):
        return 1.0
    room = (DIRECTIONS[:, None] * middles[None, :]).real - radii
    best = int(room.min(axis=1).argmax())
    fine = DIRECTIONS[best] * FINE_DIRECTIONS
    room = (fine[:, None] * middles[None, :]).real - radii
    return complex(fine[room.min(axis=1).argmax()])
