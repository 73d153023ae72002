"""Every benchmark in one run: the results as JSON, one page of tables, and the changes since an earlier run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

from bench_compare import changes, read_results
from bench_pinocchio import rnea_program
from bench_report import HEADER, KEPT, DisagreementError, Report, circumstances, print_cells

from quasilpv.artifact.files import write_atomically
from quasilpv.errors import QuasilpvError

LAYERS = ("model", "lmi", "certificate", "step", "premises", "plant", "transport", "latency", "soak", "footprint")


def main() -> int:
    """Run all tools; exit code 0, 1 if what is compared is not the same computation, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="tools/bench/all", description=__doc__, epilog=f"{HEADER}.")
    parser.add_argument("--quick", action="store_true", help="few repetitions, under five minutes: rough numbers")
    parser.add_argument("--compare", metavar="OLD.json", type=Path, help="print new / old of every row as well")
    parser.add_argument("--only", metavar="LAYER", choices=LAYERS, action="append", help="may be repeated")
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, default=KEPT, help="of all.json and all.md")
    options = parser.parse_args()
    try:
        rnea_program(may_build=True)  # a quick run of the step alone leaves it out
        old = None if options.compare is None else read_results(options.compare)
        results = measure_all(options.only or LAYERS, quick=options.quick)
        name = "quick" if options.quick else "all"
        options.out.mkdir(parents=True, exist_ok=True)
        kept = {f"{name}.json": json.dumps(results, indent=2, allow_nan=False) + "\n", f"{name}.md": page(results)}
        write_atomically({options.out / file: text.encode() for file, text in kept.items()})
    except DisagreementError as error:
        print(error, file=sys.stderr)
        return 1
    except QuasilpvError as error:
        print(error, file=sys.stderr)
        return 2
    print(page(results))
    print(f"kept: {options.out / name}.json and {name}.md", file=sys.stderr)
    if old is not None:
        print_changes(old, results)
    return 0


def measure_all(layers: tuple[str, ...], *, quick: bool) -> dict[str, Any]:
    """Rows and notes of every layer with the circumstances of the run, its load before anything was measured."""
    about = circumstances(())
    found: dict[str, Report] = {}
    for layer in layers:
        start = monotonic()
        found[layer] = import_module(f"bench_{layer}").measure(quick)
        print(f"{layer}: {monotonic() - start:.0f} s", file=sys.stderr)
    about["versions"] = circumstances([name for report in found.values() for name in report.packages])["versions"]
    documents = {layer: {"rows": asdict(report)["rows"], "notes": report.notes} for layer, report in found.items()}
    return {**about, "quick": quick, "layers": documents}


def page(results: Mapping[str, Any]) -> str:
    """The results as a page of Markdown: the machine, then a table per layer with its notes."""
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    lines = [
        "# Benchmark results",
        "",
        f"Made by `tools/bench/all{' --quick' if results['quick'] else ''}` on {results['date']}: {results['cpu']}, "
        f"{results['cores']} cores, {results['kernel']}, load {results['load_average']:.1f} at the start. {versions}.",
        "",
        f"{HEADER[0].upper()}{HEADER[1:]}. What is measured and how: [benchmarks](benchmarks.md).",
    ]
    for layer, found in results["layers"].items():
        lines += ["", f"## {layer}", "", "| | value | unit | ratio | competitor |", "|---|--:|---|--:|---|"]
        lines += [
            f"| {row['name']} | {row['value']:.4g} | {row['unit']} | "
            f"{'' if row['ratio'] is None else format(row['ratio'], '.3g')} | {row['against'] or ''} |"
            for row in found["rows"]
        ]
        lines += ["", *(f"* {note}" for note in found["notes"])]
    return "\n".join(lines) + "\n"


def print_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Print new / old of every row both have."""
    rows = [
        (
            change.name,
            f"{change.old:.4g}",
            f"{change.new:.4g}",
            f"{change.ratio:.3g}",
            f"{change.noise:.3g}",
            change.mark,
        )
        for change in changes(old, new)
    ]
    title = "new / old; noise: by which factor the competitors of the layer moved, whose code is the same; ~ within it"
    print_cells(title, ("", "old", "new", "new / old", "noise", ""), rows)


if __name__ == "__main__":
    sys.exit(main())
