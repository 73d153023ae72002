"""The delay margin: up to which constant transport delay the needed range stays inside the inertia margin.

A margin proved at some delays says nothing about the delays between them, so two statements are combined. Bisection
over the exact inertia margin finds a delay at which the needed range is inside and a slightly larger one at which it is
not. Then *every* delay up to (nearly) the first is covered by exclusion: the roots of the characteristic polynomial are
continuous in the inertia ratio rho and in the delay d, so if the loop is stable at one point of the rectangle of ratios
and delays and has no root on the unit circle anywhere in it, it is stable on all of it. A root ``z = e^(i phi)`` means

    rho = W(phi, d),    W = N_c N_p / (D_c z^(w+1) zeta^2),    zeta = z - 1,

and W is enclosed in ball arithmetic on cells of (phi, d) until no cell can hold a ratio of the needed range.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly

from quasilpv.certificate.gate.loop import ZETA, AccelerationLoopData, Controller, Z
from quasilpv.certificate.gate.margin import inertia_margin

LARGEST_DELAY_SAMPLES = 8
SCAN_STEPS_PER_SAMPLE = 4
BISECTIONS = 9
RETREATS = (fmpq(399, 400), fmpq(49, 50), fmpq(3, 4), fmpq(1, 2), fmpq(1, 4))
MAX_CELLS = 20_000
BITS = 128


@dataclass(frozen=True)
class DelayMargin:
    """What is proved about transport delays, in samples.

    Attributes:
        proved: the frozen loop is stable for every inertia ratio of the needed range and every constant delay in
            [0, proved]; None if not even without delay.
        not_inside: a delay at which the needed range is not inside the inertia margin; None if there was none up to
            `LARGEST_DELAY_SAMPLES`.
    """

    proved: fmpq | None
    not_inside: fmpq | None


def delay_margin(data: AccelerationLoopData, lowest: fmpq, highest: fmpq) -> DelayMargin:
    """Prove the delay margin for inertia ratios in [lowest, highest].

    Args:
        data: the law as shipped.
        lowest: smallest needed ratio, > 0.
        highest: largest needed ratio.
    """
    inside, outside = _bracket(data, lowest, highest)
    if inside is None:
        return DelayMargin(None, outside)
    rectangle = StabilityRectangle.of(data, lowest, highest)
    for retreat in RETREATS:  # the exclusion needs some distance to the limit
        if rectangle.is_free_of_crossings(inside * retreat):
            return DelayMargin(inside * retreat, outside)
    return DelayMargin(fmpq(0), outside)


def _bracket(data: AccelerationLoopData, lowest: fmpq, highest: fmpq) -> tuple[fmpq | None, fmpq | None]:
    """A delay with the range inside the margin, and a larger one without, by steps and bisection."""

    def is_inside(delay: fmpq) -> bool:
        margin = inertia_margin(data, delay)
        return margin is not None and margin.contains(lowest, highest)

    step = fmpq(1, SCAN_STEPS_PER_SAMPLE)
    inside, outside = None, fmpq(0)
    while is_inside(outside):
        inside, outside = outside, outside + step
        if outside > LARGEST_DELAY_SAMPLES:
            return inside, None
    if inside is None:
        return None, outside
    for _ in range(BISECTIONS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if is_inside(middle) else (inside, middle)
    return inside, outside


@dataclass(frozen=True)
class StabilityRectangle:
    """The loop over inertia ratios [lowest, highest] and delays from 0, stable where there is no delay.

    Attributes:
        numerator: N_c as a polynomial in zeta with ball coefficients that hold both neighbours of the filter pole.
        denominator: ``D_c zeta^2 z``, likewise.
        lowest: smallest ratio.
        highest: largest ratio.
    """

    numerator: acb_poly
    denominator: acb_poly
    lowest: fmpq
    highest: fmpq

    @classmethod
    def of(cls, data: AccelerationLoopData, lowest: fmpq, highest: fmpq) -> StabilityRectangle:
        """Enclose the controllers of both filter poles; coefficients are affine in the pole."""
        first, second = (Controller.of(data, pole) for pole in data.filter_poles())
        numerator = _hull(first.numerator, second.numerator)
        denominator = _hull(first.denominator * ZETA**2 * Z, second.denominator * ZETA**2 * Z)
        return cls(numerator, denominator, lowest, highest)

    def is_free_of_crossings(self, delay_samples: fmpq, budget: int = MAX_CELLS) -> bool:
        """Whether no ratio and no delay in [0, delay_samples] puts a root on the unit circle: proved, or not known.

        Args:
            delay_samples: longest delay.
            budget: cells after which it stays unknown.
        """
        with ctx.workprec(BITS):
            whole = int(delay_samples.floor())
            starts = [fmpq(w) for w in range(whole + 1)]
            ends = [*starts[1:], delay_samples]
            for start, end in zip(starts, ends, strict=True):
                budget = self._exclude(int(start), end - start, budget)
            return budget > 0

    def _exclude(self, whole: int, latest: fmpq, budget: int) -> int:
        """Cells left after covering frequencies [0, pi] and delays whole + [0, latest]; 0 if they were not enough."""
        pi = arb.pi().upper().fmpq()
        pending = [(fmpq(0), pi, fmpq(0), latest)]
        while pending and budget > 0:
            budget -= 1
            low, high, soonest, last = pending.pop()
            if self._is_excluded(whole, low, high, soonest, last):
                continue
            # W ~ zeta^-5 turns five times as fast as zeta in frequency, and by phi in delay.
            if 4 * (high - low) > high * high * (last - soonest):
                middle = (low + high) / 2
                pending += [(low, middle, soonest, last), (middle, high, soonest, last)]
            else:
                middle = (soonest + last) / 2
                pending += [(low, high, soonest, middle), (low, high, middle, last)]
        return budget

    def _is_excluded(self, whole: int, low: fmpq, high: fmpq, soonest: fmpq, last: fmpq) -> bool:
        """Whether W misses [lowest, highest] for phi in [low, high] and delays of whole + [soonest, last] samples."""
        middle, radius = (low + high) / 2, (high - low) / 2
        zeta = acb(arb(middle).cos() - 1, arb(middle).sin())
        early = 1 - arb((soonest + last) / 2, (last - soonest) / 2)
        around = acb(arb(0, arb(radius)), arb(0, arb(radius)))
        box = zeta + around
        plant = 1 + (early + fmpq(1, 2)) * box + early**2 / 2 * box**2
        numerator = _centred(self.numerator, zeta, radius) * plant
        denominator = _centred(self.denominator, zeta, radius) * acb(0, arb(middle, radius) * whole).exp()
        small, large = denominator.abs_lower(), denominator.abs_upper()
        if numerator.abs_lower() > self.highest * large or numerator.abs_upper() < self.lowest * small:
            return True
        product = numerator * denominator.conjugate()
        if not product.imag.contains(0):
            return True
        return bool(product.real < self.lowest * small**2 or product.real > self.highest * large**2)


def _hull(first: fmpq_poly, second: fmpq_poly) -> acb_poly:
    """Coefficients that hold everything between those of two polynomials."""
    with ctx.workprec(BITS):
        degree = max(first.degree(), second.degree())
        return acb_poly([acb(arb(first[k]).union(arb(second[k]))) for k in range(degree + 1)])


def _centred(polynomial: acb_poly, centre: acb, radius: fmpq) -> acb:
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
