"""Tracking experiments: metrics, designs kept on disk, the closed loop's claims, and the same run over LCM."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.certificate import verify
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.experiments import designs
from quasilpv.experiments.disturbance import true_disturbance
from quasilpv.experiments.hil import merge_records, read_record, require_identical, run_over_lcm
from quasilpv.experiments.metrics import compute_metrics
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import run_from_columns, track
from quasilpv.release import release
from quasilpv.scenarios import (
    IdaIntegrator,
    Rk4Integrator,
    Scenario,
    Sensors,
    TrackingExperiment,
    build_scenario,
    tracking_experiment,
)
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot
from reference.runs import synthetic_run

EXACT = Sensors(encoder_bits=0, velocity_noise_rad_s=0.0)
BASELINES = ("pid", "ctc", "ctc-dob")


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("designs")


def design(cache: Path, controller: str, *, compensate: bool = True) -> Artifact:
    return designs.kept_design(
        DesignRequest.of("arm3", controller, Specification(), compensated=compensate), folder=cache
    )


@pytest.fixture(scope="session")
def results(cache: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], TrackResult]:
    """Every default controller on both scenarios, with the perturbed plant and 20-bit encoders."""
    folder = tmp_path_factory.mktemp("runs")
    return {
        (scenario, controller): track(
            RunSetup(tracking_experiment(scenario), design(cache, controller), plant="perturbed", sensors=Sensors()),
            folder / scenario / controller,
        )
        for scenario in ("serial-square", "serial-circle")
        for controller in (*BASELINES, "dob-acceleration")
    }


# ---- metrics ---------------------------------------------------------------------------------------------------------


def test_when_the_errors_are_known_expect_the_metrics_of_their_definitions() -> None:
    run = synthetic_run(samples=4, joints=3)
    error = np.array([[3e-3, 0.0, 9.0], [-4e-3, 0.0, 9.0], [0.0, 1e-3, 9.0], [0.0, -1e-3, 9.0]])
    torque = np.array([[1.0, 2.0, 2.0], [1.0, 2.0, 2.0], [4.0, 6.0, 2.0], [4.0, 6.0, 2.0]])
    speed_error = np.full((4, 3), 0.1)
    metrics = compute_metrics(
        replace(
            run,
            true_angle_rad=run.reference_angle_rad + error,
            torque_nm=torque,
            estimated_speed_rad_s=run.true_speed_rad_s + speed_error,
        ),
        error[:, :2],  # of a tool whose position is the first two joint angles
    )
    assert metrics.rms_x_m == pytest.approx(2.5e-3, rel=1e-9)  # sqrt((9 + 16) / 4)
    assert metrics.rms_y_m == pytest.approx(np.sqrt(0.5) * 1e-3, rel=1e-9)
    assert metrics.mav_x_m == pytest.approx(4e-3, rel=1e-9)
    assert metrics.mav_y_m == pytest.approx(1e-3, rel=1e-9)
    assert metrics.rms_torque_nm == pytest.approx(np.sqrt((9 + 9 + 56 + 56) / 4), rel=1e-12)
    assert metrics.rms_torque_increment_nm == pytest.approx(np.sqrt(25 / 3), rel=1e-12)
    assert metrics.rms_velocity_error_rad_s == pytest.approx(np.sqrt(0.03), rel=1e-9)


@pytest.mark.parametrize("field", ["torque_nm", "time_s", "flags"])
def test_when_one_sample_of_a_run_changes_by_one_bit_expect_the_difference_named(field: str) -> None:
    run = synthetic_run(samples=20, joints=2)
    values = np.array(getattr(run, field))
    values[17] = np.nextafter(values[17], np.inf) if values.dtype.kind == "f" else values[17] + 1
    changed: dict[str, Any] = {field: values}
    assert run.first_difference(run) is None
    with pytest.raises(ClaimError, match=f"{field} differs first at sample 17"):
        require_identical(replace(run, **changed), run)


# ---- designs on disk -------------------------------------------------------------------------------------------------


def test_when_a_design_was_made_before_expect_it_read_and_not_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = design(tmp_path, "pid")

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("designed again")

    monkeypatch.setattr(designs, "synthesise", refuse)
    monkeypatch.setattr(designs, "checked_artifact", refuse)
    assert design(tmp_path, "pid").hash == made.hash


def test_when_a_law_runs_with_and_without_compensation_expect_its_gains_searched_for_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[str] = []

    def counted(request: DesignRequest, **options: Any) -> TrackingDesign:
        searched.append(request.controller)
        return synthesise(request, **options)

    monkeypatch.setattr(designs, "synthesise", counted)
    monkeypatch.setattr(designs, "_designs", {})
    without, whole = (design(tmp_path, "dob-acceleration", compensate=compensate) for compensate in (False, True))
    assert searched == ["dob-acceleration"]
    assert (without.law.disturbance_compensation, whole.law.disturbance_compensation) == (False, True)
    for artifact in (without, whole):
        assert verify(artifact.content()).verified
        assert artifact.verification["gate"]["passed"]
    assert len(list(tmp_path.iterdir())) == 2
    design(tmp_path, "dob-acceleration")
    designs.kept_design(DesignRequest.of("arm3", "dob-acceleration", Specification(encoder_bits=17)), folder=tmp_path)
    assert searched == ["dob-acceleration"] * 2


def test_when_a_kept_design_is_damaged_expect_it_made_again(tmp_path: Path) -> None:
    made = design(tmp_path, "pid")
    (file,) = tmp_path.rglob("artifact.json")
    file.write_bytes(file.read_bytes()[:-3])
    assert design(tmp_path, "pid").hash == made.hash
    assert len(list(tmp_path.rglob("artifact.json"))) == 1


def test_when_rate_encoders_or_code_change_expect_another_design(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    design(tmp_path, "ctc")
    designs.kept_design(DesignRequest.of("arm3", "ctc", Specification(rate_hz=2000.0)), folder=tmp_path)
    designs.kept_design(DesignRequest.of("arm3", "ctc", Specification(encoder_bits=17)), folder=tmp_path)
    monkeypatch.setattr(designs, "_code_digest", lambda: "another")
    design(tmp_path, "ctc")
    assert len(list(tmp_path.iterdir())) == 4


def test_when_encoders_are_too_coarse_for_the_torque_activity_expect_infeasible_and_nothing_kept(
    tmp_path: Path,
) -> None:
    with pytest.raises(InfeasibleError):
        designs.kept_design(
            DesignRequest.of("arm3", "dob-acceleration", Specification(encoder_bits=8)), folder=tmp_path
        )
    assert list(tmp_path.iterdir()) == []


# ---- the closed loop -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", ["serial-square", "serial-circle"])
def test_when_the_default_controller_tracks_the_perturbed_arm_expect_the_promised_accuracy(
    results: dict[tuple[str, str], TrackResult], scenario: str
) -> None:
    result = results[scenario, "dob-acceleration"]
    assert max(result.metrics.rms_x_m, result.metrics.rms_y_m) <= 5e-5
    assert max(result.metrics.mav_x_m, result.metrics.mav_y_m) <= 2e-4
    assert result.metrics.rms_torque_increment_nm <= 350.0
    assert result.worst_growth_rate_per_s is not None
    assert result.worst_growth_rate_per_s < 0.0
    assert np.all(result.run.flags == 0)


@pytest.mark.parametrize("scenario", ["serial-square", "serial-circle"])
def test_when_controllers_are_compared_expect_each_to_beat_the_one_before(
    results: dict[tuple[str, str], TrackResult], scenario: str
) -> None:
    ranked = [results[scenario, controller].metrics for controller in (*BASELINES, "dob-acceleration")]
    for worse, better in pairwise(ranked):
        assert better.rms_x_m < worse.rms_x_m
        assert better.rms_y_m < worse.rms_y_m


def test_when_the_disturbance_is_not_compensated_expect_at_least_twenty_times_the_error(
    results: dict[tuple[str, str], TrackResult], cache: Path, tmp_path: Path
) -> None:
    uncompensated = track(
        RunSetup(
            tracking_experiment("serial-square"),
            design(cache, "dob-acceleration", compensate=False),
            plant="perturbed",
            sensors=Sensors(),
        ),
        tmp_path,
    )
    compensated = results["serial-square", "dob-acceleration"].metrics
    assert uncompensated.metrics.rms_x_m >= 20.0 * compensated.rms_x_m
    assert uncompensated.metrics.rms_y_m >= 20.0 * compensated.rms_y_m
    assert uncompensated.variant.label == "dob-acceleration, no compensation"


@pytest.mark.parametrize("controller", [*BASELINES, "dob-acceleration"])
def test_when_quantisation_and_noise_are_off_expect_ida_and_rk4_to_agree(controller: str, cache: Path) -> None:
    experiment = tracking_experiment("serial-circle")
    artifact = _runtime.Artifact.parse(canonical_json(design(cache, controller).to_document()))
    reference = _runtime.Trajectory.parse(canonical_json(experiment.trajectory.to_document()))

    def angles(integrator: IdaIntegrator | Rk4Integrator) -> FloatArray:
        scenario = build_scenario(
            experiment.robot,
            experiment.trajectory,
            sensors=EXACT,
            integrator=integrator,
            external_torque=experiment.external_torque,
        )
        return _runtime.run_closed_loop(artifact, reference, runtime_scenario(scenario))["angle_rad"]

    difference = np.abs(angles(IdaIntegrator()) - angles(Rk4Integrator()))
    assert 0.0 < difference.max() <= 1e-6


def runtime_scenario(scenario: Scenario) -> _runtime.Scenario:
    return _runtime.Scenario.parse(canonical_json(scenario.to_document()))


def test_when_the_plant_is_the_model_expect_the_true_disturbance_to_be_the_external_torque() -> None:
    experiment = tracking_experiment("serial-square")
    artifact = release(DesignRequest.of("arm3", "ctc-dob")).artifact
    runtime = _runtime.Artifact.parse(canonical_json(artifact.to_document()))
    torque = experiment.external_torque
    scenario = build_scenario(
        experiment.robot, experiment.trajectory, plant="nominal", sensors=EXACT, external_torque=torque
    )
    columns = _runtime.run_closed_loop(
        runtime,
        _runtime.Trajectory.parse(canonical_json(experiment.trajectory.to_document())),
        runtime_scenario(scenario),
    )
    run = run_from_columns(columns, 3, artifact.sample_period_s)
    disturbance = true_disturbance(run, artifact, runtime)
    assert disturbance is not None
    assert disturbance.unit == "N m"
    np.testing.assert_allclose(disturbance.values, columns["external_torque_nm"], rtol=0, atol=1e-8)
    assert np.abs(disturbance.values).max() > 400.0  # the largest amplitude is 450 N m


def test_when_the_observer_has_converged_expect_its_estimate_near_the_true_disturbance(
    results: dict[tuple[str, str], TrackResult],
) -> None:
    result = results["serial-square", "dob-acceleration"]
    assert result.true_disturbance is not None
    settled = result.run.time_s > 0.3
    true = result.true_disturbance.values[settled]
    error = result.run.filtered_disturbance[settled] - true
    for joint in range(3):
        assert np.sqrt(np.mean(error[:, joint] ** 2)) < 0.2 * np.sqrt(np.mean(true[:, joint] ** 2))


def test_when_the_controller_is_for_another_robot_expect_one_line_and_no_files(tmp_path: Path) -> None:
    other = release(DesignRequest.of("arm2", "pid")).artifact
    with pytest.raises(InputError, match=r"robot\.id: got arm2, expected arm3"):
        track(
            RunSetup(tracking_experiment("serial-square"), other, plant="nominal", sensors=Sensors()), tmp_path / "run"
        )
    assert not (tmp_path / "run").exists()


# ---- over LCM --------------------------------------------------------------------------------------------------------


def test_when_controller_and_plant_are_two_processes_in_lock_step_expect_identical_samples(
    results: dict[tuple[str, str], TrackResult], cache: Path, tmp_path: Path
) -> None:
    over_lcm = run_over_lcm(
        RunSetup(
            tracking_experiment("serial-circle"),
            design(cache, "dob-acceleration"),
            plant="perturbed",
            sensors=Sensors(),
        ),
        tmp_path,
        Talk("lockstep"),
    )
    in_process = results["serial-circle", "dob-acceleration"]
    require_identical(over_lcm.result.run, in_process.run)
    assert over_lcm.result.row() == in_process.row()
    assert over_lcm.controller["steps"] == over_lcm.simulator["samples"] == 3000


def write_csv(path: Path, names: str, rows: list[str]) -> Path:
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    return path


def test_when_records_miss_different_samples_expect_the_common_ones_matched_by_number(tmp_path: Path) -> None:
    artifact = release(DesignRequest.of("arm2", "pid")).artifact
    plant_columns = ["angle_rad", "speed_rad_s", "acceleration_rad_s2", "external_torque_nm"]
    controller_columns = [
        *("measured_angle_rad", "reference_angle_rad", "reference_speed_rad_s", "torque_applied_nm"),
        *("estimated_angle_rad", "estimated_speed_rad_s", "estimated_disturbance", "filtered_disturbance"),
    ]

    def table(path: Path, columns: list[str], samples: list[int], extra: str) -> Path:
        names = ",".join(["seq", "time_s", *(f"{name}_{j}" for name in columns for j in range(2)), extra])
        last = [0] * (1 + extra.count(","))
        rows = [",".join(map(str, [k, k * 1e-3, *([k + 0.25, k + 0.5] * len(columns)), *last])) for k in samples]
        return write_csv(path, names, rows)

    run = merge_records(
        table(tmp_path / "plant.csv", plant_columns, [0, 1, 3, 4], "command_delay_s"),
        table(tmp_path / "controller.csv", controller_columns, [1, 2, 3], "flags,premise_excess"),
        artifact,
    )
    np.testing.assert_array_equal(run.time_s, [1e-3, 3e-3])
    np.testing.assert_array_equal(run.true_angle_rad, [[1.25, 1.5], [3.25, 3.5]])
    np.testing.assert_array_equal(run.torque_nm, [[1.25, 1.5], [3.25, 3.5]])


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n3\n", "a,b\n1,x\n"])
def test_when_a_record_is_not_a_table_of_numbers_expect_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="expected a table of numbers"):
        read_record(file, 3)


def test_when_the_path_leaves_the_reach_of_the_arm_expect_one_line_with_the_reason(tmp_path: Path) -> None:
    file = tmp_path / "far.json"
    line = {"line": {"to": [5.0, -1.75], "duration_s": 1.0}}
    path = {"name": "far", "tool_angle_rad": 0.785, "start": [1.3, -1.75], "segments": [line]}
    file.write_text(json.dumps(path), encoding="utf-8")
    with pytest.raises(InputError, match=r"far\.json: .*expected a distance|far\.json: .*expected \["):
        TrackingExperiment.from_path_file(file, robot("arm3"))
