"""The same experiment with controller and plant as two processes over LCM, in lock-step or in real time."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.errors import ClaimError, FaultStop
from quasilpv.experiments.fault import Fault, fault_of
from quasilpv.experiments.processes import (
    CONTROLLER,
    SIMULATOR,
    Mode,
    Talk,
    common_samples,
    read_table,
    run_both,
)
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import run_documents, run_from_columns, summarise, write_run_files
from quasilpv.telemetry import LOG_NAME
from quasilpv.telemetry.log import point_to
from quasilpv.telemetry.recorder import Recorder

LEAST_SAMPLES = 2
"""Of a run that has increments of torque to count."""


@dataclass(frozen=True, eq=False)
class HilResult:
    """A run over LCM.

    Attributes:
        mode: ``"lockstep"`` or ``"realtime"``.
        result: the numbers of the run; of one that a fault stopped, those of the samples before it.
        controller: what `qlpv-controller` reports: steps, counters, latencies in ns.
        simulator: what `qlpv-simulator` reports, likewise.
        stop: the fault that stopped the run; None if it was none.
    """

    mode: Mode
    result: TrackResult
    controller: dict[str, Any]
    simulator: dict[str, Any]
    stop: Fault | None = None

    @property
    def fault(self) -> str | None:
        """What stopped the run and when, in a line."""
        return None if self.stop is None else str(self.stop)


def run_over_lcm(setup: RunSetup, folder: Path, talk: Talk) -> HilResult:
    """Run controller and plant as two processes on this machine, with a session of their own; log what they say.

    Args:
        setup: what runs.
        folder: where the run's files, both records and the log are written.
        talk: how both talk.

    Raises:
        InputError: robot and controller do not fit, an executable is missing, or the folder cannot be written.
        TransportError: the processes did not hear each other.
        PlantError: the plant could not be integrated.
        FaultStop: a fault stopped the run before there was anything to count.
    """
    artifact, log = setup.artifact, setup.log
    files = write_run_files(folder, setup)
    records = {CONTROLLER: folder / "controller.csv", SIMULATOR: folder / "plant.csv"}
    inputs = {CONTROLLER: ["--trajectory", str(files.trajectory)], SIMULATOR: ["--scenario", str(files.scenario)]}
    commands = talk.commands(files.artifact, inputs, records)
    if log:  # the log in this place is of this run or there is none: never that of a run before it that went well
        (folder / LOG_NAME).unlink(missing_ok=True)
    documents = run_documents(talk.mode, files, setup)
    with Recorder(talk.url, folder / LOG_NAME, documents) if log else nullcontext() as recorder:
        reports, said = run_both(commands, talk.limit_s(setup.experiment.trajectory.duration_s))
        if recorder is not None:
            recorder.add_truth(read_record(records[SIMULATOR], artifact.joints))
    if log:
        point_to(folder / LOG_NAME)
    run = merge_records(records[SIMULATOR], records[CONTROLLER], artifact)
    stop = None if said is None else _stop(said, reports[CONTROLLER], records, artifact)
    if stop is not None:
        run = run.until(stop.sample)
        if run.time_s.size < LEAST_SAMPLES:
            raise FaultStop(str(stop))
    return HilResult(
        talk.mode,
        summarise(run, setup),
        reports[CONTROLLER],
        reports[SIMULATOR],
        stop,
    )


def _stop(said: str, report: dict[str, Any], records: dict[str, Path], artifact: Artifact) -> Fault:
    """The fault of a run, from the records of both programs and the report of the controller."""
    controller, plant = (read_record(records[name], artifact.joints) for name in (CONTROLLER, SIMULATOR))
    return fault_of(said, report, controller, plant, artifact.sample_period_s)


def require_identical(over_lcm: Run, in_process: Run) -> None:
    """Check that a lock-step run over LCM and a run in one process are the same, bit for bit.

    Raises:
        ClaimError: they differ; the message says where first.
    """
    difference = over_lcm.first_difference(in_process)
    if difference is not None:
        raise ClaimError(f"lock-step over LCM and in process: {difference}, expected identical samples")


def merge_records(plant_csv: Path, controller_csv: Path, artifact: Artifact) -> Run:
    """The record of a run from the records of both processes, matched by sample number.

    Samples that only one side has (real time: a lost message) are left out.

    Raises:
        InputError: a record is missing, damaged, or they have no sample in common.
    """
    n = artifact.joints
    plant, controller = (read_record(path, n) for path in (plant_csv, controller_csv))
    columns = common_samples(plant_csv, controller_csv, plant, controller)
    return run_from_columns(columns, n, artifact.sample_period_s)


def read_record(path: Path, joints: int) -> dict[str, FloatArray]:
    """Columns of a record by name; ``name_0 ... name_(n-1)`` become one column of shape (N, n).

    Raises:
        InputError: the file cannot be read, or is not a table of numbers.
    """
    table = read_table(path)
    columns: dict[str, FloatArray] = {}
    for name, values in table.items():
        stem, _, suffix = name.rpartition("_")
        if joints > 1 and suffix == "0":
            columns[stem] = np.column_stack([table[f"{stem}_{joint}"] for joint in range(joints)])
        elif not (suffix.isdigit() and stem in columns):
            columns[name] = values
    return columns
