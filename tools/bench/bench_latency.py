"""Wake-up, paced control step and LCM round trip at 1 kHz, as the doctor measures them, without privileges and with."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench_programs import Documents, Experiment, ProgramError, costs, run_in_turns
from bench_report import Report, Row, main, row

from quasilpv.experiments.processes import find_executable

URL = "udpm://239.255.76.67:7692?ttl=0"  # a port of its own: no other run is disturbed or listened to
UNPRIVILEGED = (
    ("setpriv", "--bounding-set=-sys_nice,-ipc_lock", "--inh-caps=-sys_nice,-ipc_lock") if os.geteuid() == 0 else ()
)
WITHOUT_PRIVILEGES = (*UNPRIVILEGED, "prlimit", "--rtprio=0:0", "--memlock=0:0")
MEASURED = {"wake-up": "wakeup_ns", "step": "step_ns", "LCM round trip": "round_trip_ns"}
QUANTILES = {"p50": "p50", "p99": "p99", "p99.9": "p99_9"}


def measure(quick: bool) -> Report:
    """Ask the doctor in both ways; under SCHED_FIFO its wake-up is that of the privileged run."""
    with TemporaryDirectory() as folder:
        artifact = Experiment.write(Path(folder)).artifact("dob-acceleration")
        seconds = "0.05" if quick else "4"
        ways = {"bare": WITHOUT_PRIVILEGES, "privileged": ()}
        runs = {name: partial(doctor, prefix, artifact, seconds) for name, prefix in ways.items()}
        measured = run_in_turns(runs, quick=quick)
    bare, privileged = measured["bare"], measured["privileged"]
    notes = [
        f"{len(bare)} times {seconds} s of each at 1 kHz: every step comes after a millisecond of sleep, "
        "with cold caches"
    ]
    rows = rows_of("without privilege", bare)
    if all(findings["fifo"] for findings in privileged):
        rows += rows_of(
            "SCHED_FIFO", [{**findings, "wakeup_ns": findings["wakeup_fifo_ns"]} for findings in privileged]
        )
    else:
        notes.append("SCHED_FIFO is not permitted here: nothing was measured with it")
    return Report(rows, notes)


def doctor(prefix: tuple[str, ...], artifact: Path, seconds: str) -> Any:
    """The doctor's findings under a command that takes or leaves privileges.

    Raises:
        ProgramError: it failed.
    """
    folder = os.environ.get("QUASILPV_BIN")
    program = shutil.which("qlpv-controller", path=folder) if folder else None
    command = [program or find_executable("qlpv-controller"), "--doctor", "--json", "--url", URL]
    command += ["--artifact", str(artifact), "--seconds", seconds]
    done = subprocess.run([*prefix, *command], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: it measured, and says that this machine will not hold the rate
        raise ProgramError(f"qlpv-controller --doctor: {' '.join(done.stderr.split())}")
    return json.loads(done.stdout)


def rows_of(privilege: str, findings: Documents) -> list[Row]:
    """One row per latency and quantile."""
    return [
        row(f"{name} {label}, {privilege}", costs(findings, key, quantile, scale=1e-3), "us")
        for name, key in MEASURED.items()
        for label, quantile in QUANTILES.items()
    ]


if __name__ == "__main__":
    main("latency", "Wake-up, paced step and round trip at 1 kHz, without privileges and with.", measure)
