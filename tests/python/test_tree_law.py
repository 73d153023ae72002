"""Laws for robots in space, sample by sample in the run-time side, against recursions written in numpy."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact.schema import Artifact
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import SpatialInertia
from quasilpv.systems.robots.tree import KinematicTree
from reference.random_trees import random_tree
from reference.tree_artifacts import tree_artifact

T = 1e-3
DOB: dict[str, Any] = {
    "kind": "dob-acceleration",
    "feedback": {"kp": -2500.0, "kd": -90.0, "ki": 0.0},
    "observer": [0.7, 400.0, 9e4, 8e6],
    "filter_time_constant_s": 6e-4,
    "disturbance_compensation": True,
}
LOAD = {"mass_kg": 0.8, "first_moment_kg_m": [0.03, -0.02, 0.07]}
COMPUTED_TORQUE: dict[str, Any] = {
    "gp": [900.0] * 4,
    "gd": [60.0] * 4,
    "gi": [2000.0] * 4,
    "velocity_filter_time_constant_s": 2e-3,
}


def runtime_of(artifact: Artifact) -> _runtime.Artifact:
    return _runtime.Artifact.parse(canonical_json(artifact.to_document()), "test")


def with_load(tree: KinematicTree) -> KinematicTree:
    """The tree with the load as part of its last body, of which only gravity is looked at."""
    last = tree.joints[-1]
    body = SpatialInertia(LOAD["mass_kg"], np.array(LOAD["first_moment_kg_m"]), np.zeros((3, 3)))
    return replace(tree, joints=(*tree.joints[:-1], replace(last, inertia=last.inertia.plus(body))))


def measured(rng: np.random.Generator, n: int, count: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Angles that move about, speeds, and references."""
    start, ways = rng.uniform(-1.0, 1.0, n), rng.normal(size=(3, n)) * 0.3
    times = T * np.arange(count)[:, None]
    angle = start + ways[0] * np.sin(7.0 * times) + 1e-5 * rng.normal(size=(count, n))
    speed = 7.0 * ways[0] * np.cos(7.0 * times) + 0.01 * rng.normal(size=(count, n))
    reference = [start + ways[1] * np.sin(6.0 * times), 6.0 * ways[1] * np.cos(6.0 * times)]
    return angle, speed, [*reference, -36.0 * ways[1] * np.sin(6.0 * times)]


@pytest.mark.parametrize("n", [1, 3, 6, 7])
@pytest.mark.parametrize("loaded", [False, True])
def test_when_the_observer_law_steps_with_a_tree_expect_the_recursion_to_1e_12(n: int, loaded: bool) -> None:
    rng = np.random.default_rng(100 * n + loaded)
    tree = random_tree(rng, n)
    artifact = tree_artifact(tree, {**DOB, **({"gravity_load": LOAD} if loaded else {})}, torque_nm=1e6)
    controller = _runtime.Controller(runtime_of(artifact))
    heavy = with_load(tree) if loaded else tree
    angle, speed, (r, rd, rdd) = measured(rng, n, 60)
    gains, pole = DOB["observer"], math.exp(-T / DOB["filter_time_constant_s"])
    th, w, d, j, f = angle[0].copy(), *np.zeros((4, n))
    for k in range(60):
        report = controller.step(angle[k], r[k], rd[k], rdd[k], speed[k], k)
        innovation = angle[k] - th
        th, w, d, j = (x + gain * innovation for x, gain in zip((th, w, d, j), gains, strict=True))
        f = pole * f + (1.0 - pole) * d
        a = rdd[k] - f + DOB["feedback"]["kp"] * (th - r[k]) + DOB["feedback"]["kd"] * (w - rd[k])
        torque = tree.inertia(angle[k]) @ a + heavy.gravity(angle[k])
        scale = max(1.0, float(np.abs(torque).max()))
        np.testing.assert_allclose(report.torque_applied[:n], torque, rtol=0, atol=1e-12 * scale)
        np.testing.assert_array_equal(report.torque_applied, report.torque_commanded)
        applied = a + d
        th = th + T * w + T**2 / 2.0 * applied + T**3 / 6.0 * j
        w, d = w + T * applied + T**2 / 2.0 * j, d + T * j


def test_when_a_limit_acts_expect_the_prediction_with_the_torque_that_was_applied() -> None:
    rng = np.random.default_rng(9)
    tree = random_tree(rng, 4, sliding=0.0)
    artifact = tree_artifact(tree, {**DOB, "gravity_load": LOAD}, torque_nm=2.0)
    controller, heavy = _runtime.Controller(runtime_of(artifact)), with_load(tree)
    angle, speed, (r, rd, rdd) = measured(rng, 4, 2)
    first = controller.step(angle[0], r[0] + 0.5, rd[0], rdd[0], speed[0], 0)
    assert np.abs(first.torque_applied[:4]).max() == 2.0
    known = np.linalg.solve(tree.inertia(angle[0]), first.torque_applied[:4] - heavy.gravity(angle[0]))
    predicted = angle[0] + T**2 / 2.0 * known
    second = controller.step(angle[1], r[1], rd[1], rdd[1], speed[1], 1)
    corrected = predicted + DOB["observer"][0] * (angle[1] - predicted)
    np.testing.assert_allclose(second.estimated_angle[:4], corrected, atol=1e-13)


@pytest.mark.parametrize("observer", [0.0, 80.0])
def test_when_computed_torque_steps_with_a_tree_expect_its_inverse_dynamics(observer: float) -> None:
    rng = np.random.default_rng(10)
    tree = random_tree(rng, 4)
    kind = "ctc-dob" if observer else "ctc"
    law = {**COMPUTED_TORQUE, "kind": kind, "disturbance_observer_bandwidth_rad_s": observer, "gravity_load": LOAD}
    controller, heavy = _runtime.Controller(runtime_of(tree_artifact(tree, law, torque_nm=1e7))), with_load(tree)
    angle, speed, (r, rd, rdd) = measured(rng, 4, 30)
    pole, filtered, integral = math.exp(-T / 2e-3), speed[0].copy(), np.zeros(4)
    forget = math.exp(-observer * T)
    gain = (1.0 - forget) / T
    zeta = -gain * filtered
    for k in range(30):
        report = controller.step(angle[k], r[k], rd[k], rdd[k], speed[k], k)
        filtered = filtered if k == 0 else pole * filtered + (1.0 - pole) * speed[k]
        estimate = zeta + gain * filtered
        a = rdd[k] + 900.0 * (r[k] - angle[k]) + 60.0 * (rd[k] - filtered) + 2000.0 * integral - estimate
        coriolis = tree.coriolis(angle[k], filtered)
        torque = tree.inertia(angle[k]) @ a + coriolis + heavy.gravity(angle[k])
        scale = max(1.0, float(np.abs(torque).max()))
        np.testing.assert_allclose(report.torque_applied[:4], torque, rtol=0, atol=1e-11 * scale)
        integral = integral + T * (r[k] - angle[k])
        zeta = forget * zeta - (1.0 - forget) * (a + gain * filtered)


def test_when_pid_steps_with_a_tree_expect_gravity_alone_beside_its_feedback() -> None:
    rng = np.random.default_rng(11)
    tree = random_tree(rng, 3)
    law = {
        "kind": "pid",
        "kp": [300.0, 200.0, 100.0],
        "kd": [20.0, 10.0, 5.0],
        "ki": [0.0, 0.0, 0.0],
        "velocity_filter_time_constant_s": 0.0,
    }
    controller = _runtime.Controller(runtime_of(tree_artifact(tree, law, torque_nm=1e6)))
    angle, speed, (r, rd, rdd) = measured(rng, 3, 5)
    for k in range(5):
        report = controller.step(angle[k], r[k], rd[k], rdd[k], speed[k], k)
        feedback = np.array(law["kp"]) * (r[k] - angle[k]) + np.array(law["kd"]) * (rd[k] - speed[k])
        np.testing.assert_allclose(report.torque_applied[:3], feedback + tree.gravity(angle[k]), atol=1e-10)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"joints": []}, "joints"),
        ({"kind": "five-bar"}, "kind"),
        ({"tool": None}, "tool"),
    ],
)
def test_when_a_design_tree_is_none_expect_it_refused_by_field(change: dict[str, Any], field: str) -> None:
    artifact = tree_artifact(random_tree(np.random.default_rng(12), 2), DOB)
    document = artifact.content()
    document["law"]["inertia"] = {**document["law"]["inertia"], **change}
    with pytest.raises(InputError, match=f"law.inertia.{field}"):
        Artifact.from_document(document)


def test_when_a_table_has_a_gravity_load_or_a_tree_programs_expect_a_refusal() -> None:
    document = tree_artifact(random_tree(np.random.default_rng(13), 2), DOB).content()
    table = {"lower": [], "upper": [], "centre": [], "representation": "takagi-sugeno", "blocks": []}
    broken = {**document, "law": {**document["law"], "inertia": table, "gravity_load": LOAD}}
    with pytest.raises(InputError):
        Artifact.from_document(broken)
    programs = {"gravity": {"outputs": 2, "code": [["angle", 0], ["angle", 1]]}}
    with pytest.raises(InputError, match="programs"):
        Artifact.from_document({**document, "programs": programs})
