"""Sizes of Theorem I.2 on the block polytope and on the Takagi-Sugeno form of a model, and the time to state it."""

from __future__ import annotations

from time import process_time_ns

from bench_report import REPETITIONS, Report, Row, main, row

from quasilpv.studies import Question, count

CONDITION = "I.2"
OURS, COMPETITOR = "reduced", "ts"
SIZES = ("vertices", "unknowns", "inequalities", "rows")


def measure(quick: bool) -> Report:
    """Count and time; the arm with 4096 Takagi-Sugeno vertices takes a minute."""
    rows: list[Row] = []
    for system in ("arm2",) if quick else ("arm2", "arm3"):
        stated = [_stated(system, OURS) for _ in range(1 if quick else REPETITIONS)]
        ours, our_seconds = stated[0][0], [seconds for _, seconds in stated]
        theirs, their_seconds = _stated(system, COMPETITOR)
        name = f"{CONDITION} of {system}, block polytope"
        rows += [row(f"{name}: {size}", ours[size], "1", ("Takagi-Sugeno form", theirs[size])) for size in SIZES]
        rows.append(row(f"{name}: stated", our_seconds, "s", ("Takagi-Sugeno form", their_seconds)))
    notes = ["sizes as published, counted from the problems as built; stated: CPU time from the system to expressions"]
    return Report(rows, notes, packages=("numpy", "sympy"))


def _stated(system: str, representation: str) -> tuple[dict[str, int], float]:
    """Sizes of the condition, and the CPU time to state and count it."""
    start = process_time_ns()
    sizes = count(Question(system, CONDITION, representation)).to_document()
    return sizes, (process_time_ns() - start) * 1e-9


if __name__ == "__main__":
    main("model", "Sizes of a condition on the block polytope and on the Takagi-Sugeno form.", measure)
