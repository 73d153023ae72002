"""Peak resident memory of controller and plant in a lock-step run over LCM, beside a Python process with numpy."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from bench_programs import Experiment, ProgramError, costs, run_in_turns
from bench_report import Report, main, row

from quasilpv.experiments.processes import find_executable

URL = "udpm://239.255.76.67:7693?ttl=0"  # a port of its own: no other run is disturbed or listened to
COMPETITOR = "Python with numpy, idle"
POLL_S = 0.005
STATUS = Path("/proc/self/status")


def measure(quick: bool) -> Report:
    """Run both programs over LCM and watch the high-water marks of their memory; then those of the competitor."""
    with TemporaryDirectory() as folder:
        experiment = Experiment.write(Path(folder))
        common = ["--artifact", str(experiment.artifact("dob-acceleration")), "--session", "1", "--url", URL]
        inputs = {
            "qlpv-controller": ["--trajectory", experiment.trajectory],
            "qlpv-simulator": ["--scenario", experiment.scenario],
        }
        programs = {name: [find_executable(name), *common, *map(str, options)] for name, options in inputs.items()}
        measured = run_in_turns({"loop": partial(peak_mib, programs), COMPETITOR: idle_mib}, quick=quick)
    against = COMPETITOR, costs(measured[COMPETITOR])
    rows = [row(f"{name}: peak resident memory", costs(measured["loop"], name), "MiB", against) for name in programs]
    rows.append(row(*against, "MiB"))
    return Report(
        rows, ["whole lock-step run of serial-square over LCM; VmHWM, shared libraries included"], ("numpy",), True
    )


def idle_mib() -> float:
    """The high-water mark of a Python process that has imported numpy, MiB."""
    program = f"import numpy, pathlib; print(pathlib.Path({str(STATUS)!r}).read_text())"
    return high_water_mib(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    )


def peak_mib(commands: dict[str, list[str]]) -> dict[str, float]:
    """Run programs side by side to their end; the high-water mark of each one's resident memory, MiB.

    The mark is read while they run: what wait4 reports for a child also counts its parent's memory before exec.

    Raises:
        ProgramError: one of them failed.
    """
    running = {
        name: subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for name, command in commands.items()
    }
    peaks = dict.fromkeys(commands, 0.0)
    try:
        while any(process.poll() is None for process in running.values()):
            for name, process in running.items():
                peaks[name] = max(peaks[name], _high_water_of(process.pid))
            time.sleep(POLL_S)
        for name, process in running.items():
            if process.returncode != 0:
                raise ProgramError(f"{name}: {process.stderr.read().strip() if process.stderr else ''}")
    finally:
        for process in running.values():
            with process:  # closes its pipe and waits
                process.kill()
    return peaks


def _high_water_of(pid: int) -> float:
    try:
        return high_water_mib(Path(f"/proc/{pid}/status").read_text(encoding="utf-8"))
    except OSError:  # it has just ended
        return 0.0


def high_water_mib(status: str) -> float:
    """VmHWM of the text of /proc/PID/status, 0 of a process that has ended."""
    found = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.MULTILINE)
    return int(found[1]) / 1024.0 if found else 0.0


if __name__ == "__main__":
    main("footprint", "Peak resident memory of controller and plant, beside a Python process.", measure)
