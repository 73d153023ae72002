"""The plant with elastic joints against MuJoCo with two bodies per joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from reference.elastic_mujoco import motion
from reference.elastic_robots import elastic_ur5
from reference.elastic_tree import ElasticArm
from reference.random_trees import random_tree

T, SAMPLES = 2e-3, 60


def drawn_arm(n: int, seed: int) -> ElasticArm:
    """Oblique axes, soft gears: steps are long enough to leave something to see."""
    rng = np.random.default_rng(seed)
    drawn = random_tree(rng, n, sliding=0.0)
    joints = tuple(replace(joint, rotor_inertia_kg_m2=float(rng.uniform(0.1, 0.5))) for joint in drawn.joints)
    tree = replace(drawn, joints=joints)
    return ElasticArm(tree, rng.uniform(3e3, 9e3, n), rng.uniform(0.5, 3.0, n), rng.uniform(0.2, 2.0, n), np.zeros(n))


def ur5_arm() -> ElasticArm:
    """The UR5 with gears, its damping and viscous friction."""
    robot = elastic_ur5()
    drives = [joint.drive for joint in robot.joints if joint.drive is not None]
    stiffness = np.array([drive.stiffness_nm_rad[0] for drive in drives])
    viscous = np.array([joint.friction_viscous_nm_s for joint in robot.joints])
    return ElasticArm(robot.tree, stiffness, 1.5e-4 * stiffness, viscous, np.zeros(6))


def by_ida(arm: ElasticArm, q: FloatArray, torques: FloatArray) -> FloatArray:
    """Angles of links and motors at the samples, (N + 1, 2 n)."""
    n = q.size
    scenario: dict[str, Any] = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": "elastic",
        "duration_s": 1.0,
        "plant": arm.plant_document("both"),
        "integrator": {"kind": "ida", "relative_tolerance": 1e-12, "absolute_tolerance": 1e-13},
        "external_torque": [],
        "sensors": {"encoder_bits": 0, "velocity_noise_rad_s": 0.0, "seed": 1},
        "transport_delay_s": 0.0,
        "initial": {"angle_rad": q.tolist(), "speed_rad_s": [0.0] * n},
    }
    session = _runtime.PlantSession(_runtime.Scenario.parse(canonical_json(scenario)), T)
    angles = []
    for torque in [*torques, None]:
        angles.append(np.concatenate([session.gears["link_angle_rad"], session.gears["motor_angle_rad"]]))
        if torque is not None:
            session.advance(torque)
    return np.array(angles)


@pytest.mark.full
@pytest.mark.parametrize(("joints", "coarsest"), [(1, 1), (3, 4), (5, 4), ("ur5", 8)])
def test_links_and_motors_move_as_under_ida_and_the_difference_falls_with_the_fourth_power_of_the_step(
    joints: int | Literal["ur5"], coarsest: int
) -> None:
    """Below the coarsest step MuJoCo diverges; with the shortest the difference is above IDA's own error."""
    arm = ur5_arm() if joints == "ur5" else drawn_arm(joints, joints)
    n = arm.tree.order
    q = np.linspace(0.3, -0.5, n)
    weight = arm.tree.gravity(q)
    start = np.concatenate([q, q + weight / arm.stiffness])
    torques = weight + 8.0 * np.sin(40.0 * T * np.arange(SAMPLES)[:, None] + np.arange(n))
    exact = by_ida(arm, q, torques)
    wound = exact[:, n:] - exact[:, :n]
    assert np.abs(exact - exact[0]).max() > 1e-2
    assert np.ptp(wound, axis=0).max() > 3e-4
    assert np.ptp(wound, axis=0).min() > 1e-6
    errors = [
        np.abs(motion(arm, start, torques, T, steps) - exact).max() for steps in (coarsest, 2 * coarsest, 4 * coarsest)
    ]
    print(joints, [f"{error:.2g} rad" for error in errors])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((ratios > 10.0) & (ratios < 24.0)), errors
    assert errors[-1] < 1e-7
