"""Logs of runs of general systems: written of a run in this process, and read back as if it had just been made."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from quasilpv.errors import InputError
from quasilpv.experiments.system_run import SystemRun, level_of
from quasilpv.telemetry import RunHeader, RunLog
from quasilpv.telemetry.codes import LEFT_DOMAIN
from quasilpv.telemetry.log import point_to
from quasilpv.telemetry.system_recording import (
    CONTROLLER_NAME,
    TELEMETRY,
    TRUTH,
    SystemRunDocuments,
    system_columns_of,
    write_system_run,
)


def write_log(path: Path, run: SystemRun) -> Path:
    """Write the log of a run in this process. InputError: the file cannot be written."""
    artifact = run.artifact
    names = [signal.name for signal in artifact.states]
    left = None if run.exit is None else (len(run.time_s) - 1, names.index(run.exit[1]))
    columns = {
        "state": run.state,
        "measured": run.measured,
        "input": run.input,
        "commanded": run.commanded,
        "premise": run.premise,
        "level": run.measured_level,
    }
    header = RunHeader(mode="in-process", controller=CONTROLLER_NAME)
    write_system_run(path, SystemRunDocuments(header, artifact, run.scenario), columns, run.sample_flags, left)
    point_to(path)
    return path


def logged_system_run(log: RunLog) -> SystemRun:
    """The run of a log: the samples of which both telemetry and the truth are known.

    Raises:
        InputError: there is none, or the log lacks a document.
    """
    artifact = log.system_artifact
    telemetry, truth = log["telemetry"].samples, log["truth"].samples
    seq, told, true = np.intersect1d(telemetry["seq"], truth["seq"], return_indices=True)
    if not seq.size:
        raise InputError(log.source, TRUTH, "no sample", f"the true states of the plant beside {TELEMETRY}")
    columns = system_columns_of(TELEMETRY, telemetry[told], artifact) | system_columns_of(TRUTH, truth[true], artifact)
    events = log["event"].records
    left = events[events["code"] == LEFT_DOMAIN]
    exit_at = None
    if left.size:
        state = artifact.states[int(left[0]["detail"][0])]
        exit_at = (float(left[0]["seq"] * artifact.sample_period_s), state.name)
    return SystemRun(
        artifact=artifact,
        scenario=log.system_scenario,
        time_s=seq * artifact.sample_period_s,
        state=columns["state"],
        measured=columns["measured"],
        input=columns["input"],
        commanded=columns["commanded"],
        premise=columns["premise"],
        level=level_of(artifact, columns["state"]),
        measured_level=np.array(telemetry[told]["level"]),
        sample_flags=telemetry[told]["flags"].astype(np.int64),
        exit=exit_at,
    )
