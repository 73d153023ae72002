"""CPU time of a 1 ms sample of the 3-DoF arm and of the five-bar: IDA and RK4, with their errors."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench_programs import Experiment, five_bar_scenario, run_program
from bench_report import Report, Row, main, row

COMPETITOR_OF = {
    "IDA": "IDA, difference quotients",
    "IDA, difference quotients": "IDA",
    "RK4, 1 step": "IDA",
    "RK4, 4 steps": "IDA",
}


def measure(quick: bool) -> Report:
    """Time every integrator over the same run of each plant, beside real time and beside another integrator."""
    rounds = 1 if quick else 11
    with TemporaryDirectory() as name:
        folder = Path(name)
        experiment = Experiment.write(folder)
        arm = run_program("plant_bench", experiment.artifact("ctc"), experiment.trajectory, experiment.scenario, rounds)
        five_bar = run_program("five_bar_bench", five_bar_scenario(folder), rounds)
    results = {"arm": arm, "five-bar": five_bar}
    notes = [
        f"CPU time of one sample of {arm['sample_period_s'] * 1e6:g} us, the integrator restarted at each; ratio to "
        f"real time = real-time factor; IDA at a relative tolerance of {arm['relative_tolerance']:g}"
    ]
    return Report(
        [entry for plant, result in results.items() for entry in rows_of(plant, result)],
        notes + [note for plant, result in results.items() for note in errors_of(plant, result)],
    )


def rows_of(plant: str, result: dict[str, Any]) -> list[Row]:
    """The rows of one plant."""
    period_us = result["sample_period_s"] * 1e6
    times_us = {entry["integrator"]: entry["cpu_ns_per_sample"] * 1e-3 for entry in result["integrators"]}
    rows: list[Row] = []
    for integrator, time_us in times_us.items():
        competitor = COMPETITOR_OF[integrator]
        name, rival = f"{plant}: {integrator}", f"{plant}: {competitor}"
        rows.append(row(name, time_us, "us", ("real time", period_us)))
        rows.append(row(f"{name} beside {competitor}", time_us, "us", (rival, times_us[competitor])))
    return rows


def errors_of(plant: str, result: dict[str, Any]) -> list[str]:
    """What every integrator of one plant gets wrong, in words."""
    return [
        f"{plant}: {entry['integrator']}: largest angle error {entry['largest_angle_error_rad']:.2g} rad "
        f"over {result['samples']} samples, against RK4 with {result['reference_steps_per_sample']} steps a sample"
        for entry in result["integrators"]
    ]


if __name__ == "__main__":
    main("plant", "CPU time of a 1 ms sample of the 3-DoF arm and the five-bar with IDA and RK4.", measure)
