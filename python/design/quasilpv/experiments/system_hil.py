"""A run of a general system with controller and plant as two processes over LCM, in lock-step or in real time."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.documents.system_artifact import Signal, SystemArtifactDocument
from quasilpv.errors import ClaimError
from quasilpv.experiments.fault import Fault, fault_of
from quasilpv.experiments.processes import CONTROLLER, SIMULATOR, Mode, Talk, common_samples, read_table, run_both
from quasilpv.experiments.system_run import SystemRun, level_of
from quasilpv.scenarios import SystemScenario, write_system_scenario
from quasilpv.telemetry import LOG_NAME, RunHeader
from quasilpv.telemetry.log import point_to
from quasilpv.telemetry.recorder import Recorder
from quasilpv.telemetry.system_recording import CONTROLLER_NAME, SystemRunDocuments

SCENARIO_NAME = "scenario.json"
LEFT_DOMAIN = "left_domain"


@dataclass(frozen=True, eq=False)
class SystemHilResult:
    """A run over LCM.

    Attributes:
        mode: ``"lockstep"`` or ``"realtime"``.
        run: its samples; of one that a fault stopped, those up to the fault too.
        controller: what `qlpv-controller` reports: steps, counters, latencies in ns.
        simulator: what `qlpv-simulator` reports, likewise.
        stop: the fault that stopped the run; None if it was none. A state that left its domain is none.
    """

    mode: Mode
    run: SystemRun
    controller: dict[str, Any]
    simulator: dict[str, Any]
    stop: Fault | None = None


def run_system_over_lcm(
    artifact: SystemArtifactDocument, scenario: SystemScenario, folder: Path, talk: Talk, *, log: bool = True
) -> SystemHilResult:
    """Run controller and plant as two processes on this machine; log what they say.

    Args:
        artifact: the controller, and the equations of the plant.
        scenario: what is run.
        folder: where the files of the run, both records and the log are written.
        talk: how both talk.
        log: whether one is written.

    Raises:
        InputError: an executable is missing, or the folder cannot be written.
        TransportError: the processes did not hear each other.
        PlantError: the plant could not be integrated.
    """
    path = write_system_artifact(folder, artifact)[0]
    inputs = {
        CONTROLLER: [],
        SIMULATOR: ["--scenario", str(write_system_scenario(folder / SCENARIO_NAME, scenario))],
    }
    records = {CONTROLLER: folder / "controller.csv", SIMULATOR: folder / "plant.csv"}
    commands = talk.commands(path, inputs, records)
    place = folder / LOG_NAME
    documents = SystemRunDocuments(RunHeader(mode=talk.mode, controller=CONTROLLER_NAME), artifact, scenario)
    if log:  # the log in this place is of this run or there is none
        place.unlink(missing_ok=True)
    with Recorder(talk.url, place, documents) if log else nullcontext() as recorder:
        reports, said = run_both(commands, talk.limit_s(scenario.samples * artifact.sample_period_s))
        plant, controller = read_table(records[SIMULATOR]), read_table(records[CONTROLLER])
        if recorder is not None:
            truth = {
                "state": _stacked(plant, "state", artifact.states),
                "input": _stacked(plant, "input", artifact.inputs),
            }
            recorder.add_truth({"seq": plant["seq"], **truth})
    if log:
        point_to(place)
    columns = common_samples(records[SIMULATOR], records[CONTROLLER], plant, controller)
    run = _run_of(artifact, scenario, columns, reports[SIMULATOR][LEFT_DOMAIN])
    stop = None
    if said is not None and run.exit is None:
        stop = fault_of(said, reports[CONTROLLER], controller, plant, artifact.sample_period_s)
    return SystemHilResult(talk.mode, run, reports[CONTROLLER], reports[SIMULATOR], stop)


def require_identical(over_lcm: SystemRun, in_process: SystemRun) -> None:
    """Check that a lock-step run over LCM and a run in one process are the same, bit for bit.

    Raises:
        ClaimError: they differ; the message says where first.
    """
    difference = over_lcm.first_difference(in_process)
    if difference is not None:
        raise ClaimError(f"lock-step over LCM and in process: {difference}, expected identical samples")


def _stacked(columns: Mapping[str, FloatArray], what: str, signals: tuple[Signal, ...]) -> FloatArray:
    return np.column_stack([columns[f"{what}.{signal.name}"] for signal in signals])


def _run_of(
    artifact: SystemArtifactDocument,
    scenario: SystemScenario,
    columns: Mapping[str, FloatArray],
    left: Mapping[str, Any] | None,
) -> SystemRun:
    """A run from the columns of both records, and where the plant says that a state left its domain."""
    state = _stacked(columns, "state", artifact.states)
    count = len(artifact.model.names)
    premises = [f"premise_{k}" for k in range(count)] if count > 1 else ["premise"] * count
    return SystemRun(
        artifact=artifact,
        scenario=scenario,
        time_s=columns["time_s"],
        state=state,
        measured=_stacked(columns, "measured", artifact.states),
        input=_stacked(columns, "input", artifact.inputs),
        commanded=_stacked(columns, "commanded", artifact.inputs),
        premise=np.array([columns[name] for name in premises]).reshape(count, len(state)).T,
        level=level_of(artifact, state),
        measured_level=columns["level"],
        sample_flags=columns["flags"].astype(np.int64),
        exit=None if left is None else (float(left["time_s"]), str(left["signal"])),
    )
