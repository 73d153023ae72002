"""An observer for a designed feedback, proved with the sampled loop: candidates from samples, then the enclosure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from quasilpv.certificate.systems.balls import split
from quasilpv.certificate.systems.cells import Cells
from quasilpv.certificate.systems.observed import ObservedLoop
from quasilpv.documents.system_artifact import ObserverDocument, ObserverSampling
from quasilpv.errors import ClaimError, InfeasibleError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.regional.feedback import RegionalDesign
from quasilpv.synthesis.regional.observer import ObserverDesign, SampledSlopes, observer_designs, unseen_modes
from quasilpv.synthesis.regional.request import DEFAULT_RATE_HZ, RegionalRequest
from quasilpv.system_release.document import artifact_of
from quasilpv.system_release.search import rates_from, searched

POINTS = 24
SEED = 2022

CELLS = 400
"""Of the first look at a candidate; what is shipped is decided with more."""

MOST_TRIED = 3
"""Candidates that are enclosed for a period."""

SLOWER = (1.0, 5.0)
"""Closed loops are tried that are made for rates so many times lower."""

LARGEST_RATE_HZ = 1e6

WEIGHT = 1.0 + 1e-6
"""nu: candidates are scaled for 1."""


@dataclass(frozen=True, eq=False)
class Observed:
    """An observer, and how its loop is proved for a period; None: it is not."""

    observer: ObserverDocument
    sampling: ObserverSampling | None


class Observing:
    """The way from a feedback to its observer.

    Raises:
        ArithmeticError: as `Cells`.
    """

    def __init__(self, design: RegionalDesign) -> None:
        """Look at samples of the region."""
        self.design, self.artifact = design, artifact_of(design)
        self._cells = Cells(self.artifact)
        self._near: float | None = None  # the best rate of the error at the last period

    @cached_property
    def samples(self) -> SampledSlopes:
        """The trim first, then points of the region, mostly of its border; inputs and parameters at random ends."""
        cells, rng = self._cells, np.random.default_rng(SEED)
        q, n, m = cells.q, cells.n, cells.m
        R = np.linalg.cholesky(np.array(self.artifact.region.lyapunov))
        low, high = np.array(cells.whole).T
        slopes, closed = [], []
        for k in range(POINTS):
            direction = rng.normal(size=q)
            size = 0.0 if k == 0 else 1.0 if k % 4 else rng.uniform()
            point = np.where(rng.uniform(size=len(low)) < 0.5, low, high)
            point[q:n] = 0.0
            point[:q] = size * R @ direction / np.linalg.norm(direction)
            if k == 0:
                point[n : n + m] = 0.0
                point[n + m :] = 0.5 * (low + high)[n + m :]
            cell = cells.balls(tuple((value, value) for value in point))
            slopes.append(split(cells.dynamics.slope(cell))[0])
            closed.append(split(cells.dynamics.closed(cell))[0])
        left = np.linalg.inv(R)
        names = [signal.name for signal in self.artifact.states[:q]]
        return SampledSlopes(
            region=R @ R.T,
            measured=tuple(name in self.design.request.measured for name in names),
            slopes=R @ np.array(slopes) @ left,
            closed=R @ np.array(closed) @ left,
            decay_rate=self.artifact.region.decay_rate_per_s,
        )

    @property
    def missing(self) -> list[str]:
        """Names of states to measure too, because nothing that is measured tells of them."""
        return [self.artifact.states[k].name for k in unseen_modes(self.samples)]

    def at(self, period_s: float, allow_unproved_rate: bool = False) -> Observed | None:
        """An observer with which a period is proved; None if none of the candidates is.

        Args:
            period_s: T.
            allow_unproved_rate: take the best candidate, proved or not.
        """
        candidates = observer_designs(self.samples, period_s, self._near)
        if not candidates:
            return None
        self._near = candidates[0].rate
        for candidate in [each for each in candidates if each.contracts][:MOST_TRIED]:
            found = self.proved(candidate, period_s, CELLS)
            if found is not None:
                return found
        return Observed(self.document(candidates[0]), None) if allow_unproved_rate else None

    def proved(self, candidate: ObserverDesign, period_s: float, cells: int) -> Observed | None:
        """A candidate, if its contraction is enclosed below 1."""
        observer = self.document(candidate)
        trial = artifact_of(self.design.at(1.0 / period_s), observer=observer)
        loop = ObservedLoop(trial, cells)
        theta = loop.contraction()
        if not theta < 1.0:
            return None
        own = loop.bound
        sampling = ObserverSampling(
            method="observer",
            speed_per_s=own.b,
            lipschitz_per_s=own.J,
            mismatch_per_s=own.d,
            error_contraction=own.mu,
            contraction=theta,
        )
        return Observed(observer, sampling)

    def document(self, candidate: ObserverDesign) -> ObserverDocument:
        """A candidate as it is shipped."""
        request = self.design.request
        names = [signal.name for signal in self.artifact.states[: self._cells.q]]
        trim = [signal.trim for signal in self.artifact.states[: self._cells.q]]
        start = [request.start_estimate.get(name, value) - value for name, value in zip(names, trim, strict=True)]
        rows = candidate.gain.tolist(), candidate.lyapunov.tolist()
        return ObserverDocument(
            measured=tuple(name for name in names if name in request.measured),
            gain=tuple(map(tuple, rows[0])),
            lyapunov=tuple(map(tuple, rows[1])),
            weight=WEIGHT,
            start=tuple(start),
        )


def observed(
    request: RegionalRequest, allow_unproved_rate: bool = False, progress: Progress = no_progress
) -> tuple[RegionalDesign, Observed]:
    """A feedback and its observer, proved at the rate that was asked for or at the first one that is.

    The feedback is that of a law that reads the whole state; if the rate is asked for and not proved with an observer,
    it is one of a slower closed loop.

    Args:
        request: what is asked for.
        allow_unproved_rate: take the first observer, proved or not.
        progress: called with (designs done, designs in all).

    Raises:
        InputError, InfeasibleError: see `design_feedback`; or no observer contracts at samples of the region.
        ClaimError: no period is proved.
    """
    exact = replace(request, measured=(), start_estimate={})
    name, refusal = request.system.name, None
    for slower in SLOWER if request.rate_hz is not None else (1.0,):
        asked = None if request.rate_hz is None else request.rate_hz / slower
        try:
            found = searched(replace(exact, rate_hz=asked), allow_unproved_rate, progress)
        except (InfeasibleError, ClaimError) as error:
            refusal = refusal or error
            continue
        rate_hz = found.design.request.rate_hz or DEFAULT_RATE_HZ
        own = replace(request, system=found.design.request.system, rate_hz=rate_hz)
        observing = Observing(replace(found.design, request=own))
        if observing.missing:
            raise InfeasibleError(f"{name}: {_missing(request, observing.missing)}")
        rates = [rate_hz] if request.rate_hz is not None else rates_from(rate_hz, LARGEST_RATE_HZ)
        for rate in rates:
            answer = observing.at(1.0 / rate, allow_unproved_rate)
            if answer is not None:
                return observing.design.at(rate), answer
        faster = next((rate for rate in rates_from(2.0 * rate_hz, LARGEST_RATE_HZ) if observing.at(1.0 / rate)), None)
        refusal = refusal or ClaimError(_not_proved(request, rate_hz, faster))
    assert refusal is not None  # there is at least one feedback
    raise refusal


def _missing(request: RegionalRequest, names: list[str]) -> str:
    told, wanted = ", ".join(request.measured), ", ".join(names)
    return f"nothing that is measured ({told}) tells how {wanted} moves: measure {wanted} too, or leave it out"


def _not_proved(request: RegionalRequest, rate_hz: float, faster: float | None) -> str:
    name, told = request.system.name, ", ".join(request.measured)
    if faster is None:
        return (
            f"{name}: no sampling rate up to {LARGEST_RATE_HZ:g} Hz is proved with an observer that reads {told}: "
            "measure more states, or ask for less input, decay or domain; --allow-unproved-rate releases one"
        )
    return (
        f"{name}: {rate_hz:g} Hz is not proved with an observer that reads {told}; {faster:g} Hz would be (--rate-hz), "
        "or measure more states; --allow-unproved-rate releases it unproved"
    )
