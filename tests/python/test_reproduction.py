"""Figures and tables of the source: rules of comparison, runner, and the items themselves."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.cli import run
from quasilpv.conditions.forms.cube import cube_sum
from quasilpv.errors import ClaimError, InfeasibleError, InputError, PlantError, QuasilpvError
from quasilpv.lmi import Problem, Variable
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.exact import rank_factors, to_rational
from quasilpv.lmi.feasibility import decide
from quasilpv.reproduction import ITEMS, Effort, Finding, Item, ItemResult, ItemVerdict, item, reproduce, rules, runner
from quasilpv.reproduction.complexity_growth import crossing
from quasilpv.reproduction.conservatism import DIALS, guarantee
from quasilpv.reproduction.counting import Row, single_sum, symmetric, table_finding
from quasilpv.reproduction.report import markdown_table
from quasilpv.reproduction.synthetic import counted, single_sum_at
from quasilpv.studies import Question

ROOT = Path(__file__).parents[2]
REQUIRED = {
    *(f"fig-I.{k}" for k in (2, 4, 5, 7)),
    *(f"fig-II.{k}" for k in (1, 2, 3, 4, 5, 6, 7)),
    *(f"fig-III.{k}" for k in (1, 3, 4, 5, 6, 7, 8)),
    *(f"fig-IV.{k}" for k in (3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 14, 15, 16)),
    *(f"table-I.{k}" for k in (2, 5)),
    *(f"table-II.{k}" for k in (1, 2, 3, 4)),
    *(f"table-III.{k}" for k in (1, 2)),
    *(f"table-IV.{k}" for k in (1, 2, 5, 6)),
    "table-III.3",
    "study-estimation",
    "study-conservatism",
}
"""Everything the source shows that is computed, by id."""

positive = st.floats(1e-6, 1e6)
places = st.frozensets(st.tuples(st.integers(0, 6).map(float), st.integers(0, 6).map(float)))


@given(positive, positive)
def test_numbers_agree_if_and_only_if_within_the_factor(printed: float, computed: float) -> None:
    assert rules.number("x", printed, computed).holds == (0.8 * printed <= computed <= 1.25 * printed)


@given(positive)
def test_a_number_agrees_with_itself_and_not_with_its_double_or_half(value: float) -> None:
    assert rules.number("x", value, value).holds
    assert not rules.number("x", value, 2.0 * value).holds
    assert not rules.number("x", value, 0.5 * value).holds


@given(st.integers(), st.integers())
def test_counts_agree_exactly_or_not_at_all(printed: int, computed: int) -> None:
    assert rules.exact("x", printed, computed).holds == (printed == computed)


@given(places, places)
def test_inclusion_is_that_of_sets_and_names_a_point_outside(inner: rules.Places, outer: rules.Places) -> None:
    found = rules.inclusion("x", inner, outer)
    assert found.holds == (inner <= outer)
    assert rules.strict_inclusion("x", inner, outer).holds == (inner < outer)
    if not found.holds:
        assert any(str(place) in found.found for place in inner - outer)


@given(places, places)
def test_regions_are_compared_symmetrically_and_by_their_jaccard_index(one: rules.Places, other: rules.Places) -> None:
    found = rules.same_region("x", one, other)
    assert found == rules.same_region("x", other, one)
    assert rules.same_region("x", one, one).holds
    differing, union = len(one ^ other), len(one | other)
    assert found.holds == (10 * differing <= union)


def an_item(compute: Callable[[Effort], Finding], assumptions: tuple[str, ...] = ()) -> Item:
    return Item("fig-0.0", "made up", {}, assumptions, compute)


def finding(*held: bool) -> Finding:
    return Finding([rules.fact(f"claim {k}", holds, f"value {k}") for k, holds in enumerate(held)], {"x": 1.0})


@pytest.mark.parametrize(
    ("held", "assumptions", "verdict"),
    [
        ((True, True), (), ItemVerdict.REPRODUCED),
        ((True,), ("z2 in [0, 1]",), ItemVerdict.WITH_ASSUMPTION),
        ((True, False), (), ItemVerdict.NOT_REPRODUCIBLE),
        ((False, True), ("z2 in [0, 1]",), ItemVerdict.NOT_REPRODUCIBLE),
    ],
)
def test_the_verdict_follows_from_the_checks(held: tuple[bool], assumptions: tuple[str], verdict: ItemVerdict) -> None:
    result = ItemResult(an_item(lambda _: finding(*held), assumptions), finding(*held), 0.1)
    assert result.verdict is verdict
    for k, holds in enumerate(held):
        assert (f"claim {k}" in result.reason) == (not holds)


def test_when_run_again_expect_nothing_computed_and_the_same_rows(tmp_path: Path) -> None:
    calls: list[Effort] = []

    def compute(effort: Effort) -> Finding:
        calls.append(effort)
        return finding(True)

    first = reproduce([an_item(compute)], Effort.QUICK, tmp_path)
    assert reproduce([an_item(compute)], Effort.QUICK, tmp_path) == first
    assert calls == [Effort.QUICK]
    reproduce([an_item(compute)], Effort.FULL, tmp_path)
    assert calls == [Effort.QUICK, Effort.FULL]


def test_when_interrupted_expect_finished_items_kept(tmp_path: Path) -> None:
    done: list[str] = []

    def good(_: Effort) -> Finding:
        done.append("good")
        return finding(True)

    def interrupted(_: Effort) -> Finding:
        raise KeyboardInterrupt

    second = replace(an_item(interrupted), id="fig-0.1")
    with pytest.raises(KeyboardInterrupt):
        reproduce([an_item(good), second], Effort.QUICK, tmp_path)
    mended = replace(second, compute=lambda _: finding(False))
    rows = reproduce([an_item(good), mended], Effort.QUICK, tmp_path)
    assert done == ["good"]
    assert [row["id"] for row in rows] == ["fig-0.0", "fig-0.1"]
    assert json.loads((tmp_path / "results.json").read_text()) == list(rows)


def test_when_the_code_has_changed_expect_stale_results_computed_again_and_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = replace(an_item(lambda _: finding(True)), id="fig-0.1")
    reproduce([an_item(lambda _: finding(True)), other], Effort.QUICK, tmp_path)
    monkeypatch.setattr(runner, "_code_digest", lambda: "another code")
    (row,) = reproduce([an_item(lambda _: finding(False))], Effort.QUICK, tmp_path)
    assert row["verdict"] == ItemVerdict.NOT_REPRODUCIBLE
    assert [kept["id"] for kept in json.loads((tmp_path / "results.json").read_text())] == ["fig-0.0"]


@pytest.mark.parametrize(
    "refusal",
    [
        InputError("design", "slew", "250", "at least 317"),
        ClaimError("not released: slew 250, needed at least 317"),
        InfeasibleError("no gains: at least 317"),
        PlantError("IDA: at least 317"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_when_an_item_is_refused_expect_the_others_computed_and_one_line_that_names_it(
    refusal: QuasilpvError, tmp_path: Path
) -> None:
    def refuses(_: Effort) -> Finding:
        raise refusal

    refused = replace(an_item(refuses), id="fig-0.1")
    after = replace(an_item(lambda _: finding(True)), id="fig-0.2")
    with pytest.raises(InputError, match=r"1 refused: fig-0\.1: .*at least 317") as error:
        reproduce([refused, after], Effort.QUICK, tmp_path)
    assert "\n" not in str(error.value)
    assert [row["id"] for row in json.loads((tmp_path / runner.RESULTS).read_text())] == ["fig-0.2"]


def test_items_computed_in_several_runs_share_one_file(tmp_path: Path) -> None:
    for name in ("fig-0.0", "fig-0.1"):
        reproduce([replace(an_item(lambda _: finding(True)), id=name)], Effort.QUICK, tmp_path)
    assert [row["id"] for row in json.loads((tmp_path / "results.json").read_text())] == ["fig-0.0", "fig-0.1"]
    assert (tmp_path / "results.md").read_text().count("\n") == 4


@pytest.mark.parametrize("content", ["{", '{"id": 3}', "[1]", '"text"'])
def test_when_a_kept_result_is_something_else_expect_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "fig-0.0.json").write_text(content)
    with pytest.raises(InputError, match=r"fig-0\.0\.json.*a result of this program"):
        reproduce([an_item(lambda _: finding(True))], Effort.QUICK, tmp_path)


def test_when_the_folder_cannot_be_written_expect_one_line_before_anything_is_computed(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    calls: list[Effort] = []

    def compute(effort: Effort) -> Finding:
        calls.append(effort)
        return finding(True)

    with pytest.raises(InputError):
        reproduce([an_item(compute)], Effort.QUICK, tmp_path / "file" / "below")
    assert not calls


def test_every_required_item_is_there_under_its_own_id() -> None:
    assert set(ITEMS) >= REQUIRED
    assert all(name == entry.id and entry.title for name, entry in ITEMS.items())


def test_when_an_item_is_unknown_expect_those_there_are() -> None:
    with pytest.raises(InputError, match=r"fig-I\.4"):
        item("fig-9.9")


def test_a_table_is_compared_with_its_explanation_applied_and_says_what_it_is() -> None:
    rows = [Row("A", {"N": 7}, {"N": 5}, {"N": 2}, "two more"), Row("B", {"N": 3}, {"N": 4})]
    found = table_finding(rows)
    assert [check.holds for check in found.checks] == [True, False]
    assert "two more" in found.instead
    assert found.computed["A"]["as built"] == {"N": 5}


@given(st.integers(1, 40))
def test_symmetric_matrices_are_counted_by_their_upper_triangle(size: int) -> None:
    assert symmetric(size) == len(np.triu_indices(size)[0])


@pytest.mark.parametrize("name", ["I.2", "I.53"])
def test_sizes_at_many_vertices_are_those_of_the_problem_built(name: str) -> None:
    question = Question("arm2", name, "reduced")
    built = single_sum(question)
    line = single_sum_at(name, order=4, inputs=2, vertices=6)
    assert (line["unknowns"], line["rows"]) == (built.unknowns, built.rows)


def test_sizes_depend_on_orders_and_representation_only() -> None:
    real = single_sum_at("I.2", order=4, inputs=2, vertices=10)
    built = single_sum(Question("arm2", "I.2", "per-premise"))
    assert (real["unknowns"], real["rows"]) == (built.unknowns, built.rows)
    with pytest.raises(ValueError, match="affine"):
        single_sum_at("II.5", order=2, inputs=1, vertices=20)


def test_counts_of_a_condition_grow_with_the_square_of_the_premises_at_most() -> None:
    rows = [counted("II.6", order=3, inputs=1, premises=r).rows for r in (2, 3, 4)]
    assert rows[2] - 2 * rows[1] + rows[0] == 8 * 3 * 2


def test_crossing_is_where_the_curves_meet() -> None:
    assert crossing(lambda r: 64.0, lambda r: 2.0**r, 20) == pytest.approx(6.0)
    assert crossing(lambda r: 2.0**r, lambda r: 1.0, 20) == np.inf


def test_the_table_of_results_escapes_what_would_break_it() -> None:
    row = {"id": "fig-0.0", "verdict": "reproduced", "reason": "|x| < 1", "assumptions": []}
    line = markdown_table([row]).splitlines()[2]
    assert len(re.split(r"(?<!\\)\|", line)) == 6


def random_cube(seed: int) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]], float]:
    """Whole-number ``-2 I + rho sum_p d_p He(u_p v_p')``, rank 2, and the largest rho for which all corners hold."""
    random = np.random.default_rng(seed)
    size, count = 4, 5
    factors = [(random.integers(-3, 4, (size, 1)), random.integers(-3, 4, (1, size))) for _ in range(count)]
    terms = [u @ v + (u @ v).T for u, v in factors]
    signs = 2 * np.array(list(np.ndindex(*(2,) * count))) - 1
    largest = np.linalg.eigvalsh(np.tensordot(signs, np.array(terms), axes=1))[:, -1].max()
    return np.eye(size), factors, 2.0 / float(largest)


@pytest.mark.parametrize("seed", range(8))
def test_the_matrix_cube_relaxation_is_exact_within_half_pi_for_rank_two(seed: int) -> None:
    centre, factors, exact = random_cube(seed)

    def relaxed(radius: float) -> bool:
        problem, scale = Problem(), Variable("scale", 1)
        problem.positive("scale", scale)
        terms = [
            (to_rational(u.astype(float)), (scale.expression * to_rational(radius * v.astype(float))))
            for u, v in factors
            if u.any() and v.any()
        ]
        cube_sum(problem, "X", scale.expression * to_rational(-centre), terms)
        return decide(CompiledProblem.of(problem)).feasible

    assert relaxed(0.999 * exact / (np.pi / 2))
    assert not relaxed(1.001 * exact)


def test_the_guarantee_grows_with_the_rank_of_what_a_premise_multiplies() -> None:
    # A premise of the inertia matrix of two joints multiplies a matrix of rank 2, He of it has rank 4.
    assert guarantee(DIALS[0]) == pytest.approx(np.pi)
    assert rank_factors(to_rational(np.outer([1.0, 2.0], [3.0, 4.0])))[0].shape[1] == 1


def test_one_item_from_the_command_line_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["reproduce", "fig-II.1", "--quick", "-o", str(tmp_path), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["id"] == "fig-II.1"
    assert row["checks"]
    assert all(check["holds"] for check in row["checks"])
    assert {path.name for path in tmp_path.iterdir()} >= {
        "fig-II.1.png",
        "fig-II.1.json",
        "results.json",
    }


@pytest.mark.parametrize("arguments", [(), ("fig-II.1", "--all"), ("fig-9.9",)])
def test_when_the_command_is_asked_nothing_or_both_expect_one_line(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["reproduce", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def documented() -> dict[str, str]:
    """Verdict of every item in the documentation."""
    text = (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8")
    return dict(re.findall(r"^\| ([a-z]+-[\w.]+) \| ([^|]+) \|", text, flags=re.MULTILINE))


def test_the_documentation_lists_every_item_with_a_verdict() -> None:
    assert list(documented()) == list(ITEMS)
    assert set(documented().values()) <= {verdict.value for verdict in ItemVerdict}


@pytest.mark.full
@pytest.mark.parametrize("name", ITEMS)
def test_every_item_has_claims_and_the_documented_verdict(name: str, tmp_path: Path) -> None:
    (row,) = reproduce([ITEMS[name]], Effort.QUICK, tmp_path)
    assert row["checks"]
    assert row["verdict"] == documented()[name]
