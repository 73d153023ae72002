"""All benchmarks in one run: what is kept, its page, and what counts as a change between two runs."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_all import LAYERS, main, page
from bench_certificate import COMPETITORS
from bench_compare import LEAST_NOISE, changes, read_results
from bench_footprint import high_water_mib, peak_mib
from bench_programs import ProgramError
from bench_report import REPETITIONS, Report, row, spread_of
from flint import fmpq_mat

from quasilpv.certificate.exact.matrices import is_positive_definite
from quasilpv.errors import InputError

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"


def results(ours: float, theirs: float, alone: float = 1.0) -> dict[str, Any]:
    """A layer with a competitor of another project and a row without."""
    rows = [row("a", ours, "ms", ("theirs", theirs)), row("b", alone, "ms")]
    return kept({"lmi": Report(rows, foreign=True)})


def kept(reports: Mapping[str, Report]) -> dict[str, Any]:
    return {"layers": {layer: report.to_document() for layer, report in reports.items()}}


def marks(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    return [change.mark for change in changes(old, new)]


@pytest.mark.parametrize(
    ("new", "expected"),
    [
        (results(2.0, 10.0), ["dearer", "~"]),  # the competitor stood still: ours changed
        (results(2.0, 20.0, 0.4), ["~", "cheaper"]),  # the machine was twice as slow
        (results(0.5, 5.0), ["~", "~"]),
        (results(1.04, 10.0, 0.9), ["~", "cheaper"]),
    ],
)
def test_a_change_counts_only_beyond_what_the_competitors_of_its_layer_moved(
    new: dict[str, Any], expected: list[str]
) -> None:
    assert marks(results(1.0, 10.0), new) == expected


def plant(seed: int, *, ida: float = 100.0, machine: float = 1.0) -> dict[str, Any]:
    """A run of a layer that competes with itself, its repetitions scattered by a fifth, on a machine so much slower."""
    random = np.random.default_rng(seed)

    def repeated(cost: float) -> list[float]:
        return (cost * machine * np.exp(random.uniform(-0.2, 0.2, REPETITIONS))).tolist()

    rows = [
        row("IDA beside RK4", repeated(ida), "us", ("RK4", repeated(20.0))),
        row("RK4 beside IDA", repeated(20.0), "us", ("IDA", repeated(ida))),
        row("vertices", 6.0, "1"),
    ]
    beside = [row("ours", repeated(1.0), "ms", ("sympy", repeated(50.0)))]
    return kept({"plant": Report(rows), "certificate": Report(beside, foreign=True)})


def test_when_the_same_code_runs_twice_expect_no_change_though_its_medians_differ() -> None:
    pairs = [(plant(seed), plant(seed + 1)) for seed in range(0, 400, 2)]
    assert any(abs(change.ratio - 1.0) > LEAST_NOISE - 1.0 for old, new in pairs for change in changes(old, new))
    assert sum(mark != "~" for old, new in pairs for mark in marks(old, new)) <= 0.01 * 4 * len(pairs)


def test_when_the_code_of_one_row_changes_expect_it_alone_though_it_is_the_competitor_of_another() -> None:
    assert marks(plant(0), plant(1, ida=50.0)) == ["cheaper", "~", "~", "~"]
    assert marks(plant(0), plant(1, ida=200.0)) == ["dearer", "~", "~", "~"]


def test_when_the_machine_is_slower_expect_a_layer_without_foreign_competitors_judged_by_those_of_others() -> None:
    assert marks(plant(0), plant(1, machine=3.0)) == ["~"] * 4
    without = [{"layers": {"plant": run["layers"]["plant"]}} for run in (plant(0), plant(1, machine=3.0))]
    assert marks(*without) == ["dearer", "dearer", "~"]


def test_when_a_row_was_measured_once_expect_the_widest_spread_of_its_layer() -> None:
    def run(once: float) -> dict[str, Any]:
        return kept({"lmi": Report([row("many", [1.0, 1.3], "ms"), row("once", once, "s")])})

    assert marks(run(1.0), run(1.29)) == ["~", "~"]
    assert marks(run(1.0), run(1.31)) == ["~", "dearer"]


def test_when_a_count_changes_expect_it_never_taken_for_noise() -> None:
    def run(unknowns: float) -> dict[str, Any]:
        return kept({"model": Report([row("stated", [1.0, 2.0], "s"), row("unknowns", unknowns, "1")])})

    assert marks(run(1000.0), run(1001.0)) == ["~", "dearer"]


def test_spread_is_between_medians_of_parts_so_that_one_outlier_is_none() -> None:
    assert spread_of(3.0) is None
    assert spread_of([1.0, 1.5]) == 1.5
    assert spread_of([1.0, 1.0, 50.0] * REPETITIONS) == 1.0
    assert spread_of([1.0] * 12 + [2.0] * 3) == 2.0


def test_when_a_row_is_new_expect_no_change_of_it() -> None:
    assert list(changes({"layers": {}}, results(1.0, 2.0))) == []
    [first, _] = changes(results(1.0, 2.0), results(1.0, 2.0))
    assert (first.name, first.ratio, first.noise) == ("lmi: a", 1.0, LEAST_NOISE)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"layers": 1}', '{"layers": {"lmi": {"rows": [{"value": "1"}]}}}'])
def test_when_the_old_results_are_something_else_expect_the_file_named(text: str, tmp_path: Path) -> None:
    (tmp_path / "old.json").write_text(text)
    with pytest.raises(InputError, match=r"old\.json"):
        read_results(tmp_path / "old.json")


def test_when_layers_are_measured_expect_machine_rows_and_a_page_that_names_every_competitor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("bench_all.rnea_program", lambda **_: None)
    command = ["all", "--quick", "--only", "model", "--only", "certificate", "-o", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    assert main() == 0
    kept = read_results(tmp_path / "quick.json")
    assert {"cpu", "cores", "kernel", "load_average", "date", "versions", "quick"} <= set(kept)
    text = (tmp_path / "quick.md").read_text(encoding="utf-8")
    assert text == page(kept)
    assert str(kept["cpu"]) in text
    for name, layer in kept["layers"].items():
        assert f"## {name}\n" in text
        assert any(row["ratio"] is not None for row in layer["rows"])
    for competitor in ("Takagi-Sugeno form", *COMPETITORS):
        assert f"| {competitor} |" in text
    capsys.readouterr()
    monkeypatch.setattr(sys, "argv", [*command, "--compare", str(tmp_path / "quick.json")])
    assert main() == 0
    said = capsys.readouterr().out.splitlines()
    [vertices] = [line for line in said if "block polytope: vertices" in line and "|" not in line]
    old, new, ratio, _, mark = vertices.split()[-5:]
    assert (old, new, ratio, mark) == ("6", "6", "1", "~")


def test_the_page_of_the_documentation_is_made_from_the_results_beside_it_and_has_a_ratio_in_every_layer() -> None:
    kept = json.loads((REFERENCE / "benchmark-results.json").read_bytes())
    assert (REFERENCE / "benchmark-results.md").read_text(encoding="utf-8") == page(kept)
    for name in set(LAYERS) - {"latency"}:  # of the machine: there is nobody to compete with
        assert any(row["ratio"] is not None for row in kept["layers"][name]["rows"]), name


@pytest.mark.parametrize("decide", COMPETITORS.values(), ids=COMPETITORS)
def test_every_test_of_definiteness_decides_these_matrices_alike(decide: Any) -> None:
    for entries, positive in (
        ([2, 1, 1, 2], True),
        ([1, 2, 2, 1], False),
        ([1, 1, 1, 1], False),
        ([0, 0, 0, 1], False),
    ):
        assert decide(fmpq_mat(2, 2, entries)) is positive is is_positive_definite(fmpq_mat(2, 2, entries))


def test_when_a_program_holds_memory_expect_it_in_its_peak_and_not_that_of_its_parent() -> None:
    ours = high_water_mib(Path("/proc/self/status").read_text(encoding="utf-8"))
    hold = "import time; held = bytearray(b'x') * (64 << 20); time.sleep(0.2)"
    programs = {"small": "import time; time.sleep(0.2)", "large": hold}
    peaks = peak_mib({name: [sys.executable, "-S", "-c", program] for name, program in programs.items()})
    assert peaks["large"] - peaks["small"] == pytest.approx(64.0, abs=4.0)
    assert peaks["small"] < ours


def test_when_a_program_fails_expect_its_words() -> None:
    with pytest.raises(ProgramError, match="no such thing"):
        peak_mib({"sad": [sys.executable, "-c", "raise SystemExit('no such thing')"]})
