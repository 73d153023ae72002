"""What every benchmark tool prints and keeps: rows with a competitor of the same run, on which machine, with what."""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from rich.console import Console
from rich.table import Table

from quasilpv.errors import QuasilpvError
from quasilpv.files import write_atomically

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "out" / "bench"
HEADER = "ratio = competitor / ours: above 1 ours is the cheaper"

REPETITIONS = 5
"""How often what takes long is measured in one run, all of it in turns: what spreads is what the machine did."""

Unit = Literal["ns", "us", "ms", "s", "MiB", "1"]
Cost: TypeAlias = float | Sequence[float]
"""A cost that was measured once, or the costs of its repetitions in the order of time."""


@dataclass(frozen=True)
class Row:
    """One measured cost: a duration, memory, or a count.

    Attributes:
        name: what was measured.
        value: how much of `unit` it took, the median of its repetitions.
        unit: ns, us, ms or s; MiB; 1 of counts.
        against: the competitor measured in the same run, None if there is none.
        ratio: cost of the competitor over `value`, None if there is no competitor.
        spread: largest over smallest median of the (at most five) parts of the run, None if it was measured once.
    """

    name: str
    value: float
    unit: Unit
    against: str | None = None
    ratio: float | None = None
    spread: float | None = None


def row(name: str, cost: Cost, unit: Unit, against: tuple[str, Cost] | None = None) -> Row:
    """The row of a cost beside that of a competitor, (its name, its cost in the same unit)."""
    value = typical(cost)
    if against is None:
        return Row(name, value, unit, spread=spread_of(cost))
    competitor, its_cost = against
    return Row(name, value, unit, competitor, typical(its_cost) / value, spread_of(cost))


def typical(cost: Cost) -> float:
    """Median of the repetitions."""
    return float(np.median(cost))


def spread_of(cost: Cost) -> float | None:
    """Largest over smallest median of consecutive parts, by time; None of a single measurement."""
    repetitions = np.atleast_1d(cost)
    if repetitions.size == 1:
        return None
    parts = [float(np.median(part)) for part in np.array_split(repetitions, min(REPETITIONS, repetitions.size))]
    return max(parts) / min(parts)


@dataclass(frozen=True)
class Report:
    """Outcome of one benchmark tool.

    Attributes:
        rows: the costs.
        notes: what a reader must know to judge them: errors of what was timed, how, what could not be measured and why.
        packages: Python distributions whose version matters.
        foreign: whether the competitors are not of this project: between two runs only the machine moves them.
    """

    rows: list[Row]
    notes: list[str] = field(default_factory=list)
    packages: Sequence[str] = ()
    foreign: bool = False

    def to_document(self) -> dict[str, Any]:
        """What is kept of it."""
        document = asdict(self)
        del document["packages"]
        return document


def run_tool(layer: str, summary: str, measure: Callable[[bool], Report]) -> int:
    """Parse the command line of a benchmark tool, measure, print, and keep the result in ``out/bench/<layer>.json``.

    Args:
        layer: name of the tool.
        summary: one line for ``--help``.
        measure: called with ``quick``; a quick run says that the tool works, its numbers are not kept.

    Returns:
        Exit code: 0; 1 if what is compared is not the same computation; 2 for bad input.
    """
    parser = argparse.ArgumentParser(
        prog=f"tools/bench/{layer}", description=summary, epilog=f"{HEADER}. Kept in out/bench/{layer}.json."
    )
    parser.add_argument(
        "--json", action="store_true", help="print a list of {name, value, unit, against, ratio, spread}"
    )
    parser.add_argument("--quick", action="store_true", help="few repetitions, nothing is kept: a check of the tool")
    options = parser.parse_args()

    def measured() -> None:
        report = measure(options.quick)
        if not options.quick:
            keep(layer, report)
        present(layer, report, as_json=options.json)

    return exit_code_of(measured)


class DisagreementError(QuasilpvError):
    """Two implementations that are compared do not compute the same (exit code 1)."""


def exit_code_of(work: Callable[[], None]) -> int:
    """Exit code of a benchmark tool, its error on stderr: 0; 1 for a disagreement; 2 for bad input."""
    try:
        work()
    except QuasilpvError as error:
        print(error, file=sys.stderr)
        return 1 if isinstance(error, DisagreementError) else 2
    return 0


def present(layer: str, report: Report, *, as_json: bool) -> None:
    """Print the rows on stdout, the notes on stderr."""
    if as_json:
        print(json.dumps([asdict(entry) for entry in report.rows], indent=2, allow_nan=False))
    else:
        print_table(layer, report.rows)
    for note in report.notes:
        print(note, file=sys.stderr)


def print_table(layer: str, rows: Sequence[Row]) -> None:
    """Print rows on stdout, never narrower than their content when stdout is not a terminal."""
    cells = [(r.name, f"{r.value:.4g}", r.unit, factor(r.spread), factor(r.ratio), r.against) for r in rows]
    print_cells(f"{layer}: {HEADER}", ("", "value", "unit", "spread", "ratio", "competitor"), cells)


def factor(value: float | None) -> str:
    """A spread or a ratio as it is printed, nothing of one that there is not."""
    return "" if value is None else f"{value:.3g}"


def print_cells(title: str, headings: Sequence[str], rows: Sequence[Sequence[str | None]]) -> None:
    """Print a table on stdout; columns whose heading is of a number align right."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(heading, justify="left" if heading in {"", "unit", "competitor"} else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def keep(layer: str, report: Report) -> None:
    """Write rows, notes and the circumstances of the measurement to ``out/bench/<layer>.json``."""
    document = {"layer": layer, **circumstances(report.packages), **report.to_document()}
    KEPT.mkdir(parents=True, exist_ok=True)
    write_atomically({KEPT / f"{layer}.json": (json.dumps(document, indent=2) + "\n").encode()})


def circumstances(packages: Sequence[str]) -> dict[str, Any]:
    """Machine, date and versions. The load says how much else ran: above the number of cores, medians suffer too."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": platform.node(),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "load_average": os.getloadavg()[0],
        "kernel": f"{platform.system()} {platform.release()}",
        "versions": {
            "python": platform.python_version(),
            "compiler": compiler(),
            **{name: metadata.version(name) for name in ("quasilpv", *packages) if is_installed(name)},
        },
    }


def cpu_model() -> str:
    """The processor's name as Linux reports it; what Python knows elsewhere."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def compiler() -> str:
    """First line of what the C++ compiler says of itself."""
    try:
        output = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return output.splitlines()[0]


def is_installed(distribution: str) -> bool:
    """Whether a Python distribution is installed."""
    try:
        metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True


def main(layer: str, summary: str, measure: Callable[[bool], Report]) -> None:
    """`run_tool` as a program."""
    sys.exit(run_tool(layer, summary, measure))
