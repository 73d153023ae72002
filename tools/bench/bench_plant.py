"""CPU time of a 1 ms sample of the 3-DoF arm and of the five-bar: IDA and RK4, with their errors."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench_programs import Documents, Experiment, costs, five_bar_scenario, run_in_turns, run_program
from bench_report import Report, Row, main, row

COMPETITOR_OF = {
    "IDA": "IDA, difference quotients",
    "IDA, difference quotients": "IDA",
    "RK4, 1 step": "IDA",
    "RK4, 4 steps": "IDA",
}


def measure(quick: bool) -> Report:
    """Time every integrator over the same run of each plant, beside real time and beside another integrator."""
    rounds = 1 if quick else 3
    with TemporaryDirectory() as name:
        folder = Path(name)
        experiment = Experiment.write(folder)
        arm_inputs = experiment.artifact("ctc"), *experiment.inputs
        runs = {
            "arm": partial(run_program, "plant_bench", *arm_inputs, rounds),
            "five-bar": partial(run_program, "five_bar_bench", five_bar_scenario(folder), rounds),
        }
        measured = run_in_turns(runs, quick=quick)
    arm = measured["arm"][0]
    notes = [
        f"CPU time of one sample of {arm['sample_period_s'] * 1e6:g} us, the integrator restarted at each; ratio to "
        f"real time = real-time factor; IDA at a relative tolerance of {arm['relative_tolerance']:g}"
    ]
    return Report(
        [entry for plant, documents in measured.items() for entry in rows_of(plant, documents)],
        notes + [note for plant, documents in measured.items() for note in errors_of(plant, documents[0])],
    )


def rows_of(plant: str, documents: Documents) -> list[Row]:
    """The rows of one plant."""
    period_us = documents[0]["sample_period_s"] * 1e6
    integrators = [entry["integrator"] for entry in documents[0]["integrators"]]
    times_us = {
        integrator: costs(documents, "integrators", place, "cpu_ns_per_sample", scale=1e-3)
        for place, integrator in enumerate(integrators)
    }
    rows: list[Row] = []
    for integrator, time_us in times_us.items():
        competitor = COMPETITOR_OF[integrator]
        name, rival = f"{plant}: {integrator}", f"{plant}: {competitor}"
        rows.append(row(name, time_us, "us", ("real time", period_us)))
        rows.append(row(f"{name} beside {competitor}", time_us, "us", (rival, times_us[competitor])))
    return rows


def errors_of(plant: str, result: Any) -> list[str]:
    """What every integrator of one plant gets wrong, in words."""
    return [
        f"{plant}: {entry['integrator']}: largest angle error {entry['largest_angle_error_rad']:.2g} rad "
        f"over {result['samples']} samples, against RK4 with {result['reference_steps_per_sample']} steps a sample"
        for entry in result["integrators"]
    ]


if __name__ == "__main__":
    main("plant", "CPU time of a 1 ms sample of the 3-DoF arm and the five-bar with IDA and RK4.", measure)
