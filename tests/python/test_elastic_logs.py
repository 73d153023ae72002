"""Logs of robots whose gears have sensors: what was measured on either side, and a replay that hears it again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.documents.canonical import canonical_json
from quasilpv.scenarios import Scenario
from quasilpv.telemetry import Event, RunLog, read_log
from quasilpv.telemetry.codes import GEAR_SENSORS
from quasilpv.telemetry.log import RunHeader
from quasilpv.telemetry.recording import RunDocuments, write_run
from quasilpv.telemetry.replay import replay
from quasilpv.trajectories import rest
from reference.elastic_tree import ElasticArm
from reference.logged_run import edited
from reference.random_trees import random_tree
from reference.tree_artifacts import tree_artifact

SAMPLES, N = 40, 2
LAW = {
    "kind": "motor-pid",
    "feedback": {"kp": -31500.0, "kd": -700.0, "ki": -126000.0},
    "observer": [0.8, 250.0, 4e4, 2.5e6],
    "rotor_inertia_kg_m2": [0.4, 0.3],
    "stiffness_nm_rad": [2e4, 1e4],
    "correction_bandwidth_rad_s": 3.0,
    "correction_source": "motor-torque",
    "friction_viscous_nm_s": [0.0, 0.0],
    "friction_coulomb_nm": [0.0, 0.0],
    "dead_zone_rad": 0.0,
}


def logged(folder: Path, side: str, *, torque_sensor: bool) -> tuple[RunLog, dict[str, np.ndarray]]:
    """A short run of an arm with elastic joints, as read from its log, and its columns."""
    tree = random_tree(np.random.default_rng(7), N, sliding=0.0)
    none = np.zeros(N)
    plant = ElasticArm(tree, np.array([2e4, 1e4]), np.array([2.0, 1.0]), none, none).plant_document(side)
    for joint, rotor in zip(plant["joints"], LAW["rotor_inertia_kg_m2"], strict=True):
        joint["rotor_inertia_kg_m2"] = rotor
    if torque_sensor:
        plant["torque_sensor"] = True
    scenario = Scenario.from_document(
        {
            "schema": "quasilpv.scenario",
            "schema_version": 1,
            "name": "elastic",
            "duration_s": SAMPLES * 1e-3,
            "plant": plant,
            "integrator": {"kind": "rk4", "steps_per_sample": 4},
            "external_torque": [{"joint": 1, "amplitude_nm": 5.0, "frequency_rad_s": 60.0, "phase_rad": 0.0}],
            "sensors": {"encoder_bits": 20, "velocity_noise_rad_s": 0.0, "seed": 1, "link_encoder_bits": 16},
            "transport_delay_s": 0.0,
            "initial": {"angle_rad": [0.0] * N, "speed_rad_s": [0.0] * N},
        }
    )
    artifact = tree_artifact(tree, LAW, torque_nm=1e4)
    trajectory = rest("still", N, SAMPLES * 1e-3)
    columns = _runtime.run_closed_loop(
        _runtime.Artifact.parse(canonical_json(artifact.to_document())),
        _runtime.Trajectory.parse(canonical_json(trajectory.to_document())),
        _runtime.Scenario.parse(canonical_json(scenario.to_document())),
    )
    header = RunHeader(mode="in-process", controller="motor-pid")
    path = write_run(folder / "run.lcmlog", RunDocuments(header, artifact, trajectory, scenario), columns)
    return read_log(path), columns


@pytest.mark.parametrize(("side", "torque_sensor"), [("motor", False), ("both", True)])
def test_when_gears_have_sensors_expect_the_log_to_hold_what_they_said_and_where_the_motors_were(
    side: str, torque_sensor: bool, tmp_path: Path
) -> None:
    log, columns = logged(tmp_path, side, torque_sensor=torque_sensor)
    there = {"motor_angle_rad"} | ({"link_angle_rad", "joint_torque_nm"} if torque_sensor else set())
    for channel in ("measurement", "telemetry"):
        records = log[channel].samples
        assert set(records["available"].tolist()) == {sum(GEAR_SENSORS[name] for name in there)}
        for name in GEAR_SENSORS:
            expected = columns[f"measured_{name}"] if name in there else np.zeros((SAMPLES, N))
            np.testing.assert_array_equal(records[name][:, :N], expected)
    truth = log["truth"].samples
    np.testing.assert_array_equal(truth["motor_angle_rad"][:, :N], columns["motor_angle_rad"])
    np.testing.assert_array_equal(truth["joint_torque_nm"][:, :N], columns["joint_torque_nm"])
    assert np.abs(truth["motor_angle_rad"][:, :N] - truth["angle_rad"][:, :N]).max() > 1e-5
    np.testing.assert_allclose(log["measurement"].samples["angle_rad"][:, :N], columns["motor_angle_rad"], atol=4e-6)


@pytest.mark.parametrize("missing", ["", "QLPV_MEASUREMENT", "QLPV_TELEMETRY"])
def test_when_a_run_with_sensors_on_both_sides_is_replayed_expect_every_command_from_either_channel(
    missing: str, tmp_path: Path
) -> None:
    log, _ = logged(tmp_path, "both", torque_sensor=True)

    def drop(_: int, event: Event) -> Event | None:
        return None if event.channel == missing else event

    shown = replay(read_log(edited(Path(log.source), tmp_path / "dropped.lcmlog", drop)))
    assert (shown.samples, shown.compared, shown.first_difference) == (SAMPLES, SAMPLES, None)


def test_when_encoders_sit_on_the_links_only_expect_a_law_of_the_motors_to_measure_nothing(tmp_path: Path) -> None:
    log, columns = logged(tmp_path, "link", torque_sensor=False)
    assert set(columns["flags"].astype(int).tolist()) == {1}
    assert not columns["torque_applied_nm"].any()
    assert replay(log).first_difference is None
