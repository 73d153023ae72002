"""Every benchmark in one run: the results as JSON, one page of tables, and the changes since an earlier run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

from bench_compare import changes, read_results
from bench_pinocchio import rnea_program
from bench_report import HEADER, KEPT, Report, circumstances, exit_code_of, factor, print_cells

from quasilpv.files import write_atomically

LAYERS = ("model", "lmi", "certificate", "step", "premises", "plant", "transport", "latency", "soak", "footprint")


def main() -> int:
    """Run all tools; exit code 0, 1 if what is compared is not the same computation, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="tools/bench/all", description=__doc__, epilog=f"{HEADER}.")
    parser.add_argument("--quick", action="store_true", help="few repetitions, under five minutes: rough numbers")
    parser.add_argument("--compare", metavar="OLD.json", type=Path, help="print new / old of every row as well")
    parser.add_argument("--only", metavar="LAYER", choices=LAYERS, action="append", help="may be repeated")
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, default=KEPT, help="of all.json and all.md")
    options = parser.parse_args()

    def measured() -> None:
        rnea_program(may_build=True)  # a quick run of the step alone leaves it out
        old = None if options.compare is None else read_results(options.compare)
        results = measure_all(options.only or LAYERS, quick=options.quick)
        keep_all(options.out, results)
        if old is not None:
            print_changes(old, results)

    return exit_code_of(measured)


def keep_all(folder: Path, results: Mapping[str, Any]) -> None:
    """Write the results and their page into a folder, and print the page."""
    name = "quick" if results["quick"] else "all"
    folder.mkdir(parents=True, exist_ok=True)
    kept = {f"{name}.json": json.dumps(results, indent=2, allow_nan=False) + "\n", f"{name}.md": page(results)}
    write_atomically({folder / file: text.encode() for file, text in kept.items()})
    print(page(results))
    print(f"kept: {folder / name}.json and {name}.md", file=sys.stderr)


def measure_all(layers: tuple[str, ...], *, quick: bool) -> dict[str, Any]:
    """Rows and notes of every layer with the circumstances of the run, its load before anything was measured."""
    about = circumstances(())
    found: dict[str, Report] = {}
    for layer in layers:
        start = monotonic()
        found[layer] = import_module(f"bench_{layer}").measure(quick)
        print(f"{layer}: {monotonic() - start:.0f} s", file=sys.stderr)
    about["versions"] = circumstances([name for report in found.values() for name in report.packages])["versions"]
    return {**about, "quick": quick, "layers": {layer: report.to_document() for layer, report in found.items()}}


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
        lines += [
            "",
            f"## {layer}",
            "",
            "| | value | unit | spread | ratio | competitor |",
            "|---|--:|---|--:|--:|---|",
        ]
        lines += [
            f"| {row['name']} | {row['value']:.4g} | {row['unit']} | {factor(row.get('spread'))} | "
            f"{factor(row['ratio'])} | {row['against'] or ''} |"
            for row in found["rows"]
        ]
        lines += ["", *(f"* {note}" for note in found["notes"])]
    return "\n".join(lines) + "\n"


def print_changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Print new / old of every row both have."""
    rows = [
        (each.name, f"{each.old:.4g}", f"{each.new:.4g}", factor(each.ratio), factor(each.noise), each.mark)
        for each in changes(old, new)
    ]
    title = "noise: the factor that the same code can differ by; ~ is within it"
    print_cells(title, ("", "old", "new", "new / old", "noise", ""), rows)


if __name__ == "__main__":
    sys.exit(main())
