"""The control step of every law of the 3-DoF arm and of the UR5, warm, beside Pinocchio's inverse dynamics of them."""

from __future__ import annotations

from collections.abc import Callable
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
IN_SPACE = ("dob-acceleration", "ctc-dob-tuned")
SPACE = "UR5: "
OURS = {"": "closed-form inverse dynamics", SPACE: "inverse dynamics by recursion"}
COMPETITOR = "Pinocchio RNEA"
LARGEST_DIFFERENCE_NM = 1e-9


def measure(quick: bool) -> Report:
    """Time the steps, our inverse dynamics and Pinocchio's of the same arms; check that the last two agree."""
    rounds, count = (1, 100) if quick else (20, 1000)
    competitor = rnea_program(may_build=not quick)
    with TemporaryDirectory() as folder:
        planar, spatial = Experiment.write(Path(folder)), Experiment.in_space(Path(folder) / "space")
        runs: dict[str, Callable[[], Any]] = {}
        for experiment, controllers, prefix in ((planar, CONTROLLERS, ""), (spatial, IN_SPACE, SPACE)):
            motions = experiment.scenario, experiment.states(count), rounds
            for name in controllers:
                inputs = experiment.artifact(name), *experiment.inputs, rounds
                runs[prefix + name] = partial(run_program, "step_bench", *inputs)
            runs[prefix + OURS[prefix]] = partial(run_program, "inverse_dynamics_bench", *motions)
            if competitor.program:
                runs[prefix + COMPETITOR] = partial(run_path, competitor.program, *motions)
        measured = run_in_turns(runs, quick=quick)
    steps = [*CONTROLLERS, *(SPACE + name for name in IN_SPACE)]
    notes = [
        f"{name}: a step of the closed-loop run raised the flags {measured[name][0]['flags']:#x}"
        for name in steps
        if measured[name][0]["flags"]
    ]
    calls = sum(costs(measured[CONTROLLERS[0]], "timing", "calls"))
    overhead = typical(costs(measured[CONTROLLERS[0]], "timing", "clock_overhead_ns"))
    notes.append(f"{calls:.0f} steps a law; {overhead:.3g} ns of the clock subtracted from each")
    if competitor.program is None:
        notes.append(f"{COMPETITOR} was not measured: {competitor.missing}")
    rows = []
    for controllers, prefix in ((CONTROLLERS, ""), (IN_SPACE, SPACE)):
        ours, rnea = measured[prefix + OURS[prefix]], measured.get(prefix + COMPETITOR)
        for name in controllers:
            rows += quantile_rows(f"{prefix}{name} step", measured[prefix + name], rnea)
        rows += quantile_rows(prefix + OURS[prefix], ours, rnea)
        if rnea:
            rows += quantile_rows(prefix + COMPETITOR, rnea, None)
            notes.append(prefix + agreement(ours[0], rnea[0]))
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
    text = f"{COMPETITOR} and ours differ by at most {difference:.2g} N m in {torques.shape[0]} random motions"
    if not difference <= LARGEST_DIFFERENCE_NM:
        raise DisagreementError(f"{text}: more than {LARGEST_DIFFERENCE_NM:g} N m, so it is not the same arm")
    return text


if __name__ == "__main__":
    main("step", "Control steps of the 3-DoF arm and the UR5, warm, beside Pinocchio's RNEA of the same arms.", measure)
