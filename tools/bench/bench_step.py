"""The control step of every law of the 3-DoF arm, warm, beside Pinocchio's inverse dynamics of the same arm."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench_pinocchio import rnea_program
from bench_programs import Experiment, run_path, run_program
from bench_report import DisagreementError, Report, Row, main, row

CONTROLLERS = ("dob-acceleration", "pid", "ctc", "ctc-dob")
QUANTILES = {"p50": "p50_ns", "p99": "p99_ns", "p99.9": "p999_ns", "batch mean": "batch_ns"}
COMPETITOR = "Pinocchio RNEA"
LARGEST_DIFFERENCE_NM = 1e-9


def measure(quick: bool) -> Report:
    """Time the steps, the closed-form inverse dynamics and Pinocchio's; check that the last two agree."""
    rounds = 1 if quick else 100
    with TemporaryDirectory() as folder:
        experiment = Experiment.write(Path(folder))
        states = experiment.states(count=100 if quick else 1000)
        closed_form = run_program("inverse_dynamics_bench", experiment.scenario, states, rounds)
        competitor = rnea_program(may_build=not quick)
        rnea = competitor.program and run_path(competitor.program, experiment.scenario, states, rounds)
        laws = {
            name: run_program(
                "step_bench", experiment.artifact(name), experiment.trajectory, experiment.scenario, rounds
            )
            for name in CONTROLLERS
        }
    notes = [
        f"{name}: a step of the closed-loop run raised the flags {law['flags']:#x}"
        for name, law in laws.items()
        if law["flags"]
    ]
    timing = laws[CONTROLLERS[0]]["timing"]
    notes.append(
        f"{timing['calls']} steps a law; {timing['clock_overhead_ns']:.3g} ns of the clock subtracted from each"
    )
    if rnea:
        notes.append(agreement(closed_form, rnea))
    else:
        notes.append(f"{COMPETITOR} was not measured: {competitor.missing}")
    rows = [entry for name, law in laws.items() for entry in quantile_rows(f"{name} step", law, rnea)]
    rows += quantile_rows("closed-form inverse dynamics", closed_form, rnea)
    if rnea:
        rows += quantile_rows(COMPETITOR, rnea, None)
    return Report(rows, notes, packages=("pin",))


def quantile_rows(name: str, measured: Any, competitor: Any) -> list[Row]:
    """One row per quantile, beside the same quantile of the competitor if it was measured."""
    return [
        row(
            f"{name} {label}",
            measured["timing"][key],
            "ns",
            (f"{COMPETITOR} {label}", competitor["timing"][key]) if competitor else None,
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
