"""How far the intervals of parameters can grow before a shipped feedback is no more proved, each and all together.

The interval of a parameter grows around its middle by a factor. A factor is *proved* if the checker decides every
inequality on the wider intervals, with gains and region as shipped; *refuted* if a point of the region with parameters
of the wider intervals is found at which V does not fall as claimed, in ball arithmetic. Between both it is *unknown*.
Both are of the loop before sampling, with parameters that may change at any speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from quasilpv.certificate.systems.rising import Rise, RisingPoints
from quasilpv.documents.system_artifact import Signal, SystemArtifactDocument
from quasilpv.lmi.budget import TimeUpError
from quasilpv.progress import Progress, no_progress
from quasilpv.system_release.reanalysis import Intervals, proved, widened

LARGEST = 64.0
"""Factor beyond which nothing is asked."""

PROOFS, REFUTATIONS = 7, 14
"""Steps of the bisections."""

DECAY, FALLS = "decay", "V falls"
"""The claims: the decay rate and the speed that the artifact states, or only that V falls."""


@dataclass(frozen=True)
class ParameterMargin:
    """Of some parameters whose intervals grow by one factor.

    Attributes:
        names: of the parameters.
        claim: `DECAY` or `FALLS`.
        proved: a factor up to which the claim is proved.
        refuted: a factor at which it is refuted; None if none up to `LARGEST` was.
        at: where, for that factor.
        reason: why no larger factor is proved, where that is not because the inequalities fail.
    """

    names: tuple[str, ...]
    claim: str
    proved: float
    refuted: float | None
    at: Rise | None
    reason: str = ""


def parameter_margins(artifact: SystemArtifactDocument, progress: Progress = no_progress) -> list[ParameterMargin]:
    """Of every parameter with an interval of positive width, and of all of them; none if there is none.

    Args:
        artifact: of a controller of a system, verified.
        progress: called with (margins found, margins in all).
    """
    wide = [signal for signal in artifact.parameters if _half(signal) > 0.0]
    groups = [[signal] for signal in wide] + ([wide] if len(wide) > 1 else [])
    asked = [(group, claim) for group in groups for claim in (DECAY, FALLS)]
    found = []
    for done, (group, claim) in enumerate(asked):
        progress(done, len(asked))
        found.append(_margin(artifact, group, claim))
    return found


def grown(signals: Sequence[Signal], factor: float) -> dict[str, tuple[float, float]]:
    """Intervals of parameters, as deviations from their trim, that are wider by a factor."""
    if factor == 1.0:
        return {signal.name: (signal.low or 0.0, signal.high or 0.0) for signal in signals}
    middles = {signal.name: 0.5 * ((signal.low or 0.0) + (signal.high or 0.0)) for signal in signals}
    return {
        signal.name: (middles[signal.name] - factor * _half(signal), middles[signal.name] + factor * _half(signal))
        for signal in signals
    }


def margin_document(artifact: SystemArtifactDocument, margin: ParameterMargin) -> dict[str, Any]:
    """What ``--json`` prints: intervals with their trim."""
    signals = [signal for signal in artifact.parameters if signal.name in margin.names]

    def intervals(factor: float | None) -> Mapping[str, list[float]] | None:
        if factor is None:
            return None
        own = grown(signals, factor)
        return {s.name: [own[s.name][0] + s.trim, own[s.name][1] + s.trim] for s in signals}

    at = margin.at and {
        **{s.name: float(v + s.trim) for s, v in zip(artifact.states, margin.at.state, strict=False)},
        **{s.name: float(v + s.trim) for s, v in zip(artifact.parameters, margin.at.parameters, strict=True)},
    }
    return {
        "parameters": list(margin.names),
        "claim": margin.claim,
        "proved_factor": margin.proved,
        "proved": intervals(margin.proved),
        "refuted_factor": margin.refuted,
        "refuted": intervals(margin.refuted),
        "refuted_at": at,
        "reason": margin.reason,
    }


def _half(signal: Signal) -> float:
    return 0.5 * ((signal.high or 0.0) - (signal.low or 0.0))


def _margin(artifact: SystemArtifactDocument, signals: Sequence[Signal], claim: str) -> ParameterMargin:
    region = artifact.region
    decay_rate, speed = (region.decay_rate_per_s, region.speed_per_s) if claim == DECAY else (0.0, None)
    own = _Asked(artifact, signals, decay_rate, speed)
    low, reason = own.largest_proved()
    refuted = own.smallest_refuted(low)
    margin = ParameterMargin(tuple(s.name for s in signals), claim, low, None, None, reason)
    return margin if refuted is None else replace(margin, refuted=refuted[0], at=refuted[1])


@dataclass(frozen=True)
class _Asked:
    artifact: SystemArtifactDocument
    signals: Sequence[Signal]
    decay_rate: float
    speed: float | None

    def _at(self, factor: float) -> SystemArtifactDocument | None:
        intervals: Intervals = grown(self.signals, factor)
        return widened(self.artifact, intervals)

    def largest_proved(self) -> tuple[float, str]:
        """By doubling, then bisection; the artifact itself is the proof at 1."""
        low, high, reason = 1.0, 2.0, ""
        while high <= LARGEST:
            good, why = self._proved(high)
            if not good:
                reason = why
                break
            low, high = high, 2.0 * high
        else:
            return low, "no more was asked"
        for _ in range(PROOFS):
            middle = (low * high) ** 0.5
            good, why = self._proved(middle)
            low, high = (middle, high) if good else (low, middle)
            reason = reason if good else why
        return low, reason

    def _proved(self, factor: float) -> tuple[bool, str]:
        own = self._at(factor)
        if own is None:
            return False, "a premise that the law is told would leave its box, where the law holds it"
        try:
            return proved(own, self.decay_rate, self.speed), ""
        except TimeUpError:
            return False, "the time was up"

    def smallest_refuted(self, proved_factor: float) -> tuple[float, Rise] | None:
        """By bisection between what is proved and the largest factor, as far as points are found."""
        best = self._rise(LARGEST)
        if best is None:
            return None
        low, high = proved_factor, LARGEST
        for _ in range(REFUTATIONS):
            middle = (low * high) ** 0.5
            found = self._rise(middle)
            if found is None:
                low = middle
            else:
                high, best = middle, found
        return high, best

    def _rise(self, factor: float) -> Rise | None:
        own = self._at(factor)
        return None if own is None else RisingPoints(own, self.decay_rate).found()
