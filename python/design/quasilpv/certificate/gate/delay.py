"""The delay margin: up to which constant transport delay the needed range stays inside the inertia margin.

A margin proved at some delays says nothing about the delays between them, so two statements are combined. Bisection
over the inertia margin, at both ends of the lag, finds a delay with the needed range inside and a slightly
larger one at which it is not. Then *every* delay up to (nearly) the first, with every lag of the interval, is covered
by exclusion (`quasilpv.certificate.gate.exclusion`), anchored where there is no delay and the least lag.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq

from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.exclusion import StabilityBox
from quasilpv.certificate.gate.loop import NO_LAG, AccelerationLoopData, Interval
from quasilpv.certificate.gate.margin import inertia_margin, numerical_margin

LARGEST_DELAY_SAMPLES = 8
SCAN_STEPS_PER_SAMPLE = 4
BISECTIONS = 9
RETREATS = (fmpq(399, 400), fmpq(49, 50), fmpq(3, 4), fmpq(1, 2), fmpq(1, 4))


@dataclass(frozen=True)
class DelayMargin:
    """What is proved about transport delays, in samples.

    Attributes:
        proved: the frozen loop is stable for every inertia ratio of the needed range, every constant delay in
            [0, proved] and every lag of the drives; None if not even without delay.
        not_inside: a delay at which the needed range is not inside the inertia margin (of drives that lag in doubles);
            None if there was none up to `LARGEST_DELAY_SAMPLES`.
    """

    proved: fmpq | None
    not_inside: fmpq | None


def delay_margin(data: AccelerationLoopData, lowest: fmpq, highest: fmpq, lag: Interval = NO_LAG) -> DelayMargin:
    """Prove the delay margin for inertia ratios in [lowest, highest].

    Args:
        data: the law as shipped.
        lowest: smallest needed ratio, > 0.
        highest: largest needed ratio.
        lag: shortest and longest time constant of the drives, in samples.
    """
    inside, outside = _bracket(data, lowest, highest, lag)
    anchor = inertia_margin(data, fmpq(0), lag[0])
    if inside is None or anchor is None or not anchor.contains(lowest, highest):
        return DelayMargin(None, outside)
    box = StabilityBox.of(data, lowest, highest, lag)
    for retreat in RETREATS:  # the exclusion needs some distance to the limit
        if box.is_free_of_crossings((fmpq(0), inside * retreat)):
            return DelayMargin(inside * retreat, outside)
    # Without delay the least lag is known to be stable, but none that is longer.
    still = lag[0] == lag[1] or box.is_free_of_crossings(NO_LAG)
    return DelayMargin(fmpq(0) if still else None, outside)


def _bracket(data: AccelerationLoopData, lowest: fmpq, highest: fmpq, lag: Interval) -> tuple[fmpq | None, fmpq | None]:
    """A delay with the range inside the margin, and a larger one without, by steps and bisection."""

    def is_inside_at(delay: fmpq, end: fmpq) -> bool:
        if end > 0:
            found = numerical_margin(data, delay, end)
            return found is not None and found[0] < to_float(lowest) and to_float(highest) < found[1]
        margin = inertia_margin(data, delay)
        return margin is not None and margin.contains(lowest, highest)

    def is_inside(delay: fmpq) -> bool:
        return all(is_inside_at(delay, end) for end in dict.fromkeys(lag))

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
