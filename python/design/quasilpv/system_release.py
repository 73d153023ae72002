"""From a system and a request to the artifact that is shipped: designed, compiled, checked, in one object.

For general systems what `quasilpv.release` is for robots. Nothing leaves it whose claims do not hold, or whose sampling
period is not proved, unless that is asked for; then the artifact says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import floor, inf, isfinite, log10, sqrt
from typing import Any

import numpy as np
import sympy as sp

from quasilpv import __version__
from quasilpv.arrays import FloatArray
from quasilpv.artifact.compilation import compile_program
from quasilpv.artifact.plant_program import plant_document
from quasilpv.certificate.exact.trigonometric import UnsupportedError
from quasilpv.certificate.systems import verify_system
from quasilpv.certificate.systems.linearised import LINEARISED, LinearisedLoop
from quasilpv.certificate.systems.sampled import SampledBound, SampledLoop
from quasilpv.documents.canonical import document_hash
from quasilpv.documents.programs import Program
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SCHEMA, SystemArtifactDocument
from quasilpv.errors import ClaimError, InfeasibleError
from quasilpv.lmi import budget
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.regional.feedback import RegionalDesign, default_decay_rate, design_feedback
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.systems.descriptor.factorings import factorings
from quasilpv.systems.descriptor.premise import AffineMatrix, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

SPEEDS = (1.0, 0.7, 0.5, 0.35)
"""Bounds of the closed loop that are tried for a sampling period, in units of ``sqrt(2 alpha / T)``: the proof of a
period T needs ``b (b + J) < 2 alpha / T``, about."""

DECAYS = (1.0, 3.0, 10.0)
"""Decay rates that are tried if none is asked for, in units of the default one: more decay allows a longer period."""

RATES_HZ = (1e3, 1e4, 1e5)
"""Of which closed loops are tried if no rate is asked for, and which such a rate does not exceed."""

CELLS = 400
"""Of the first look at a sampled loop; what is shipped is decided with more."""

SHARPER_CELLS = 2500
"""The same of the sharper bound."""

MOST_CUT = 3
"""Signals of which so many cells can be made that the sharper bound is worth its time for every candidate."""

MOST_GAIN = 100.0
"""Longer periods, in units of Euler's longest, are not tried with the sharper bound."""

SPARE = 1.3
"""Periods are tried that are this much shorter than what samples of the region would stand: cells have a width."""

GAINS = (32.0, 16.0, 8.0, 4.0, 2.0)
"""Periods for which the sharper bound is tried where none that was asked for is proved, in the same units."""


def release_system(
    request: RegionalRequest,
    *,
    allow_unproved_rate: bool = False,
    progress: Progress = no_progress,
) -> SystemArtifactDocument:
    """Design a feedback, find its region, check all of it on the numbers that are shipped.

    Designs are tried until the sampling period of one is proved: the one that was asked for, then those with slower
    closed loops and more decay where neither was asked for. If no rate was asked for either, closed loops for some are
    tried, and the rate is the next of 1, 2, 5, 10 ... that is proved.
    A period is proved by Euler's bound, which is cheap, or else by the sharper one.

    Args:
        request: what is asked for.
        allow_unproved_rate: release a sampling period that is not proved; the artifact says so.
        progress: called with (designs done, designs in all).

    Raises:
        InputError: something does not fit; see `design_feedback`.
        InfeasibleError: no feedback was found.
        ClaimError: a claim does not hold on the shipped numbers, or the sampling period is not proved.
    """
    found = _searched(request, allow_unproved_rate, progress)
    artifact = _artifact(found.design, found.sampling, None)
    verdict = verify_system(artifact)
    if not verdict.verified:
        raise ClaimError(f"{artifact.name}: not verified: {', '.join(verdict.failed[:3])}")
    evidence = {"version": 1, "certificate": verdict.findings(), "assumed": list(found.design.assumed)}
    return _artifact(found.design, found.sampling, evidence)


def _searched(request: RegionalRequest, allow_unproved_rate: bool, progress: Progress) -> _Sampled:
    """The first design whose sampling period is proved; of equations, for the first factoring with a design at all."""
    refusal: InfeasibleError | None = None
    systems = factorings(request.system) if request.system.from_formulas else [request.system]
    try:
        with budget.limited(budget.DEFAULT):
            for system in systems:
                try:
                    return _at_some_rate(replace(request, system=system), allow_unproved_rate, progress)
                except InfeasibleError as error:
                    refusal = refusal or error
    except budget.TimeUpError as error:
        raise InfeasibleError(f"{request.system.name}: no feedback was found: {error}") from error
    assert refusal is not None  # a system is a factoring of itself
    raise refusal


def _at_some_rate(request: RegionalRequest, allow_unproved_rate: bool, progress: Progress) -> _Sampled:
    """The same for one factoring, at the rate that was asked for or one that is proved. Errors: `release_system`."""
    if request.rate_hz is not None:
        try:
            return _search(request, allow_unproved_rate, progress)
        except InfeasibleError:
            if request.unbounded is None:
                raise
        # Closed loops slow enough for this rate, which alone bound the region, do not exist: faster ones may.
        faster = _at_some_rate(replace(request, rate_hz=None), allow_unproved_rate, progress)
        if allow_unproved_rate:
            return faster.at(request.rate_hz)
        raise _NotProvedError(_not_proved(request, faster), faster)
    refusal: Exception | None = None
    for rate_hz in RATES_HZ:
        try:
            found = _search(replace(request, rate_hz=rate_hz), allow_unproved_rate, progress)
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


class _NotProvedError(ClaimError):
    """The sampling period of no design is proved; `best` has the longest one that is."""

    def __init__(self, message: str, best: _Sampled) -> None:
        super().__init__(message)
        self.best = best


def _search(request: RegionalRequest, allow_unproved_rate: bool, progress: Progress) -> _Sampled:
    """The same for one factoring. Errors: `release_system`."""
    tried: list[_Sampled] = []
    refusal: InfeasibleError | None = None
    rows = list(_candidates(request))
    for done, row in enumerate(rows):
        progress(done, len(rows))
        for candidate in row:  # from the fastest closed loop to slower ones: after an infeasible one all others are
            try:
                tried.append(_Sampled.of(design_feedback(candidate)))
            except InfeasibleError as error:
                refusal = refusal or error
                break
            if tried[-1].proved or allow_unproved_rate:
                return tried[-1]
    if not tried:
        assert refusal is not None  # there is at least one candidate
        raise refusal
    best = max(tried, key=lambda each: each.longest_s).sharpened()
    raise _NotProvedError(_not_proved(request, best), best)


def _not_proved(request: RegionalRequest, best: _Sampled) -> str:
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


@dataclass(frozen=True, eq=False)
class _Sampled:
    """A design, and how long a sampling period was proved for it: by Euler's bound, or by the sharper one."""

    design: RegionalDesign
    bound: SampledBound | None
    reason: str = ""
    sharper: LinearisedLoop | None = None
    sharper_s: float = 0.0

    @classmethod
    def of(cls, design: RegionalDesign) -> _Sampled:
        """Enclose its loop; the sharper bound is tried where Euler's does not prove the period that is asked for."""
        artifact, period = _artifact(design, None, None), design.request.sample_period_s
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

    def sharpened(self) -> _Sampled:
        """With a longer period than Euler's, if the sharper bound proves one."""
        if self.bound is None or self.bound.longest_period_s == 0.0:
            return self
        loop = self.sharper or LinearisedLoop(_artifact(self.design, None, None), SHARPER_CELLS)
        periods = [self.bound.longest_period_s * factor for factor in GAINS]
        return replace(self, sharper=loop, sharper_s=next((T for T in periods if _is_proved(loop, T)), 0.0))

    def at(self, rate_hz: float) -> _Sampled:
        """The same design, sampled at another rate."""
        return replace(self, design=replace(self.design, request=replace(self.design.request, rate_hz=rate_hz)))

    @property
    def longest_s(self) -> float:
        return 0.0 if self.bound is None else max(self.bound.longest_period_s, self.sharper_s)

    @property
    def proved(self) -> bool:
        period = self.design.request.sample_period_s
        return period <= self.sharper_s or (self.bound is not None and period < self.bound.longest_period_s)

    @property
    def sampling(self) -> dict[str, Any] | None:
        """The member of the artifact; None if the period is not proved."""
        if self.bound is None or not self.proved:
            return None
        if self.sharper is not None and self.design.request.sample_period_s >= self.bound.longest_period_s:
            return {
                "method": LINEARISED,
                "growth_per_s": self.sharper.growth,
                "curvature_per_s": self.sharper.curvature,
                "longest_period_s": self.sharper_s,
            }
        return {
            "method": "euler",
            "speed_per_s": self.bound.speed,
            "lipschitz_per_s": self.bound.lipschitz,
            "longest_period_s": self.bound.longest_period_s,
        }


def _is_proved(loop: LinearisedLoop, period_s: float) -> bool:
    try:
        return not loop.is_hopeless(period_s * SPARE) and loop.cells_of_proof(period_s) is not None
    except (ArithmeticError, UnsupportedError):
        return False


def _artifact(
    design: RegionalDesign, sampling: dict[str, Any] | None, verification: dict[str, Any] | None
) -> SystemArtifactDocument:
    system, request = design.model.system, design.request
    signals = _signals(request)
    numbers = {symbol: ("signal", k) for k, symbol in enumerate(_symbols(system))}
    premises = tuple(premise.expression for premise in system.premises)
    centre = design.model.polytope.centre
    told = [
        sp.Float(centre[p]) if premise.kind is PremiseKind.UNKNOWN else premise.expression
        for p, premise in enumerate(system.premises)
    ]
    units = design.units
    document = {
        "schema": SCHEMA,
        "schema_version": 1,
        "name": f"{system.name}-{1.0 / request.sample_period_s:.0f}hz",
        "creator": {"tool": "quasilpv", "version": __version__},
        "design_hash": document_hash(_inputs(request)),
        "sample_period_s": request.sample_period_s,
        "signals": signals,
        "model": {
            "differential": system.differential,
            "names": [premise.name for premise in system.premises],
            "lower": system.lower.tolist(),
            "upper": system.upper.tolist(),
            "premises": _compiled(premises, numbers),
            **{name: _affine(matrix) for name, matrix in (("E", system.E), ("A", system.A), ("B", system.B))},
        },
        "law": {
            "kind": "regional-feedback",
            "gain": design.model.polytope.to_document(design.gains),
            "schedule": _compiled(tuple(told), numbers),
        },
        "region": {
            "lyapunov": _symmetric(design.lyapunov),
            "decay_rate_per_s": design.decay_rate,
            "speed_per_s": request.speed,
        },
        "plant": plant_document(system, _symbols(system)),
        "witness": {
            "units": [units.T.tolist(), units.S.tolist(), units.D.tolist(), [units.c]],
            **{name: value.tolist() for name, value in design.witness.items()},
        },
        "sampling": sampling,
        "verification": verification,
    }
    return validate(SystemArtifactDocument, document, system.name)


def _symmetric(P: FloatArray) -> list[list[float]]:
    full: list[list[float]] = (0.5 * (P + P.T)).tolist()
    return full


def _symbols(system: DescriptorSystem) -> tuple[sp.Symbol, ...]:
    """Of the signals: states, inputs, parameters."""
    inputs = tuple(sp.Symbol(name, real=True) for name in system.inputs)
    return (*system.state, *inputs, *system.parameters)


def _signals(request: RegionalRequest) -> list[dict[str, Any]]:
    system = request.system
    n, m = system.order, len(system.inputs)
    trim = system.trim or (0.0,) * (n + m)
    unknown = {
        symbol
        for premise in system.premises
        if premise.kind is PremiseKind.UNKNOWN
        for symbol in premise.expression.free_symbols
    }

    def signal(name: str, role: str, bounds: tuple[float, float], value: float, known: bool = True) -> dict[str, Any]:
        low, high = (bound if isfinite(bound) else None for bound in map(float, bounds))
        return {"name": name, "role": role, "unit": "1", "low": low, "high": high, "trim": value, "known": known}

    everything = (-np.inf, np.inf)
    states = [
        signal(symbol.name, "state", system.domain.get(symbol, everything), trim[k])
        for k, symbol in enumerate(system.state)
    ]
    inputs = [
        signal(name, "input", (-bound, bound), trim[n + k])
        for k, (name, bound) in enumerate(zip(system.inputs, request.limits_of_inputs, strict=True))
    ]
    parameters = [
        signal(symbol.name, "parameter", system.domain[symbol], 0.0, symbol not in unknown)
        for symbol in system.parameters
    ]
    return states + inputs + parameters


def _compiled(expressions: tuple[sp.Expr, ...], numbers: Mapping[sp.Symbol, tuple[str, int]]) -> dict[str, Any]:
    program: Program = compile_program(expressions, numbers)
    return program.model_dump(mode="json")


def _affine(matrix: AffineMatrix) -> dict[str, Any]:
    return {"constant": matrix.constant.tolist(), "coefficients": matrix.coefficients.tolist()}


def _inputs(request: RegionalRequest) -> dict[str, Any]:
    """What the design was asked for, as a document."""
    return {
        "system": request.system.name,
        "objective": request.objective,
        "decay_rate": request.decay_rate,
        "input_limits": dict(request.input_limits),
        "rate_hz": request.rate_hz,
        "speed": request.speed,
        "share": request.share,
    }
