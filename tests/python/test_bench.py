"""The benchmark tools: shape of their rows and their errors. How fast anything is, is never asserted."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_map import QUESTION, Timed, agreement, inequalities
from bench_report import DisagreementError
from bench_solvers import Conic, Cvxopt, Scs, decide_with

from quasilpv.lmi import Problem, Variable, he
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.layout import Layout
from quasilpv.studies import Verdict

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / "tools" / "bench"
QUICK_LAYERS = ("step", "plant", "transport", "premises", "latency", "soak")  # which tests below look into, too
SLOW_LAYERS = ("lmi", "model", "certificate", "footprint", "systems")
LAYERS = (*QUICK_LAYERS, *(pytest.param(layer, marks=pytest.mark.full) for layer in SLOW_LAYERS))


def run_tool(layer: str, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [str(TOOLS / layer), "--quick", *options]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=False)


@cache
def quick_rows(layer: str) -> list[dict[str, Any]]:
    done = run_tool(layer, "--json")
    assert done.returncode == 0, done.stderr
    rows: list[dict[str, Any]] = json.loads(done.stdout)
    return rows


@pytest.mark.parametrize("layer", LAYERS)
def test_every_row_is_a_positive_cost_with_a_name_of_its_own(layer: str) -> None:
    rows = quick_rows(layer)
    assert rows
    assert len({row["name"] for row in rows}) == len(rows)
    for row in rows:
        assert set(row) == {"name", "value", "unit", "against", "ratio", "spread"}
        assert row["unit"] in {"ns", "us", "ms", "s", "MiB", "1"}
        assert math.isfinite(row["value"])
        assert row["value"] > 0


@pytest.mark.parametrize("layer", LAYERS)
def test_a_ratio_is_given_exactly_where_there_is_a_competitor(layer: str) -> None:
    for row in quick_rows(layer):
        assert (row["against"] is None) == (row["ratio"] is None)
        assert row["ratio"] is None or row["ratio"] > 0


@pytest.mark.parametrize("layer", ["plant", "transport"])
def test_when_the_competitor_is_a_row_too_expect_ratio_competitor_over_ours(layer: str) -> None:
    values = {row["name"]: row["value"] for row in quick_rows(layer)}
    beside = [row for row in quick_rows(layer) if row["against"] in values]
    assert beside
    for row in beside:
        assert row["ratio"] == pytest.approx(values[row["against"]] / row["value"], rel=1e-12)


def test_the_step_benchmark_has_the_median_step_of_every_law() -> None:
    names = {row["name"] for row in quick_rows("step")}
    assert {f"{law} step p50" for law in ("dob-acceleration", "pid", "ctc", "ctc-dob")} <= names


def test_quantiles_of_the_step_are_ordered() -> None:
    values = {row["name"]: row["value"] for row in quick_rows("step")}
    p50, p99, p999 = (values[f"dob-acceleration step {quantile}"] for quantile in ("p50", "p99", "p99.9"))
    assert p50 <= p99 <= p999


def test_a_dense_block_is_the_competitor_of_the_same_number_of_premises() -> None:
    rows = {row["name"]: row for row in quick_rows("premises")}
    for premises in (1, 3):
        collapsed = rows[f"collapsed, {premises} premises, {2 * premises} vertices"]
        assert collapsed["against"] == f"dense, {premises} premises, {2**premises} vertices"
        assert collapsed["against"] in rows


def test_latencies_are_there_without_privilege_and_their_quantiles_are_ordered() -> None:
    values = {row["name"]: row["value"] for row in quick_rows("latency")}
    for name in ("wake-up", "step", "LCM round trip"):
        p50, p99, p999 = (values[f"{name} {label}, without privilege"] for label in ("p50", "p99", "p99.9"))
        assert p50 <= p99 <= p999


def test_the_soak_observed_something() -> None:
    done = run_tool("soak")
    assert done.returncode == 0, done.stderr
    assert "6 s simulated" in done.stderr
    assert "lost 0" not in done.stderr


@pytest.mark.full
def test_the_map_is_compared_with_both_ways_of_writing_it_in_cvxpy_with_and_without_the_exact_check() -> None:
    beside = {(row["name"].partition(": ")[2].partition(",")[0], row["against"]) for row in quick_rows("lmi")}
    for way in ("certified", "solver only"):
        assert {(way, "cvxpy, built anew"), (way, "cvxpy, compiled once (DPP)")} <= beside


def test_when_the_statements_differ_in_a_verdict_expect_an_error_and_not_a_time() -> None:
    ours, theirs = (Timed(1.0, verdicts) for verdicts in ((Verdict.FEASIBLE,), (Verdict.INFEASIBLE,)))
    assert len(agreement({"certified": ours, "other": theirs}, same={})) == 2
    with pytest.raises(DisagreementError, match="0 of 1"):
        agreement({"certified": ours, "other": theirs}, same={"other": None})


def test_the_inequalities_written_for_cvxpy_have_the_unknowns_of_the_library() -> None:
    unknowns = sum(v.size for v in QUESTION.statement().problem.variables)
    theirs = inequalities(1.0, 1.0).variables()
    assert sum(v.shape[0] * (v.shape[0] + 1) // 2 if v.attributes["symmetric"] else v.size for v in theirs) == unknowns


@pytest.mark.parametrize("load", [Scs, Cvxopt])
def test_when_the_verdict_is_known_expect_every_other_solver_to_find_it(load: Callable[[Layout], Conic]) -> None:
    for abscissa, verdict in ((-0.5, Verdict.FEASIBLE), (0.5, Verdict.INFEASIBLE)):
        P, problem = Variable("P", 2, symmetric=True), Problem()
        problem.positive("P", P)
        problem.negative("decrease", he(np.array([[-1.0, 3.0], [0.0, abscissa]]) @ P))
        compiled = CompiledProblem.of(problem)
        assert decide_with(load(compiled.layout), compiled) is verdict


@pytest.mark.parametrize("layer", ["step", "plant", "transport", "premises", "soak"])
def test_when_the_programs_are_not_built_expect_exit_2_and_one_line_that_names_the_folder(
    layer: str, tmp_path: Path
) -> None:
    done = run_tool(layer, QUASILPV_BIN=str(tmp_path))
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert str(tmp_path) in done.stderr


def test_when_a_tool_is_given_an_unknown_option_expect_exit_2() -> None:
    assert run_tool("lmi", "--fast").returncode == 2
