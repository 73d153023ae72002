"""The inertia margin: for which ``M_t / M_n`` the frozen sampled loop is stable, proved in exact arithmetic.

The loop is stable at ``rho = M_t / M_n = 1 / mu`` if ``F + mu G`` is Schur. Roots are continuous in mu and the degree
does not change, so between two neighbouring critical values (a root on the unit circle) nothing changes: Schur at
mu = 1, decided by a Jury table in rationals, means Schur up to the nearest critical value on either side, and those are
isolated roots of one polynomial.

Where the drives lag, coefficients are balls. Then the table of Jury decides in ball arithmetic, critical values are
found in doubles, and that none lies between them is proved by exclusion (`quasilpv.certificate.gate.exclusion`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from flint import arb, fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.polynomials import critical_values, is_schur
from quasilpv.certificate.exact.rationals import float_at_least, float_at_most
from quasilpv.certificate.gate.exclusion import StabilityBox
from quasilpv.certificate.gate.loop import (
    AccelerationLoopData,
    CharacteristicPolynomial,
    Controller,
    LaggingPolynomial,
)

ZERO = fmpq(0)
LOWEST_PHASE, PHASES, BISECTIONS = 1e-4, 400, 50
LARGEST_RATIO = 1e4
"""Of ratios that are looked at where the drives lag."""

RETREATS = (1e-6, 1e-4, 1e-2)
"""From a critical ratio found in doubles, relative: the exclusion needs some distance to it."""


@dataclass(frozen=True)
class InertiaMargin:
    """The interval of ``M_t / M_n`` around 1 on which the loop is stable, from both sides.

    Stable strictly between ``inner`` bounds; not stable at some ratio between an inner bound and the ``outer`` bound on
    the same side.

    Attributes:
        inner: proved (lower, upper); the upper bound is None if every larger ratio is stable.
        outer: (lower, upper) with outer lower <= inner lower and inner upper <= outer upper; 0 if the loop is stable
            for every smaller ratio, None as above. Where the drives lag nothing is said: 0 and None.
    """

    inner: tuple[fmpq, fmpq | None]
    outer: tuple[fmpq, fmpq | None]

    def contains(self, lowest: fmpq, highest: fmpq) -> bool:
        """Whether every ratio of [lowest, highest] is proved stable."""
        low, high = self.inner
        return low < lowest and (high is None or highest < high)

    def to_floats(self) -> tuple[float, float | None]:
        """The proved bounds as doubles, rounded inwards."""
        low, high = self.inner
        return float_at_least(low), None if high is None else float_at_most(high)


def inertia_margin(data: AccelerationLoopData, delay_samples: fmpq, lag_samples: fmpq = ZERO) -> InertiaMargin | None:
    """The proved inertia margin at a constant delay and lag; None if the loop is not stable at ``M_t = M_n``.

    Args:
        data: the law as shipped; the margin holds for both neighbours of its filter pole.
        delay_samples: transport delay in samples, >= 0.
        lag_samples: time constant of the drives in samples, >= 0.

    Raises:
        InputError: the delay is negative.
    """
    if lag_samples > 0:
        return _lagging_margin(data, delay_samples, lag_samples)
    margins = [_margin(Controller.of(data, pole), delay_samples) for pole in data.filter_poles()]
    proved = [margin for margin in margins if margin is not None]
    return _intersection(proved) if len(proved) == len(margins) else None


def _lagging_margin(data: AccelerationLoopData, delay: fmpq, lag: fmpq) -> InertiaMargin | None:
    polynomials = [LaggingPolynomial.of(Controller.of(data, pole), delay, lag) for pole in data.filter_poles()]
    if not all(polynomial.is_schur() for polynomial in polynomials):
        return None
    below, above = _critical_ratios(polynomials[0])
    for retreat in RETREATS:
        low, high = rational(below * (1.0 + retreat)), rational(above * (1.0 - retreat))
        box = StabilityBox.of(data, low, high, (lag, lag))
        if low < 1 < high and box.is_free_of_crossings((delay, delay)):
            return InertiaMargin((low, high), (ZERO, None))
    return None


def numerical_margin(data: AccelerationLoopData, delay_samples: fmpq, lag_samples: fmpq) -> tuple[float, float] | None:
    """The inertia margin of drives that lag in doubles: where to look for a proof. None as for `inertia_margin`."""
    polynomial = LaggingPolynomial.of(Controller.of(data, data.filter_poles()[0]), delay_samples, lag_samples)
    return _critical_ratios(polynomial) if polynomial.is_schur() else None


def _critical_ratios(polynomial: LaggingPolynomial) -> tuple[float, float]:
    """The critical ratios next to 1, in doubles: where ``-G/F`` is real on the unit circle."""
    F, G = (np.array([float(c.mid()) for c in part.coeffs()[::-1]]) for part in (polynomial.F, polynomial.G))

    def ratio(phase: FloatArray) -> npt.NDArray[np.complex128]:
        zeta = np.expm1(1j * phase)
        return np.asarray(-np.polyval(G, zeta) / np.polyval(F, zeta))

    phases = np.append(np.geomspace(LOWEST_PHASE, np.pi, PHASES, endpoint=False), np.pi)
    values = ratio(phases).imag
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    low, high, sign = phases[at], phases[at + 1], np.sign(values[at])
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        before = ratio(middle).imag * sign > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    found = np.append(ratio((low + high) / 2.0).real, ratio(np.array([np.pi])).real)
    below, above = found[(found > 0.0) & (found < 1.0)], found[found >= 1.0]
    return float(np.max(below, initial=1.0 / LARGEST_RATIO)), float(np.min(above, initial=LARGEST_RATIO))


def _margin(controller: Controller, delay_samples: fmpq) -> InertiaMargin | None:
    polynomial = CharacteristicPolynomial.of(controller, delay_samples)
    if not is_schur(polynomial.F + polynomial.G):
        return None
    values = critical_values(polynomial.F, polynomial.G)
    first_above = _nearest([value for value in values if not value < 1], min)
    first_below = _nearest([value for value in values if not value > 1], max)
    lower = (fmpq(0), fmpq(0)) if first_above is None else (1 / first_above[1], 1 / first_above[0])
    upper: tuple[fmpq | None, fmpq | None] = (None, None)
    if first_below is not None and first_below[1] > 0:
        upper = (1 / first_below[1], 1 / first_below[0] if first_below[0] > 0 else None)
    return InertiaMargin((lower[1], upper[0]), (lower[0], upper[1]))


def _nearest(values: Sequence[arb], nearest: Callable[[Iterable[fmpq]], fmpq]) -> tuple[fmpq, fmpq] | None:
    """Lower and upper bound of the smallest or largest of some enclosed numbers."""
    if not values:
        return None
    return nearest(value.lower().fmpq() for value in values), nearest(value.upper().fmpq() for value in values)


def _intersection(margins: Sequence[InertiaMargin]) -> InertiaMargin:
    """What holds for all of several loops; their outer bounds are taken from the same loop as the inner ones."""
    low, outer_low = max((margin.inner[0], margin.outer[0]) for margin in margins)
    bounded = [(margin.inner[1], margin.outer[1]) for margin in margins if margin.inner[1] is not None]
    high, outer_high = min(bounded, key=lambda bounds: bounds[0]) if bounded else (None, None)
    return InertiaMargin((low, high), (outer_low, outer_high))
