"""The needed range of inertia ratios and the whole gate: samples, closed forms, wrong data, and the command line."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.artifact import Artifact, write_artifact
from quasilpv.certificate.exact.cells import Cells, Pencil, are_positive_definite, cosine_enclosure
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.rationals import to_float, to_floats
from quasilpv.certificate.gate.proof import RobustGate, margin_curve
from quasilpv.certificate.robot.data import cosine_pairs
from quasilpv.certificate.robot.inertia import design_inertia, true_inertia
from quasilpv.certificate.robot.range import InertiaPair, NeededRange, needed_range
from quasilpv.certificate.robot.serial_arm import SerialArmData
from quasilpv.cli import run
from quasilpv.documents.mechanism import LinkParameters, SerialArm
from quasilpv.errors import InputError
from quasilpv.figures.margins import margin_figure
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.robots.registry import Robot, robot
from reference.artifacts import arm3_document
from reference.checked import inertia_data, loop_data, robust_gate
from reference.gated_arms import arm4, artifact_document, growth_rate, multiple_pole_loop

LINK = LinkParameters(length_m=1.0, mass_kg=1.0, com_m=0.5, inertia_kg_m2=0.5, friction_nm_s=0.0)
FOUR_LINKS = SerialArmData(SerialArm(gravity_m_s2=9.81, equilibrium="hanging", links=(LINK,) * 4))
LOOP = multiple_pole_loop(60, 1200, 1e-3, 1e-3)
SCALE = 1.2
ANSWER = {
    "passed": bool,
    "proved": bool,
    "evidence": str,
    "inertia_margin": list,
    "delay_margin_s": float,
    "lag_s": list,
    "proved_in_motion": type(None),
    "motion_box_rad": type(None),
    "motion_speed_limit_rad_s": type(None),
    "beta_per_s": type(None),
    "needed_range": list,
    "sampled_range": list,
    "worst_growth_rate_per_s": float,
    "where": dict,
}


def document(name: str = "arm3") -> dict[str, Any]:
    return artifact_document({"arm4": arm4}.get(name, lambda: robot(name))(), LOOP, SCALE)


@cache
def gate(name: str) -> RobustGate:
    return robust_gate(document(name))


def proved_range(name: str) -> NeededRange:
    needed = gate(name).needed
    assert needed is not None
    return needed


def random_ratios(subject: Robot, count: int, seed: int) -> np.ndarray:
    """Eigenvalues of M_n^-1 M_t at random postures and payloads, from the robot's own model."""
    rng = np.random.default_rng(seed)
    low, high = np.array(subject.domain.angle_rad).T
    found = []
    for fraction in rng.uniform(size=50):
        plant = subject.with_payload_fraction(float(fraction))
        for theta in rng.uniform(low, high, size=(count // 50, len(low))):
            design = SCALE * subject.model.inertia(theta)
            found.append(np.linalg.eigvals(np.linalg.solve(design, plant.inertia(theta))).real)
    return np.concatenate(found)


# ---- the two inertias ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm2", "arm3", "arm4", "fivebar"])
@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_when_inertias_are_rebuilt_from_the_artifact_expect_the_robots_own(name: str, fraction: float) -> None:
    subject = arm4() if name == "arm4" else robot(name)
    data = inertia_data(document(name))
    theta = np.array([sum(interval) / 2 for interval in subject.domain.angle_rad])
    S = subject.model.absolute_map
    alpha = S @ theta
    cosines = np.cos(alpha[:, None] - alpha[None, :])
    D = np.array([[to_float(entry(rational(fraction))) for entry in row] for row in true_inertia(data)])
    assert S.T @ (D * cosines) @ S == pytest.approx(subject.with_payload_fraction(fraction).inertia(theta), rel=1e-12)
    collapsed = design_inertia(data)
    design = to_floats(collapsed.constant) + sum(
        cosines[pair] * to_floats(slope) for pair, slope in collapsed.slopes.items()
    )
    assert S.T @ design @ S == pytest.approx(SCALE * subject.model.inertia(theta), rel=1e-12)


def test_when_premises_share_a_block_expect_the_same_design_inertia_up_to_a_rest_of_rounding_size() -> None:
    changed, arm3 = document(), robot("arm3")
    affine = arm3.model.inertia_affine()
    table = changed["law"]["inertia"]
    grouped = BlockPolytope.grouped(table["lower"], table["upper"], [[0], [1, 2]])
    vertices = grouped.vertices(SCALE * affine.constant, SCALE * affine.coefficients)
    changed["law"]["inertia"] = grouped.to_document(vertices)
    ours, theirs = design_inertia(inertia_data(document())), design_inertia(inertia_data(changed))
    assert to_floats(theirs.constant) == pytest.approx(to_floats(ours.constant), abs=1e-12)
    for pair, slope in ours.slopes.items():
        assert to_floats(theirs.slopes[pair]) == pytest.approx(to_floats(slope), abs=1e-12)
    assert 0 < np.max(to_floats(theirs.rest)) < 1e-13
    bounds = needed_range(InertiaPair(inertia_data(changed)))
    assert bounds is not None
    assert bounds.to_floats() == pytest.approx(proved_range("arm3").to_floats(), rel=1e-9)


# ---- the proof on cells ----------------------------------------------------------------------------------------------


@given(st.floats(-20, 20), st.floats(0, 8))
def test_when_a_cosine_is_enclosed_expect_its_range_and_nothing_wider(start: float, length: float) -> None:
    end = start + length
    below, above = (bound / 2**60 for bound in cosine_enclosure(rational(start), rational(end), 60))
    with mpmath.workdps(40):
        inside = [mpmath.cos(k * mpmath.pi) for k in range(-10, 10) if start <= k * mpmath.pi <= end]
        values = [mpmath.cos(mpmath.mpf(start)), mpmath.cos(mpmath.mpf(end)), *inside]
        assert below == pytest.approx(float(min(values)), abs=1e-15)
        assert above == pytest.approx(float(max(values)), abs=1e-15)


COMBINATIONS = np.array([[1, 0, 1, 2], [0, 1, 1, -1]], dtype=object)
"""Cosines of two angles, of their sum, and of twice the first less the second."""


def random_pencil(seed: int, level: list[int]) -> tuple[np.ndarray, Cells, float]:
    """Random coefficients of a random degree, a random cell, and the smallest eigenvalue that samples of it find."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(1, 7))
    K = rng.normal(size=(degree + 1, 5, 3, 3))
    K = np.round((K + np.swapaxes(K, 2, 3)) * 2**20) / 2**20
    index = [int(rng.integers(2**depth)) for depth in level]
    cell = Cells((fmpq(-2), fmpq(-1), fmpq(0)), (fmpq(1), fmpq(3), fmpq(1)), np.array([level]), np.array([index]))
    low, high = cell.bounds()
    corners = np.stack(np.meshgrid(*np.vstack([low, high]).T, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.vstack([corners, rng.uniform(low, high, size=(3000, 3))])
    cosines = np.column_stack([np.ones(len(points)), np.cos(points[:, :2] @ COMBINATIONS.astype(float))])
    X = np.einsum("np,nk,pkab->nab", points[:, 2:] ** np.arange(degree + 1), cosines, K)
    return K, cell, float(np.linalg.eigvalsh(X)[:, 0].min())


def is_proved(K: np.ndarray, shift: float, cell: Cells) -> bool:
    """Whether the pencil minus ``shift`` times the identity is proved positive definite on the cell."""
    exact = np.vectorize(rational, otypes=[object])(K)
    for i in range(3):
        exact[0, 0, i, i] -= rational(shift)
    pencil = Pencil.enclosing(exact, np.full((3, 3), fmpq(0), dtype=object), COMBINATIONS)
    return bool(are_positive_definite(pencil, cell)[0])


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**31), st.lists(st.integers(0, 4), min_size=3, max_size=3))
def test_when_a_random_matrix_is_barely_indefinite_somewhere_in_a_cell_expect_no_proof(
    seed: int, level: list[int]
) -> None:
    K, cell, smallest = random_pencil(seed, level)
    assert not is_proved(K, smallest + 1e-9, cell)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([5, 7, 9]))
def test_when_cells_shrink_expect_the_overestimate_to_shrink_with_their_square(seed: int, depth: int) -> None:
    K, cell, smallest = random_pencil(seed, [depth] * 3)
    width = (np.array([3.0, 4.0, 1.0]) / 2**depth).sum()
    assert is_proved(K, smallest - 2 * width**2 * float(np.abs(K).sum()), cell)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.integers(0, 5), st.floats(1.0, 7.0))
def test_when_a_cell_is_proved_definite_expect_no_sample_of_it_to_contradict(
    seed: int, depth: int, bound: float
) -> None:
    inertia, rng = InertiaPair(inertia_data(document())), np.random.default_rng(seed)
    cells = inertia.domain()
    for _ in range(3 * depth):
        cells = cells.halved(np.array([rng.integers(3)])).only(np.array([rng.integers(2)]))
    proved = are_positive_definite(inertia.pencil("highest", rational(bound)), cells)
    low, high = cells.bounds()
    ratios = inertia.ratios(rng.uniform(low, high, size=(200, 3)))
    assert not proved[0] or ratios.max() < bound


def test_when_a_cell_is_small_expect_it_proved_up_to_its_own_largest_ratio() -> None:
    inertia = InertiaPair(inertia_data(document()))
    whole = inertia.domain()
    level = np.full((1, 3), 8)
    cell = Cells(whole.lower, whole.upper, level, np.array([[200, 255, 255]]))
    low, high = cell.bounds()
    largest = float(inertia.ratios(np.random.default_rng(1).uniform(low, high, size=(500, 3))).max())
    for bound, expected in ((1.01 * largest, True), (0.99 * largest, False)):
        pencil = inertia.pencil("highest", rational(bound))
        assert are_positive_definite(pencil, cell).tolist() == [expected]


@pytest.mark.parametrize("name", ["arm2", "arm3", "arm4", "fivebar"])
def test_when_5000_postures_and_payloads_are_drawn_expect_all_ratios_inside_and_the_bounds_tight(name: str) -> None:
    subject = arm4() if name == "arm4" else robot(name)
    needed = proved_range(name)
    low, high = needed.to_floats()
    ratios = random_ratios(subject, 5000, seed=2)
    assert low < ratios.min()
    assert ratios.max() < high
    reached = needed.where_lowest.inertia_ratio, needed.where_highest.inertia_ratio
    assert (low, high) == pytest.approx(reached, rel=0.01)
    for place, ratio in ((needed.where_lowest, reached[0]), (needed.where_highest, reached[1])):
        plant = subject.with_payload_fraction(place.payload_fraction).inertia(np.array(place.angle_rad))
        design = SCALE * subject.model.inertia(np.array(place.angle_rad))
        assert np.min(np.abs(np.linalg.eigvals(np.linalg.solve(design, plant)) - ratio)) < 1e-9


def test_when_the_three_link_arm_carries_its_payload_expect_the_known_range_of_the_nominal_inertia() -> None:
    low, high = (SCALE * bound for bound in proved_range("arm3").to_floats())
    assert 0.99 <= low <= 1.0
    assert 6.11 <= high <= 6.2


def test_when_the_arm_has_one_joint_expect_the_closed_form() -> None:
    single = copy.deepcopy(document("arm2"))
    link = single["robot"]["parameters"]["links"][1]
    single["robot"]["parameters"]["links"] = [link]
    single["payloads"] |= {"mass_scale": [1.5], "com_scale": [1.2]}
    single["domain"]["angle_rad"] = [[-1.0, 1.0]]
    single["programs"]["premises"] = {"outputs": 0, "code": []}
    block = {"kind": "box", "premises": [], "vertices": [[[link["inertia_kg_m2"]]]]}
    single["law"]["inertia"] = {"premises": 0, "lower": [], "upper": [], "centre": [], "blocks": [block]}
    needed = needed_range(InertiaPair(inertia_data(single)))
    assert needed is not None
    first_moment = link["mass_kg"] * link["com_m"] ** 2
    highest = 1 + first_moment * (1.5 * 1.2**2 - 1) / link["inertia_kg_m2"]
    low, high = needed.to_floats()
    assert 0.997 < low < 1.0
    assert highest < high < 1.003 * highest


def test_when_the_design_inertia_is_indefinite_in_a_posture_expect_no_range_and_no_pass() -> None:
    wrong = document()
    for block in wrong["law"]["inertia"]["blocks"]:
        for vertex in block["vertices"]:
            vertex[2][2] = 0.2
    verdict = robust_gate(wrong)
    assert verdict.needed is None
    assert not verdict.passed
    assert verdict.to_document()["needed_range"] is None


# ---- reading an artifact ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "pairs"),
    [
        ([["angle", 1], ["cos"]], ((0, 1),)),
        ([["angle", 1], ["angle", 2], ["add"], ["neg"], ["cos"]], ((0, 2),)),
        ([["angle", 2], ["cos"], ["angle", 3], ["neg"], ["angle", 2], ["sub"], ["cos"]], ((1, 2), (1, 3))),
    ],
)
def test_when_premises_are_cosines_of_sums_expect_their_pairs(code: list[Any], pairs: tuple[Any, ...]) -> None:
    assert cosine_pairs(code, FOUR_LINKS.absolute_map) == pairs


@pytest.mark.parametrize(
    "code",
    [
        [["angle", 0], ["cos"]],
        [["angle", 1], ["angle", 3], ["add"], ["cos"]],
        [["angle", 1], ["angle", 2], ["sub"], ["cos"]],
        [["angle", 1], ["sin"]],
        [["angle", 1]],
        [["angle", 1], ["cos"], ["neg"]],
        [["angle", 1], ["angle", 2], ["cos"], ["add"]],
        [["angle", 1], ["angle", 1], ["sub"], ["cos"]],
    ],
)
def test_when_a_premise_is_no_cosine_of_neighbouring_angles_expect_it_refused(code: list[Any]) -> None:
    with pytest.raises(InputError, match=r"programs\.premises"):
        cosine_pairs(code, FOUR_LINKS.absolute_map)


Change = Callable[[dict[str, Any]], object]
DAMAGES: dict[str, tuple[Change, str]] = {
    "another robot": (lambda d: d["robot"]["parameters"].pop("links"), "links"),
    "another payload rule": (lambda d: d["payloads"].update(inertia_about_com="scaled"), "inertia_about_com"),
    "fractions beyond 1": (lambda d: d["payloads"].update(fraction=[0, 2]), "fraction"),
    "asymmetric vertex": (lambda d: _first_vertex(d)[0].__setitem__(1, 9.0), "symmetric"),
    "narrow premise box": (lambda d: d["law"]["inertia"]["upper"].__setitem__(0, 0.5), "box of premise 0"),
    "a scale missing": (lambda d: d["payloads"]["mass_scale"].pop(), "mass_scale"),
}


def _first_vertex(content: dict[str, Any]) -> list[list[float]]:
    return content["law"]["inertia"]["blocks"][0]["vertices"][0]  # type: ignore[no-any-return]


@pytest.mark.parametrize("damage", DAMAGES)
def test_when_an_artifact_does_not_fit_the_gate_expect_the_field_named(damage: str) -> None:
    change, field = DAMAGES[damage]
    content = document()
    change(content)
    with pytest.raises(InputError, match=field):
        robust_gate(content)


def test_when_a_law_has_no_gate_expect_those_that_have_one() -> None:
    with pytest.raises(InputError, match=r"law\.kind: got pid, expected one with this gate: dob-acceleration, dob-tor"):
        robust_gate(arm3_document("pid"))


# ---- the gate --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm2", "arm3", "arm4", "fivebar"])
def test_when_a_sound_design_meets_the_gate_expect_it_passed_and_proved(name: str) -> None:
    verdict = gate(name).to_document()
    assert verdict["passed"] is True
    assert verdict["proved"] is True
    assert verdict["inertia_margin"][0] < verdict["needed_range"][0]
    assert verdict["needed_range"][1] < verdict["inertia_margin"][1]
    assert verdict["delay_margin_s"] >= 0.5e-3
    assert verdict["worst_growth_rate_per_s"] < 0


def test_when_the_gate_answers_expect_exactly_the_documented_members() -> None:
    answer = gate("arm3").to_document()
    assert {key: type(value) for key, value in answer.items()} == ANSWER
    assert answer["where"].keys() == {"angle_rad", "payload_fraction", "inertia_ratio", "delay_s", "lag_s"}
    json.dumps(answer, allow_nan=False)


def test_when_the_worst_case_is_named_expect_its_growth_rate_there() -> None:
    worst = gate("arm3").worst
    assert worst is not None
    rate = growth_rate(LOOP, worst.place.inertia_ratio, worst.delay_s / LOOP.sample_period_s)
    assert rate == pytest.approx(worst.growth_rate_per_s, abs=0.5)
    assert worst.place == proved_range("arm3").where_highest


def test_when_random_plants_run_under_a_passed_gate_expect_all_of_them_stable() -> None:
    delay = gate("arm3").to_document()["delay_margin_s"] / LOOP.sample_period_s
    rng = np.random.default_rng(8)
    for ratio in rng.choice(random_ratios(robot("arm3"), 500, seed=9), 300):
        assert growth_rate(LOOP, float(ratio), float(rng.uniform(0, delay))) < 0


def test_when_a_longer_delay_is_specified_expect_the_gate_to_refuse() -> None:
    verdict = robust_gate(document(), delay_samples=fmpq(1))
    assert not verdict.passed
    assert verdict.to_document()["inertia_margin"] is None


@pytest.mark.parametrize("change", [{"kp": -LOOP.kp}, {"kd": 0.3 * LOOP.kd}, {"filter_time_constant_s": 0.02}])
def test_when_a_gain_is_changed_so_that_it_fails_expect_no_pass(change: dict[str, float]) -> None:
    wrong = artifact_document(robot("arm3"), replace(LOOP, **change), SCALE)  # type: ignore[arg-type]
    verdict = robust_gate(wrong)
    assert not verdict.passed
    assert verdict.needed is not None


def test_when_the_margin_is_drawn_expect_its_limits_and_the_needed_band() -> None:
    curve = margin_curve(loop_data(document()), fmpq(3, 2), points=7)
    assert curve.delay_s == pytest.approx(np.linspace(0, 1.5e-3, 7))
    stable = np.isfinite(curve.lowest)
    assert stable[:3].all()
    assert not stable[-1]
    assert (np.diff(curve.lowest[stable]) > 0).all()
    assert (np.diff(curve.highest[stable]) < 0).all()
    axes = margin_figure(gate("arm3"), curve).axes[0]
    labels = axes.get_legend_handles_labels()[1]
    assert set(labels) == {
        "stable (proved)", "inertia margin", "needed range (proved)", "specified delay", "delay margin (proved)"
    }  # fmt: skip
    assert axes.get_xlim() == pytest.approx((0.0, 1.5))


# ---- the command line ------------------------------------------------------------------------------------------------


def written(content: dict[str, Any], folder: Path) -> Path:
    return write_artifact(folder, Artifact.from_document(content))[0]


def test_when_the_command_proves_a_design_expect_exit_0_its_json_and_a_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(document(), tmp_path)
    assert run(["robust", str(path), "--json", "-o", str(tmp_path)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed.pop("seconds_to_check") > 0.0
    assert printed.pop("seconds_to_find") is None  # the range of a planar arm is found by the gate itself
    assert printed == gate("arm3").to_document()
    assert {file.name for file in tmp_path.glob("inertia-margin.*")} == {"inertia-margin.png"}
    assert run(["robust", str(path)]) == 0
    assert "passed: proved" in capsys.readouterr().out


@pytest.mark.parametrize("json_option", [[], ["--json"]])
def test_when_the_payload_is_too_heavy_expect_exit_1_and_a_reason(
    json_option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heavy = document()
    heavy["payloads"]["mass_scale"] = [1.4, 1.4, 4.0]
    assert run(["robust", str(written(heavy, tmp_path)), *json_option]) == 1
    printed = capsys.readouterr().out
    if json_option:
        answer = json.loads(printed)
        assert answer["passed"] is False
        assert answer["proved"] is False
        assert answer["needed_range"][1] > answer["inertia_margin"][1]
    else:
        assert "NOT passed: the needed range does not lie inside" in printed


def test_when_there_is_no_such_artifact_expect_exit_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "missing.json"
    assert run(["robust", str(path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
