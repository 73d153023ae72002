"""The grid check of a general system: its exact plant over a sample from many points of the region. No proof.

At points on the border of the region and inside it, with parameters in and at the ends of their intervals, the C++ law
asks for an input and IDA integrates the equations under it; what is looked for is the largest V+/V. From the ten worst
points a local search goes on. With a delay, whose first sample nothing acts in, it is the mean per sample over some.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.experiments.system_run import SystemExperiment, level_of, scenario_of
from quasilpv.progress import Progress, no_progress

POINTS = 2000
"""Half of them on the border."""

CLIMBED = 10
"""So many of the worst points are climbed from."""

CLIMBS = 25
"""Steps of each, shorter and shorter."""

BORDER = 0.999
"""|x|_P of points on the border."""

DELAYED_SAMPLES = 20
"""Over which the mean is taken with a delay."""

TOLERANCE = 1e-10
"""Relative, of IDA."""

_SEED = 2022


@dataclass(frozen=True, eq=False)
class SystemGrid:
    """What was found, sampled.

    Attributes:
        artifact: the controller.
        delay_s: until an input acts.
        state: where the runs began, differential states with their trim, (N, q).
        parameters: of the true plant, (N, p).
        growth: V+/V, of a sample or in the mean, (N,); infinite where a state left its domain.
        input: largest share of the limits of an input, (N,); 0 without limits.
    """

    artifact: SystemArtifactDocument
    delay_s: float
    state: FloatArray
    parameters: FloatArray
    growth: FloatArray
    input: FloatArray

    @property
    def worst(self) -> int:
        """The number of the worst point."""
        return int(np.argmax(self.growth))

    @property
    def passed(self) -> bool:
        """Whether V fell from every point and no input passed its limits."""
        return bool(self.growth.max() < 1.0 and self.input.max() <= 1.0 + 1e-9)

    def to_document(self) -> dict[str, Any]:
        """What ``design robust --json`` prints."""
        k, q = self.worst, self.artifact.model.differential
        growth = float(self.growth[k])
        return {
            "artifact": self.artifact.name,
            "hash": self.artifact.hash,
            "evidence": "sampled",
            "passed": self.passed,
            "points": len(self.growth),
            "delay_s": self.delay_s,
            "samples": 1 if self.delay_s == 0.0 else DELAYED_SAMPLES,
            "worst_growth": growth if np.isfinite(growth) else None,
            "left_domain": int(np.isinf(self.growth).sum()),
            "worst_state": {s.name: float(v) for s, v in zip(self.artifact.states[:q], self.state[k], strict=True)},
            "worst_parameters": {
                s.name: float(v) for s, v in zip(self.artifact.parameters, self.parameters[k], strict=True)
            },
            "largest_input_share": float(self.input.max()),
        }


def grid_check(
    artifact: SystemArtifactDocument,
    delay_s: float = 0.0,
    points: int | None = None,
    source: str = "artifact",
    progress: Progress = no_progress,
) -> SystemGrid:
    """Look at many points of the region.

    Args:
        artifact: a controller of a system.
        delay_s: until an input acts, at most one sample.
        points: how many before the local search; None for `POINTS`.
        source: what to call it in errors.
        progress: called with (points done, points in all).

    Raises:
        InputError: the delay is out of range.
        PlantError: the equations could not be integrated.
    """
    if not 0.0 <= delay_s <= artifact.sample_period_s:
        raise InputError(source, "delay", f"{delay_s:g} s", f"0 to one sample, {artifact.sample_period_s:g} s")
    runtime = _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()), source)
    own = _Runs(artifact, runtime, delay_s, source)
    rng = np.random.default_rng(_SEED)
    points = points or POINTS
    chosen = [own.draw(rng, is_border=k % 2 == 0) for k in range(points)]
    found = []
    for k, (y, share) in enumerate(chosen):
        progress(k, points)
        found.append((y, share, *own.run(y, share)))
    for start in sorted(found, key=lambda each: -each[2])[:CLIMBED]:
        found += own.climb(start, rng)
    y, share, growth, asked = (np.array(column) for column in zip(*found, strict=True))
    return SystemGrid(artifact, delay_s, own.states(y), own.parameters(share), growth, asked)


_Point = tuple[FloatArray, FloatArray, float, float]


@dataclass(frozen=True)
class _Runs:
    """One-sample runs of an artifact from points y of the unit ball, x = R y, and shares of the parameter intervals."""

    artifact: SystemArtifactDocument
    runtime: _runtime.SystemArtifact
    delay_s: float
    source: str

    def draw(self, rng: np.random.Generator, *, is_border: bool) -> tuple[FloatArray, FloatArray]:
        """A point, and parameters: half of the time at ends of their intervals."""
        q, p = self.artifact.model.differential, len(self.artifact.parameters)
        direction = rng.normal(size=q)
        radius = BORDER if is_border else BORDER * rng.uniform() ** (1.0 / q)
        share = rng.uniform(size=p)
        return radius * direction / np.linalg.norm(direction), np.round(share) if rng.uniform() < 0.5 else share

    def states(self, y: FloatArray) -> FloatArray:
        """Of points (N, q), with their trim."""
        trim = np.array([s.trim for s in self.artifact.states[: y.shape[1]]])
        return np.asarray(y @ np.linalg.cholesky(np.array(self.artifact.region.lyapunov)).T + trim)

    def parameters(self, share: FloatArray) -> FloatArray:
        """Of shares (N, p), with their trim."""
        ends = [((s.low or 0.0) + s.trim, (s.high or 0.0) + s.trim) for s in self.artifact.parameters]
        low, high = np.array(ends).reshape(-1, 2).T
        return np.asarray(low + share * (high - low))

    def run(self, y: FloatArray, share: FloatArray) -> tuple[float, float]:
        """V+/V and the largest share of an input's limits."""
        steps = 1 if self.delay_s == 0.0 else DELAYED_SAMPLES
        states, named = self.artifact.states, self.artifact.parameters
        start = dict(zip([s.name for s in states[: len(y)]], self.states(y[None])[0].tolist(), strict=True))
        values = self.parameters(share[None])[0].tolist() if named else []
        experiment = SystemExperiment(
            start,
            dict(zip([s.name for s in named], values, strict=True)),
            (steps + 1) * self.artifact.sample_period_s,
            self.delay_s,
            tolerance=TOLERANCE,
        )
        document = scenario_of(self.artifact, experiment, self.source).to_document()
        scenario = _runtime.SystemScenario.parse(canonical_json(document), self.source, self.runtime)
        scenario.estimate = [start[signal.name] for signal in states[: len(y)]]  # of an observer: no error
        found = _runtime.simulate_system(self.runtime, scenario)
        columns = found["columns"]
        level = level_of(self.artifact, columns["state"])
        growth = float((level[-1] / level[0]) ** (1.0 / steps)) if found["exit"] is None else np.inf
        return growth, _largest_share(self.artifact, columns["commanded"][:-1])

    def climb(self, start: _Point, rng: np.random.Generator) -> list[_Point]:
        """Points near one, each worse than the one before it."""
        worse: list[_Point] = []
        y, share, growth, _ = start
        for step in range(CLIMBS):
            width = 0.3 * 0.8**step
            own = y + width * rng.normal(size=len(y)) / np.sqrt(len(y))
            own *= min(1.0, BORDER / float(np.linalg.norm(own)))
            around = np.clip(share + width * rng.normal(size=len(share)), 0.0, 1.0)
            found = self.run(own, around)
            if found[0] > growth:
                y, share, growth = own, around, found[0]
                worse.append((own, around, *found))
        return worse


def _largest_share(artifact: SystemArtifactDocument, commanded: FloatArray) -> float:
    """Of the limits of the inputs, by what the law asked for."""
    shares: Sequence[float] = [0.0]
    for k, signal in enumerate(artifact.inputs):
        own = commanded[:, k] - signal.trim
        for bound in (signal.low, signal.high):
            if bound:
                shares = [*shares, float((own / bound).max())]
    return max(shares)
