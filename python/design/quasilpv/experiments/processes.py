"""Controller and plant as two processes that talk over LCM: how they are started, paced, ended and read."""

from __future__ import annotations

import csv
import json
import secrets
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.defaults import WATCHDOG_S
from quasilpv.errors import FaultStop, InputError, PlantError, QuasilpvError, TransportError

Mode: TypeAlias = Literal["lockstep", "realtime"]

CONTROLLER, SIMULATOR = "qlpv-controller", "qlpv-simulator"
MULTICAST_GROUP = "239.255.76.67"
POLL_S = 0.02
SILENCE_S = 10.0
"""A process gives up after so long without the other one."""
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


def own_port() -> str:
    """An LCM URL of this machine that no other run is likely to use."""
    return f"udpm://{MULTICAST_GROUP}:{49152 + secrets.randbelow(65536 - 49152)}?ttl=0"


@dataclass(frozen=True)
class Talk:
    """How both programs talk, in a session of their own.

    Attributes:
        mode: lock-step (deterministic) or real time.
        real_time: watchdog times and priority, read in real time only.
        url: where they talk, by default on a port of their own.
        key: of authenticated mode, a file of mode 0600; None: messages are not authenticated.
    """

    mode: Mode
    real_time: RealTimeOptions = field(default_factory=RealTimeOptions)
    url: str = field(default_factory=own_port)
    key: Path | None = None

    def commands(
        self, artifact: Path, inputs: Mapping[str, Sequence[str]], records: Mapping[str, Path]
    ) -> dict[str, list[str]]:
        """The command of either program.

        Args:
            artifact: of both.
            inputs: the options of each for what only it reads.
            records: where each writes its samples.
        """
        common = ["--artifact", str(artifact), "--session", str(1 + secrets.randbelow(2**31 - 1))]
        common += ["--url", self.url, "--mode", self.mode, "--timeout-s", str(SILENCE_S), "--json"]
        common += [] if self.key is None else ["--key", str(self.key)]
        return {
            name: [find_executable(name), *common, *inputs[name], "--record", str(records[name])]
            + (self.real_time.of(name) if self.mode == "realtime" else [])
            for name in (CONTROLLER, SIMULATOR)
        }

    def limit_s(self, duration_s: float) -> float:
        """How long both may take for a run of this length."""
        return LOCK_STEP_LIMIT_S if self.mode == "lockstep" else duration_s + 4 * SILENCE_S


def read_table(path: Path) -> dict[str, FloatArray]:
    """Columns of a record, (N,) each, by name.

    Raises:
        InputError: the file cannot be read, or is not a table of numbers.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file))
        table = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    except (OSError, ValueError) as error:
        raise InputError(str(path), "record", error, "a table of numbers under one line of names") from error
    return {name: table[:, index] for index, name in enumerate(header)}


def common_samples(
    plant_csv: Path, controller_csv: Path, plant: Mapping[str, FloatArray], controller: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """The columns of both records at the samples that both have, those of the plant where both have one.

    In real time a sample may be on one side only, where a message was lost.

    Raises:
        InputError: there is no such sample.
    """
    _, in_plant, in_controller = np.intersect1d(plant["seq"], controller["seq"], return_indices=True)
    if in_plant.size == 0:
        raise InputError(str(controller_csv), "seq", "no sample", f"samples that {plant_csv} has too")
    columns = {name: values[in_controller] for name, values in controller.items()}
    return columns | {name: values[in_plant] for name, values in plant.items()}


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


def run_both(commands: dict[str, list[str]], limit_s: float) -> tuple[dict[str, dict[str, Any]], str | None]:
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
