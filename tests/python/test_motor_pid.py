"""`motor-pid`, the law for arms with elastic joints: sample by sample, its loops, its design, and what is refused."""

import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.cli.synth import _why
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.experiments.designs import shipped_design
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.loops.elastic_loop import ElasticPlant, MotorLaw, growth_rate
from quasilpv.release import checked_artifact
from quasilpv.scenarios import build_scenario
from quasilpv.scenarios.registry import tracking_experiment
from quasilpv.synthesis import DesignRequest, default_controller, synthesise
from quasilpv.synthesis.elastic import motor_pid
from quasilpv.systems.robots.joint_drive import EncoderSide
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.ur5 import ur5
from quasilpv.telemetry.codes import TORQUE_SATURATED
from reference.elastic_robots import elastic_ur5
from reference.random_trees import random_tree
from reference.tree_artifacts import small_robot, tree_artifact

T = 1e-3
LAW: dict[str, Any] = {
    "kind": "motor-pid",
    "feedback": {"kp": -31500.0, "kd": -700.0, "ki": -126000.0},
    "observer": [0.8, 250.0, 4e4, 2.5e6],
    "rotor_inertia_kg_m2": [0.4, 0.3, 0.2, 0.1],
    "stiffness_nm_rad": [2e4, 1e4, 8e3, 5e3],
    "correction_bandwidth_rad_s": 3.0,
    "correction_source": "motor-torque",
    "friction_viscous_nm_s": [1.0, 0.5, 0.0, 0.2],
    "friction_coulomb_nm": [2.0, 0.0, 1.0, 0.5],
    "dead_zone_rad": 5e-4,
}


def runtime_of(artifact: Artifact) -> _runtime.Artifact:
    return _runtime.Artifact.parse(canonical_json(artifact.to_document()), "test")


@pytest.mark.parametrize("source", ["motor-torque", "joint-torque", "deflection"])
def test_when_the_law_steps_expect_the_recursion(source: str) -> None:
    rng = np.random.default_rng(12)
    tree = random_tree(rng, 4)
    law = {**LAW, "correction_source": source}
    controller = _runtime.Controller(runtime_of(tree_artifact(tree, law, torque_nm=1e7)))
    B, K = np.array(LAW["rotor_inertia_kg_m2"]), np.array(LAW["stiffness_nm_rad"])
    viscous, coulomb = np.array(LAW["friction_viscous_nm_s"]), np.array(LAW["friction_coulomb_nm"])
    share, left_alone = 1.0 - math.exp(-3.0 * T), 0
    start, ways = rng.uniform(-1.0, 1.0, 4), 0.3 * rng.normal(size=4)
    th, w, d, j, e_I, c1, c2 = start.copy(), *np.zeros((6, 4))
    gains = LAW["observer"]
    for k in range(60):
        r, rd, rdd = start + ways * np.sin(6 * k * T), 6 * ways * np.cos(6 * k * T), -36 * ways * np.sin(6 * k * T)
        y = r + 1e-3 * rng.normal(size=4)
        if k == 0:
            th = y.copy()
        wound, told = rng.normal(0.0, 1e-3, 4), k % 7 != 3
        sensors = {"joint_torque_nm": K * wound, "link_angle_rad": y - wound} if told else {}
        report = controller.step(y, r, rd, rdd, np.zeros(4), k, gears={"motor_angle_rad": y, **sensors})
        fed = tree.inverse_dynamics(r, rd, rdd)
        motor = r + fed / K + c2
        th, w, d, j = (x + gain * (y - th) for x, gain in zip((th, w, d, j), gains, strict=True))
        a = rdd + LAW["feedback"]["kp"] * (th - motor) + LAW["feedback"]["kd"] * (w - rd) + LAW["feedback"]["ki"] * e_I
        friction = viscous * rd + coulomb * np.tanh(rd / 0.01)
        torque = B * a + fed + friction
        scale = max(1.0, float(np.abs(torque).max()))
        np.testing.assert_allclose(report.torque_applied[:4], torque, rtol=0, atol=1e-12 * scale)
        away = np.abs(y - motor) > LAW["dead_zone_rad"]
        left_alone += int((~away).sum())
        e_I = e_I + T * np.where(away, y - motor, 0.0)
        unforeseen = wound - fed / K if source != "motor-torque" else (torque - fed - friction - B * rdd) / K
        if told or source == "motor-torque":
            c1 = c1 + share * np.where(away, unforeseen - c1, 0.0)
            c2 = c2 + share * np.where(away, c1 - c2, 0.0)
        applied = a + d
        th = th + T * w + T**2 / 2.0 * applied + T**3 / 6.0 * j
        w, d = w + T * applied + T**2 / 2.0 * j, d + T * j
    assert 0 < left_alone < 200


def test_when_the_inertia_is_a_table_or_a_gear_is_none_expect_it_refused() -> None:
    tree = random_tree(np.random.default_rng(1), 4)
    for change in ({"stiffness_nm_rad": [1e4, 1e4, 0.0, 1e4]}, {"rotor_inertia_kg_m2": [1.0] * 3}):
        (field,) = change
        with pytest.raises(InputError, match=rf"law\.{field}"):
            tree_artifact(tree, {**LAW, **change})


@pytest.mark.parametrize(
    ("delay", "source"), [(0.0, "motor-torque"), (0.3, "deflection"), (1.2, "motor-torque"), (1.2, "joint-torque")]
)
def test_when_a_loop_is_run_on_unit_states_expect_its_growth_rate(delay: float, source: str) -> None:
    """The plant by small steps of its own differential equation, the law step by step."""
    rng = np.random.default_rng(4)
    root = rng.normal(size=(2, 2))
    plant = ElasticPlant(root @ root.T + np.eye(2), np.array([0.4, 0.2]), np.array([9e3, 5e3]), np.array([1.5, 1.0]))
    law = MotorLaw(
        T,
        np.array([-31500.0, -700.0, -126000.0]),
        np.array(LAW["observer"]),
        np.array([0.42, 0.19]),
        np.array([1e4, 4e3]),
        3.0,
        source,
    )
    whole = math.floor(delay)
    late, n = (delay - whole) * T, 2
    inverse, share = np.linalg.inv(plant.links), 1.0 - math.exp(-3.0 * T)

    def coast(y: np.ndarray, command: np.ndarray, time: float) -> np.ndarray:
        steps = 400
        h = time / steps
        for _ in range(steps):
            q, th, w, v = y.reshape(4, n)
            spring = plant.stiffness * (th - q) + plant.damping * (v - w)
            w_half, v_half = w + h / 2 * inverse @ spring, v + h / 2 * (law.rotors * command - spring) / plant.rotors
            q, th = q + h * w_half, th + h * v_half
            spring = plant.stiffness * (th - q) + plant.damping * (v_half - w_half)
            w, v = w_half + h / 2 * inverse @ spring, v_half + h / 2 * (law.rotors * command - spring) / plant.rotors
            y = np.concatenate([q, th, w, v])
        return y

    def sample(state: np.ndarray) -> np.ndarray:
        y, own, old = state[: 4 * n], state[4 * n : 11 * n].reshape(n, 7).T, state[11 * n :].reshape(-1, n)
        p1, p2, p3, p4, e_I, c1, c2 = own
        innovation = y[n : 2 * n] - p1
        p1, p2, p3, p4 = (p + g * innovation for p, g in zip((p1, p2, p3, p4), law.observer, strict=True))
        kp, kd, ki = law.feedback
        a = kp * (p1 - c2) + kd * p2 + ki * e_I
        e_I = e_I + T * (y[n : 2 * n] - c2)
        gears = y[n : 2 * n] - y[:n]
        torques = plant.stiffness * gears + plant.damping * (y[3 * n : 4 * n] - y[2 * n : 3 * n])
        told = {"motor-torque": law.rotors * a / law.stiffness, "deflection": gears}
        c1 = c1 + share * (told.get(source, torques / law.stiffness) - c1)
        c2 = c2 + share * (c1 - c2)
        held = a + p3
        p1, p2, p3 = p1 + T * p2 + T**2 / 2 * held + T**3 / 6 * p4, p2 + T * held + T**2 / 2 * p4, p3 + T * p4
        commands = [a, *old]
        y = coast(coast(y, commands[whole + 1], late), commands[whole], T - late)
        return np.concatenate([y, np.array([p1, p2, p3, p4, e_I, c1, c2]).T.ravel(), *commands[: whole + 1]])

    size = 11 * n + n * (whole + 1)
    transition = np.array([sample(unit) for unit in np.eye(size)]).T
    rate = math.log(np.abs(np.linalg.eigvals(transition)).max()) / T
    assert growth_rate(law, plant, delay * T) == pytest.approx(rate, rel=1e-3, abs=0.05)
    flow, _ = plant.held(2.0 * T, law.rotors)
    once, _ = plant.held(T, law.rotors)
    np.testing.assert_allclose(flow, once @ once, rtol=0, atol=1e-9 * np.abs(flow).max())


@cache
def designed(side: EncoderSide = "motor") -> Artifact:
    return checked_artifact(synthesise(DesignRequest.of(elastic_ur5(side=side, uncertainty=2.0), "motor-pid")))


def test_when_an_arm_has_motor_encoders_expect_a_design_that_is_proved_and_stable_on_its_grid() -> None:
    artifact = designed()
    assert artifact.verification is not None
    report = artifact.verification["report"]
    assert report["evidence"] == "proved"
    assert report["worst_growth_rate_per_s"] < 0.0
    assert report["arm_class"] == "elastic, motor encoders"
    assert artifact.verification["gate"]["proved"]
    assert artifact.law.stiffness_nm_rad == pytest.approx((3e4, 3e4, 2e4, 6e3, 6e3, 6e3))


def followed(robot: SpatialRobot, folder: Path, plant: Any = "perturbed", side: EncoderSide = "motor") -> TrackResult:
    """The circle by the design for gears within a factor of 2, at half a sample of delay."""
    experiment = tracking_experiment("ur5-circle").by(robot)
    return track(RunSetup(experiment, designed(side), plant=plant, transport_delay_s=T / 2, log=False), folder)


def test_when_the_load_is_unknown_expect_a_tool_error_below_350_um(tmp_path: Path) -> None:
    assert followed(elastic_ur5(uncertainty=2.0), tmp_path).metrics.rms_tool_m < 350e-6


@pytest.mark.full
def test_when_encoders_sit_on_both_sides_expect_a_proved_correction_and_200_um(tmp_path: Path) -> None:
    artifact = designed("both")
    assert artifact.law.correction_source == "deflection"
    assert artifact.verification is not None
    assert artifact.verification["gate"]["proved"]
    assert followed(elastic_ur5(side="both", uncertainty=2.0), tmp_path, side="both").metrics.rms_tool_m < 200e-6


@pytest.mark.full
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("plant", ["nominal", "perturbed"])
def test_when_gears_are_softer_or_stiffer_expect_a_stable_loop(tmp_path: Path, factor: float, plant: str) -> None:
    robot = elastic_ur5()
    joints = []
    for joint in robot.joints:
        assert joint.drive is not None
        low, high = joint.drive.stiffness_nm_rad
        joints.append(replace(joint, drive=replace(joint.drive, stiffness_nm_rad=(factor * low, factor * high))))
    found = followed(replace(robot, joints=tuple(joints)), tmp_path, plant)
    print(f"K x {factor}, {plant}: {1e6 * found.metrics.rms_tool_m:.0f} um rms")
    assert found.metrics.rms_tool_m < (1.5e-3 if factor < 1.0 else 350e-6 * max(1.0, factor))


def test_when_a_law_for_rigid_joints_reads_motor_encoders_expect_it_refused_and_the_loop_to_end_at_the_limits() -> None:
    robot = elastic_ur5()
    for controller in ("dob-acceleration", "dob-moving", "ctc-tuned", "pid-tuned"):
        with pytest.raises(InputError, match=r"elastic, motor encoders, expected one of motor-pid; above .* rad/s"):
            synthesise(DesignRequest.of(robot, controller))
    rigid = shipped_design(DesignRequest.of(ur5(), "dob-acceleration"))
    assert rigid is not None
    experiment = tracking_experiment("ur5-circle")
    scenario = build_scenario(robot, experiment.trajectory, plant="nominal").model_copy(update={"duration_s": 0.3})
    run = _runtime.run_closed_loop(
        runtime_of(rigid),
        _runtime.Trajectory.parse(canonical_json(experiment.trajectory.to_document()), "circle"),
        _runtime.Scenario.parse(canonical_json(scenario.to_document())),
    )
    # It ends in a cycle between the torque limits: the motors shake while the reference has hardly begun to move.
    assert int(np.bitwise_or.reduce(run["flags"].astype(int))) & TORQUE_SATURATED
    assert np.abs(run["measured_speed_rad_s"]).max() > 10.0 * np.abs(run["reference_speed_rad_s"]).max()


def test_when_nobody_asks_for_a_controller_expect_that_of_the_class() -> None:
    assert default_controller(elastic_ur5()) == "motor-pid"
    assert default_controller(elastic_ur5(side="both")) == "motor-pid"
    assert default_controller(elastic_ur5(side="link")) == "link-dob"
    assert default_controller(ur5()) == "dob-acceleration"


def test_when_an_arm_is_of_another_class_expect_motor_pid_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"motor-pid for rigid joints, expected one of .*dob-acceleration"):
        synthesise(DesignRequest.of(small_robot(), "motor-pid"))
    with pytest.raises(InputError, match=r"for an arm that is elastic, link encoders, expected one of link-dob"):
        synthesise(DesignRequest.of(elastic_ur5(side="link"), "motor-pid"))
    with pytest.raises(InputError, match=r"one for robots in the plane: "):
        synthesise(DesignRequest.of("arm3", "motor-pid"))


def test_when_elastic_modes_are_beyond_the_reach_of_the_rate_expect_no_design_and_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = elastic_ur5(damping_s=1e-7)
    monkeypatch.setattr(motor_pid, "POSTURES", 8)
    stiff = [replace(joint, drive=replace(joint.drive, stiffness_nm_rad=(4e5, 4e5))) for joint in robot.joints]  # type: ignore[type-var]
    with pytest.raises(InfeasibleError, match=r"no motor-pid at 1000 Hz: .*damping_least"):
        synthesise(DesignRequest.of(replace(robot, joints=tuple(stiff)), "motor-pid"))


def test_when_a_gear_without_damping_rings_above_the_lead_expect_it_refused_with_what_is_needed() -> None:
    refused = r"damping_least: got 0, .*rings at up to \d+ rad/s, .* loop ends at 1047 rad/s"
    with pytest.raises(InputError, match=rf"{refused}.*from [\de.-]+ s on it is proved"):
        synthesise(DesignRequest.of(elastic_ur5(damping_s=0.0), "motor-pid"))
    with pytest.raises(InputError, match=refused):
        synthesise(DesignRequest.of(elastic_ur5(side="both", damping_s=0.0), "link-damped"))


@pytest.mark.full
def test_when_drives_lag_expect_a_proof_for_every_lag() -> None:
    """Half a minute of cells: frequency, delay and lag."""
    robot = replace(elastic_ur5(), lag_s=(0.0, 5e-4))
    artifact = checked_artifact(synthesise(DesignRequest.of(robot, "motor-pid")))
    assert artifact.verification is not None
    report = artifact.verification["report"]
    assert report["evidence"] == "proved"
    assert list(artifact.payloads["lag_s"]) == [0.0, 5e-4]
    assert report["highest_mode_rad_s"] > report["lead_window_rad_s"]


def test_when_the_law_of_a_class_is_chosen_expect_why_and_what_else_there_is() -> None:
    said = _why(elastic_ur5(side="both"), default_controller(elastic_ur5(side="both")))
    assert re.fullmatch(
        r"ur5-elastic is elastic, dual encoders, above \d+ rad/s the motor of \w+ feels its rotor alone, "
        r"1/[\d.]+ of the arm's inertia: motor-pid; --law link-damped is there too",
        said,
    )
    assert "--law" not in _why(elastic_ur5(), "motor-pid")
