"""Which designs of a general system are tried, until the sampling period of one is proved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from math import floor, inf, log10, sqrt

import numpy as np

from quasilpv.conditions.condition import Options
from quasilpv.errors import ClaimError, InfeasibleError
from quasilpv.lmi import budget
from quasilpv.polytopes import polytopic_model
from quasilpv.progress import Progress
from quasilpv.studies.refutation import Loop, refutation
from quasilpv.synthesis.regional.feedback import default_decay_rate, design_feedback
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release.sampling import Sampled
from quasilpv.systems.descriptor.factorings import factorings
from quasilpv.systems.descriptor.system import DescriptorSystem

SPEEDS = (1.0, 0.7, 0.5, 0.35)
"""Bounds of the closed loop that are tried for a sampling period, in units of ``sqrt(2 alpha / T)``: the proof of a
period T needs ``b (b + J) < 2 alpha / T``, about."""

DECAYS = (1.0, 3.0, 10.0)
"""Decay rates that are tried if none is asked for, in units of the default one: more decay allows a longer period."""

LIKE = "I.2"
"""A condition of which a refutation is one of a feedback of the states, whatever its inequalities."""

REFUTATION_S = 5.0
"""What looking for a refutation may take."""

FIRST_UNITS = 1
"""In so many units every factoring is tried first."""

RATES_HZ = (1e3, 1e4, 1e5)
"""Of which closed loops are tried if no rate is asked for, and which such a rate does not exceed."""


def searched(request: RegionalRequest, allow_unproved_rate: bool, progress: Progress) -> Sampled:
    """The first design whose sampling period is proved; of equations, for the first factoring with a design at all.

    Every factoring is tried in the first units before any is tried in all of them: what has no design in any takes
    long to find out.

    Args:
        request: what is asked for.
        allow_unproved_rate: take the first design, proved or not.
        progress: called with (designs done, designs in all).

    Raises:
        InputError, InfeasibleError: see `design_feedback`.
        ClaimError: the sampling period is not proved.
    """
    refusal: InfeasibleError | None = None
    seen: list[DescriptorSystem] = []
    systems = factorings(request.system) if request.system.from_formulas else iter([request.system])
    rounds = chain(((FIRST_UNITS, system) for system in systems), ((None, system) for system in seen))
    try:
        with budget.limited(budget.DEFAULT):
            for most_units, system in rounds:
                seen += [system] if most_units else []
                try:
                    own = replace(request, system=system)
                    return _Search(own, most_units, allow_unproved_rate, progress).at_some_rate()
                except InfeasibleError as error:
                    refusal = refusal or error
    except budget.TimeUpError as error:
        raise InfeasibleError(f"{request.system.name}: no feedback was found: {error}") from error
    assert refusal is not None  # a system is a factoring of itself
    refuted = _refuted(request)
    raise refusal if refuted is None else InfeasibleError(f"{request.system.name}: {refuted}")


def _refuted(request: RegionalRequest) -> str | None:
    """In words, a mode at the trim that no input reaches: there is no feedback then. None if none was found."""
    system, decay_rate = request.system, request.decay_rate or default_decay_rate(request.system)
    try:
        with budget.limited(budget.Limits(time_s=REFUTATION_S)):
            found = refutation(LIKE, polytopic_model(system, "per-premise"), Options(decay_rate=decay_rate))
    except budget.TimeUpError:
        return None
    if found is None or system.parameters:
        return None
    if [value for _, value in found.point] != system.premise_values(np.zeros(system.order)).tolist():
        return None  # of the equations as they are factored, but not of the system
    return f"no feedback has a decay of {decay_rate:.4g} 1/s, proved: {found.sentence(Loop.CLOSED)}"


class _NotProvedError(ClaimError):
    """The sampling period of no design is proved; `best` has the longest one that is."""

    def __init__(self, message: str, best: Sampled) -> None:
        super().__init__(message)
        self.best = best


@dataclass(frozen=True)
class _Search:
    """That for one factoring. Errors: `searched`."""

    request: RegionalRequest
    most_units: int | None
    allow_unproved_rate: bool
    progress: Progress

    def at_some_rate(self) -> Sampled:
        """At the rate that was asked for, or one that is proved."""
        request = self.request
        if request.rate_hz is not None:
            try:
                return self._first()
            except InfeasibleError:
                if request.unbounded is None:
                    raise
            # Closed loops slow enough for this rate, which alone bound the region, do not exist: faster ones may.
            faster = replace(self, request=replace(request, rate_hz=None)).at_some_rate()
            if self.allow_unproved_rate:
                return faster.at(request.rate_hz)
            raise _NotProvedError(_not_proved(request, faster), faster)
        refusal: Exception | None = None
        for rate_hz in RATES_HZ:
            try:
                found = replace(self, request=replace(request, rate_hz=rate_hz))._first()
            except _NotProvedError as error:
                refusal = error
                own = _next_rate(1.0 / error.best.longest_s) if error.best.longest_s > 0.0 else inf
                if own <= min(10.0 * rate_hz, RATES_HZ[-1]):
                    return error.best.at(own)
            except InfeasibleError as error:
                if request.unbounded is None:
                    raise
                refusal = error
            else:
                return found
        assert refusal is not None  # there is at least one rate
        raise refusal

    def _first(self) -> Sampled:
        """The first candidate whose period is proved."""
        tried: list[Sampled] = []
        refusal: InfeasibleError | None = None
        rows = list(_candidates(self.request))
        for done, row in enumerate(rows):
            self.progress(done, len(rows))
            for candidate in row:  # from the fastest closed loop to slower ones: after an infeasible one all others are
                try:
                    tried.append(Sampled.of(design_feedback(candidate, most_units=self.most_units)))
                except InfeasibleError as error:
                    refusal = refusal or error
                    break
                if tried[-1].proved or self.allow_unproved_rate:
                    return tried[-1]
        if not tried:
            assert refusal is not None  # there is at least one candidate
            raise refusal
        best = max(tried, key=lambda each: each.longest_s).sharpened()
        raise _NotProvedError(_not_proved(self.request, best), best)


def _not_proved(request: RegionalRequest, best: Sampled) -> str:
    """Why a rate is refused, and what to do, in one line."""
    name, asked = request.system.name, 1.0 / request.sample_period_s
    if best.longest_s == 0.0:
        reason = best.reason or "the bounds over the region are too wide"
        return f"{name}: no sampling rate is proved: {reason}; --allow-unproved-rate releases {asked:g} Hz"
    return (
        f"{name}: {asked:g} Hz is not proved; {_next_rate(1.0 / best.longest_s):g} Hz would be (--rate-hz), or less "
        "input, decay or domain; --allow-unproved-rate releases it unproved"
    )


def _candidates(request: RegionalRequest) -> Iterator[list[RegionalRequest]]:
    """What is tried, in this order: rows of one decay rate, closed loops slower and slower.

    Raises:
        InputError: nothing bounds the region, and no bound of the speed can.
    """
    is_open = request.decay_rate is None and request.objective != "fastest"
    decays = [factor * default_decay_rate(request.system) for factor in DECAYS] if is_open else [request.decay_rate]
    for decay in decays:
        own = replace(request, decay_rate=decay)
        row = [own] if own.unbounded is None or decay is None or request.speed is not None else []
        if request.speed is None and decay is not None:
            scale = sqrt(2.0 * decay / request.sample_period_s)
            row += [replace(own, speed=factor * scale) for factor in SPEEDS]
        yield row


def _next_rate(least_hz: float) -> float:
    """The next of 1, 2, 5, 10, ... times a power of ten above, with a percent to spare."""
    power = 10.0 ** floor(log10(1.01 * least_hz))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 1.01 * least_hz)


def rates_from(least_hz: float, most_hz: float) -> Iterator[float]:
    """A rate, then the next ones of 1, 2, 5, 10, ... times a power of ten."""
    rate = least_hz
    while rate <= most_hz:
        yield rate
        rate = _next_rate(1.02 * rate)
