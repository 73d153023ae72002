"""Joints that stick and slip: against the same equations in numpy, Karnopp's events, and what sticking is."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.scenarios import Scenario, build_scenario
from quasilpv.systems.robots.tree import KinematicTree
from quasilpv.trajectories import rest
from reference.elastic_robots import elastic_ur5
from reference.elastic_tree import ElasticArm
from reference.random_trees import random_tree
from reference.stick_slip import Bristle, karnopp_pulled
from reference.tree_artifacts import small_robot

IDA = {"kind": "ida", "relative_tolerance": 1e-9, "absolute_tolerance": 1e-11}
OWN = Bristle(viscous=0.4, coulomb=2.0, breakaway=3.0, stribeck=1e-2, presliding=5e-5, damping=200.0)


def level_tree(n: int, seed: int) -> KinematicTree:
    """A chain without gravity, its rotors of 0.3 kg m^2."""
    drawn = random_tree(np.random.default_rng(seed), n, sliding=0.0)
    joints = tuple(replace(joint, rotor_inertia_kg_m2=0.3) for joint in drawn.joints)
    return replace(drawn, joints=joints, gravity_m_s2=np.zeros(3))


def plant_document(tree: KinematicTree, kind: str, bristle: Bristle) -> dict[str, Any]:
    n = tree.order
    arm = ElasticArm(
        tree, np.full(n, 8e3), np.full(n, 2.0), np.full(n, bristle.viscous), np.full(n, bristle.coulomb)
    ).plant_document()
    for joint in arm["joints"]:
        joint["stick_slip"] = bristle.document()
    if kind == "tree":
        del arm["encoder_side"]
        for joint in arm["joints"]:
            del joint["stiffness_nm_rad"], joint["damping_nm_s"]
    return {**arm, "kind": kind}


def scenario(plant: dict[str, Any], integrator: dict[str, Any] = IDA) -> dict[str, Any]:
    n = len(plant["joints"])
    return {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "sticking",
        "duration_s": 1.0,
        "plant": plant,
        "integrator": integrator,
        "external_torque": [],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0.0, "seed": 1},
        "transport_delay_s": 0.0,
        "initial": {"angle_rad": [0.1] * n, "speed_rad_s": [0.0] * n},
    }


def parsed(content: dict[str, Any]) -> _runtime.Scenario:
    assert Scenario.from_document(content).to_document() == content
    return _runtime.Scenario.parse(canonical_json(content))


@pytest.mark.parametrize("kind", ["tree", "elastic-tree"])
def test_when_states_are_random_expect_the_equations_of_the_prototype(kind: str) -> None:
    tree, n, rng = level_tree(3, 4), 3, np.random.default_rng(6)
    plant = _runtime.Plant(parsed(scenario(plant_document(tree, kind, OWN))))
    rotors = np.diag(tree.rotor_inertias)
    for _ in range(30):
        q, w, torque = rng.normal(size=n), rng.normal(size=n) * 10.0 ** rng.uniform(-4, 0, n), rng.normal(0, 5.0, n)
        th, v = q + rng.normal(0, 1e-3, n), w + rng.normal(0, 0.1, n)
        b = rng.uniform(-1.4, 1.4, n)
        moving, inertia = tree.inverse_dynamics(q, w, np.zeros(n)), tree.inertia(q)
        if kind == "tree":
            friction = np.array([OWN.torque(*pair) for pair in zip(w, b, strict=True)])
            expected = [w, np.linalg.solve(inertia, torque - moving - friction)]
            y, speed = np.concatenate([q, w, b]), w
        else:
            friction = np.array([OWN.torque(*pair) for pair in zip(v, b, strict=True)])
            spring = 8e3 * (th - q) + 2.0 * (v - w)
            links = np.linalg.solve(inertia - rotors, spring - moving)
            expected = [w, v, links, (torque - friction - spring) / 0.3]
            y, speed = np.concatenate([q, th, w, v, b]), v
        rates = np.array([OWN.rate(*pair) for pair in zip(speed, b, strict=True)])
        y_dot = np.concatenate([*expected, rates])
        np.testing.assert_allclose(plant.derivative(0.0, y, torque), y_dot, rtol=1e-9, atol=1e-9)
        left = plant.residual(0.0, y, y_dot, torque)
        np.testing.assert_allclose(left, 0.0, rtol=0, atol=1e-9 * (1.0 + np.abs(y_dot).max()))


def one_joint(
    bristle: Bristle, integrator: dict[str, Any] = IDA, T: float = 1e-3
) -> tuple[_runtime.PlantSession, float]:
    """A disc with friction, and its moment of inertia."""
    tree = level_tree(1, 5)
    session = _runtime.PlantSession(parsed(scenario(plant_document(tree, "tree", bristle), integrator)), T)
    return session, float(tree.inertia(np.zeros(1))[0, 0])


@pytest.mark.parametrize("integrator", [IDA, {"kind": "rk4", "steps_per_sample": 40}], ids=["ida", "rk4"])
def test_when_torques_push_it_to_and_fro_expect_the_motion_that_scipy_finds(integrator: dict[str, Any]) -> None:
    T, N = 2e-3, 60
    session, inertia = one_joint(OWN, integrator, T)
    torques = 6.0 * np.sin(2 * np.pi * np.arange(N) / 40)
    y, largest = np.array([0.1, 0.0, 0.0]), 0.0
    for torque in torques:
        assert float(session.angle[0]) == pytest.approx(y[0], abs=2e-7)
        assert float(session.speed[0]) == pytest.approx(y[1], abs=2e-5)
        session.advance([torque])

        def slope(_: float, y: FloatArray, torque: float = torque) -> list[float]:
            return [y[1], (torque - OWN.torque(y[1], y[2])) / inertia, OWN.rate(y[1], y[2])]

        y = solve_ivp(slope, (0.0, T), y, method="Radau", rtol=1e-8, atol=[1e-12, 1e-11, 1e-8]).y[:, -1]
        largest = max(largest, abs(y[1]))
    assert largest > 0.1


def test_when_the_torque_is_below_the_break_away_torque_expect_it_to_stay_where_it_is_and_above_to_slide() -> None:
    """Also under a torque that dithers: the bristle does not creep."""
    rng = np.random.default_rng(1)
    session, _ = one_joint(OWN)
    held = []
    for k in range(800):
        held.append(float(session.angle[0]) - 0.1)
        dither = 0.1 * rng.choice([-1.0, 1.0]) if k >= 200 else 0.0
        session.advance([(0.6 * min(k / 200, 1.0) + dither) * OWN.breakaway])
    assert np.abs(held).max() <= OWN.presliding
    assert abs(np.mean(held[-100:]) - np.mean(held[300:400])) < 0.02 * OWN.presliding
    for torque, slides in ((0.97, False), (1.03, True)):
        session, _ = one_joint(OWN)
        for k in range(400):  # slowly, so that it does not swing beyond
            session.advance([min(k / 200, 1.0) * torque * OWN.breakaway])
        assert (abs(float(session.angle[0]) - 0.1) > 10 * OWN.presliding) == slides


def test_when_a_spring_pulls_it_slowly_expect_the_slips_of_karnopps_friction() -> None:
    """They differ by what the bristle gives and by the speed at which friction has fallen, both small here."""
    bristle, T = Bristle(0.0, 2.0, 3.6, 2e-3, 1e-5, 100.0), 2e-4
    session, inertia = one_joint(bristle, T=T)
    K, pull, slipping, slips = 200.0, 0.3, False, []
    for k in range(6500):
        angle, time = float(session.angle[0]) - 0.1, k * T
        if (float(session.speed[0]) > 1e-2) != slipping:
            slipping = not slipping
            slips.append((time, angle))
        session.advance([K * (pull * time - angle)])
    begun, sizes = karnopp_pulled(inertia, bristle, stiffness=K, pull=pull, time_s=1.3)
    starts, ends = slips[::2], slips[1::2]
    assert len(begun) >= 3
    assert len(starts) in (len(begun), len(begun) - 1)
    for k, ((time, angle), (_, end)) in enumerate(zip(starts, ends, strict=False)):
        assert time == pytest.approx(begun[k], abs=0.03 * (begun[1] - begun[0]))
        assert end - angle == pytest.approx(sizes[k], rel=0.05)


def test_when_it_slides_freely_expect_it_to_stop_where_coulombs_torque_stops_it() -> None:
    content = scenario(plant_document(level_tree(1, 5), "tree", replace(OWN, viscous=0.0, breakaway=2.0)))
    content["initial"]["speed_rad_s"] = [1.0]
    session = _runtime.PlantSession(parsed(content), 1e-3)
    inertia = float(level_tree(1, 5).inertia(np.zeros(1))[0, 0])
    speeds = []
    for _ in range(int(1000 * inertia / 2.0) + 50):
        speeds.append(float(session.speed[0]))
        session.advance([0.0])
    assert float(session.angle[0]) - 0.1 == pytest.approx(inertia / 2.0 / 2.0, abs=5.0 * OWN.presliding)
    assert abs(float(session.speed[0])) < 1e-5
    assert all(after <= before + 1e-9 for before, after in pairwise(speeds) if after > 1e-3)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"breakaway_nm": 1.9}, r"joints\[1\]\.stick_slip\.breakaway_nm"),
        ({"presliding_rad": 0.0}, r"joints\[1\]\.stick_slip\.presliding_rad"),
        ({"presliding_damping_nm_s": -1.0}, r"joints\[1\]\.stick_slip\.presliding_damping_nm_s"),
        ({"stribeck_speed_rad_s": 0.0}, r"joints\[1\]\.stick_slip\.stribeck_speed_rad_s"),
        (None, r"joints\[1\]\.friction_coulomb_nm"),
    ],
)
def test_when_stick_slip_is_none_expect_it_refused_by_name_on_both_sides(
    change: dict[str, float] | None, field: str
) -> None:
    content = scenario(plant_document(level_tree(2, 5), "tree", OWN))
    joint = content["plant"]["joints"][1]
    if change is None:
        joint["friction_coulomb_nm"] = 0.0
    else:
        joint["stick_slip"] = joint["stick_slip"] | change
    for read in (lambda tree: _runtime.Scenario.parse(canonical_json(tree)), Scenario.from_document):
        with pytest.raises(InputError, match=field):
            read(content)


def test_when_a_robot_sticks_expect_its_plants_to_and_mujoco_refused() -> None:
    for robot in (small_robot(coulomb_nm=0.5), elastic_ur5()):
        trajectory = rest("still", len(robot.joints), 0.1)
        smooth = build_scenario(robot, trajectory, plant="nominal").to_document()["plant"]["joints"]
        assert not any("stick_slip" in joint for joint in smooth)
        sticking = build_scenario(robot.sticking(1.5), trajectory, plant="nominal")
        for joint in sticking.to_document()["plant"]["joints"]:
            own = joint["stick_slip"]
            assert own["breakaway_nm"] == 1.5 * joint["friction_coulomb_nm"]
            assert {**joint, "stick_slip": None} in [{**other, "stick_slip": None} for other in smooth]
    content = scenario(plant_document(level_tree(2, 5), "tree", OWN), {"kind": "mujoco", "steps_per_sample": 4})
    with pytest.raises(InputError, match=r"integrator\.kind: got mujoco, expected ida or rk4 with joints that stick"):
        Scenario.from_document(content)
    with pytest.raises(InputError, match=r"friction\.breakaway|breakaway: got 0\.9"):
        small_robot(coulomb_nm=0.5).sticking(0.9)
