"""A robot with elastic joints as a plant: against a prototype in numpy, two closed forms, and what is refused."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.scenarios import Scenario
from reference.elastic_tree import ElasticArm
from reference.random_trees import random_tree

T = 1e-3
SINE = {"joint": 0, "amplitude_nm": 6.0, "frequency_rad_s": 9.0, "phase_rad": 0.4}
IDA = {"kind": "ida", "relative_tolerance": 1e-10, "absolute_tolerance": 1e-12}
RK4 = {"kind": "rk4", "steps_per_sample": 40}


def random_arm(n: int, seed: int) -> ElasticArm:
    rng = np.random.default_rng(seed)
    drawn = random_tree(rng, n, sliding=0.0)
    rotors = rng.uniform(0.1, 0.5, n)
    joints = zip(drawn.joints, rotors, strict=True)
    tree = replace(drawn, joints=tuple(replace(j, rotor_inertia_kg_m2=float(rotor)) for j, rotor in joints))
    return ElasticArm(
        tree, rng.uniform(3e3, 2e4, n), rng.uniform(0.5, 4.0, n), rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 3.0, n)
    )


def document(arm: ElasticArm, integrator: dict[str, Any], *, side: str = "motor", sine: bool = True) -> dict[str, Any]:
    n = arm.tree.order
    return {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "elastic",
        "duration_s": 0.3,
        "plant": arm.plant_document(side),
        "integrator": integrator,
        "external_torque": [SINE] if sine else [],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0.0, "seed": 1},
        "transport_delay_s": 0.0,
        "initial": {"angle_rad": [0.2] * n, "speed_rad_s": [0.0] * n},
    }


def parsed(content: dict[str, Any]) -> _runtime.Scenario:
    return _runtime.Scenario.parse(canonical_json(content))


def external(n: int, t: float) -> FloatArray:
    torque = np.zeros(n)
    torque[0] = 6.0 * np.sin(9.0 * t + 0.4)
    return torque


@pytest.mark.parametrize("n", [1, 3, 6, 7])
def test_when_states_are_random_expect_the_equations(n: int) -> None:
    arm, rng = random_arm(n, n), np.random.default_rng(20 + n)
    plant = _runtime.Plant(parsed(document(arm, IDA)))
    for _ in range(20):
        y = np.concatenate([rng.uniform(-2.0, 2.0, n), rng.uniform(-2.0, 2.0, n), rng.normal(size=2 * n)])
        y_dot, torque, t = rng.normal(size=4 * n), rng.normal(0.0, 50.0, n), float(rng.uniform(0.0, 2.0))
        expected = arm.residual(y, y_dot, torque, external(n, t))
        scale = 1.0 + np.abs(arm.stiffness).max() * 4.0
        np.testing.assert_allclose(plant.residual(t, y, y_dot, torque), expected, rtol=0, atol=1e-12 * scale)
        solved = arm.derivative(y, torque, external(n, t))
        size = 1.0 + np.abs(solved).max()
        np.testing.assert_allclose(plant.derivative(t, y, torque), solved, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("integrator", [IDA, RK4], ids=["ida", "rk4"])
@pytest.mark.parametrize("n", [1, 4])
def test_when_torques_are_held_expect_the_motion_of_the_prototype(n: int, integrator: dict[str, Any]) -> None:
    arm, rng = random_arm(n, 30 + n), np.random.default_rng(n)
    torques = rng.normal(0.0, 20.0, (60, n))
    session = _runtime.PlantSession(parsed(document(arm, integrator)), T)
    start = np.concatenate([np.full(n, 0.2), 0.2 + arm.tree.gravity(np.full(n, 0.2)) / arm.stiffness, np.zeros(2 * n)])
    expected = arm.run(start, torques, T, 20, lambda t: external(n, t))
    for k, torque in enumerate(torques):
        motors, speeds = session.measure()
        np.testing.assert_allclose(motors, expected[k, n : 2 * n], rtol=0, atol=2e-8)
        np.testing.assert_allclose(speeds, expected[k, 3 * n :], rtol=0, atol=2e-6)
        np.testing.assert_allclose(session.angle, expected[k, :n], rtol=0, atol=2e-8)
        session.advance(torque)
    assert np.abs(expected[-1, :n] - expected[0, :n]).max() > 1e-3


@pytest.mark.parametrize(
    ("side", "torque_sensor", "names"),
    [
        ("motor", False, {"motor_angle_rad"}),
        ("link", False, {"link_angle_rad"}),
        ("both", False, {"motor_angle_rad", "link_angle_rad"}),
        ("motor", True, {"motor_angle_rad", "joint_torque_nm"}),
        ("both", True, {"motor_angle_rad", "link_angle_rad", "joint_torque_nm"}),
    ],
)
def test_when_gears_have_sensors_expect_those_and_no_others_with_the_motion_of_the_prototype(
    side: str, torque_sensor: bool, names: set[str]
) -> None:
    arm, n = random_arm(2, 32), 2
    content = document(arm, IDA, side=side)
    if torque_sensor:
        content["plant"]["torque_sensor"] = True
    content["sensors"] |= {"encoder_bits": 16, "link_encoder_bits": 12}
    assert Scenario.from_document(content).to_document() == content
    session = _runtime.PlantSession(parsed(content), T)
    torques = np.random.default_rng(2).normal(0.0, 20.0, (30, n))
    start = np.concatenate([np.full(n, 0.2), 0.2 + arm.tree.gravity(np.full(n, 0.2)) / arm.stiffness, np.zeros(2 * n)])
    expected = arm.run(start, torques, T, 20, lambda t: external(n, t))
    for k, torque in enumerate(torques):
        q, th, w, v = expected[k].reshape(4, n)
        seen = session.gears
        assert set(seen) == names
        if "motor_angle_rad" in names:
            np.testing.assert_allclose(seen["motor_angle_rad"], th, rtol=0, atol=np.pi / 2**16 + 2e-8)
        if "link_angle_rad" in names:
            turn = 2**16 if side == "link" else 2**12
            np.testing.assert_allclose(seen["link_angle_rad"], q, rtol=0, atol=np.pi / turn + 2e-8)
            counts = seen["link_angle_rad"] * turn / (2 * np.pi)
            np.testing.assert_allclose(counts, np.rint(counts), rtol=0, atol=1e-9)
        if "joint_torque_nm" in names:
            np.testing.assert_allclose(seen["joint_torque_nm"], arm.spring(q, th, w, v), rtol=0, atol=1e-3)
        first = "link_angle_rad" if side == "link" else "motor_angle_rad"
        np.testing.assert_array_equal(session.measure()[0], seen[first])
        session.advance(torque)


@pytest.mark.parametrize("integrator", [IDA, RK4], ids=["ida", "rk4"])
def test_when_torque_sensors_err_expect_drives_to_hear_them_and_others_not(integrator: dict[str, Any]) -> None:
    """A loop of gain s follows ``s command + (1 - s) (spring + error)``: it is told ``(1 - s) / s error`` more."""
    arm, n, gain = random_arm(2, 35), 2, 4.0
    content = document(arm, integrator, side="both")
    content["plant"] |= {"torque_sensor": True, "torque_loop": {"gain": gain, "lag_s": 1e-3}}
    noisy = copy.deepcopy(content)
    for joint in noisy["plant"]["joints"]:
        joint |= {"torque_noise_nm": 1.5, "torque_quantum_nm": 0.25}
    assert Scenario.from_document(noisy).to_document() == noisy
    heard, exact = (_runtime.PlantSession(parsed(own), T) for own in (noisy, content))
    errors = []
    for torque in np.random.default_rng(5).normal(0.0, 10.0, (200, n)):
        said = heard.gears["joint_torque_nm"]
        np.testing.assert_allclose(said / 0.25, np.rint(said / 0.25), rtol=0, atol=1e-9)
        errors.append(said - exact.gears["joint_torque_nm"])
        np.testing.assert_allclose(heard.angle, exact.angle, rtol=0, atol=1e-7)
        heard.advance(torque)
        exact.advance(torque + (1.0 - gain) / gain * errors[-1])
    assert np.std(errors) == pytest.approx(np.hypot(1.5, 0.25 / np.sqrt(12.0)), rel=0.15)
    content["plant"]["torque_loop"] = noisy["plant"]["torque_loop"] = None
    heard, exact = (_runtime.PlantSession(parsed(own), T) for own in (noisy, content))
    for torque in np.random.default_rng(5).normal(0.0, 10.0, (20, n)):
        np.testing.assert_array_equal(heard.angle, exact.angle)
        heard.advance(torque)
        exact.advance(torque)


def test_when_a_torque_sensor_that_is_not_there_errs_expect_it_refused_on_both_sides() -> None:
    content = document(random_arm(1, 3), IDA)
    content["plant"]["joints"][0]["torque_noise_nm"] = 0.1
    for read in (Scenario.from_document, parsed):
        with pytest.raises(
            InputError, match=r"joints\[0\]\.torque_noise_nm: got 0\.1, expected 0 without torque_sensor"
        ):
            read(content)


@pytest.mark.parametrize("lag_s", [0.0, 2e-3])
def test_when_drives_control_torques_expect_their_equation(lag_s: float) -> None:
    """``lag u' + u = s (command - spring) + spring``."""
    arm, n, rng = random_arm(3, 14), 3, np.random.default_rng(15)
    content = document(arm, IDA, sine=False)
    content["plant"]["torque_loop"] = {"gain": 5.0, "lag_s": lag_s}
    assert Scenario.from_document(content).to_document() == content
    plant = _runtime.Plant(parsed(content))
    for _ in range(10):
        q, w, v, u, command = rng.normal(size=(5, n))
        th = q + 1e-3 * rng.normal(size=n)
        y = np.concatenate([q, th, w, v])
        spring = arm.spring(q, th, w, v)
        wanted = 5.0 * (command - spring) + spring
        expected = arm.derivative(y, u if lag_s else wanted, np.zeros(n))
        if lag_s:
            y, expected = np.concatenate([y, u]), np.concatenate([expected, (wanted - u) / lag_s])
        found = plant.derivative(0.0, y, command)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * (1.0 + np.abs(expected).max()))


@pytest.mark.parametrize(("field", "value"), [("gain", 0.5), ("lag_s", -1e-3)])
def test_when_a_torque_loop_is_none_expect_it_refused_by_name_on_both_sides(field: str, value: float) -> None:
    content = document(random_arm(2, 3), IDA)
    content["plant"]["torque_loop"] = {"gain": 4.0, "lag_s": 0.0, field: value}
    for read in (parsed, lambda tree: Scenario.from_document(tree, "scenario")):
        with pytest.raises(InputError, match=rf"torque_loop\.{field}"):
            read(content)


def free_joint(damping: float) -> ElasticArm:
    """One joint about a vertical axis: two discs and a spring."""
    arm = random_arm(1, 5)
    tree = replace(arm.tree, gravity_m_s2=np.zeros(3))
    none = np.zeros(1)
    return ElasticArm(tree, np.array([5e3]), np.array([damping]), none, none)


def test_when_a_step_of_torque_hits_two_discs_and_a_spring_expect_the_frequency_of_the_closed_form() -> None:
    """``B th'' = 1 - K (th - q)``: the deflection is ``(1 - cos(w t)) J / ((J + B) K)``, ``w^2 = K (1/J + 1/B)``."""
    arm = free_joint(0.0)
    J, B, K = arm.links_inertia(np.zeros(1))[0, 0], arm.rotors[0], arm.stiffness[0]
    sessions = [
        _runtime.PlantSession(parsed(document(arm, IDA, side=side, sine=False)), T) for side in ("motor", "link")
    ]
    w = np.sqrt(K * (1.0 / J + 1.0 / B))
    for k in range(100):
        motor, link = (session.measure()[0][0] for session in sessions)
        deflection = (1.0 - np.cos(w * k * T)) * J / ((J + B) * K)
        assert motor - link == pytest.approx(deflection, abs=1e-9)
        for session in sessions:
            session.advance(np.array([1.0]))


def test_when_the_arm_starts_at_rest_expect_its_springs_to_carry_its_weight() -> None:
    arm = random_arm(4, 8)
    arm = ElasticArm(arm.tree, arm.stiffness, arm.damping, np.zeros(4), np.zeros(4))
    session = _runtime.PlantSession(parsed(document(arm, IDA, sine=False)), T)
    q = np.full(4, 0.2)
    weight = arm.tree.gravity(q)
    np.testing.assert_allclose(session.measure()[0], q + weight / arm.stiffness, rtol=0, atol=1e-12)
    for _ in range(50):
        session.advance(weight)
    np.testing.assert_allclose(session.angle, q, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("field", "value"),
    [("stiffness_nm_rad", 0.0), ("stiffness_nm_rad", None), ("damping_nm_s", -1.0), ("rotor_inertia_kg_m2", 0.0)],
)
def test_when_a_gear_is_none_expect_it_refused_by_name_on_both_sides(field: str, value: float | None) -> None:
    content = document(random_arm(2, 3), IDA)
    if value is None:
        del content["plant"]["joints"][1][field]
    else:
        content["plant"]["joints"][1][field] = value
    for read in (parsed, lambda tree: Scenario.from_document(tree, "scenario")):
        with pytest.raises(InputError, match=rf"joints\[1\]\.{field}"):
            read(content)


def test_when_encoders_sit_nowhere_expect_it_refused_by_name() -> None:
    content = document(random_arm(2, 3), IDA, side="gear")
    for read in (parsed, lambda tree: Scenario.from_document(tree, "scenario")):
        with pytest.raises(InputError, match=r"encoder_side"):
            read(content)
