"""A design with the longest sampling period that is proved for it, by Euler's bound or by the sharper one."""

from __future__ import annotations

from dataclasses import dataclass, replace

from quasilpv.certificate.exact.trigonometric import UnsupportedError
from quasilpv.certificate.systems.linearised import LinearisedLoop
from quasilpv.certificate.systems.sampled import SampledBound, SampledLoop
from quasilpv.documents.system_artifact import EulerSampling, LinearisedSampling, SamplingDocument
from quasilpv.synthesis.regional.feedback import RegionalDesign
from quasilpv.system_release.document import artifact_of

CELLS = 400
"""Of the first look at a sampled loop; what is shipped is decided with more."""

SHARPER_CELLS = 2500
"""The same of the sharper bound."""

MOST_CUT = 6
"""Signals of which so many cells can be made that the sharper bound is worth its time for every candidate."""

MOST_GAIN = 100.0
"""Longer periods, in units of Euler's longest, are not tried with the sharper bound."""

SPARE = 1.3
"""Periods are tried that are this much shorter than what samples of the region would stand: cells have a width."""

GAINS = (32.0, 16.0, 8.0, 4.0, 2.0)
"""Periods for which the sharper bound is tried where none that was asked for is proved, in the same units."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """A design, and how long a sampling period was proved for it: by Euler's bound, or by the sharper one."""

    design: RegionalDesign
    bound: SampledBound | None
    reason: str = ""
    sharper: LinearisedLoop | None = None
    sharper_s: float = 0.0

    @classmethod
    def of(cls, design: RegionalDesign) -> Sampled:
        """Enclose its loop; the sharper bound is tried where Euler's does not prove the period that is asked for."""
        artifact, period = artifact_of(design), design.request.sample_period_s
        try:
            bound = SampledLoop(artifact, CELLS).bound
        except (ArithmeticError, ZeroDivisionError) as error:
            return cls(design, None, str(error) or "the rates could not be enclosed over the region")
        if period < bound.longest_period_s or period > MOST_GAIN * bound.longest_period_s:
            return cls(design, bound)
        loop = LinearisedLoop(artifact, SHARPER_CELLS)
        if len(loop.cut) > MOST_CUT:
            return cls(design, bound)
        return cls(design, bound, "", loop, period if _is_proved(loop, period) else 0.0)

    def sharpened(self) -> Sampled:
        """With a longer period than Euler's, if the sharper bound proves one."""
        if self.bound is None or self.bound.longest_period_s == 0.0:
            return self
        loop = self.sharper or LinearisedLoop(artifact_of(self.design), SHARPER_CELLS)
        periods = [self.bound.longest_period_s * factor for factor in GAINS]
        return replace(self, sharper=loop, sharper_s=next((T for T in periods if _is_proved(loop, T)), 0.0))

    def at(self, rate_hz: float) -> Sampled:
        """The same design, sampled at another rate."""
        return replace(self, design=self.design.at(rate_hz))

    @property
    def longest_s(self) -> float:
        """The longest period that is proved, s; 0 for none."""
        return 0.0 if self.bound is None else max(self.bound.longest_period_s, self.sharper_s)

    @property
    def proved(self) -> bool:
        """Whether the period of the design is proved."""
        period = self.design.request.sample_period_s
        return period <= self.sharper_s or (self.bound is not None and period < self.bound.longest_period_s)

    @property
    def sampling(self) -> SamplingDocument | None:
        """The member of the artifact; None if the period is not proved."""
        if self.bound is None or not self.proved:
            return None
        if self.sharper is not None and self.design.request.sample_period_s >= self.bound.longest_period_s:
            return LinearisedSampling(
                method="linearised",
                growth_per_s=self.sharper.growth,
                curvature_per_s=self.sharper.curvature,
                longest_period_s=self.sharper_s,
            )
        return EulerSampling(
            method="euler",
            speed_per_s=self.bound.speed,
            lipschitz_per_s=self.bound.lipschitz,
            longest_period_s=self.bound.longest_period_s,
        )


def _is_proved(loop: LinearisedLoop, period_s: float) -> bool:
    try:
        return not loop.is_hopeless(period_s * SPARE) and loop.cells_of_proof(period_s) is not None
    except (ArithmeticError, UnsupportedError):
        return False
