"""Limits that act: refused where they must, counted and warned of where they may."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import Artifact
from quasilpv.cli.results import print_warnings
from quasilpv.errors import ClaimError
from quasilpv.experiments.metrics import compute_metrics
from quasilpv.experiments.result import Variant
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import disturbance_beyond_limits, start_outside_domain, track
from quasilpv.release import checked_artifact, to_artifact
from quasilpv.scenarios import (
    EXTERNAL_TORQUE,
    Sensors,
    TrackingExperiment,
    build_scenario,
    motions_of,
    sine_torques,
    tracking_experiment,
    tracking_experiments,
)
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.actuator_demand import Motion, largest_gravity, predicted_increments, unmet_demands
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot, robots
from quasilpv.trajectories import rest
from reference.runs import synthetic_result, synthetic_run, tool_position

ARM2, ARM3 = robot("arm2"), robot("arm3")
PERIOD_S = 1e-3


def limited(design: TrackingDesign, **limits: tuple[float, ...]) -> TrackingDesign:
    """The same design for a robot with other limits."""
    return replace(design, robot=replace(design.robot, limits=replace(design.robot.limits, **limits)))


@pytest.fixture(scope="module")
def pid() -> TrackingDesign:
    return synthesise(DesignRequest.of(ARM3, "pid"))


@pytest.fixture(scope="module")
def noisy(pid: TrackingDesign) -> TrackingDesign:
    """A design that predicts increments of 180 N m rms."""
    return replace(pid, report={"predicted_torque_increment_nm": 180.0})


# ---- what a design needs ---------------------------------------------------------------------------------------------


def test_largest_gravity_is_that_of_the_outstretched_loaded_arm() -> None:
    plant = ARM2.with_payload_fraction(1.0)
    postures = [(a, b) for a in np.linspace(*ARM2.domain.angle_rad[0], 31) for b in np.linspace(-0.785, 0.785, 31)]
    largest = np.max([np.abs(plant.gravity(theta)) for theta in postures], axis=0)
    np.testing.assert_allclose(largest_gravity(ARM2), largest, rtol=1e-2)


def test_joints_share_the_predicted_increments_so_that_their_norm_is_the_prediction(noisy: TrackingDesign) -> None:
    shares = predicted_increments(noisy)
    assert np.linalg.norm(shares) == pytest.approx(180.0)
    assert shares[0] > shares[1] > shares[2] > 0.0


def test_when_limits_are_the_robots_own_expect_every_demand_met(noisy: TrackingDesign) -> None:
    assert list(unmet_demands(noisy, motions_of)) == []


@pytest.mark.parametrize("entry", robots(), ids=lambda entry: entry.id)
def test_every_registered_robot_can_do_what_it_is_asked_for(entry: Any) -> None:
    design = TrackingDesign("any", entry, PERIOD_S, {"kind": "state-feedback"}, {}, {})
    assert motions_of(entry) or entry.id == "arm2"
    assert list(unmet_demands(design, motions_of)) == []


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"torque_nm": (200.0, 1200.0, 700.0)}, ("torque limit of joint 0: 200 N m", "gravity")),
        ({"torque_nm": (1500.0, 1200.0, 79.0)}, ("torque limit of joint 2: 79 N m", "gravity")),
        ({"slew_nm_per_s": (3e4, 3e4, 3e4)}, ("slew limit of joint 0: 30 N m per sample", "rms increment")),
        ({"slew_nm_per_s": (1e6, 1e6, 2e3)}, ("slew limit of joint 2: 2 N m per sample", "rms increment")),
    ],
)
def test_when_a_limit_is_below_what_the_design_needs_expect_refusal_with_the_numbers(
    noisy: TrackingDesign, limits: dict[str, tuple[float, ...]], words: tuple[str, ...]
) -> None:
    with pytest.raises(ClaimError) as refused:
        checked_artifact(limited(noisy, **limits))
    assert "\n" not in str(refused.value)
    for word in (*words, "needed"):
        assert word in str(refused.value)
    marked = checked_artifact(limited(noisy, **limits), allow_unverified=True)
    assert marked.verification["released_unverified"] is True


@pytest.mark.parametrize("disturbance_nm", [10.0, 700.0])
def test_when_a_motion_with_its_disturbance_needs_more_than_a_limit_expect_its_name(
    pid: TrackingDesign, disturbance_nm: float
) -> None:
    angle = np.tile([0.1, 1.5, -0.8], (50, 1))
    still = np.zeros_like(angle)
    force = np.array([0.0, 0.0, disturbance_nm])
    motion = Motion("the-hold", angle, still, still, force, np.zeros(3), PERIOD_S)
    unmet = list(unmet_demands(pid, lambda _: [motion]))
    assert len(unmet) == (disturbance_nm > 600.0)
    assert all("joint 2" in line and "the-hold" in line for line in unmet)


def test_when_the_torque_changes_faster_than_the_slew_limit_allows_expect_refusal(pid: TrackingDesign) -> None:
    """A disturbance of 300 N m at 100 rad/s changes by up to 30 N m within a millisecond."""
    angle = np.tile([0.1, 1.5, -0.8], (50, 1))
    still = np.zeros_like(angle)
    motion = Motion("shaken", angle, still, still, np.full(3, 300.0), np.full(3, 3e4), PERIOD_S)
    for slew, unmet in ((2.9e4, 1), (3.1e4, 0)):
        assert len(list(unmet_demands(limited(pid, slew_nm_per_s=(slew,) * 3), lambda _: [motion]))) == unmet


# ---- what a run reports ----------------------------------------------------------------------------------------------


def test_metrics_count_the_samples_at_a_limit_and_take_the_largest_excess() -> None:
    run = synthetic_run(samples=8, joints=2)
    flags = np.array([0, 1 << 2, 1 << 3, (1 << 2) | (1 << 3), 1 << 1, 1, 0, 0])
    excess = np.array([0.0, 0.1, 0.02, 0.0, 0.3, 0.0, 0.0, 0.0])
    error = tool_position(run.true_angle_rad) - tool_position(run.reference_angle_rad)
    metrics = compute_metrics(replace(run, flags=flags, premise_excess=excess), error)
    assert metrics.share_at_limit == 3 / 8
    assert metrics.largest_premise_excess == 0.3
    healthy = compute_metrics(run, error)
    assert (healthy.share_at_limit, healthy.largest_premise_excess) == (0.0, 0.0)


def test_a_run_at_a_limit_or_outside_the_box_is_warned_of_and_a_healthy_one_is_not(
    capsys: pytest.CaptureFixture[str],
) -> None:
    healthy = synthetic_result(Variant("pid"), samples=40)
    print_warnings(healthy)
    assert capsys.readouterr() == ("", "")
    metrics = replace(healthy.metrics, share_at_limit=0.125, largest_premise_excess=0.25)
    print_warnings(replace(healthy, metrics=metrics))
    out, errors = capsys.readouterr()
    assert out == ""
    assert "12.5 % of the samples" in errors
    assert "up to 0.25 of its width" in errors
    assert all(line.startswith("warning: synthetic, pid") for line in errors.splitlines())


def test_when_actuators_are_too_slow_for_the_run_expect_the_share_in_its_row(
    pid: TrackingDesign, tmp_path: Path
) -> None:
    short = replace(tracking_experiment("serial-square"), external_torque=EXTERNAL_TORQUE)
    trajectory = rest("hold", 3, 0.1)
    shifted = trajectory.coefficients.copy()
    shifted[:, :, 0] = short.trajectory.evaluate(0.0).angle
    experiment = replace(short, reference=replace(trajectory, coefficients=shifted))
    shares = []
    for slew in (1e6, 5e3):
        artifact = to_artifact(limited(pid, slew_nm_per_s=(slew,) * 3))
        result = track(
            RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors(), log=False), tmp_path / f"{slew:g}"
        )
        shares.append(result.row()["share_at_limit"])
    assert shares[0] == 0.0
    assert shares[1] > 0.5


# ---- nobody's disturbance but one's own ------------------------------------------------------------------------------


def test_no_experiment_is_disturbed_unless_it_says_so() -> None:
    hold = rest("hold", 3, 1.0)
    assert TrackingExperiment("hold", ARM3, hold).external_torque == ()
    assert build_scenario(ARM3, hold).external_torque == ()
    for one in tracking_experiments():
        assert (one.external_torque == EXTERNAL_TORQUE) == one.name.startswith("serial-")


def test_a_disturbance_beyond_the_limits_and_a_start_outside_the_domain_are_said(pid: TrackingDesign) -> None:
    artifact: Artifact = to_artifact(pid)
    experiment = replace(
        tracking_experiment("serial-square"),
        external_torque=sine_torques((450.0, 15.0), (1300.0, 15.0), (300.0, 15.0)),
    )
    said = disturbance_beyond_limits(experiment, artifact)
    assert said is not None
    assert "1300 N m on joint 1" in said
    assert "1200 N m" in said
    registered = tracking_experiment("serial-square")
    assert disturbance_beyond_limits(registered, artifact) is None
    assert start_outside_domain(registered, artifact) is None
    turned = tuple(registered.trajectory.evaluate(0.0).angle + np.array([0.0, 0.0, 2.0 * np.pi]))
    outside = start_outside_domain(replace(registered, initial_angle_rad=turned), artifact)
    assert outside is not None
    assert "joint 2" in outside
