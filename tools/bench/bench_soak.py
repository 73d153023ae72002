"""Soak: the loop of the 3-DoF arm over a bad wire for one simulated hour; any fault, leak or miscount is an error."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from bench_programs import Experiment, costs, run_program
from bench_report import Report, main, row


def measure(quick: bool) -> Report:
    """Run it; the program fails unless all counters agree, something was lost, and memory stayed flat."""
    with TemporaryDirectory() as folder:
        experiment = Experiment.write(Path(folder))
        artifact = experiment.artifact("dob-acceleration")
        result = run_program("soak_bench", artifact, experiment.trajectory, experiment.scenario, 6 if quick else 3600)
    sample_us = costs(result["cpu_ns_per_sample"], scale=1e-3)
    rows = [row("loop and plant, one sample", sample_us, "us", ("real time", 1e3))]
    return Report(
        rows,
        [
            f"{result['simulated_s']:g} s simulated in {result['runs']} runs: no fault, all packets counted; lost "
            f"{result['lost']}, repeated {result['duplicated']}, out of order {result['reordered']} measurements; "
            f"predicted {result['predicted']} samples; memory grew by {result['memory_growth_bytes']:g} bytes"
        ],
    )


if __name__ == "__main__":
    main("soak", "One simulated hour over a wire that loses, repeats, reorders and delays.", measure)
