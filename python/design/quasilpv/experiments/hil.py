"""The same experiment with controller and plant as two processes over LCM, in lock-step or in real time."""

from __future__ import annotations

import csv
import json
import secrets
import shutil
import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.defaults import WATCHDOG_S
from quasilpv.errors import ClaimError, FaultStop, InputError, PlantError, QuasilpvError, TransportError
from quasilpv.experiments.fault import Fault, fault_of
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import RunFiles, run_documents, run_from_columns, summarise, write_run_files
from quasilpv.telemetry import LOG_NAME
from quasilpv.telemetry.log import point_to
from quasilpv.telemetry.recorder import Recorder

Mode: TypeAlias = Literal["lockstep", "realtime"]

CONTROLLER, SIMULATOR = "qlpv-controller", "qlpv-simulator"
MULTICAST_GROUP = "239.255.76.67"
POLL_S = 0.02
SILENCE_S = 10.0
"""A process gives up after so long without the other one."""
LEAST_SAMPLES = 2
"""Of a run that has increments of torque to count."""
LOCK_STEP_LIMIT_S = 600.0
"""Nothing in lock-step bounds the run but the processes; this does."""

EXIT_FAULT_STOP = 3
"""The run ended in a fault: an outcome with a report, not an error of the program."""

_ERRORS: dict[int, type[QuasilpvError]] = {5: TransportError, 6: PlantError}


@dataclass(frozen=True)
class RealTimeOptions:
    """What both processes are asked for in real time.

    Attributes:
        silence_s: the controller latches a fault after so long without a measurement.
        hold_s: the plant's watchdog brakes after so long without a command.
        priority: lock memory and use SCHED_FIFO with this priority, 1 to 99; None: normal scheduling.
    """

    silence_s: float = WATCHDOG_S
    hold_s: float = WATCHDOG_S
    priority: int | None = None

    def of(self, program: str) -> list[str]:
        """Options of one program."""
        options = ["--silence-s", str(self.silence_s)] if program == CONTROLLER else ["--hold-s", str(self.hold_s)]
        return options if self.priority is None else [*options, "--priority", str(self.priority)]


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


def run_over_lcm(
    setup: RunSetup,
    folder: Path,
    *,
    mode: Mode,
    real_time: RealTimeOptions | None = None,
    url: str | None = None,
    key: Path | None = None,
) -> HilResult:
    """Run controller and plant as two processes on this machine, with a session of their own; log what they say.

    Args:
        setup: what runs.
        folder: where the run's files, both records and the log are written.
        mode: lock-step (deterministic) or real time.
        real_time: watchdog times and priority, read in real time only.
        url: where they talk, by default on a port of their own.
        key: of authenticated mode, a file of mode 0600; None: messages are not authenticated.

    Raises:
        InputError: robot and controller do not fit, an executable is missing, or the folder cannot be written.
        TransportError: the processes did not hear each other.
        PlantError: the plant could not be integrated.
        FaultStop: a fault stopped the run before there was anything to count.
    """
    artifact, log = setup.artifact, setup.log
    files = write_run_files(folder, setup)
    records = {CONTROLLER: folder / "controller.csv", SIMULATOR: folder / "plant.csv"}
    url = url or f"udpm://{MULTICAST_GROUP}:{49152 + secrets.randbelow(65536 - 49152)}?ttl=0"
    commands = _commands(files, records, mode, url)
    if key is not None:
        commands = {name: [*command, "--key", str(key)] for name, command in commands.items()}
    if mode == "realtime":
        commands = {name: [*command, *(real_time or RealTimeOptions()).of(name)] for name, command in commands.items()}
    limit_s = LOCK_STEP_LIMIT_S if mode == "lockstep" else setup.experiment.trajectory.duration_s + 4 * SILENCE_S
    if log:  # the log in this place is of this run or there is none: never that of a run before it that went well
        (folder / LOG_NAME).unlink(missing_ok=True)
    documents = run_documents(mode, files, setup)
    with Recorder(url, folder / LOG_NAME, documents) if log else nullcontext() as recorder:
        reports, said = _run_both(commands, limit_s)
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
        mode,
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
    _, in_plant, in_controller = np.intersect1d(plant["seq"], controller["seq"], return_indices=True)
    if in_plant.size == 0:
        raise InputError(str(controller_csv), "seq", "no sample", f"samples that {plant_csv} has too")
    columns = {name: values[in_controller] for name, values in controller.items()}
    columns.update({name: values[in_plant] for name, values in plant.items()})
    return run_from_columns(columns, n, artifact.sample_period_s)


def read_record(path: Path, joints: int) -> dict[str, FloatArray]:
    """Columns of a record by name; ``name_0 ... name_(n-1)`` become one column of shape (N, n).

    Raises:
        InputError: the file cannot be read, or is not a table of numbers.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        table = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    except (OSError, ValueError) as error:
        raise InputError(str(path), "record", error, "a table of numbers under one line of names") from error
    columns: dict[str, FloatArray] = {}
    for index, name in enumerate(header):
        stem, _, suffix = name.rpartition("_")
        if joints > 1 and suffix == "0":
            columns[stem] = table[:, index : index + joints]
        elif not (suffix.isdigit() and stem in columns):
            columns[name] = table[:, index]
    return columns


def find_executable(name: str) -> str:
    """Path of an executable of the project: beside the running interpreter, else on PATH.

    Raises:
        InputError: it is in neither place.
    """
    folder = Path(sys.executable).parent
    found = shutil.which(name, path=str(folder)) or shutil.which(name)
    if found is None:
        raise InputError("installation", name, "no such executable", f"it in {folder} or on PATH (pip install .)")
    return found


def _commands(files: RunFiles, records: dict[str, Path], mode: Mode, url: str) -> dict[str, list[str]]:
    common = ["--artifact", str(files.artifact), "--session", str(1 + secrets.randbelow(2**31 - 1))]
    common += ["--url", url, "--mode", mode]
    common += ["--timeout-s", str(SILENCE_S), "--json"]
    inputs = {CONTROLLER: ["--trajectory", str(files.trajectory)], SIMULATOR: ["--scenario", str(files.scenario)]}
    return {
        name: [find_executable(name), *common, *inputs[name], "--record", str(records[name])]
        for name in (CONTROLLER, SIMULATOR)
    }


def _run_both(commands: dict[str, list[str]], limit_s: float) -> tuple[dict[str, dict[str, Any]], str | None]:
    """Run the processes to their end and return their reports, and why if a fault stopped them.

    If one fails, the others are stopped. A fault stop is no failure: the other process ends by itself.
    """
    processes = {
        name: subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", errors="surrogateescape"
        )
        for name, command in commands.items()
    }
    try:
        deadline = time.monotonic() + limit_s
        while any(process.poll() is None for process in processes.values()):
            if any(process.returncode not in (None, 0, EXIT_FAULT_STOP) for process in processes.values()):
                break
            if time.monotonic() > deadline:
                raise TransportError(f"{' and '.join(commands)}: still running after {limit_s:g} s")
            time.sleep(POLL_S)
        _raise_refused_start(processes[CONTROLLER])
        for name, process in processes.items():
            if process.returncode not in (None, 0, EXIT_FAULT_STOP):
                _raise_failure(name, process)
        said = {name: process.communicate() for name, process in processes.items()}
        stopped = [name for name, process in processes.items() if process.returncode == EXIT_FAULT_STOP]
        fault = said[stopped[0]][1].strip().splitlines()[-1] if stopped else None
        return {name: json.loads(output) for name, (output, _) in said.items()}, fault
    finally:
        for process in processes.values():
            if process.poll() is None:
                process.terminate()
            process.communicate()


def _raise_refused_start(controller: subprocess.Popen[str]) -> None:
    """Raise what stopped a controller that never began: there is no run to look at."""
    if controller.returncode == EXIT_FAULT_STOP:
        report, errors = controller.communicate()
        if json.loads(report)["end"] == "start refused":
            raise FaultStop(errors.strip().splitlines()[-1])


def _raise_failure(program: str, process: subprocess.Popen[str]) -> None:
    """Raise the exception that the exit code of an ended process stands for, in its own words."""
    errors = process.communicate()[1].strip()
    line = errors.splitlines()[-1].removeprefix(f"{program}: ") if errors else "not a word"
    if process.returncode == 2:
        raise InputError(program, "input", line, "files both programs accept")
    raise _ERRORS.get(process.returncode, QuasilpvError)(f"{program}: exit code {process.returncode}: {line}")
