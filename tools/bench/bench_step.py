"""The control step of every law of the 3-DoF arm, warm, beside Pinocchio's inverse dynamics of the same arm."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench_pinocchio import rnea_program
from bench_programs import Documents, Experiment, costs, run_in_turns, run_path, run_program
from bench_report import DisagreementError, Report, Row, main, row, typical

CONTROLLERS = ("dob-acceleration", "pid", "ctc", "ctc-dob")
QUANTILES = {"p50": "p50_ns", "p99": "p99_ns", "p99.9": "p999_ns", "batch mean": "batch_ns"}
OURS = "closed-form inverse dynamics"
COMPETITOR = "Pinocchio RNEA"
LARGEST_DIFFERENCE_NM = 1e-9


def measure(quick: bool) -> Report:
    """Time the steps, the closed-form inverse dynamics and Pinocchio's; check that the last two agree."""
    rounds = 1 if quick else 20
    competitor = rnea_program(may_build=not quick)
    with TemporaryDirectory() as folder:
        experiment = Experiment.write(Path(folder))
        motions = experiment.scenario, experiment.states(count=100 if quick else 1000), rounds
        runs = {
            name: partial(run_program, "step_bench", experiment.artifact(name), *experiment.inputs, rounds)
            for name in CONTROLLERS
        }
        runs[OURS] = partial(run_program, "inverse_dynamics_bench", *motions)
        if competitor.program:
            runs[COMPETITOR] = partial(run_path, competitor.program, *motions)
        measured = run_in_turns(runs, quick=quick)
    rnea = measured.get(COMPETITOR)
    notes = [
        f"{name}: a step of the closed-loop run raised the flags {measured[name][0]['flags']:#x}"
        for name in CONTROLLERS
        if measured[name][0]["flags"]
    ]
    calls = sum(costs(measured[CONTROLLERS[0]], "timing", "calls"))
    overhead = typical(costs(measured[CONTROLLERS[0]], "timing", "clock_overhead_ns"))
    notes.append(f"{calls:.0f} steps a law; {overhead:.3g} ns of the clock subtracted from each")
    if rnea:
        notes.append(agreement(measured[OURS][0], rnea[0]))
    else:
        notes.append(f"{COMPETITOR} was not measured: {competitor.missing}")
    rows = [entry for name in CONTROLLERS for entry in quantile_rows(f"{name} step", measured[name], rnea)]
    rows += quantile_rows(OURS, measured[OURS], rnea)
    if rnea:
        rows += quantile_rows(COMPETITOR, rnea, None)
    return Report(rows, notes, packages=("pin",), foreign=True)


def quantile_rows(name: str, measured: Documents, competitor: Documents | None) -> list[Row]:
    """One row per quantile, beside the same quantile of the competitor if it was measured."""
    return [
        row(
            f"{name} {label}",
            costs(measured, "timing", key),
            "ns",
            (f"{COMPETITOR} {label}", costs(competitor, "timing", key)) if competitor else None,
        )
        for label, key in QUANTILES.items()
    ]


def agreement(ours: Any, theirs: Any) -> str:
    """Say how far two inverse dynamics are apart.

    Raises:
        DisagreementError: too far for the same arm.
    """
    torques = np.array(ours["torques_nm"])
    difference = float(np.max(np.abs(torques - np.array(theirs["torques_nm"]))))
    text = (
        f"{COMPETITOR} and the closed form differ by at most {difference:.2g} N m in {torques.shape[0]} random motions"
    )
    if not difference <= LARGEST_DIFFERENCE_NM:
        raise DisagreementError(f"{text}: more than {LARGEST_DIFFERENCE_NM:g} N m, so it is not the same arm")
    return text


if __name__ == "__main__":
    main("step", "Control steps of the 3-DoF arm, warm, beside Pinocchio's RNEA of the same arm.", measure)
