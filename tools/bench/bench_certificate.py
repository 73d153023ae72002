"""The exact check of the default law's artifact, and its definiteness test beside those of general libraries."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from time import process_time_ns
from typing import Any
from unittest.mock import patch

import sympy
from bench_report import REPETITIONS, ROOT, DisagreementError, Report, main, row
from flint import fmpq_mat

from quasilpv.certificate import verify
from quasilpv.certificate.exact import claims
from quasilpv.certificate.exact.matrices import is_positive_definite
from quasilpv.experiments.designs import kept_design
from quasilpv.synthesis import DEFAULT_CONTROLLER, DesignRequest, Specification

ROBOT = "arm3"


@contextmanager
def decided_matrices() -> Iterator[list[fmpq_mat]]:
    """Collect the matrices whose definiteness a check decides."""
    matrices: list[fmpq_mat] = []

    def collect(square: fmpq_mat) -> bool:
        matrices.append(square)
        return is_positive_definite(square)

    with patch.object(claims, "is_positive_definite", collect):
        yield matrices


def with_fractions(square: fmpq_mat) -> bool:
    """Gaussian elimination in Python's fractions, as one writes it first: all pivots positive."""
    work = [[Fraction(int(entry.p), int(entry.q)) for entry in line] for line in square.table()]
    for k, line in enumerate(work):
        if line[k] <= 0:
            return False
        for below in work[k + 1 :]:
            factor = below[k] / line[k]
            below[:] = [entry - factor * over for entry, over in zip(below, line, strict=True)]
    return True


def with_sympy(square: fmpq_mat) -> bool:
    """What sympy says of the same matrix of rationals."""
    entries = [[sympy.Rational(int(entry.p), int(entry.q)) for entry in line] for line in square.table()]
    return bool(sympy.Matrix(entries).is_positive_definite)


COMPETITORS: Mapping[str, Callable[[fmpq_mat], bool]] = {"fractions": with_fractions, "sympy": with_sympy}


def measure(quick: bool) -> Report:
    """Time the check as a whole, then its definiteness test against others on the very same matrices."""
    repetitions = 1 if quick else REPETITIONS
    document = kept_design(
        DesignRequest.of(ROBOT, DEFAULT_CONTROLLER, Specification()), folder=ROOT / "out" / "cache"
    ).content()
    with decided_matrices() as matrices:
        verdict = verify(document)
    if not verdict.verified:
        raise DisagreementError(f"{ROBOT}: not verified: {', '.join(verdict.failed)}")
    whole = _cpu_ms(lambda: verify(document), repetitions)
    ours = _cpu_ms(lambda: [is_positive_definite(square) for square in matrices], repetitions)
    rows = [row(f"{DEFAULT_CONTROLLER} of {ROBOT}: verified", whole, "ms")]
    for name, decide in COMPETITORS.items():
        if not all(decide(square) for square in matrices):
            raise DisagreementError(f"{name}: a matrix that is positive definite here is not so there")
        theirs = _cpu_ms(lambda decide=decide: [decide(square) for square in matrices], repetitions)  # type: ignore[misc]
        rows.append(row(f"definiteness of its {len(matrices)} matrices, beside {name}", ours, "ms", (name, theirs)))
    orders = sorted({square.nrows() for square in matrices})
    notes = [f"CPU time, median of {repetitions}; matrices of rationals of orders {', '.join(map(str, orders))}"]
    return Report(rows, notes, packages=("python-flint", "sympy"), foreign=True)


def _cpu_ms(work: Callable[[], Any], repetitions: int) -> list[float]:
    """CPU time of every repetition, ms."""
    times = []
    for _ in range(repetitions):
        start = process_time_ns()
        work()
        times.append((process_time_ns() - start) * 1e-6)
    return times


if __name__ == "__main__":
    main(
        "certificate", "The exact check of an artifact, and its definiteness test beside sympy and fractions.", measure
    )
