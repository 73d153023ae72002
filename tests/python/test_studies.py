"""Questions, boundaries, maps and counts. As commands: `test_study_commands`."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import quasilpv as ql
from quasilpv.conditions.condition import Options
from quasilpv.errors import InputError
from quasilpv.lmi.common import common_problem
from quasilpv.lmi.compiled import CompiledProblem, compile_family
from quasilpv.lmi.feasibility import decide
from quasilpv.studies import Answer, Question, Sweep, Verdict, count, find_boundary
from quasilpv.studies.boundary import Interval
from quasilpv.studies.checkpoint import Checkpoint, Forgetful
from quasilpv.studies.engines import in_processes, on_cluster
from quasilpv.studies.region import Axis, Map, Region, Task, counts, solve_task

QUESTION = Question("ex-I.1", "II.6")
REFUTED = ("infeasible", "proved")
"""What is proved again when a map is resumed."""

X, Y = Axis("a", -2.0, 6.0, 5), Axis("b", -4.0, 8.0, 9)


def make_map(**changes: object) -> Map:
    settings: dict = {"solver": in_processes(1), "memory": Forgetful(), "progress": lambda done, total: None}
    return Map(QUESTION, X, Y, **{**settings, **changes})


@pytest.fixture(scope="module")
def full_map() -> Region:
    return make_map().full()


def test_a_sweep_that_updates_answers_as_one_that_rebuilds() -> None:
    sweep = Sweep(QUESTION, ("a", "b"))
    assert sweep.updates
    for point in ({"a": 1.0, "b": 2.6}, {"a": 1.0, "b": 2.8}, {"a": -3.0, "b": 7.25}):
        rebuilt = Sweep(QUESTION.at(point), ()).at({})
        assert sweep.at(point).verdict is rebuilt.verdict
        assert (sweep.at(point).unknowns, sweep.at(point).rows) == (rebuilt.unknowns, rebuilt.rows)


def test_a_parameter_that_moves_the_box_rebuilds_the_problem() -> None:
    assert not Sweep(Question("arm2", "II.6"), ("theta_max",)).updates


def test_a_parameter_that_starts_at_its_lower_bound_can_be_swept() -> None:
    sweep = Sweep(Question("arm3", "I.53", "reduced"), ("m3", "fv"))
    assert sweep.updates
    assert sweep.at({"m3": 4.2, "fv": 0.0}).verdict is Verdict.FEASIBLE


def test_feasible_means_certified_and_nothing_else_does(full_map: Region) -> None:
    assert {p.answer.certified for p in full_map.points if p.answer.verdict is Verdict.FEASIBLE} == {True}
    assert {p.answer.certified for p in full_map.points if p.answer.verdict is not Verdict.FEASIBLE} == {False}
    assert all(counts(full_map)[verdict] > 0 for verdict in (Verdict.FEASIBLE, Verdict.INFEASIBLE))


def test_the_boundary_is_certified_below_and_infeasible_above() -> None:
    found = find_boundary(QUESTION.at({"a": 1.0}), Interval("b", 0.0, 30.0))
    assert found.certified_up_to is not None
    assert found.infeasible_from is not None
    assert found.certified_up_to < found.infeasible_from < 1.002 * found.certified_up_to
    sweep = Sweep(QUESTION.at({"a": 1.0}), ("b",))
    assert sweep.at({"b": found.certified_up_to}).certified
    assert sweep.at({"b": found.infeasible_from}).verdict is Verdict.INFEASIBLE


def test_the_boundary_is_the_same_from_either_end() -> None:
    up, down = (find_boundary(QUESTION.at({"a": 1.0}), Interval("b", *ends)) for ends in ((0.0, 9.0), (9.0, 0.0)))
    assert up.value == pytest.approx(down.value, rel=2e-3)


def test_a_range_without_a_change_has_no_boundary() -> None:
    inside = find_boundary(QUESTION.at({"a": 1.0}), Interval("b", 0.0, 1.0))
    assert (inside.certified_up_to, inside.infeasible_from) == (1.0, None)
    outside = find_boundary(QUESTION.at({"a": 1.0}), Interval("b", 20.0, 30.0))
    assert (outside.certified_up_to, outside.value) == (None, None)


def test_adaptive_map_agrees_with_the_full_one_wherever_it_looked(full_map: Region) -> None:
    adaptive = make_map().adaptive()
    full = {(p.x, p.y): p.answer.verdict for p in full_map.points}
    assert {(p.x, p.y): p.answer.verdict for p in adaptive.points}.items() <= full.items()
    assert adaptive.boundary == full_map.boundary


def test_every_crossing_has_a_feasible_and_another_side(full_map: Region) -> None:
    assert full_map.boundary
    sweep = Sweep(QUESTION, ("a", "b"))
    for crossing in full_map.boundary:
        ends = [dict(zip(("a", "b"), place, strict=True)) for place in (crossing.feasible, crossing.other)]
        assert [sweep.at(end).certified for end in ends] == [True, False]
        gaps = np.abs(np.subtract(crossing.feasible, crossing.other)) / (2.0, 1.5)
        assert max(gaps) == pytest.approx(2.0**-5)


def test_processes_do_not_change_a_map(full_map: Region) -> None:
    assert without_times(make_map(solver=in_processes(2)).full()) == without_times(full_map)


def test_a_local_cluster_does_not_change_a_map(full_map: Region) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None, processes=True) as cluster:
        region = make_map(solver=on_cluster(cluster.scheduler_address)).full()
    assert without_times(region) == without_times(full_map)


def test_a_map_interrupted_and_resumed_equals_one_that_was_not(full_map: Region, tmp_path: Path) -> None:
    class PowerCutError(Exception):
        pass

    def solve_twelve(tasks: Sequence[Task]) -> Iterable[Answer]:
        for number, task in enumerate(tasks):
            if number == 12:
                raise PowerCutError
            yield solve_task(task)

    with pytest.raises(PowerCutError):
        make_map(solver=solve_twelve, memory=Checkpoint(tmp_path, QUESTION, ("a", "b"))).full()
    (kept,) = tmp_path.iterdir()
    with kept.open("a", encoding="utf-8") as file:
        file.write('{"places": [[1.0, ')  # cut while a line was being written
    solved: list[Task] = []

    def counting(tasks: Sequence[Task]) -> Iterable[Answer]:
        solved.extend(tasks)
        return map(solve_task, tasks)

    memory = Checkpoint(tmp_path, QUESTION, ("a", "b"))
    assert memory.size == 12
    resumed = make_map(solver=counting, memory=memory).full()
    assert without_times(resumed) == without_times(full_map)
    assert len(solved) == resumed.evaluations - 12


def test_a_checkpoint_of_something_else_is_refused(tmp_path: Path) -> None:
    place = Checkpoint(tmp_path, QUESTION, ("a", "b")).path
    place.write_text('{"colour": "blue"}\n', encoding="utf-8")
    with pytest.raises(InputError, match="line 1"):
        Checkpoint(tmp_path, QUESTION, ("a", "b"))
    other = Checkpoint(tmp_path, replace(QUESTION, options=Options(decay_rate=1.0)), ("a", "b"))
    assert other.path != place


@pytest.fixture(scope="module")
def area_map() -> Region:
    return make_map().areas()


def test_every_proved_area_is_feasible_wherever_it_is_asked(area_map: Region) -> None:
    """The problem is built anew at points of no grid, and the solution for the corners is put into it."""
    assert area_map.areas is not None
    family = compile_family(lambda point: QUESTION.at(point).statement().problem, {"a": 1.0, "b": 1.0})
    assert family is not None
    rng = np.random.default_rng(13)
    assert area_map.areas.proved
    for cell in area_map.areas.proved:
        corners = [{"a": a, "b": b} for a in cell.x for b in cell.y]
        decision = decide(common_problem(family, corners))
        assert decision.feasible
        for share in rng.integers(0, 2**20, (2, 2)) / 2.0**20:
            a, b = (low + share[k] * (high - low) for k, (low, high) in enumerate((cell.x, cell.y)))
            compiled = CompiledProblem.of(QUESTION.at({"a": a, "b": b}).statement().problem)
            whole = np.zeros(compiled.layout.unknowns)
            whole[family.layout.kept] = decision.point
            everything = replace(compiled, layout=replace(compiled.layout, kept=np.arange(whole.size)))
            assert everything.holds_exactly(whole)


def test_areas_agree_with_the_full_map_at_every_point(area_map: Region, full_map: Region) -> None:
    assert area_map.areas is not None
    full = {(p.x, p.y): p.answer.verdict for p in full_map.points}
    assert {(p.x, p.y): p.answer.verdict for p in area_map.points}.items() <= full.items()
    for (x, y), verdict in full.items():
        inside = [r for r in area_map.areas.proved if r.x[0] <= x <= r.x[1] and r.y[0] <= y <= r.y[1]]
        assert not inside or verdict is Verdict.FEASIBLE
    total = (X.end - X.start) * (Y.end - Y.start)
    shares = [
        sum((r.x[1] - r.x[0]) * (r.y[1] - r.y[0]) for r in cells) / total
        for cells in (area_map.areas.proved, area_map.areas.undecided)
    ]
    assert shares == pytest.approx([area_map.areas.proved_share, area_map.areas.undecided_share])
    assert area_map.to_document()["proved_share"] == area_map.areas.proved_share > 0.5
    assert full_map.to_document()["proved_share"] is None


def test_processes_and_direction_of_an_axis_do_not_change_areas(area_map: Region) -> None:
    assert without_times(make_map(solver=in_processes(2)).areas()) == without_times(area_map)
    forgetful = {"solver": in_processes(1), "memory": Forgetful(), "progress": lambda done, total: None}
    turned = Map(QUESTION, Axis("a", X.end, X.start, X.count), Y, **forgetful).areas()  # type: ignore[arg-type]
    assert turned.areas is not None
    assert area_map.areas is not None
    assert turned.areas.proved_share == pytest.approx(area_map.areas.proved_share, abs=2.0 / 32.0)


def test_the_front_door_proves_areas_where_it_can() -> None:
    found = ql.region("ex-I.1", "II.6", ("a", -1.0, 0.0, 3), ("b", -1.0, 0.0, 3))
    assert found.areas is not None
    assert (found.areas.proved_share, len(found.areas.proved)) == (1.0, 1)
    assert ql.region("ex-I.1", "II.6", ("a", -1.0, 0.0, 2), ("b", -1.0, 0.0, 2), grid=True).areas is None


@pytest.mark.parametrize(
    ("question", "axes"),
    [
        (Question("arm2", "II.6"), (Axis("theta_max", 0.5, 1.0, 2), Axis("m2", 1.0, 2.0, 2))),
        (Question("arm2", "I.2", "reduced"), (Axis("m2", 1.0, 2.0, 2), Axis("fv1", 0.0, 1.0, 2))),
    ],
)
def test_where_the_data_are_not_affine_areas_are_refused(question: Question, axes: tuple[Axis, Axis]) -> None:
    """A mass at an arm that is not affine in it, and a bound of the premises."""
    survey = Map(question, *axes, solver=in_processes(1), memory=Forgetful(), progress=lambda done, total: None)
    assert not survey.proves_areas
    with pytest.raises(InputError, match="affine"):
        survey.areas()


def test_areas_interrupted_and_resumed_equal_those_that_were_not(area_map: Region, tmp_path: Path) -> None:
    first = make_map(memory=Checkpoint(tmp_path, QUESTION, ("a", "b"))).areas()
    (kept,) = tmp_path.iterdir()
    lines = kept.read_bytes().splitlines(keepends=True)
    left = lines[: len(lines) * 2 // 3]
    kept.write_bytes(b"".join(left) + lines[-1][:40])
    believed = [entry for entry in map(json.loads, left[1:]) if (entry["verdict"], entry["evidence"]) != REFUTED]
    solved: list[Task] = []

    def counting(tasks: Sequence[Task]) -> Iterable[Answer]:
        solved.extend(tasks)
        return map(solve_task, tasks)

    memory = Checkpoint(tmp_path, QUESTION, ("a", "b"))
    resumed = make_map(memory=memory, solver=counting).areas()
    assert without_times(resumed) == without_times(first) == without_times(area_map)
    assert len(solved) == first.evaluations - len(believed) > 0


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("checkpoint")
    make_map(memory=Checkpoint(folder, QUESTION, ("a", "b"))).areas()
    (path,) = folder.iterdir()
    return path


class TestEditedCheckpoint:
    """Whatever is changed in a checkpoint, nothing that is not proved is called feasible."""

    @staticmethod
    def refusal(written: Path, tmp_path: Path, lines: Sequence[bytes]) -> str:
        (tmp_path / written.name).write_bytes(b"".join(line + b"\n" for line in lines))
        with pytest.raises(InputError) as caught:
            make_map(memory=Checkpoint(tmp_path, QUESTION, ("a", "b"))).areas()
        assert "\n" not in str(caught.value)
        assert written.name in str(caught.value)
        return str(caught.value)

    @pytest.mark.parametrize("change", ["flip", "drop", "swap", "digit", "repeat"])
    def test_a_line_that_was_changed_lost_or_moved_is_refused(self, written: Path, tmp_path: Path, change: str) -> None:
        lines = written.read_bytes().splitlines()
        at = next(k for k, line in enumerate(lines) if b'"infeasible"' in line)
        edited = {
            "flip": [*lines[:at], lines[at].replace(b'"infeasible"', b'"feasible"'), *lines[at + 1 :]],
            "drop": [*lines[:at], *lines[at + 1 :]],
            "swap": [*lines[:at], lines[at + 1], lines[at], *lines[at + 2 :]],
            "digit": [*lines[:at], lines[at].replace(b"0", b"1", 1), *lines[at + 1 :]],
            "repeat": [*lines[: at + 1], *lines[at:]],
        }[change]
        assert "hash" in self.refusal(written, tmp_path, edited)

    @pytest.mark.parametrize("forgery", ["no witness", "another witness", "shorter witness"])
    def test_when_the_hashes_are_made_anew_expect_the_proof_checked(
        self, written: Path, tmp_path: Path, forgery: str
    ) -> None:
        entries = [json.loads(line) for line in written.read_bytes().splitlines()]
        proof = next(entry for entry in entries[1:] if entry["verdict"] == "feasible")
        for entry in entries[1:]:
            if entry["verdict"] == "infeasible":
                entry["verdict"], entry["evidence"] = "feasible", "proved"
                entry["witness"] = {
                    "no witness": [],
                    "another witness": proof["witness"],
                    "shorter witness": proof["witness"][:-1],
                }[forgery]
        chain, lines = "", []
        for entry in entries:
            del entry["hash"]
            body = json.dumps(entry)
            chain = hashlib.sha256((chain + body).encode()).hexdigest()
            lines.append(f'{body[:-1]}, "hash": "{chain}"}}'.encode())
        assert "does not hold" in self.refusal(written, tmp_path, lines)

    @pytest.mark.parametrize(
        ("first", "words"),
        [
            (b'{"place": [1.0, 2.0], "verdict": "feasible", "certified": true}', "version 1"),
            (b'{"schema": "quasilpv.map-checkpoint", "schema_version": 3}', "schema_version: got 3, expected 2"),
            (b'{"schema": "quasilpv.artifact", "schema_version": 2}', "line 1"),
            (b"[]", "line 1"),
            (b"\xff\xfe", "line 1"),
        ],
    )
    def test_another_version_or_document_is_refused(
        self, written: Path, tmp_path: Path, first: bytes, words: str
    ) -> None:
        assert words in self.refusal(written, tmp_path, [first, *written.read_bytes().splitlines()[1:]])


def test_no_scheduler_is_a_clear_error() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="a running Dask scheduler"):
        on_cluster("nowhere")


def test_counts_are_those_of_the_formula() -> None:
    """Theorem II.6 with r premises: n^2 (8 r + 1/2) + n (1/2 + 2 r) + 2 r m n unknowns, slack symmetric."""
    n, m, r = 2, 1, 3
    sizes = count(QUESTION)
    assert sizes.vertices == 2 * r
    assert sizes.unknowns + sizes.slack_unknowns == n**2 * 8 * r + n**2 // 2 + (n + 4 * r * n) // 2 + 2 * r * m * n
    assert sizes.slack_unknowns == 2 * r * (2 * n) * (2 * n + 1) // 2
    assert sizes.inequalities == (2 * r) ** 2 + 1
    assert sizes.rows == (2 * r) ** 2 * 2 * n + n


@pytest.mark.parametrize("axes", [("a", "a"), ("a", "colour")])
def test_axes_that_are_no_two_parameters_are_refused(axes: tuple[str, str]) -> None:
    with pytest.raises(InputError):
        Map(
            QUESTION,
            Axis(axes[0], 0.0, 1.0, 3),
            Axis(axes[1], 0.0, 1.0, 3),
            solver=in_processes(1),
            memory=Forgetful(),
            progress=lambda done, total: None,
        )


def test_an_axis_of_one_point_is_refused() -> None:
    with pytest.raises(InputError):
        Axis("a", 0.0, 1.0, 1)


def test_a_question_is_refused_when_asked_not_when_solved() -> None:
    with pytest.raises(InputError):
        Question("ex-I.1", "II.6", parameters=(("colour", 1.0),))
    with pytest.raises(InputError):
        Question("ex-I.1", "no such theorem")


def without_times(region: Region) -> object:
    document = region.to_document()
    del document["seconds_per_point"]
    return document


def test_a_compiled_problem_of_a_question_is_decided_like_its_answer() -> None:
    statement = QUESTION.at({"a": 1.0, "b": 2.0}).statement()
    assert decide(CompiledProblem.of(statement.problem)).feasible
