"""One closed-loop run of a general system against its own equations, in one process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.system_artifact import Signal, SystemArtifactDocument
from quasilpv.errors import InputError, one_of

FLAGS = {
    1: "signal invalid",
    2: "premise outside its box",
    4: "input at its limit",
    8: "input not finite",
    16: "outside the region",
}
SETTLING_TIMES = 6.0
"""Length of a run if none is stated, in units of 1 / decay rate."""

MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class SystemExperiment:
    """What is simulated.

    Attributes:
        start: states by name, with their trim; those not named start at their trim.
        parameters: by name; those not named are in the middle of their intervals.
        duration_s: None for `SETTLING_TIMES`.
        delay_s: until an input acts, at most one sample.
        rk4_steps: of the Runge-Kutta method per sample; 0 for IDA.
        tolerance: relative, of IDA.
    """

    start: Mapping[str, float]
    parameters: Mapping[str, float]
    duration_s: float | None = None
    delay_s: float = 0.0
    rk4_steps: int = 0
    tolerance: float = 1e-8


@dataclass(frozen=True, eq=False)
class SystemRun:
    """A run.

    Attributes:
        artifact: the controller.
        time_s: of the samples, (N,).
        state, input: (N, n) and (N, m), with their trim.
        level: V, (N,): at most 1 in the region.
        flags: of all samples, in words.
        exit: when a state left its domain, and which; None if none did.
    """

    artifact: SystemArtifactDocument
    time_s: FloatArray
    state: FloatArray
    input: FloatArray
    level: FloatArray
    flags: tuple[str, ...]
    exit: tuple[float, str] | None

    @property
    def stayed(self) -> bool:
        """Whether V never exceeded its start, and no state left its domain."""
        return self.exit is None and bool(self.level.max() <= max(self.level[0], 1e-300) * (1.0 + 1e-9))

    def to_document(self) -> dict[str, Any]:
        """What ``design simulate --json`` prints."""
        names = [signal.name for signal in self.artifact.states]
        return {
            "artifact": self.artifact.name,
            "hash": self.artifact.hash,
            "samples": len(self.time_s),
            "duration_s": float(self.time_s[-1]) + self.artifact.sample_period_s,
            "level_at_start": float(self.level[0]),
            "largest_level": float(self.level.max()),
            "final_level": float(self.level[-1]),
            "final_state": dict(zip(names, self.state[-1].tolist(), strict=True)),
            "largest_input": {
                signal.name: float(np.abs(self.input[:, k] - signal.trim).max())
                for k, signal in enumerate(self.artifact.inputs)
            },
            "flags": list(self.flags),
            "left_domain": None if self.exit is None else {"time_s": self.exit[0], "signal": self.exit[1]},
        }


def simulate(artifact: SystemArtifactDocument, experiment: SystemExperiment, source: str = "artifact") -> SystemRun:
    """Run it.

    Raises:
        InputError: a name is unknown, or a number is out of range.
        PlantError: the equations could not be integrated.
    """
    start = _values(artifact.states, experiment.start, source, "start", [s.trim for s in artifact.states])
    middle = [
        0.5 * (signal.low + signal.high) + signal.trim
        for signal in artifact.parameters
        if signal.low is not None and signal.high is not None
    ]
    parameters = _values(artifact.parameters, experiment.parameters, source, "parameter", middle)
    period = artifact.sample_period_s
    duration = experiment.duration_s
    if duration is None:
        duration = SETTLING_TIMES / max(artifact.region.decay_rate_per_s, 1e-9)
    samples = round(duration / period)
    if not 1 <= samples <= MOST_SAMPLES:
        raise InputError(
            source,
            "duration",
            f"{duration:g} s",
            f"{period:g} to {MOST_SAMPLES * period:g} s, 1 to {MOST_SAMPLES} samples",
        )
    if not 0.0 <= experiment.delay_s <= period:
        raise InputError(source, "delay", f"{experiment.delay_s:g} s", f"0 to one sample, {period:g} s")
    runtime = _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()), source)
    found = _runtime.simulate_system(
        runtime, start, parameters, samples, experiment.rk4_steps, experiment.tolerance, experiment.delay_s
    )
    columns = found["columns"]
    return SystemRun(
        artifact=artifact,
        time_s=columns["time_s"][:, 0],
        state=columns["state"],
        input=columns["input"],
        level=columns["level"][:, 0],
        flags=tuple(text for bit, text in FLAGS.items() if found["flags"] & bit),
        exit=found["exit"],
    )


def _values(
    signals: tuple[Signal, ...], given: Mapping[str, float], source: str, field: str, otherwise: list[float]
) -> list[float]:
    """In order; those not named as they are otherwise."""
    names = [signal.name for signal in signals]
    for name in given:
        if name not in names:
            raise InputError(source, field, name, one_of(names, name) if names else "nothing: it has none")
    return [float(given.get(name, value)) for name, value in zip(names, otherwise, strict=True)]
