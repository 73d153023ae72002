"""Stability of the frozen loop over a whole box of inertia ratios, delays and lags, by exclusion.

The roots of the characteristic polynomial are continuous in the inertia ratio rho, in the transport delay d and in the
time constant s of drives that lag. So if the loop is stable at one point of a box of these and has no root on the unit
circle anywhere in it, it is stable on all of it. A root ``z = e^(i phi)`` means

    rho = W,    W = N_c N / (D_c z^(w+1) zeta^2),    zeta = z - 1,

with the sampled plant N of `quasilpv.certificate.gate.loop`, and W is enclosed in ball arithmetic on cells of
(phi, d, s) until no cell can hold a ratio of the box. Delay and lag are the same for all joints: only then do the loops
of the joints stay apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly

from quasilpv.certificate.gate.loop import NO_LAG, ZETA, AccelerationLoopData, Controller, Interval, Z

MAX_CELLS = 100_000
BITS = 128


@dataclass(frozen=True)
class Cell:
    """Phases, the part of the delay beyond whole samples, and lags, all in samples."""

    phase: Interval
    delay: Interval
    lag: Interval

    def parts(self) -> tuple[Cell, Cell]:
        """Both halves, cut where W turns most.

        W ~ zeta^-5 turns five times as fast as zeta in frequency, and by phi in delay and lag.
        """
        low, high = self.phase
        if 4 * (high - low) > high * high * max(width(self.delay), width(self.lag)):
            return Cell((low, middle(self.phase)), self.delay, self.lag), Cell(
                (middle(self.phase), high), self.delay, self.lag
            )
        if width(self.delay) >= width(self.lag):
            (first, last), cut = self.delay, middle(self.delay)
            return Cell(self.phase, (first, cut), self.lag), Cell(self.phase, (cut, last), self.lag)
        (first, last), cut = self.lag, middle(self.lag)
        return Cell(self.phase, self.delay, (first, cut)), Cell(self.phase, self.delay, (cut, last))


@dataclass(frozen=True)
class StabilityBox:
    """The loop over inertia ratios [lowest, highest] and lags, to be shown free of roots on the unit circle.

    Attributes:
        numerator: N_c as a polynomial in zeta with ball coefficients that hold both neighbours of the filter pole.
        denominator: ``D_c zeta^2 z``, likewise.
        lowest, highest: smallest and largest ratio.
        lag: shortest and longest time constant of the drives, in samples.
    """

    numerator: acb_poly
    denominator: acb_poly
    lowest: fmpq
    highest: fmpq
    lag: Interval = NO_LAG

    @classmethod
    def of(cls, data: AccelerationLoopData, lowest: fmpq, highest: fmpq, lag: Interval = NO_LAG) -> StabilityBox:
        """Enclose the controllers of both filter poles; coefficients are affine in the pole."""
        first, second = (Controller.of(data, pole) for pole in data.filter_poles())
        numerator = _hull(first.numerator, second.numerator)
        denominator = _hull(first.denominator * ZETA**2 * Z, second.denominator * ZETA**2 * Z)
        return cls(numerator, denominator, lowest, highest, lag)

    def is_free_of_crossings(self, delay: Interval, budget: int = MAX_CELLS) -> bool:
        """Whether nothing in the box puts a root on the unit circle: proved, or not known.

        Args:
            delay: shortest and longest delay, in samples.
            budget: cells after which it stays unknown.
        """
        with ctx.workprec(BITS):
            for whole, part in by_whole_samples(delay):
                budget = self._exclude(whole, part, budget)
            return budget > 0

    def _exclude(self, whole: int, delay: Interval, budget: int) -> int:
        """Cells left after covering frequencies [0, pi] and delays of whole samples and some; 0 if too few."""
        pending = [Cell((fmpq(0), arb.pi().upper().fmpq()), delay, self.lag)]
        while pending and budget > 0:
            budget -= 1
            cell = pending.pop()
            if not self._is_excluded(whole, cell):
                pending += cell.parts()
        return budget

    def _is_excluded(self, whole: int, cell: Cell) -> bool:
        """Whether W misses [lowest, highest] on a cell."""
        centre, radius = middle(cell.phase), width(cell.phase) / 2
        zeta = acb(arb(centre).cos() - 1, arb(centre).sin())
        box = zeta + acb(arb(0, arb(radius)), arb(0, arb(radius)))
        numerator = centred(self.numerator, zeta, radius) * sampled_plant(box, cell.delay, cell.lag)
        denominator = centred(self.denominator, zeta, radius) * acb(0, arb(centre, radius) * whole).exp()
        small, large = denominator.abs_lower(), denominator.abs_upper()
        if numerator.abs_lower() > self.highest * large or numerator.abs_upper() < self.lowest * small:
            return True
        product = numerator * denominator.conjugate()
        if not product.imag.contains(0):
            return True
        return bool(product.real < self.lowest * small**2 or product.real > self.highest * large**2)


def sampled_plant(zeta: acb, delay: Interval, lag: Interval) -> acb:
    """N (see `quasilpv.certificate.gate.loop`) on a box of zeta, of delays (less whole samples) and of lags."""
    early, s = 1 - interval_ball(delay), interval_ball(lag)
    u = early - s
    plant = 1 + (u + fmpq(1, 2)) * zeta + (u**2 + s**2) / 2 * zeta**2
    if lag[1] == 0:
        return plant
    # exp(-g/s) grows with s and falls with g; so does the pole exp(-1/s). Both are 0 without lag.
    pole = _exponential(fmpq(1), lag[0]).union(_exponential(fmpq(1), lag[1]))
    left = _exponential(1 - delay[0], lag[0]).union(_exponential(1 - delay[1], lag[1]))
    return plant - s**2 * left * zeta**3 / (zeta + 1 - pole)


def _exponential(time: fmpq, lag: fmpq) -> arb:
    return arb(0) if lag == 0 else (arb(-time / lag)).exp()


def by_whole_samples(delay: Interval) -> Iterator[tuple[int, Interval]]:
    """Whole samples w, and the delays beyond them, of an interval of delays."""
    first, last = delay
    for whole in range(int(first.floor()), int(last.floor()) + 1):
        yield whole, (max(first - whole, fmpq(0)), min(last - whole, fmpq(1)))


def middle(interval: Interval) -> fmpq:
    """Of an interval."""
    return (interval[0] + interval[1]) / 2


def width(interval: Interval) -> fmpq:
    """Of an interval."""
    return interval[1] - interval[0]


def interval_ball(interval: Interval) -> arb:
    """The ball of an interval."""
    return arb(middle(interval), width(interval) / 2)


def _hull(first: fmpq_poly, second: fmpq_poly) -> acb_poly:
    """Coefficients that hold everything between those of two polynomials."""
    with ctx.workprec(BITS):
        degree = max(first.degree(), second.degree())
        return acb_poly([acb(arb(first[k]).union(arb(second[k]))) for k in range(degree + 1)])


def centred(polynomial: acb_poly, centre: acb, radius: fmpq) -> acb:
    """Enclosure on the disk ``|zeta - centre| <= radius`` from the Taylor coefficients there.

    As ``|e^(i phi) - e^(i middle)| <= |phi - middle|``, a disk with the radius of a cell holds its arc of the circle.
    """
    taylor = polynomial(acb_poly([centre, 1]))
    spread, power = arb(0), arb(1)
    for coefficient in taylor.coeffs()[1:]:
        power = power * radius
        spread += coefficient.abs_upper() * power
    ball = arb(0, spread.upper())
    return acb(taylor[0].real + ball, taylor[0].imag + ball)
