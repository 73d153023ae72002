"""CPU time of a 1 ms sample of the 3-DoF arm: IDA and RK4, with their errors."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from bench_programs import Experiment, run_program
from bench_report import Report, Row, main, row

COMPETITOR_OF = {
    "IDA": "IDA, difference quotients",
    "IDA, difference quotients": "IDA",
    "RK4, 1 step": "IDA",
    "RK4, 4 steps": "IDA",
}


def measure(quick: bool) -> Report:
    """Time every integrator over the same run, beside real time and beside another integrator."""
    with TemporaryDirectory() as folder:
        experiment = Experiment.write(Path(folder))
        result = run_program(
            "plant_bench", experiment.artifact("ctc"), experiment.trajectory, experiment.scenario, 1 if quick else 11
        )
    period_us = result["sample_period_s"] * 1e6
    times_us = {entry["integrator"]: entry["cpu_ns_per_sample"] * 1e-3 for entry in result["integrators"]}
    rows: list[Row] = []
    for name, time_us in times_us.items():
        competitor = COMPETITOR_OF[name]
        rows.append(row(name, time_us, "us", ("real time", period_us)))
        rows.append(row(f"{name} beside {competitor}", time_us, "us", (competitor, times_us[competitor])))
    notes = [
        f"CPU time of one sample of {period_us:g} us, the integrator restarted at each; the ratio to real time is the "
        f"real-time factor; IDA at a relative tolerance of {result['relative_tolerance']:g}"
    ]
    notes += [
        f"{entry['integrator']}: largest angle error {entry['largest_angle_error_rad']:.2g} rad "
        f"over {result['samples']} samples, against RK4 with {result['reference_steps_per_sample']} steps a sample"
        for entry in result["integrators"]
    ]
    return Report(rows, notes)


if __name__ == "__main__":
    main("plant", "CPU time of a 1 ms sample of the 3-DoF arm with IDA and RK4.", measure)
