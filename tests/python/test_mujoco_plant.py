"""MuJoCo as a third plant: the same motion as IDA's under the same torques, the nearer the shorter its steps."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.cli import run
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError, PlantError
from quasilpv.experiments.designs import kept_design
from quasilpv.experiments.logged import logged_result
from quasilpv.experiments.mujoco_plant import MujocoPlant
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.scenarios import (
    IdaIntegrator,
    Integrator,
    MujocoIntegrator,
    Scenario,
    Sensors,
    build_scenario,
    sine_torques,
    tracking_experiment,
)
from quasilpv.synthesis import DesignRequest
from quasilpv.systems.robots.registry import any_robot
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.trajectories import Trajectory
from reference.random_trees import random_tree

T = 1e-3
COARSE_S = 0.01
"""A sample of which a part is a step long enough to leave something to see."""
EXACT_IDA = IdaIntegrator(relative_tolerance=1e-13, absolute_tolerance=1e-14)


def scenario_of(robot: TreeMechanism, integrator: Integrator, start: FloatArray) -> Scenario:
    """A robot that is pushed from outside; it starts with speed."""
    n = robot.joints
    document = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "pushed",
        "duration_s": 1.0,
        "plant": robot.plant_document("drawn"),
        "integrator": integrator.model_dump(mode="json"),
        "external_torque": [t.model_dump(mode="json") for t in sine_torques(*[(3.0, 40.0)] * n)],
        "sensors": Sensors(encoder_bits=0, velocity_noise_rad_s=0.0).model_dump(mode="json"),
        "transport_delay_s": 0.0,
        "torque_limit_nm": None,
        "initial": {"angle_rad": start.tolist(), "speed_rad_s": [0.3] * n},
    }
    return Scenario.from_document(document)


def by_ida(scenario: Scenario, torques: FloatArray, period_s: float = T) -> FloatArray:
    """Angles at every sample, under torques held in between."""
    session = _runtime.PlantSession(_runtime.Scenario.parse(canonical_json(scenario.to_document())), period_s)
    angles = [session.angle]
    for torque in torques:
        session.advance(torque)
        angles.append(session.angle)
    return np.array(angles)


def by_mujoco(scenario: Scenario, torques: FloatArray, steps: int, period_s: float = T) -> FloatArray:
    plant = MujocoPlant(scenario.model_copy(update={"integrator": MujocoIntegrator(steps_per_sample=steps)}), period_s)
    state = np.concatenate([scenario.initial.angle_rad, scenario.initial.speed_rad_s])
    states = [state]
    with plant.running():
        for k, torque in enumerate(torques):
            states.append(plant.advance(k * period_s, (k + 1) * period_s, states[-1], torque))
    return np.array(states)[:, : torques.shape[1]]


@pytest.mark.parametrize("seed", [0, 2, 3, 4])
def test_a_random_robot_moves_as_under_ida_and_the_difference_falls_with_the_fourth_power_of_the_step(
    seed: int,
) -> None:
    """Oblique axes, joints that slide, rotors, both kinds of friction, sines from outside.

    Motions in which no joint turns around: there smoothed Coulomb friction changes faster than these steps see.
    """
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 3, sliding=0.4)
    robot = TreeMechanism(tree, (0.4, 0.3, 0.2), (0.5, 0.3, 0.2))
    start = np.array([0.5 * (joint.lower + joint.upper) for joint in tree.joints])
    scenario = scenario_of(robot, EXACT_IDA, start)
    times = COARSE_S * np.arange(12)
    torques = robot.gravity(start) + 4.0 * np.sin(30.0 * times[:, None] + np.arange(3))
    exact = by_ida(scenario, torques, COARSE_S)
    moved = np.abs(exact - exact[0]).max()

    errors = [np.abs(by_mujoco(scenario, torques, steps, COARSE_S) - exact).max() for steps in (2, 4, 8)]

    assert moved > 1e-3
    assert errors[-1] < 1e-6 * moved
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.5)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.5)


@pytest.mark.full
def test_the_ur5_under_the_torques_of_a_run_moves_alike_and_each_integrators_steps_bring_them_together(
    tmp_path: Path,
) -> None:
    experiment = tracking_experiment("ur5-square")
    artifact = kept_design(DesignRequest.of(experiment.robot), folder=tmp_path)
    torques = track(RunSetup(experiment, artifact, log=False), tmp_path).run.torque_nm[:1500]
    scenario = build_scenario(experiment.robot, experiment.trajectory, integrator=EXACT_IDA)
    exact = by_ida(scenario, torques)
    by_steps = [np.abs(by_mujoco(scenario, torques, steps) - exact).max() for steps in (1, 2, 4, 8)]
    ratios = np.array(by_steps[:-1]) / np.array(by_steps[1:])
    assert np.all((ratios > 10.0) & (ratios < 24.0)), by_steps
    assert by_steps[-1] < 1e-9

    finest = by_mujoco(scenario, torques, 8)
    tolerances = [1e-5, 1e-7, 1e-9, 1e-11]
    by_tolerance = [
        np.abs(
            by_ida(
                build_scenario(
                    experiment.robot,
                    experiment.trajectory,
                    integrator=IdaIntegrator(relative_tolerance=t, absolute_tolerance=0.01 * t),
                ),
                torques,
            )
            - finest
        ).max()
        for t in tolerances
    ]
    assert by_tolerance == sorted(by_tolerance, reverse=True)
    for coarse, fine in zip(by_tolerance, by_tolerance[2:], strict=False):  # whose tolerance is 10^4 times smaller
        assert fine < 0.01 * coarse, by_tolerance


def test_a_closed_loop_on_mujoco_is_that_on_ida_to_what_encoders_and_integrators_leave(tmp_path: Path) -> None:
    """A short way of the UR5; encoders round, so that a difference far below a count moves a torque now and then."""
    robot = any_robot("ur5")
    start = [0.2, -1.7, 2.0, -1.87, -1.57, 0.3]
    reference = Trajectory.through([start, [0.25, -1.68, 1.97, -1.85, -1.55, 0.28]], [0.0, 0.2], name="short")
    experiment = replace(tracking_experiment("ur5-square"), name="short", reference=reference)
    artifact = kept_design(DesignRequest.of(robot), folder=tmp_path)
    ida, other = (
        track(RunSetup(experiment, artifact, plant=plant), tmp_path / plant) for plant in ("perturbed", "mujoco")
    )
    assert (ida.plant, other.plant) == ("perturbed", "mujoco")
    assert mujoco.get_mjcb_passive() is None
    logged = logged_result(read_log(tmp_path / "mujoco" / LOG_NAME))  # the tool is the robot's there, too
    assert logged.metrics == other.metrics
    assert logged.plant == "mujoco"
    difference = np.abs(ida.run.true_angle_rad - other.run.true_angle_rad).max()
    assert 0.0 < difference < 1e-5
    assert other.metrics.rms_tool_m == pytest.approx(ida.metrics.rms_tool_m, rel=0.02)


def test_a_body_mujoco_does_not_take_is_refused_by_name() -> None:
    tree = any_robot("ur5").tree
    wrist = replace(tree.joints[-1], inertia=tree.joints[-1].inertia.scaled(0.0))
    massless = TreeMechanism(replace(tree, joints=(*tree.joints[:-1], wrist)), (0.0,) * 6, (0.0,) * 6)
    scenario = scenario_of(massless, MujocoIntegrator(), np.zeros(6))
    with pytest.raises(InputError, match=r"wrist_3.*expected a robot that MuJoCo takes"):
        MujocoPlant(scenario, T)


def test_when_the_motion_grows_beyond_numbers_expect_an_error_and_no_motion_from_zero(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo alone would begin anew at zero, and write a file beside the user's."""
    monkeypatch.chdir(tmp_path)
    scenario = scenario_of(any_robot("ur5").model, MujocoIntegrator(), np.zeros(6))
    for torque in (1e30, float("nan")):
        with pytest.raises(PlantError, match=r"MuJoCo: .* not finite at t = 0\.0\d* s, with steps of 0.00025 s"):
            by_mujoco(scenario, np.full((20, 6), torque), 4)
    assert list(tmp_path.iterdir()) == []


def test_the_simulator_has_no_mujoco_and_says_who_has() -> None:
    robot = any_robot("ur5").model
    document = scenario_of(robot, MujocoIntegrator(), np.zeros(6)).to_document()
    with pytest.raises(InputError, match=r"integrator.kind: got mujoco, expected ida or rk4"):
        _runtime.PlantSession(_runtime.Scenario.parse(canonical_json(document)), T)
    del document["plant"]["tool"]  # as files have it that were written before
    assert Scenario.from_document(document).to_document() == document
    document["integrator"]["steps_per_sample"] = 0
    with pytest.raises(InputError, match="steps_per_sample"):
        _runtime.Scenario.parse(canonical_json(document))


def test_drives_that_lag_are_not_moved_by_mujoco() -> None:
    document = scenario_of(any_robot("ur5").model, MujocoIntegrator(), np.zeros(6)).to_document()
    with pytest.raises(InputError, match=r"integrator.kind: got mujoco, expected ida or rk4 with drives that lag"):
        Scenario.from_document({**document, "plant": {**document["plant"], "lag_s": 1e-3}})


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("track serial-square --plant mujoco", "--plant: got mujoco, expected nominal or perturbed: arm3 moves in a"),
        ("hil ur5-square --plant mujoco", "--plant: got mujoco, expected nominal or perturbed: qlpv-simulator"),
        ("track ur5-square --plant mojoco", "--plant: got mojoco, expected one of nominal, perturbed, mujoco"),
    ],
)
def test_where_mujoco_cannot_move_the_plant_it_is_refused_before_anything_is_designed(
    command: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(command.split()) == 2
    assert line in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_where_mujoco_is_not_installed_it_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert run(["track", "ur5-square", "--plant", "mujoco"]) == 2
    error = capsys.readouterr().err
    assert "library mujoco: got not installed, expected MuJoCo" in error
    assert error.count("\n") == 1
