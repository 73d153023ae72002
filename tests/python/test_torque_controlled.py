"""`dob-acceleration` for arms whose drives control the torque in their joints: proved on condition, links read."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.certificate import gate, verify
from quasilpv.certificate.gate import elastic_grid
from quasilpv.certificate.gate.proof import RobustGate
from quasilpv.certificate.laws import dob_acceleration
from quasilpv.cli.robust import _answer
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.loops.elastic_loop import ElasticPlant
from quasilpv.loops.link_loop import LinkLaw, link_growth_rate
from quasilpv.release import checked_artifact
from quasilpv.scenarios.registry import tracking_experiment
from quasilpv.synthesis import DesignRequest, default_controller, synthesise
from quasilpv.synthesis.elastic import torque_controlled
from quasilpv.synthesis.elastic.arms import links_of
from quasilpv.synthesis.tracking_design import TrackingDesign
from reference.elastic_robots import elastic_ur5

T = 1e-3
ROBOT = elastic_ur5(side="both", uncertainty=2.0, torque_loop=True)


@pytest.fixture(autouse=True)
def few_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elastic_grid, "POSTURES", 3)


@cache
def design() -> TrackingDesign:
    return synthesise(DesignRequest.of(ROBOT, default_controller(ROBOT)))


@cache
def designed() -> Artifact:
    return checked_artifact(design())


@cache
def gated() -> RobustGate:
    found = gate(designed())
    assert isinstance(found, RobustGate)
    return found


def changed(path: tuple[str, ...], value: Any) -> Artifact:
    content = designed().content()
    member = content
    for name in path[:-1]:
        member = member[name]
    member[path[-1]] = value
    return Artifact.from_document(content)


def test_when_drives_control_torques_expect_the_default_law_proved_on_condition() -> None:
    artifact = designed()
    assert artifact.law.kind == "dob-acceleration"
    assert artifact.law.angle_side == "link"
    assert artifact.verification is not None
    report = artifact.verification["report"]
    assert report["evidence"] == "proved on condition"
    assert report["worst_elastic_growth_rate_per_s"] < 0.0
    assert verify(artifact).verified
    found = gated()
    assert found.passed
    assert "whatever the link does" in found.to_document()["on_condition"]
    rows, said = _answer(found)
    assert said.endswith("whatever the link does")
    assert found.elastic is not None
    assert found.elastic.passed
    assert found.to_document()["elastic_grid"]["proved"] is False
    assert dict(rows)["elastic arms beside it (numerical, grid)"].startswith("-")


def test_when_an_arm_is_looked_at_beside_the_proof_expect_its_loops_with_whole_rotors_in_torque_loops() -> None:
    found = gated()
    assert found.elastic is not None
    content, drives = designed().content(), [own.drive for own in ROBOT.joints if own.drive is not None]
    gains = [content["law"]["feedback"][name] for name in ("kp", "kd", "ki")]
    filter_s, observer = content["law"]["filter_time_constant_s"], np.array(content["law"]["observer"])
    rotors = np.array([joint.rotor_inertia_kg_m2 for joint in ROBOT.joints])
    stiff = torque_controlled.as_rigid(ROBOT)
    assert designed().verification is not None
    scale = designed().verification["report"]["inertia_scale"]
    law = LinkLaw(T, np.array(gains), observer, filter_s, scale, np.zeros(6))
    for loop in found.elastic.loops[::5]:
        pull = np.array([drive.stiffness_nm_rad[int(loop.gears == "stiffest")] for drive in drives])
        drag, at = pull * np.array([drive.damping_least_s for drive in drives]), loop.angle_rad[None]
        trees = [links_of(tree) for tree in (ROBOT.heaviest() if loop.loaded else (ROBOT.lightest(),))]
        rates = [
            link_growth_rate(
                law,
                ElasticPlant(tree.inertia(at)[0], rotors, pull, drag, 0.0, 4.0),
                stiff.tree.inertia(at)[0],
                loop.delay_s,
            )
            for tree in trees
        ]
        assert min(abs(loop.growth_rate_per_s - rate) for rate in rates) < 1e-6


def test_when_an_artifact_states_a_lag_that_its_loops_do_not_bear_expect_the_gate_not_passed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever is proved on condition: that takes long with a lag, so that the proof without one stands in for it."""
    proved = replace(gated(), elastic=None)
    assert proved.passed
    monkeypatch.setattr(dob_acceleration, "robust_gate", lambda *_: proved)
    found = gate(changed(("payloads", "lag_s"), [0.0, 1e-3]))
    assert isinstance(found, RobustGate)
    assert not found.passed
    assert "numerical (grid), of elastic arms" in found.why_not_passed()
    assert _answer(found)[1].startswith("NOT passed: gears give")


def test_when_the_gain_of_the_torque_loops_is_another_expect_the_range_refused() -> None:
    """With the whole rotors in the links' equations the inertia leaves the range that is claimed."""
    verdict = verify(changed(("payloads", "torque_gain"), 1.0))
    assert any("M_t" in name for name in verdict.failed)


def test_when_encoders_sit_on_both_sides_expect_the_law_to_read_the_links() -> None:
    def runtime(artifact: Artifact) -> _runtime.Controller:
        return _runtime.Controller(_runtime.Artifact.parse(canonical_json(artifact.to_document()), "test"))

    law = {name: member for name, member in designed().content()["law"].items() if name != "angle_side"}
    reading, plain = runtime(designed()), runtime(changed(("law",), law))
    rng, zero = np.random.default_rng(3), np.zeros(6)
    for k in range(20):
        link = 0.1 + 1e-4 * rng.normal(size=6)
        motor = link + 1e-3
        gears = {"link_angle_rad": link, "motor_angle_rad": motor}
        both = reading.step(motor, zero + 0.1, zero, zero, zero, k, gears=gears)
        alone = plain.step(link, zero + 0.1, zero, zero, zero, k)
        np.testing.assert_array_equal(both.torque_applied, alone.torque_applied)


def test_when_gears_give_inside_torque_loops_expect_a_stable_run(tmp_path: Path) -> None:
    setup = RunSetup(
        tracking_experiment("ur5-circle").by(ROBOT), designed(), plant="perturbed", transport_delay_s=T / 2, log=False
    )
    metrics = track(setup, tmp_path).metrics
    assert metrics.rms_tool_m < 1.2e-3
    assert metrics.share_at_limit == 0.0


def loop_of(plant: ElasticPlant) -> np.ndarray:
    """The derivative of (q, th, w, v, u), u the torque of the motors, written out for two joints without commands."""
    M, B, s, lag = plant.links, plant.rotors, plant.torque_gain, plant.lag_s

    def rate(y: np.ndarray) -> np.ndarray:
        q, th, w, v, u = y.reshape(5, 2)
        spring = plant.stiffness * (th - q) + plant.damping * (v - w)
        return np.concatenate([w, v, np.linalg.solve(M, spring), (u - spring) / B, ((1.0 - s) * spring - u) / lag])

    return np.array([rate(unit) for unit in np.eye(10)]).T


def test_when_torque_loops_lag_expect_the_exact_flow_and_without_lag_smaller_rotors() -> None:
    M, B = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([0.4, 0.2])
    K, D = np.array([9e3, 5e3]), np.array([1.5, 1.0])
    lagging = ElasticPlant(M, B, K, D, 2e-3, 4.0)
    flow, _ = lagging.held(T, np.ones(2))
    np.testing.assert_allclose(flow, expm(T * loop_of(lagging)), rtol=0, atol=1e-11 * np.abs(flow).max())
    at_once, pushed = ElasticPlant(M, B, K, D, 0.0, 4.0).held(T, np.ones(2))
    smaller, pushed_there = ElasticPlant(M, B / 4.0, K, D).held(T, np.ones(2))
    np.testing.assert_allclose(at_once, smaller, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(pushed, pushed_there, rtol=1e-12, atol=1e-12)


def test_when_a_torque_loop_lags_by_more_than_its_damping_bears_expect_it_to_swing_with_its_gear() -> None:
    eta, borne = 1.5e-4, 1.5e-4 * 4.0 / 3.0
    K = np.array([1e4, 1e4])
    for share, grows in ((0.95, False), (1.2, True)):
        plant = ElasticPlant(1e6 * np.eye(2), np.array([0.4, 0.2]), K, eta * K, share * borne, 4.0)
        assert (np.linalg.eigvals(loop_of(plant)).real.max() > 1.0) == grows


def test_when_torque_loops_lag_too_much_expect_the_design_refused_with_the_lag_they_bear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = replace(design(), report={"inertia_scale": design().report["inertia_scale"]})
    monkeypatch.setattr(torque_controlled, "POSTURES", 2)
    monkeypatch.setattr(torque_controlled, "tree_acceleration_law", lambda *_, **__: known)
    monkeypatch.setattr(torque_controlled, "_with_least_inertia", lambda design, *_: design)
    with pytest.raises(InfeasibleError, match=r"grows by .* lag by 1 ms \(lag\): .* from a lag of 0\.2 ms on"):
        synthesise(DesignRequest.of(replace(ROBOT, lag_s=(0.0, 1e-3)), "dob-acceleration"))
    borne = synthesise(DesignRequest.of(replace(ROBOT, lag_s=(0.0, 5e-5)), "dob-acceleration"))
    assert borne.report["elastic_loops"] == 2 * 2 * 2 * 2 * 2


def test_when_a_joint_of_the_arm_is_rigid_expect_it_refused_by_name() -> None:
    first, *others = ROBOT.joints
    with pytest.raises(InputError, match=r"shoulder_pan\.stiffness: got rigid"):
        synthesise(DesignRequest.of(replace(ROBOT, joints=(replace(first, drive=None), *others)), "dob-acceleration"))
