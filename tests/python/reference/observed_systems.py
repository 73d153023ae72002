"""Systems whose laws read some states and estimate the others, and what is released for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from quasilpv.documents.system_artifact import ObserverDocument, SystemArtifactDocument
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.system import DescriptorSystem
from reference.released_systems import EXAMPLES, changed

HEAVY = DescriptorSystem.from_equations(
    ["x' = v", "(2 - cos(x))*v' = 9*sin(x) - k*v + u"],
    state="x v",
    inputs="u",
    domain={"x": (-1, 1), "v": (-3, 3), "k": (0.1, 0.3)},
    unknown="k",
    name="heavy",
)
"""With a mass that depends on the angle, and friction that nobody knows."""

OBSERVED: dict[str, tuple[Callable[[], DescriptorSystem], dict[str, Any]]] = {
    "two-tanks": (
        lambda: system_kind(str(EXAMPLES / "systems/two_tanks.py:two_tanks")).system(),
        {"decay_rate": 0.05, "input_limits": {"u": 0.006}, "measured": ("h2",), "rate_hz": 10.0},
    ),
    "heavy": (lambda: HEAVY, {"decay_rate": 1.0, "input_limits": {"u": 30.0}, "measured": ("x",), "rate_hz": 2000.0}),
}


@cache
def observed(name: str) -> SystemArtifactDocument:
    make, asked = OBSERVED[name]
    return release_system(RegionalRequest(make(), **asked))


def observer_of(artifact: SystemArtifactDocument) -> ObserverDocument:
    assert artifact.observer is not None
    return artifact.observer


def with_observer(artifact: SystemArtifactDocument, **members: Any) -> SystemArtifactDocument:
    return changed(artifact, observer={**observer_of(artifact).model_dump(mode="json"), **members})
