"""What the search of the acceleration-level law demands: at which scales of the design inertia a candidate is robust.

A law tolerates some true inertias, given relative to the design inertia ``M_n = s M_nominal``; the robot needs some,
given relative to the nominal one. The scales s at which the first contain the second are an interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.synthesis.specification import Specification

CENTRES = 61
LARGEST_SCALE = 3.0
PHASES = 400
CLEARANCE = 1.005
"""Factor on the radius of the disc: room for phases between those of the grid, and for the proof."""


@dataclass(frozen=True)
class Tolerated:
    """What a law tolerates.

    Attributes:
        margin: interval of ``M_t / M_n`` around 1 on which the frozen loop with the specified delay is stable.
        span: how far the tolerated inertias spread, largest over smallest.
        scales: the admissible interval of s; None if there is none.
    """

    margin: tuple[float, float]
    span: float
    scales: tuple[float, float] | None


class Disc(Protocol):
    """A disc around a multiple of the identity that holds ``M_t^-1 M_n`` in suitable coordinates."""

    @property
    def centre(self) -> float:
        """c."""

    @property
    def radius(self) -> float:
        """r."""


class Range(Protocol):
    """An interval of inertia ratios."""

    @property
    def lowest(self) -> float:
        """Smallest ratio."""

    @property
    def highest(self) -> float:
        """Largest ratio."""


class Tolerance(Protocol):
    """A demand on candidates."""

    @property
    def span(self) -> float:
        """How far the inertias that must be tolerated spread, largest over smallest."""

    def tolerated(self, law: AccelerationLaw) -> Tolerated | None:
        """What a law tolerates; None if it is not even stable with the design inertia."""


@dataclass(frozen=True)
class FrozenTolerance:
    """Every posture and payload on its own: the inertia margin contains the needed range with the specified spare.

    Attributes:
        specification: delay and spare.
        needed: range of ``M_t / M_nominal``.
        lag_s: shortest and longest time constant of the drives.
    """

    specification: Specification
    needed: Range
    lag_s: tuple[float, float] = (0.0, 0.0)

    @property
    def span(self) -> float:
        """See `Tolerance`."""
        return self.needed.highest / self.needed.lowest * self.specification.margin_spare**2

    def tolerated(self, law: AccelerationLaw) -> Tolerated | None:
        """See `Tolerance`."""
        margins = [
            SampledLoop(law, self.specification.delay_s, lag).inertia_margin() for lag in dict.fromkeys(self.lag_s)
        ]
        found = [margin for margin in margins if margin is not None and margin[0] > 0.0]
        if len(found) < len(margins):
            return None
        margin = max(low for low, _ in found), min(high for _, high in found)
        spare = self.specification.margin_spare
        smallest, largest = self.needed.highest * spare / margin[1], self.needed.lowest / (margin[0] * spare)
        return Tolerated(margin, margin[1] / margin[0], (smallest, largest) if smallest <= largest else None)


@dataclass(frozen=True, eq=False)
class MovingTolerance:
    """Postures and payloads that change from sample to sample: the circle criterion for the disc of ``M_t^-1 M_n``.

    Without delay and with the specified one, ``|1 - c L| > r |L|`` on the unit circle, L the loop transfer per unit mu;
    the frozen loop must be stable as well. Where the shape of the function changes with the posture, by a factor of at
    most exp(beta t) in a time t, the circle is that of radius exp(-beta T / 2). References: as for
    `quasilpv.certificate.gate.motion` and `quasilpv.certificate.gate.tree_motion`.

    Attributes:
        frozen: the demand on every posture on its own.
        disc: of the nominal inertia.
        rate_per_s: beta.
    """

    frozen: FrozenTolerance
    disc: Disc
    rate_per_s: float = 0.0

    @property
    def span(self) -> float:
        """See `Tolerance`."""
        relative = CLEARANCE * self.disc.radius / self.disc.centre
        return (1.0 + relative) / (1.0 - relative)

    @cached_property
    def _scales(self) -> np.ndarray:
        return np.geomspace(1.0 / LARGEST_SCALE, LARGEST_SCALE, CENTRES)

    def tolerated(self, law: AccelerationLaw) -> Tolerated | None:
        """See `Tolerance`."""
        frozen = self.frozen.tolerated(law)
        if frozen is None:
            return None
        relative = np.minimum(*(self._relative_radii(law, d) for d in (0.0, self.frozen.specification.delay_s)))
        span = float(((1.0 + relative) / np.maximum(1.0 - relative, 1e-9)).max())
        wide = self._scales[relative >= CLEARANCE * self.disc.radius / self.disc.centre]
        if not wide.size or frozen.scales is None:
            return Tolerated(frozen.margin, span, None)
        smallest, largest = max(wide[0], frozen.scales[0]), min(wide[-1], frozen.scales[1])
        scales = (float(smallest), float(largest)) if smallest <= largest else None
        if scales is not None and not all(self._decays(law, scale) for scale in scales):
            scales = None
        return Tolerated(frozen.margin, span, scales)

    def _decays(self, law: AccelerationLaw, scale: float) -> bool:
        """Whether the frozen loop at the centre of the disc falls fast enough; nothing is asked for with rate 0."""
        if self.rate_per_s == 0.0:
            return True
        loop = SampledLoop(law, self.frozen.specification.delay_s)
        return loop.growth_rate(scale * self.disc.centre) < -self.rate_per_s / 2.0

    def _relative_radii(self, law: AccelerationLaw, delay_s: float) -> np.ndarray:
        """Per scale s, the largest radius the loop tolerates around s c, over s c; 0 where it is not stable there."""
        loop = SampledLoop(law, delay_s)
        centres = self._scales * self.disc.centre
        margin = loop.inertia_margin()
        if margin is None:
            return np.zeros(CENTRES)
        contraction = float(np.exp(-self.rate_per_s * law.sample_period_s / 2.0))
        # Off the unit circle low phases decide too: zero, where the integrators' poles are outside, included.
        phases = np.geomspace(1e-3, np.pi, PHASES)
        L = loop.open_loop(phases if contraction == 1.0 else np.append(0.0, phases), contraction)
        radii = 1.0 / np.abs(L / (1.0 - np.outer(centres, L))).max(axis=1)
        stable = (centres * margin[0] < 1.0) & (centres * margin[1] > 1.0)
        return np.asarray(np.where(stable, radii / centres, 0.0))
