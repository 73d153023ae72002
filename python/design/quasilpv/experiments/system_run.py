"""One closed-loop run of a general system against its own equations, and the same in one process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import MAX_SAFE_INTEGER, canonical_json
from quasilpv.documents.system_artifact import DISTURBANCE, PERFORMANCE, SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.scenarios import NOISE_SEED, IdaIntegrator, Rk4Integrator, SystemScenario
from quasilpv.scenarios.system_schema import MOST_SAMPLES, SystemDisturbance, SystemSensors, values_by_name
from quasilpv.telemetry.codes import SYSTEM_FLAGS

SETTLING_TIMES = 6.0
"""Length of a run if none is stated, in units of 1 / decay rate."""


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
        noise: standard deviations of white noise on what is measured of states, by name.
        quantisation: steps to which what is measured of states is rounded, by name.
        seed: of the noise.
        disturbances: what acts on inputs and on rates of states.
    """

    start: Mapping[str, float]
    parameters: Mapping[str, float]
    duration_s: float | None = None
    delay_s: float = 0.0
    rk4_steps: int = 0
    tolerance: float = 1e-8
    noise: Mapping[str, float] = field(default_factory=dict)
    quantisation: Mapping[str, float] = field(default_factory=dict)
    seed: int = NOISE_SEED
    disturbances: tuple[SystemDisturbance, ...] = ()


@dataclass(frozen=True, eq=False)
class SystemRun:
    """A run.

    Attributes:
        artifact: the controller.
        scenario: what was run.
        time_s: of the samples, (N,).
        state, measured: (N, n), the truth and what the law used of it, measured or estimated, with their trim.
        input, commanded: (N, m), what acted and what the law asked for before limits, with their trim.
        premise: (N, p), clamped to its box.
        level: V of the truth, (N,): at most 1 in the region.
        measured_level: V as the controller saw it, (N,).
        sample_flags: (N,), bits of `codes.SYSTEM_FLAGS`.
        exit: when a state left its domain, and which; None if none did.
    """

    artifact: SystemArtifactDocument
    scenario: SystemScenario
    time_s: FloatArray
    state: FloatArray
    measured: FloatArray
    input: FloatArray
    commanded: FloatArray
    premise: FloatArray
    level: FloatArray
    measured_level: FloatArray
    sample_flags: npt.NDArray[np.int64]
    exit: tuple[float, str] | None

    @property
    def flags(self) -> tuple[str, ...]:
        """What happened in any sample, in words."""
        union = int(np.bitwise_or.reduce(self.sample_flags))
        return tuple(text for bit, text in SYSTEM_FLAGS.items() if union & bit)

    @property
    def estimation_error(self) -> dict[str, FloatArray]:
        """Of every estimated state, by name, truth less estimate, (N,)."""
        if self.artifact.observer is None:
            return {}
        names = [signal.name for signal in self.artifact.states[: self.artifact.model.differential]]
        error = self.state - self.measured
        return {name: error[:, k] for k, name in enumerate(names) if name not in self.artifact.observer.measured}

    @property
    def start_level(self) -> float:
        """V at the start; with an observer ``(|x|_P + nu |e|_Q)^2`` there, which bounds V from then on: at most 1 if
        the run begins where something is proved.

        What is measured is taken to be exact: the first measurement is the first estimate of it.
        """
        own = self.artifact.observer
        if own is None:
            return float(self.level[0])
        first = {name: values[0] for name, values in self.estimation_error.items()}
        states = self.artifact.states[: self.artifact.model.differential]
        error = np.array([first.get(signal.name, 0.0) for signal in states])
        size = np.sqrt(error @ np.linalg.solve(np.array(own.lyapunov), error))
        return float((np.sqrt(self.level[0]) + own.weight * size) ** 2)

    @property
    def beyond_assumed(self) -> dict[str, str]:
        """Parameters outside what the proof assumes of them, each with that interval in words."""
        values = self.scenario.parameters
        return {
            signal.name: f"{signal.low:g} to {signal.high:g}"
            for signal in self.artifact.parameters
            if signal.low is not None
            and signal.high is not None
            and not signal.low <= values[signal.name] - signal.trim <= signal.high
        }

    @property
    def is_nominal(self) -> bool:
        """Whether it is what proofs are of: `SystemScenario.is_nominal`, no delay, parameters as they are assumed."""
        return self.scenario.is_nominal and not self.scenario.delay_s and not self.beyond_assumed

    @property
    def stayed(self) -> bool:
        """Whether no state left its domain, and V never exceeded `start_level` or, in what no proof is of, 1."""
        bound = self.start_level if self.is_nominal else max(self.start_level, 1.0)
        return self.exit is None and bool(self.level.max() <= max(bound, 1e-300) * (1.0 + 1e-9))

    def first_difference(self, other: SystemRun) -> str | None:
        """In words, the first sample in which two runs differ in any bit; None if there is none."""
        if len(self.time_s) != len(other.time_s):
            return f"{len(self.time_s)} samples and {len(other.time_s)}"
        for name in ("time_s", "state", "measured", "input", "commanded", "premise", "measured_level"):
            mine, theirs = (np.ascontiguousarray(getattr(run, name), dtype=np.float64) for run in (self, other))
            different = np.flatnonzero(
                (mine.view(np.int64) != theirs.view(np.int64)).reshape(len(mine), -1).any(axis=1)
            )
            if different.size:
                k = int(different[0])
                return f"{name} of sample {k}: {mine[k].tolist()!r} and {theirs[k].tolist()!r}"
        return None

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
            **(
                {}
                if self.artifact.observer is None
                else {
                    "start_level": self.start_level,
                    "largest_error": {name: float(np.abs(e).max()) for name, e in self.estimation_error.items()},
                    "final_error": {name: float(e[-1]) for name, e in self.estimation_error.items()},
                }
            ),
            "exact_sensors": self.scenario.has_exact_sensors,
            "beyond_assumed": sorted(self.beyond_assumed),
            "disturbed": sorted({term.signal for term in self.scenario.disturbances}),
            "flags": list(self.flags),
            "left_domain": None if self.exit is None else {"time_s": self.exit[0], "signal": self.exit[1]},
        }


def scenario_of(artifact: SystemArtifactDocument, experiment: SystemExperiment, source: str) -> SystemScenario:
    """The document of an experiment with a controller.

    Raises:
        InputError: a name is unknown, or a number is out of range.
    """
    states = artifact.states
    nothing = [0.0] * len(states)
    middle = [
        0.5 * (signal.low + signal.high) + signal.trim
        for signal in artifact.parameters
        if signal.low is not None and signal.high is not None
    ]
    start = values_by_name(states, experiment.start, [signal.trim for signal in states], source, "start")
    parameters = values_by_name(artifact.parameters, experiment.parameters, middle, source, "parameter")
    noise = values_by_name(states, experiment.noise, nothing, source, "noise")
    quantum = values_by_name(states, experiment.quantisation, nothing, source, "quantisation")
    for name, sizes in (("noise", noise), ("quantisation", quantum)):
        for signal, size in sizes.items():
            if not 0.0 <= size < np.inf:
                raise InputError(source, f"{name} {signal}", f"{size:g}", "a number that is not negative")
    if not 0 <= experiment.seed <= MAX_SAFE_INTEGER:
        raise InputError(source, "seed", experiment.seed, f"0 to {MAX_SAFE_INTEGER}")
    tolerance = experiment.tolerance
    return SystemScenario(
        name=artifact.name,
        samples=_samples(artifact, experiment, source),
        start=start,
        parameters=parameters,
        integrator=Rk4Integrator(steps_per_sample=experiment.rk4_steps)
        if experiment.rk4_steps
        else IdaIntegrator(relative_tolerance=tolerance, absolute_tolerance=0.01 * tolerance),
        delay_s=experiment.delay_s,
        sensors=SystemSensors(noise=noise, quantum=quantum, seed=experiment.seed),
        disturbances=experiment.disturbances,
    ).require_names_of(artifact, source)


def _samples(artifact: SystemArtifactDocument, experiment: SystemExperiment, source: str) -> int:
    period, duration = artifact.sample_period_s, experiment.duration_s
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
    return samples


def simulate(artifact: SystemArtifactDocument, experiment: SystemExperiment, source: str = "artifact") -> SystemRun:
    """Run it.

    Raises:
        InputError: a name is unknown, or a number is out of range.
        PlantError: the equations could not be integrated.
    """
    return simulate_scenario(artifact, scenario_of(artifact, experiment, source), source)


def simulate_scenario(artifact: SystemArtifactDocument, scenario: SystemScenario, source: str) -> SystemRun:
    """Run a document. Errors as `simulate`."""
    runtime = _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()), source)
    wanted = _runtime.SystemScenario.parse(canonical_json(scenario.to_document()), source, runtime)
    found = _runtime.simulate_system(runtime, wanted)
    columns = found["columns"]
    return SystemRun(
        artifact=artifact,
        scenario=scenario,
        time_s=columns["time_s"][:, 0],
        state=columns["state"],
        measured=columns["measured"],
        input=columns["input"],
        commanded=columns["commanded"],
        premise=columns.get("premise", np.empty((len(columns["state"]), 0))),
        level=level_of(artifact, columns["state"]),
        measured_level=columns["level"][:, 0],
        sample_flags=columns["flags"][:, 0].astype(np.int64),
        exit=found["exit"],
    )


def disturbance_of(run: SystemRun) -> FloatArray:
    """What was added at the samples of a run, (N, n + m): to rates of states, and to inputs."""
    runtime = _runtime.SystemArtifact.parse(canonical_json(run.artifact.to_document()))
    scenario = _runtime.SystemScenario.parse(canonical_json(run.scenario.to_document()), run.scenario.name, runtime)
    added = _runtime.disturbance_of(runtime, scenario)
    return np.asarray(added[np.rint(run.time_s / run.artifact.sample_period_s).astype(np.int64)])


def gain_of(run: SystemRun) -> tuple[float, float] | None:
    """``(int z'z dt / int w'w dt)^(1/2)`` of a run and its ``int w'w dt`` (s), by sums over its samples.

    In the sizes of the design, with the performance z and the disturbance w that the design for an L2 gain names; None
    if it is of another objective, or if nothing disturbs.
    """
    artifact, witness = run.artifact, run.artifact.witness
    if artifact.l2_gain is None or not run.scenario.disturbances:
        return None
    trim = np.array([signal.trim for signal in (*artifact.states, *artifact.inputs)])
    signals = np.hstack([run.state, run.input]) - trim
    period = artifact.sample_period_s
    added, seen = (
        period * _energy(values, np.array(witness[name][0]))
        for name, values in ((DISTURBANCE, disturbance_of(run)), (PERFORMANCE, signals))
    )
    return (float(np.sqrt(seen / added)), added) if added > 0.0 else None


def _energy(values: FloatArray, sizes: FloatArray) -> float:
    """Sum of squares of the signals that have a size, in it."""
    own = sizes > 0.0
    return float(((values[:, own] / sizes[own]) ** 2).sum())


def level_of(artifact: SystemArtifactDocument, state: FloatArray) -> FloatArray:
    """V = x_d' P^-1 x_d of states (N, n) with their trim: (N,)."""
    q = artifact.model.differential
    x = state[:, :q] - np.array([signal.trim for signal in artifact.states[:q]])
    return np.asarray(np.einsum("ki,ik->k", x, np.linalg.solve(np.array(artifact.region.lyapunov), x.T)))
