"""The control step against the number of premises, seven joints: one block per premise beside one dense block."""

from __future__ import annotations

from functools import partial

from bench_programs import Documents, costs, run_in_turns, run_program
from bench_report import Report, main, row

LARGEST_COLLAPSED = 20
LARGEST_DENSE = 12
"""The loader takes no more premises in one block: 4096 vertices."""
LONGEST_DENSE_VERTICES = 1 << 17
"""Vertices that one timed round may visit."""


def measure(quick: bool) -> Report:
    """Time the step for every number of premises that the loader accepts."""
    collapsed_counts = (1, 3) if quick else range(1, LARGEST_COLLAPSED + 1)
    dense_counts = (1, 3) if quick else range(1, LARGEST_DENSE + 1)
    rounds = 1 if quick else 11
    sizes = [(p, "collapsed", 1000) for p in collapsed_counts] + [(p, "dense", steps_of(p)) for p in dense_counts]
    runs = {
        f"{p} {layout}": partial(run_program, "premises_bench", p, layout, steps, rounds) for p, layout, steps in sizes
    }
    measured = run_in_turns(runs, quick=quick)
    rows = []
    for p, layout, _ in sizes:
        dense = measured.get(f"{p} dense") if layout == "collapsed" else None
        rival = (name_of("dense", dense), step_us(dense)) if dense else None
        documents = measured[f"{p} {layout}"]
        rows.append(row(name_of(layout, documents), step_us(documents), "us", rival))
    notes = [
        "law dob-torque, seven joints, warm: inertia, feedback and observer gains are evaluated at each step; CPU time "
        f"per step, median of {rounds} rounds of each process",
        f"a dense block of more than {LARGEST_DENSE} premises is refused by the loader",
    ]
    return Report(rows, notes)


def steps_of(premises: int) -> int:
    """Steps of one round of a dense block, so that a round is short for every size."""
    return max(16, min(1000, LONGEST_DENSE_VERTICES >> premises))


def name_of(layout: str, documents: Documents) -> str:
    """Name of a row: layout and number of premises."""
    return f"{layout}, {documents[0]['premises']} premises, {documents[0]['vertices']} vertices"


def step_us(documents: Documents) -> list[float]:
    """CPU time of a step in us, of every process."""
    return costs(documents, "timing", "batch_ns", scale=1e-3)


if __name__ == "__main__":
    main("premises", "The control step of seven joints against its number of premises.", measure)
