"""The control step of general systems, warm, beside the same law in numpy."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench_programs import costs, run_in_turns, run_program
from bench_report import DisagreementError, Report, main, row

from quasilpv import _runtime
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.certificate.exact.program_ranges import outputs_of
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.system import DescriptorSystem

EXAMPLES = Path(__file__).parents[2] / "examples"
SYSTEMS = {
    "two-tanks": ("systems/two_tanks.py:two_tanks", {"u": 0.006}),
    "dc-bus": ("own_system.py:dc_bus", {}),
    "cart-pole": ("systems/cart_pole.py:cart_pole", {"u": 60.0}),
    "quadrotor": ("systems/quadrotor.py:attitude", {}),
}
COMPETITOR = "numpy, the same law"
LARGEST_DIFFERENCE = 1e-9
NUMPY_STEPS = 2000


def measure(quick: bool) -> Report:
    """Time the step of every system, in C++ and in numpy; check that both give the same input."""
    names = ["two-tanks"] if quick else list(SYSTEMS)
    rounds = 1 if quick else 20
    runs, beside, notes = {}, {}, []
    with TemporaryDirectory() as folder:
        for name in names:
            reference, limits = SYSTEMS[name]
            system = system_kind(str(EXAMPLES / reference)).system()
            artifact = release_system(RegionalRequest(system, input_limits=limits), allow_unproved_rate=True)
            path, _ = write_system_artifact(Path(folder) / name, artifact)
            runs[name] = partial(run_program, "system_step_bench", path, rounds)
            beside[name] = numpy_step_ns(system, artifact, path, 1 if quick else 5)
        measured = run_in_turns(runs, quick=quick)
    rows = []
    for name in names:
        notes.append(f"{name}: {measured[name][0]['states']} states")
        for label, key in {"p50": "p50_ns", "p99.9": "p999_ns"}.items():
            rival = (COMPETITOR, beside[name]) if label == "p50" else None
            rows.append(row(f"{name} step {label}", costs(measured[name], "timing", key), "ns", rival))
    return Report(rows, notes)


def numpy_step_ns(system: DescriptorSystem, artifact: SystemArtifactDocument, path: Path, rounds: int) -> list[float]:
    """Mean time of a step as one would write it in numpy, ns, of every round.

    Raises:
        DisagreementError: it does not give the input of the C++ step.
    """
    q, table = artifact.model.differential, artifact.law.gain
    lower, upper, centre = (np.array(values) for values in (table.lower, table.upper, table.centre))
    vertices = np.array([vertex for block in table.blocks for vertex in block.vertices])
    low = np.array([-np.inf if signal.low is None else signal.low for signal in artifact.inputs])
    high = np.array([np.inf if signal.high is None else signal.high for signal in artifact.inputs])
    parameters = {s.name: 0.5 * ((s.low or 0.0) + (s.high or 0.0)) for s in artifact.parameters}
    told = [step[0] != "const" for step in _first_steps(artifact)]

    def law(x: Any) -> Any:
        z = np.where(told, system.premise_values(x, parameters), centre)
        share = (np.clip(z, lower, upper) - lower) / (upper - lower)
        weights = np.stack([1.0 - share, share], axis=1).ravel() / max(len(table.blocks), 1)
        return np.clip(np.tensordot(weights, vertices, axes=1) @ x[:q], low, high)

    rng = np.random.default_rng(0)
    reach = np.array([0.3 * (signal.high if signal.high is not None else 1.0) for signal in artifact.states])
    states = reach * rng.uniform(-1.0, 1.0, (NUMPY_STEPS, len(reach)))
    controller = _runtime.SystemController(_runtime.SystemArtifact.load(str(path)))
    trims = [np.array([signal.trim for signal in own]) for own in (artifact.states, artifact.inputs)]
    for x in states[:50]:
        ours = controller.step(x + trims[0], list(parameters.values()))["input"] - trims[1]
        difference = np.abs(ours - law(x)).max()
        if not difference <= LARGEST_DIFFERENCE * (1.0 + np.abs(ours).max()):
            raise DisagreementError(f"{artifact.name}: {COMPETITOR} differs by {difference:.2g}")
    found = []
    for _ in range(rounds):
        start = time.process_time_ns()
        for x in states:
            law(x)
        found.append((time.process_time_ns() - start) / NUMPY_STEPS)
    return found


def _first_steps(artifact: SystemArtifactDocument) -> list[Any]:
    """The first instruction of every output of the schedule; a constant is a premise that the law is not told."""
    return [output[0] if len(output) == 1 else ("signal",) for output in outputs_of(artifact.law.schedule.code)]


if __name__ == "__main__":
    main("systems", "The control step of general systems beside the same law in numpy.", measure)
