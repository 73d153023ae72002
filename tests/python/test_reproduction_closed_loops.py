"""Closed-loop items of the source: rules for controllers, the plants and laws they need, their checks and figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from quasilpv.artifact import Artifact
from quasilpv.experiments.metrics import Metrics
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.figures.constraint import constraint_figure
from quasilpv.figures.side_by_side import disturbance_estimates, input_columns, speed_errors, tracking_columns
from quasilpv.figures.stabilisation import regulation_figure, rolling_disc_figure
from quasilpv.release import to_artifact
from quasilpv.reproduction import rules, stabilised_arms, tracking_claims, tracking_comparison, tracking_hinf
from quasilpv.reproduction.closed_loops import (
    EXACT,
    ClosedLoop,
    Outcome,
    chapter_three,
    gains,
    outcome,
    without_disturbance_states,
)
from quasilpv.reproduction.constraints import closure_along, rolling_along
from quasilpv.reproduction.tracking_claims import RATE_HZ, Printed
from quasilpv.reproduction.tracking_comparison import Comparison, Sampled
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.systems.robots.registry import robot
from reference.readable import assert_readable
from reference.runs import synthetic_result

positive = st.floats(1e-6, 1e6)
named = st.dictionaries(st.sampled_from("abc"), positive, min_size=1)


@given(named, st.floats(0.5, 2.0), st.data())
def test_numbers_by_name_agree_if_and_only_if_each_does(
    printed: dict[str, float], factor: float, data: st.DataObject
) -> None:
    wrong = data.draw(st.sampled_from(sorted(printed)))
    computed = {**printed, wrong: factor * printed[wrong]}
    assert rules.numbers("x", printed, printed).holds
    assert rules.numbers("x", printed, computed).holds == rules.number("x", printed[wrong], computed[wrong]).holds


@given(named, st.data())
def test_one_number_too_large_is_enough_to_fail(values: dict[str, float], data: st.DataObject) -> None:
    wrong = data.draw(st.sampled_from(sorted(values)))
    assert rules.at_most("x", values, values).holds
    assert not rules.at_most("x", values, {**values, wrong: 1.01 * values[wrong]}).holds
    assert rules.as_small("x", values, {**values, wrong: 1.2 * values[wrong]}).holds
    assert rules.as_small("x", values, {**values, wrong: 0.1 * values[wrong]}).holds
    assert not rules.as_small("x", values, {**values, wrong: 1.3 * values[wrong]}).holds
    halves = {name: 0.5 * value for name, value in values.items()}
    assert rules.smaller("x", halves, values).holds
    assert not rules.smaller("x", {**halves, wrong: values[wrong]}, values).holds


def metrics(**changes: float) -> Metrics:
    return replace(Metrics(1e-3, 2e-3, None, 3e-3, 4e-3, 3e-3, 5e-3, 100.0, 5.0, 0.01, 0.0, 0.0), **changes)


def stand_in(numbers: Metrics, speed_error: float = 0.1) -> Outcome:
    run = SimpleNamespace(estimated_speed_rad_s=np.full((4, 2), speed_error), true_speed_rad_s=np.zeros((4, 2)))
    result = cast(TrackResult, SimpleNamespace(metrics=numbers, run=run))
    return Outcome(ClosedLoop("serial-square", "pid", 1000.0), cast(Artifact, None), result)


@pytest.mark.parametrize("worse", ["rms_x_m", "rms_y_m", "mav_x_m", "mav_y_m"])
def test_a_controller_is_better_only_if_it_is_in_all_four_errors(worse: str) -> None:
    good = {"law": stand_in(metrics()), "other": stand_in(metrics(rms_x_m=1, rms_y_m=1, mav_x_m=1, mav_y_m=1))}
    assert tracking_claims.better(good, "law", ["other"])[0].holds
    bad = {**good, "law": stand_in(metrics(**{worse: 2.0}))}
    assert not tracking_claims.better(bad, "law", ["other"])[0].holds


def test_a_column_of_a_table_agrees_in_si_units_and_torques_as_ratios() -> None:
    printed = {"one": Printed(1e-3, 2e-3, 3e-3, 4e-3, 1e4), "two": Printed(1e-3, 2e-3, 3e-3, 4e-3, 2e4)}
    outcomes = {"one": stand_in(metrics()), "two": stand_in(metrics(rms_torque_nm=200.0))}
    assert [check.holds for check in tracking_claims.columns(outcomes, printed)] == [True, True, True]
    outcomes["two"] = stand_in(metrics(mav_y_m=4e-2))
    assert [check.holds for check in tracking_claims.columns(outcomes, printed)] == [True, False, False]


def test_errors_that_move_from_x_to_y_are_told_from_those_that_do_not() -> None:
    line = {"law": stand_in(metrics())}
    curve = {"law": stand_in(metrics(rms_x_m=5e-4, mav_x_m=2e-3, rms_y_m=3e-3, mav_y_m=5e-3))}
    assert all(check.holds for check in tracking_claims.moves_to_y(curve, line, ["law"]))
    assert not any(check.holds for check in tracking_claims.moves_to_y(line, curve, ["law"]))


def test_a_speed_estimate_is_better_only_if_it_is_on_every_joint() -> None:
    good, bad = stand_in(metrics(), 0.1), stand_in(metrics(), 0.2)
    assert tracking_claims.better_estimates(good, bad).holds
    assert not tracking_claims.better_estimates(bad, good).holds
    assert not tracking_claims.better_estimates(good, good).holds


def test_when_controllers_are_compared_expect_each_on_the_same_path_and_plant_at_its_own_rate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tracking_comparison, "outcome", lambda loop: replace(stand_in(metrics()), loop=loop))
    column = Printed(1e-3, 2e-3, 3e-3, 4e-3, 1e4)
    compared = Comparison(
        name="arm, square",
        title="arm, square, 4 kHz",
        scenario="serial-square",
        law="law",
        controllers={"PID": Sampled("pid"), "law": Sampled("dob-torque")},
        printed={"PID": column, "law": column},
        assumptions=("payload",),
        beside={"slower": Sampled("dob-acceleration", 1000.0)},
        plant="chapter-III",
    )
    assert compared.others == ("PID",)
    assert {label: entry.loop for label, entry in (compared.loops | compared.loops_beside).items()} == {
        "PID": ClosedLoop("serial-square", "pid", RATE_HZ, plant="chapter-III"),
        "law": ClosedLoop("serial-square", "dob-torque", RATE_HZ, plant="chapter-III"),
        "slower": ClosedLoop("serial-square", "dob-acceleration", 1000.0, plant="chapter-III"),
    }
    without = compared.with_and_without["without"].loop
    assert without == replace(compared.loops["law"].loop, observer="without disturbance")
    item = compared.tracking_item("fig-0.0")
    assert item.title == "arm, square: tracking with law, PID and computed torque"
    assert item.assumptions == ("payload",)
    assert item.printed == {"claim": "law tracks best", **column.as_dict()}


def test_the_plant_of_chapter_three_has_the_nominal_inertia_more_gravity_on_joint_one_and_friction() -> None:
    nominal, rng = robot("arm3").model, np.random.default_rng(5)
    plant = chapter_three(robot("arm3")).model
    for theta, omega in zip(*rng.uniform(-3.0, 3.0, (2, 20, 3)), strict=True):
        np.testing.assert_allclose(plant.inertia(theta), nominal.inertia(theta), rtol=1e-12)
        heavier = 9.81 * 5.0 * 0.5 * 1.2 * np.sin(theta[0])  # g m_1 r_1 delta_1 sin(theta_1)
        np.testing.assert_allclose(plant.gravity(theta) - nominal.gravity(theta), [heavier, 0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(plant.coriolis(theta, omega) - nominal.coriolis(theta, omega), 10.0 * omega)


@pytest.mark.parametrize("controller", ["dob-acceleration", "dob-torque"])
def test_an_observer_without_disturbance_keeps_the_gains_of_angles_and_speeds_and_makes_no_claim(
    controller: str,
) -> None:
    specification = Specification(rate_hz=2000.0, disturbance_frequency_rad_s=50.0)
    whole = to_artifact(synthesise(DesignRequest.of("fivebar", controller, specification)))
    reduced = without_disturbance_states(whole)
    assert reduced.witness is None
    assert reduced.verification is None
    assert {**reduced.content()["law"], "observer": None} == {**whole.content()["law"], "observer": None}
    if controller == "dob-acceleration":
        assert gains(whole)["law"]["feedback"] == whole.content()["law"]["feedback"]
        assert reduced.law.observer == (*whole.law.observer[:2], 0.0, 0.0)
        return
    bounds = gains(whole)["law"]["feedback_at_most"]
    vertex = np.abs(whole.law.feedback.blocks[0].vertices[0])
    assert all(vertex[:, 2 * k : 2 * k + 2].max() <= bounds[name] for k, name in enumerate(bounds))
    for kept, before in zip(reduced.law.observer.blocks, whole.law.observer.blocks, strict=True):
        np.testing.assert_array_equal(np.array(kept.vertices)[:, :4], np.array(before.vertices)[:, :4])
        assert not np.array(kept.vertices)[:, 4:].any()
        assert np.array(before.vertices)[:, 4:].any()


@pytest.fixture
def in_a_folder_of_its_own(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome.cache_clear()


@pytest.mark.usefixtures("in_a_folder_of_its_own")
def test_when_an_arm_comes_to_rest_expect_v_to_fall_and_the_same_run_backwards_to_be_found_out() -> None:
    closed_loop = outcome(ClosedLoop("stabilise-arm2", "pdc", 1000.0, plant="nominal", sensors=EXACT))
    assert outcome(ClosedLoop("stabilise-arm2", "pdc", 1000.0, plant="nominal", sensors=EXACT)) is closed_loop
    assert all(check.holds for check in stabilised_arms.claims("forwards", closed_loop))
    run, P = closed_loop.result.run, (closed_loop.artifact.witness or {})["feedback"]["P"]
    state = np.concatenate([run.true_angle_rad[7], run.true_speed_rad_s[7]])
    assert stabilised_arms.lyapunov_along(closed_loop)[7] == pytest.approx(state @ np.linalg.inv(P) @ state)
    backwards = replace(run, true_angle_rad=run.true_angle_rad[::-1], true_speed_rad_s=run.true_speed_rad_s[::-1])
    found = stabilised_arms.claims("backwards", replace(closed_loop, result=replace(closed_loop.result, run=backwards)))
    assert not any(check.holds for check in found)


@pytest.mark.full
@pytest.mark.usefixtures("in_a_folder_of_its_own")
def test_when_links_are_unequal_expect_the_loop_closed_and_the_integration_to_follow_the_run() -> None:
    closed_loop = outcome(ClosedLoop("fivebar-spiral", "ctc", 2000.0))
    equal, unequal = (closure_along(closed_loop, length) for length in (0.165, 0.2))
    assert equal.error.max() < 1e-15 < unequal.error.max() < 1e-9
    assert max(equal.replay_deviation_rad, unequal.replay_deviation_rad) < 1e-5
    assert len(equal.time_s) == len(equal.error) == len(closed_loop.result.run.time_s)


@pytest.mark.usefixtures("in_a_folder_of_its_own")
def test_when_the_disc_rolls_expect_the_force_that_accelerates_its_centre() -> None:
    loop = outcome(ClosedLoop("stabilise-spring-disc", "robust", 1000.0, sensors=EXACT))
    replay, rolling = rolling_along(loop)
    assert rolling.error.max() < 1e-12
    assert rolling.replay_deviation_rad < 1e-5
    x1, x2, _, contact = replay.states[0]
    np.testing.assert_allclose([x1, x2], [-5.0, 10.0])
    acceleration = (replay.torque_nm[0, 0] / 2.0 - x1 - x1**3 - 2.0 * x2) / (0.1 + 1.0 / 4.0)  # M + J_delta / r^2
    assert contact == pytest.approx(0.1 * acceleration + x1 + x1**3 + 2.0 * x2)


def side_by_side(joints: int) -> dict[str, TrackResult]:
    names = {"PID": "pid", "CTC with observer": "ctc-dob", "Theorem IV.11": "dob-torque"}
    return {label: synthetic_result(Variant(controller), joints) for label, controller in names.items()}


TITLE = "3-DoF arm with full payload, square, 4 kHz, Theorem IV.11"
SHARED: list[Callable[[dict[str, TrackResult]], Figure]] = [
    lambda results: tracking_columns(results, TITLE),
    lambda results: input_columns(results, TITLE),
    lambda results: speed_errors(*list(results.values())[:2], TITLE),
    lambda results: disturbance_estimates(results, 1, TITLE),
]


@pytest.mark.parametrize("joints", [2, 3])
@pytest.mark.parametrize("draw", SHARED, ids=["tracking", "inputs", "speeds", "disturbance"])
def test_when_controllers_are_side_by_side_expect_no_text_cut_or_over_another(
    draw: Callable[[dict[str, TrackResult]], Figure], joints: int
) -> None:
    assert_readable(draw(side_by_side(joints)))


def test_when_regulation_and_constraints_are_drawn_expect_no_text_cut_or_over_another() -> None:
    run = synthetic_result(Variant("pdc"), 2).run
    assert_readable(regulation_figure(run, np.exp(-3.0 * run.time_s), 1.0, TITLE))
    errors = {"b = 0.165 m": (run.time_s, np.zeros_like(run.time_s)), "b = 0.2 m": (run.time_s, 1e-11 + run.time_s)}
    assert_readable(constraint_figure(errors, "|h| (m)", TITLE))
    states = np.exp(-run.time_s)[:, None] * [-5.0, 10.0, 5.0, -80.0]
    assert_readable(rolling_disc_figure(run.time_s, states, run.torque_nm[:, 0], 0.0 * run.time_s, TITLE))


def test_when_a_law_estimates_no_disturbance_expect_no_figure_of_it() -> None:
    results = {"PID": replace(synthetic_result(Variant("pid")), true_disturbance=None)}
    with pytest.raises(ValueError, match="estimates no disturbance"):
        disturbance_estimates(results, 0, TITLE)


@pytest.mark.full
@pytest.mark.parametrize("compared", [tracking_hinf.SQUARE, tracking_hinf.CIRCLE], ids=lambda own: own.scenario)
def test_the_controllers_of_chapter_three_are_released(compared: Comparison) -> None:
    """The slew limits of the robot, which the source does not state, are too low for the noise of its law at 4 kHz."""
    assert {**compared.loops, **compared.loops_beside}.keys() == {*compared.controllers, *compared.beside}
