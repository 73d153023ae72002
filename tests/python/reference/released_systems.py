"""Released controllers of a few general systems, each made once, and starts and parameters for runs of them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.experiments.system_run import SystemExperiment, level_of, scenario_of
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind

EXAMPLES = Path(__file__).parents[3] / "examples"
ASKED: Mapping[str, tuple[str, dict[str, Any]]] = {
    "two-tanks": ("systems/two_tanks.py:two_tanks", {"decay_rate": 0.05, "input_limits": {"u": 0.006}, "rate_hz": 5.0}),
    "cart-pole": (
        "systems/cart_pole.py:cart_pole",
        {"decay_rate": 1.0, "input_limits": {"u": 60.0}, "rate_hz": 1e3, "speed": 22.0},
    ),
    "boost": (
        "systems/boost.py:boost",
        {"decay_rate": 50.0, "input_limits": {"d": 0.4}, "rate_hz": 1e4, "speed": 1000.0},
    ),
    "dc-bus": ("own_system.py:dc_bus", {}),
}


@cache
def request_of(name: str) -> RegionalRequest:
    reference, asked = ASKED[name]
    return RegionalRequest(system_kind(str(EXAMPLES / reference)).system(), **asked)


@cache
def released(name: str) -> SystemArtifactDocument:
    return release_system(request_of(name))


def loaded(artifact: SystemArtifactDocument) -> _runtime.SystemArtifact:
    return _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()))


def changed(artifact: SystemArtifactDocument, **members: Any) -> SystemArtifactDocument:
    return validate(SystemArtifactDocument, {**artifact.content(), **members}, "changed")


def on_the_border(artifact: SystemArtifactDocument, rng: np.random.Generator, scale: float = 0.999) -> dict[str, float]:
    """A start with V = scale^2, by name, with the trim."""
    q = artifact.model.differential
    direction = rng.normal(size=q)
    x = scale * np.linalg.cholesky(np.array(artifact.region.lyapunov)) @ (direction / np.linalg.norm(direction))
    return {s.name: float(v + s.trim) for s, v in zip(artifact.states[:q], x, strict=True)}


def runs_from_the_border(
    artifact: SystemArtifactDocument, count: int, samples: int = 300
) -> Iterator[tuple[dict[str, float], FloatArray, int, tuple[float, str] | None]]:
    """Runs in C++ from random starts just inside the region, with random parameters: start, V, flags, exit.

    The artifact is read once: thousands of runs take seconds.
    """
    rng, runtime = np.random.default_rng(7), loaded(artifact)
    experiment = SystemExperiment({}, {}, samples * artifact.sample_period_s, rk4_steps=2)
    document = scenario_of(artifact, experiment, "test").to_document()
    for _ in range(count):
        document["start"].update(on_the_border(artifact, rng))
        document["parameters"].update(drawn_parameters(artifact, rng))
        scenario = _runtime.SystemScenario.parse(json.dumps(document).encode(), "test", runtime)
        found = _runtime.simulate_system(runtime, scenario)
        level = level_of(artifact, found["columns"]["state"])
        yield dict(document["start"]), level, found["flags"], found["exit"]


def drawn_parameters(artifact: SystemArtifactDocument, rng: np.random.Generator) -> dict[str, float]:
    return {s.name: float(rng.uniform(s.low, s.high)) for s in artifact.parameters}
