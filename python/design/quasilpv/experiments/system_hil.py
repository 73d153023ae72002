"""A run of a general system with controller and plant as two processes over LCM, in lock-step or in real time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import ClaimError
from quasilpv.experiments.fault import Fault, fault_of
from quasilpv.experiments.processes import CONTROLLER, SIMULATOR, Mode, Talk, common_samples, read_table, run_both
from quasilpv.experiments.system_run import SystemRun, flags_in_words, level_of
from quasilpv.scenarios import SystemScenario, write_system_scenario

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
    artifact: SystemArtifactDocument, scenario: SystemScenario, folder: Path, talk: Talk
) -> SystemHilResult:
    """Run controller and plant as two processes on this machine.

    Args:
        artifact: the controller, and the equations of the plant.
        scenario: what is run.
        folder: where the files of the run and both records are written.
        talk: how both talk.

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
    reports, said = run_both(commands, talk.limit_s(scenario.samples * artifact.sample_period_s))
    plant, controller = read_table(records[SIMULATOR]), read_table(records[CONTROLLER])
    columns = common_samples(records[SIMULATOR], records[CONTROLLER], plant, controller)
    run = _run_of(artifact, scenario, columns, reports)
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


def _run_of(
    artifact: SystemArtifactDocument,
    scenario: SystemScenario,
    columns: Mapping[str, FloatArray],
    reports: Mapping[str, dict[str, Any]],
) -> SystemRun:
    def of(what: str, role: str) -> FloatArray:
        signals = artifact.states if role == "state" else artifact.inputs
        return np.column_stack([columns[f"{what}.{signal.name}"] for signal in signals])

    left = reports[SIMULATOR][LEFT_DOMAIN]
    state = of("state", "state")
    return SystemRun(
        artifact=artifact,
        scenario=scenario,
        time_s=columns["time_s"],
        state=state,
        measured=of("measured", "state"),
        input=of("input", "input"),
        level=level_of(artifact, state),
        measured_level=columns["level"],
        flags=flags_in_words(reports[CONTROLLER]["flags"]),
        exit=None if left is None else (float(left["time_s"]), str(left["signal"])),
    )
