"""The monitor in the log of a run, against the same numbers computed from the other telemetry of the same samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from quasilpv.artifact import Artifact
from quasilpv.experiments.setup import PlantKind, RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import Sensors, SineTorque, TrackingExperiment
from quasilpv.synthesis import DesignRequest
from quasilpv.systems.robots.registry import robot
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.telemetry.message_types import Records
from quasilpv.trajectories import Trajectory, rest
from reference.gated_arms import moving_five_bar

HOLD_S = 0.2
POSTURE = np.mean(robot("fivebar").domain.angle_rad, axis=1)


def five_bar_telemetry(
    folder: Path, *torques: SineTorque, plant: PlantKind, sensors: Sensors, offset: tuple[float, float] = (0.0, 0.0)
) -> Records:
    """The robot starts at rest, this far from a posture, and is to hold it."""
    coefficients = np.zeros((1, 2, 6))
    coefficients[0, :, 0] = POSTURE
    hold = Trajectory("hold", np.array([0.0, HOLD_S]), coefficients)
    start = tuple((POSTURE + offset).tolist())
    experiment = TrackingExperiment("hold", robot("fivebar"), hold, torques, start, (0.0, 0.0))
    track(RunSetup(experiment, Artifact.from_document(moving_five_bar()), plant=plant, sensors=sensors), folder)
    return read_log(folder / LOG_NAME)["telemetry"].samples


def test_when_a_law_has_a_bound_expect_the_form_of_the_known_signals_of_every_sample(tmp_path: Path) -> None:
    law, T = moving_five_bar()["law"], moving_five_bar()["sample_period_s"]
    torque = SineTorque(joint=0, amplitude_nm=10.0, frequency_rad_s=50.0)
    samples = five_bar_telemetry(tmp_path, torque, plant="perturbed", sensors=Sensors())

    def told(name: str) -> np.ndarray:
        return np.array(samples[name][:, :2])

    z = [
        told("measured_angle_rad") - told("reference_angle_rad"),
        (told("measured_angle_rad") - told("estimated_angle_rad")) / (1.0 - law["observer"][0]),
        T * (told("estimated_speed_rad_s") - told("reference_speed_rad_s")),
        T**2 * (told("estimated_disturbance") - told("filtered_disturbance")),
        told("integral_error_rad_s") / T,
    ]
    weights = np.kron(law["lyapunov_bound"]["signals"], law["lyapunov_bound"]["joints"])
    known = np.concatenate(z, axis=1)
    expected = np.einsum("ni,ij,nj->n", known, weights, known)
    assert expected.max() > 1e-8
    np.testing.assert_allclose(samples["lyapunov_rad2"], expected, rtol=1e-12)


@pytest.mark.parametrize("offset", [(1e-3, 0.0), (-5e-4, 1e-3)])
def test_when_the_plant_is_let_go_beside_its_posture_expect_never_more_than_v_at_the_start_and_soon_nothing(
    offset: tuple[float, float], tmp_path: Path
) -> None:
    exact = Sensors(encoder_bits=0, velocity_noise_rad_s=0.0)
    samples = five_bar_telemetry(tmp_path, plant="nominal", sensors=exact, offset=offset)
    motion = moving_five_bar()["witness"]["motion"]
    # The observer starts at the first measurement, at rest: angle and predicted angle are off, and nothing else.
    start = np.kron([1, 0, 1, 0, 0, 0, 0, 0, 0], offset)
    at_start = start @ np.kron(motion["lyapunov"]["no_delay"], np.linalg.inv(motion["shape"])) @ start
    assert 0.1 * at_start < samples["lyapunov_rad2"][0]
    assert np.all(samples["lyapunov_rad2"] <= at_start)
    assert samples["lyapunov_rad2"][-1] < 1e-12 * at_start


def test_when_a_run_is_logged_in_this_process_expect_the_monitor_in_its_telemetry(tmp_path: Path) -> None:
    artifact = release(DesignRequest.of("arm3", "pid")).artifact
    hold = TrackingExperiment("hold", robot("arm3"), rest("hold", 3, 0.05))
    track(RunSetup(hold, artifact, plant="nominal", sensors=Sensors()), tmp_path)
    samples = read_log(tmp_path / LOG_NAME)["telemetry"].samples
    np.testing.assert_allclose(samples["membership_sum"], 1.0, atol=1e-14)
    assert np.all(samples["premise_excess"] >= 0.0)
    assert np.all(np.isnan(samples["lyapunov_rad2"]))
