"""The monitor in the log of a run, against the same numbers computed from the other telemetry of the same samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.experiments.track import TrackingExperiment, track
from quasilpv.release import release
from quasilpv.scenarios import Sensors, SineTorque
from quasilpv.systems.registry import robot
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.telemetry.message_types import Records
from quasilpv.trajectories import Trajectory, rest
from reference.gated_arms import moving_five_bar


def five_bar_telemetry(folder: Path, artifact: Artifact) -> Records:
    """The perturbed robot holds a posture against the disturbance for a fifth of a second."""
    posture = np.zeros((1, 2, 6))
    posture[0, :, 0] = np.mean(robot("fivebar").domain.angle_rad, axis=1)
    hold = Trajectory("hold", np.array([0.0, 0.2]), posture)
    disturbance = (SineTorque(joint=0, amplitude_nm=10.0, frequency_rad_s=50.0, phase_rad=0.0),)
    experiment = TrackingExperiment("hold", robot("fivebar"), hold, disturbance)
    track(experiment, artifact, folder, plant="perturbed", sensors=Sensors())
    return read_log(folder / LOG_NAME)["telemetry"].samples


def test_when_a_law_has_a_bound_expect_the_form_of_the_known_signals_of_every_sample(tmp_path: Path) -> None:
    artifact = Artifact.from_document(moving_five_bar())
    samples, law, T = five_bar_telemetry(tmp_path, artifact), moving_five_bar()["law"], artifact.sample_period_s

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


def test_when_a_run_is_logged_in_this_process_expect_the_monitor_in_its_telemetry(tmp_path: Path) -> None:
    artifact = release("arm3", "pid").artifact
    hold = TrackingExperiment("hold", robot("arm3"), rest("hold", 3, 0.05))
    track(hold, artifact, tmp_path, plant="nominal", sensors=Sensors())
    samples = read_log(tmp_path / LOG_NAME)["telemetry"].samples
    np.testing.assert_allclose(samples["membership_sum"], 1.0, atol=1e-14)
    assert np.all(samples["premise_excess"] >= 0.0)
    assert np.all(np.isnan(samples["lyapunov_rad2"]))
