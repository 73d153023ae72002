"""`link-damped`, the law on the links of elastic arms: sample by sample, its loop, its design, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.certificate import gate, verify
from quasilpv.certificate.gate import elastic_grid
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.loops.elastic_loop import ElasticPlant
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate, link_matrix, slips
from quasilpv.release import checked_artifact
from quasilpv.scenarios.registry import tracking_experiment
from quasilpv.synthesis import DesignRequest, default_controller, synthesise
from quasilpv.synthesis.elastic import link_damped
from quasilpv.systems.robots.joint_drive import ElasticDrive
from reference.elastic_robots import elastic_ur5
from reference.random_trees import random_tree
from reference.tree_artifacts import tree_artifact

T = 1e-3
LAW: dict[str, Any] = {
    "kind": "link-damped",
    "feedback": {"kp": -900.0, "kd": -60.0, "ki": -500.0},
    "observer": [0.8, 250.0, 4e4, 2.5e6],
    "filter_time_constant_s": 0.01,
    "inertia_scale": 0.8,
    "rotor_inertia_kg_m2": [0.4, 0.3, 0.2, 0.1],
    "stiffness_nm_rad": [2e4, 1e4, 8e3, 5e3],
    "relative_damping_nm_s": [90.0, 55.0, 40.0, 22.0],
    "friction_viscous_nm_s": [1.0, 0.5, 0.0, 0.2],
    "friction_coulomb_nm": [2.0, 0.0, 1.0, 0.5],
}


def runtime_of(artifact: Artifact) -> _runtime.Artifact:
    return _runtime.Artifact.parse(canonical_json(artifact.to_document()), "test")


@pytest.mark.parametrize(
    ("torque_nm", "zone", "samples"),
    [(1e7, None, 60), (60.0, None, 60), (1e7, [3e-4, 0.0, 1.0, 5e-5], 2500)],
    ids=["no limit", "limits act", "at rest"],
)
def test_when_the_law_steps_expect_the_recursion(torque_nm: float, zone: list[float] | None, samples: int) -> None:
    rng = np.random.default_rng(12)
    tree = random_tree(rng, 4)
    members = LAW if zone is None else {**LAW, "dead_zone_rad": zone}
    controller = _runtime.Controller(runtime_of(tree_artifact(tree, members, torque_nm=torque_nm)))
    widths, near_s, waited = np.array(zone or [0.0] * 4), np.zeros(4), np.zeros(4)
    B, K, D = (np.array(LAW[name]) for name in ("rotor_inertia_kg_m2", "stiffness_nm_rad", "relative_damping_nm_s"))
    viscous, coulomb = np.array(LAW["friction_viscous_nm_s"]), np.array(LAW["friction_coulomb_nm"])
    kp, kd, ki = LAW["feedback"].values()
    pole, s = math.exp(-T / 0.01), LAW["inertia_scale"]
    start, ways = rng.uniform(-1.0, 1.0, 4), 0.3 * rng.normal(size=4)
    th, w, d, j, df, e_I = start.copy(), *np.zeros((5, 4))
    before: Any = None
    limited = 0
    for k in range(samples):
        if zone is not None and k == 20:
            start, ways = start + ways * np.sin(6 * k * T), np.zeros(4)
        r, rd, rdd = start + ways * np.sin(6 * k * T), 6 * ways * np.cos(6 * k * T), -36 * ways * np.sin(6 * k * T)
        y = r + 1e-4 * rng.normal(size=4)
        if k == 0:
            th = y.copy()
        motor = y + rng.normal(0.0, 1e-4, 4)
        told = k % 9 != 4
        gears = {"link_angle_rad": y, **({"motor_angle_rad": motor} if told else {})}
        report = controller.step(np.full(4, 9.0), r, rd, rdd, np.zeros(4), k, gears=gears)
        fed = tree.inverse_dynamics(r, rd, rdd)
        unforeseen = motor - y - (fed - B * rdd) / K
        damping = D / T * (unforeseen - before) if told and before is not None else np.zeros(4)
        before = unforeseen if told else None
        th, w, d, j = (x + gain * (y - th) for x, gain in zip((th, w, d, j), LAW["observer"], strict=True))
        near_s = np.where((np.abs(y - r) > widths) | (np.abs(rd) > widths), 0.0, np.minimum(near_s + T, 2.0))
        waits = near_s == 2.0
        waited += waits
        df = np.where(waits, df, pole * df + (1.0 - pole) * d)
        a = kp * (th - r) + kd * (w - rd) + ki * e_I - df
        M = tree.inertia(y)
        torque = fed + viscous * rd + coulomb * np.tanh(rd / 0.01) + s * M @ a - damping
        applied = np.clip(torque, -torque_nm, torque_nm)
        scale = max(1.0, float(np.abs(torque).max())) * samples / 60  # rounding adds up over the samples
        np.testing.assert_allclose(report.torque_applied[:4], applied, rtol=0, atol=1e-12 * scale)
        limited += int((applied != torque).sum())
        np.testing.assert_allclose(report.integral_error[:4], e_I, rtol=0, atol=1e-12)
        e_I = e_I + T * np.where(blocked(torque, applied, ki * (y - r)), 0.0, y - r)
        held = rdd + a + np.linalg.solve(M, applied - torque) / s + d
        th = th + T * w + T**2 / 2.0 * held + T**3 / 6.0 * j
        w, d = w + T * held + T**2 / 2.0 * j, d + T * j
    assert (limited > 0) == (torque_nm < 1e7)
    assert (waited > 0).tolist() == [False, False, zone is not None, False]


def blocked(commanded: np.ndarray, applied: np.ndarray, grows: np.ndarray) -> np.ndarray:
    """Where a limit acts and the integral would push further into it."""
    return np.asarray((commanded - applied) * grows > 0.0)


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.3])
def test_when_a_loop_is_run_on_unit_states_expect_its_growth_rate(delay: float) -> None:
    """The law step by step; the plant by the exponential that the tests of `motor-pid` compare with small steps."""
    rng = np.random.default_rng(4)
    root, n = rng.normal(size=(2, 2)), 2
    plant = ElasticPlant(root @ root.T + np.eye(2), np.array([0.4, 0.2]), np.array([9e3, 5e3]), np.array([1.5, 1.0]))
    inertia = 1.1 * plant.links + np.diag(plant.rotors)
    law = LinkLaw(T, np.array([-900.0, -60.0, -500.0]), np.array(LAW["observer"]), 0.01, 0.8, np.array([60.0, 30.0]))
    whole = math.floor(delay)
    late = (delay - whole) * T
    (before, by_old), (after, by_new) = (plant.held(time, np.ones(n)) for time in (late, T - late))
    pole = math.exp(-T / 0.01)

    def sample(state: np.ndarray) -> np.ndarray:
        y, own, old = state[: 4 * n], state[4 * n : 11 * n].reshape(7, n), state[11 * n :].reshape(-1, n)
        th, w, d, j, df, e_I, u = own
        q, motor = y[:n], y[n : 2 * n]
        th, w, d, j = (x + gain * (q - th) for x, gain in zip((th, w, d, j), law.observer, strict=True))
        df = pole * df + (1.0 - pole) * d
        kp, kd, ki = law.feedback
        a = kp * th + kd * w + ki * e_I - df
        torque = 0.8 * inertia @ a - law.relative_damping * (motor - q - u) / T
        torques = [torque, *old]
        y = after @ (before @ y + by_old @ torques[whole + 1]) + by_new @ torques[whole]
        held = a + d
        th, w, d = th + T * w + T**2 / 2 * held + T**3 / 6 * j, w + T * held + T**2 / 2 * j, d + T * j
        own = np.array([th, w, d, j, df, e_I + T * q, motor - q])
        return np.concatenate([y, own.ravel(), *torques[: whole + 1]])

    size = 11 * n + n * (whole + 1)
    transition = np.array([sample(unit) for unit in np.eye(size)]).T
    rate = math.log(np.abs(np.linalg.eigvals(transition)).max()) / T
    assert link_growth_rate(law, plant, inertia, delay * T) == pytest.approx(rate, rel=1e-6)


def test_when_a_motor_breaks_away_expect_it_as_far_as_its_loop_goes_before_it_turns_back() -> None:
    """A step of torque at one motor of an arm of two; heavier links are held more firmly by nothing but the law."""
    arm = ElasticPlant(np.diag([2.0, 1.0]), np.array([0.4, 0.2]), np.array([9e3, 5e3]), np.array([1.5, 1.0]))
    inertia = arm.links + np.diag(arm.rotors)
    law = LinkLaw(T, np.array([-900.0, -60.0, 0.0]), np.array(LAW["observer"]), 0.01, 0.8, np.array([60.0, 30.0]))
    matrix, push = link_matrix(law, arm, inertia, 5e-4), arm.held(T, np.ones(2))[1]
    for j, far in enumerate(slips(law, arm, inertia, 5e-4)):
        forced = np.concatenate([push[:, j], np.zeros(len(matrix) - 8)])
        state, motor = np.zeros(len(matrix)), [0.0]
        for _ in range(400):
            state = matrix @ state + forced
            motor.append(state[2 + j])
        turns = next(k for k in range(1, 400) if motor[k + 1] < motor[k])
        assert 0 < turns < 100
        assert far == pytest.approx(motor[turns], rel=1e-12)
        assert 1e-5 < far < 1.0 / (0.8 * inertia[j, j] * 900.0) * 2.0


@cache
def designed() -> Artifact:
    return checked_artifact(synthesise(DesignRequest.of(elastic_ur5(side="both", uncertainty=2.0), "link-damped")))


def test_when_encoders_sit_on_both_sides_expect_a_gridded_design_that_is_asked_for_by_name_and_80_um(
    tmp_path: Path,
) -> None:
    artifact, robot = designed(), elastic_ur5(side="both", uncertainty=2.0)
    assert default_controller(robot) == "motor-pid"
    assert artifact.verification is not None
    report = artifact.verification["report"]
    assert report["evidence"] == "gridded"
    assert report["worst_growth_rate_per_s"] < 0.0
    assert "gate" not in artifact.verification
    assert artifact.law.feedback.ki == 0.0
    assert len(artifact.law.dead_zone_rad) == 6
    assert min(artifact.law.dead_zone_rad) > 6 * math.pi / 2**20
    setup = RunSetup(
        tracking_experiment("ur5-circle").by(robot), artifact, plant="perturbed", transport_delay_s=T / 2, log=False
    )
    assert track(setup, tmp_path).metrics.rms_tool_m < 80e-6


def test_when_encoders_sit_on_the_links_alone_expect_a_slow_gridded_design_and_a_millimetre_whatever_the_gears(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_damped, "POSTURES", 8)
    monkeypatch.setattr(elastic_grid, "POSTURES", 3)
    robot = elastic_ur5(side="link", uncertainty=2.0)
    artifact = checked_artifact(synthesise(DesignRequest.of(robot, default_controller(robot))))
    assert artifact.law.kind == "link-damped"
    assert set(artifact.law.relative_damping_nm_s) == {0.0}
    assert artifact.verification is not None
    assert artifact.verification["report"]["evidence"] == "gridded"
    with pytest.raises(InputError, match=r"law\.kind: got link-damped"):
        verify(artifact)
    found = gate(artifact)
    assert isinstance(found, ElasticGridGate)
    assert found.passed
    rms = []
    for factor in (0.5, 2.0):
        true = [replace(own, drive=scaled(own.drive, factor)) for own in elastic_ur5(side="link").joints]
        arm = replace(robot, joints=tuple(true))
        setup = RunSetup(
            tracking_experiment("ur5-circle").by(arm), artifact, plant="perturbed", transport_delay_s=T / 2, log=False
        )
        rms.append(track(setup, tmp_path / str(factor)).metrics.rms_tool_m)
    assert max(rms) < 1e-3
    assert max(rms) / min(rms) < 1.1


def scaled(drive: ElasticDrive | None, factor: float) -> ElasticDrive:
    assert drive is not None
    pull = drive.stiffness_nm_rad[0] * factor
    return replace(drive, stiffness_nm_rad=(pull, pull))


def test_when_a_law_of_links_is_as_fast_as_the_gears_without_motor_encoders_expect_it_refused_with_its_growth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link_damped, "POSTURES", 2)
    monkeypatch.setattr(link_damped, "ALONE", replace(link_damped.ALONE, choices=link_damped.DAMPED.choices[:1]))
    with pytest.raises(InfeasibleError, match=r"no link-dob at 1000 Hz: .* the best grows by [\d.]+ 1/s"):
        synthesise(DesignRequest.of(elastic_ur5(side="link"), "link-dob"))


def test_when_an_arm_is_of_another_class_expect_the_law_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"link-damped for an arm that is elastic, motor encoders"):
        synthesise(DesignRequest.of(elastic_ur5(), "link-damped"))
