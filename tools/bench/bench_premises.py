"""The control step against the number of premises, seven joints: one block per premise beside one dense block."""

from __future__ import annotations

from typing import Any

from bench_programs import run_program
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
    rounds = 1 if quick else 51
    collapsed = {p: run_program("premises_bench", p, "collapsed", 1000, rounds) for p in collapsed_counts}
    dense = {p: run_program("premises_bench", p, "dense", steps_of(p), rounds) for p in dense_counts}
    rows = []
    for p, result in collapsed.items():
        rival = (name_of("dense", dense[p]), median_us(dense[p])) if p in dense else None
        rows.append(row(name_of("collapsed", result), median_us(result), "us", rival))
    rows += [row(name_of("dense", result), median_us(result), "us") for result in dense.values()]
    notes = [
        "law dob-torque, seven joints, warm: inertia, feedback and observer gains are evaluated at each step; CPU time "
        f"per step, median of {rounds} rounds",
        f"a dense block of more than {LARGEST_DENSE} premises is refused by the loader",
    ]
    return Report(rows, notes)


def steps_of(premises: int) -> int:
    """Steps of one round of a dense block, so that a round is short for every size."""
    return max(16, min(1000, LONGEST_DENSE_VERTICES >> premises))


def name_of(layout: str, result: Any) -> str:
    """Name of a row: layout and number of premises."""
    return f"{layout}, {result['premises']} premises, {result['vertices']} vertices"


def median_us(result: Any) -> float:
    """CPU time of a step in us."""
    return float(result["timing"]["batch_ns"]) * 1e-3


if __name__ == "__main__":
    main("premises", "The control step of seven joints against its number of premises.", measure)
