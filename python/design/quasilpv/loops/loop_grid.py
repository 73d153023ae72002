"""Stability of a frozen law over a grid of configurations and payloads, with and without transport delay: no proof."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.loops.frozen_loop import FrozenLaw, FrozenLoop

CONFIGURATIONS = 64
PAYLOAD_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)

FACTOR_STEP = 1.25
LARGEST_FACTOR = 100.0
DELAY_STEP_SAMPLES = 0.125
LARGEST_DELAY_SAMPLES = 8.0
BISECTIONS = 7


def configurations(
    angle_rad: Sequence[Sequence[float]], count: int = CONFIGURATIONS, *, every_joint: bool = False
) -> FloatArray:
    """Grid of about ``count`` configurations of a box of joint angles, bounds included, shape (N, n).

    The inertia of a serial chain does not depend on its first joint, which stays at the middle of its interval unless
    ``every_joint`` is set, for laws with gravity in their loop and for other mechanisms.
    """
    per_joint = max(3, round(count ** (1.0 / max(1, len(angle_rad) - (0 if every_joint else 1)))))
    low, high = angle_rad[0]
    first = np.linspace(low, high, per_joint) if every_joint else np.array([(low + high) / 2.0])
    axes = [first, *(np.linspace(low, high, per_joint) for low, high in angle_rad[1:])]
    return np.array(list(itertools.product(*axes)))


@dataclass(frozen=True)
class WorstLoop:
    """The largest growth rate of a set of loops, 1/s, and the joint angles (rad) and payload fraction it belongs to."""

    growth_rate_per_s: float
    angle_rad: tuple[float, ...]
    payload_fraction: float


@dataclass(frozen=True, eq=False)
class LoopGrid:
    """A law against every plant of a grid.

    Attributes:
        law: frozen at B configurations.
        angles: these configurations, (B, n), rad.
        inertia: true inertia by payload fraction, (B, n, n) each, kg m^2.
        stiffness: gravity as ``G(theta) = H theta``, H by payload fraction, (B, n, n) each, N m/rad, for laws that do
            not compensate it; None for the others.
    """

    law: FrozenLaw
    angles: FloatArray
    inertia: Mapping[float, FloatArray]
    stiffness: Mapping[float, FloatArray] | None = None

    def __len__(self) -> int:
        """Number of loops."""
        return len(self.angles) * len(self.inertia)

    def loops(self, factor: float = 1.0, delay_s: float = 0.0) -> Iterator[tuple[float, FrozenLoop]]:
        """Payload fraction and loops, one per configuration, with every true inertia multiplied by a factor."""
        for fraction, inertia in self.inertia.items():
            stiffness = None if self.stiffness is None else self.stiffness[fraction]
            yield fraction, FrozenLoop(self.law, factor * inertia, delay_s, stiffness)

    def worst(self, factor: float = 1.0, delay_s: float = 0.0) -> WorstLoop:
        """The largest growth rate and where it occurs."""
        found = []
        for fraction, loop in self.loops(factor, delay_s):
            rates = loop.growth_rates()
            row = int(np.argmax(rates))
            found.append((float(rates[row]), tuple(map(float, self.angles[row])), fraction))
        return WorstLoop(*max(found))

    def is_stable(self, factor: float = 1.0, delay_s: float = 0.0) -> bool:
        """Whether every loop is stable; the first payload with an unstable one ends the check."""
        return all(loop.growth_rates().max() < 0.0 for _, loop in self.loops(factor, delay_s))

    def disturbance_gain(self, frequency_rad_s: float, unit: FloatArray | None = None) -> float:
        """Worst `FrozenLoop.disturbance_gains` without delay."""
        return max(float(loop.disturbance_gains(frequency_rad_s, unit).max()) for _, loop in self.loops())

    def torque_activity(self, deviations: Sequence[float]) -> float:
        """Worst `FrozenLoop.torque_activity` without delay, N m."""
        return max(float(loop.torque_activity(deviations).max()) for _, loop in self.loops())

    def factor_range(self, delay_s: float = 0.0) -> tuple[float, float] | None:
        """Largest interval around 1 of a common factor on all true inertias that leaves every loop stable.

        Searched by steps and bisection between stable and unstable factors, from 1 to `LARGEST_FACTOR` both ways; None
        if a loop is unstable at 1.
        """
        if not self.is_stable(1.0, delay_s):
            return None
        return self._limit(1.0 / FACTOR_STEP, delay_s), self._limit(FACTOR_STEP, delay_s)

    def _limit(self, step: float, delay_s: float) -> float:
        """The last stable factor found, away from 1 in the direction of the step."""
        stable, tried = 1.0, step
        while self.is_stable(tried, delay_s):
            stable, tried = tried, tried * step
            if not 1.0 / LARGEST_FACTOR <= tried <= LARGEST_FACTOR:
                return stable
        for _ in range(BISECTIONS):
            middle = math.sqrt(stable * tried)
            stable, tried = (middle, tried) if self.is_stable(middle, delay_s) else (stable, middle)
        return stable

    def delay_margin_s(self, required_s: float = 0.0) -> float | None:
        """The last stable delay found from 0 in steps and by bisection; None if a loop is unstable without delay.

        Args:
            required_s: a delay that is tried too, so that a margin of just this size is not missed between steps.
        """
        if not self.is_stable():
            return None
        step = DELAY_STEP_SAMPLES * self.law.sample_period_s
        grid = [step * k for k in range(1, round(LARGEST_DELAY_SAMPLES / DELAY_STEP_SAMPLES) + 1)]
        stable, limit = 0.0, math.inf
        for delay in sorted({*grid, required_s}):
            if not self.is_stable(delay_s=delay):
                limit = delay
                break
            stable = delay
        if math.isinf(limit):
            return stable
        for _ in range(BISECTIONS):
            middle = (stable + limit) / 2.0
            stable, limit = (middle, limit) if self.is_stable(delay_s=middle) else (stable, middle)
        return stable
