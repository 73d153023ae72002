"""Drives that lag, simulated: a step in closed form, both integrators, and a loop that bears the lag it states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.release import to_artifact
from quasilpv.scenarios import MujocoIntegrator, Scenario, Sensors, build_scenario
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.synthesis.acceleration import tree_law
from quasilpv.synthesis.acceleration.search import Grid
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.trajectories import Trajectory
from reference.tree_artifacts import small_robot

T = 1e-3
NEAR = Grid((0.03, 0.15), (0.45, 0.76), (0.6, 1.2))
"""The best points of the whole grid, with and without lag."""

LAG_S = 2e-3
RK4 = {"kind": "rk4", "steps_per_sample": 20}
IDA = {"kind": "ida", "relative_tolerance": 1e-10, "absolute_tolerance": 1e-12}


def lagging(robot: SpatialRobot, lag_s: float = LAG_S) -> SpatialRobot:
    return replace(robot, lag_s=(0.0, lag_s))


def scenario(robot: SpatialRobot, trajectory: Trajectory, plant: Any = "perturbed") -> dict[str, Any]:
    sensors = Sensors(encoder_bits=20, velocity_noise_rad_s=0.0)
    return build_scenario(robot, trajectory, plant=plant, sensors=sensors, transport_delay_s=T / 2).to_document()


def parsed(content: dict[str, Any]) -> _runtime.Scenario:
    return _runtime.Scenario.parse(canonical_json(content))


@pytest.mark.parametrize("integrator", [IDA, RK4], ids=["ida", "rk4"])
def test_when_a_torque_steps_expect_the_closed_form_of_a_lag_and_two_integrators(integrator: dict[str, Any]) -> None:
    """About the vertical axis of the base: ``J q'' = u``, ``lag u' + u = 1``, other joints held by no torque."""
    robot = lagging(small_robot())
    weightless = replace(robot, tree=replace(robot.tree, gravity_m_s2=np.zeros(3)))
    still = Trajectory.through([[0.0] * 3, [0.0] * 3], [0.0, 1.0])
    content = {**scenario(weightless, still), "integrator": integrator, "transport_delay_s": 0.0}
    assert content["plant"]["lag_s"] == LAG_S
    for joint in content["plant"]["joints"]:
        joint |= {"friction_viscous_nm_s": 0.0, "friction_coulomb_nm": 0.0}
    content["sensors"] = {"encoder_bits": 0, "velocity_noise_rad_s": 0.0, "seed": 1}
    content["plant"]["joints"] = content["plant"]["joints"][:1]
    content["initial"] = {"angle_rad": [0.0], "speed_rad_s": [0.0]}
    session = _runtime.PlantSession(parsed(content), T)
    J = _runtime.Tree(
        {k: v for k, v in content["plant"].items() if k in ("kind", "gravity_m_s2")} | {"joints": bare(content)}
    )
    inertia = float(J.inertia([0.0])[0, 0])
    for k in range(30):
        t = k * T
        speed = (t - LAG_S * (1.0 - np.exp(-t / LAG_S))) / inertia
        angle = (t**2 / 2.0 - LAG_S * t + LAG_S**2 * (1.0 - np.exp(-t / LAG_S))) / inertia
        assert session.speed[0] == pytest.approx(speed, abs=1e-9)
        assert session.angle[0] == pytest.approx(angle, abs=1e-10)
        session.advance(np.array([1.0]))


def bare(content: dict[str, Any]) -> list[dict[str, Any]]:
    rubbing = ("friction_viscous_nm_s", "friction_coulomb_nm", "coulomb_speed_rad_s")
    return [{k: v for k, v in joint.items() if k not in rubbing} for joint in content["plant"]["joints"]]


def test_when_drives_lag_expect_the_law_designed_for_it_stable_and_one_for_none_not() -> None:
    robot = lagging(small_robot(coulomb_nm=0.3))
    ends = [[0.2, 0.3, -0.4], [0.6, -0.2, 0.3]]
    trajectory = Trajectory.through(ends, [0.0, 1.0])
    errors = []
    for designed_for in (robot, replace(robot, lag_s=(0.0, 0.0))):
        request = DesignRequest(designed_for, "dob-acceleration", specification_for(designed_for, torque_activity=0.05))
        with patch.object(tree_law, "GRID", NEAR):
            artifact = to_artifact(synthesise(request))
        run = _runtime.run_closed_loop(
            _runtime.Artifact.parse(canonical_json(artifact.to_document()), "test"),
            _runtime.Trajectory.parse(canonical_json(trajectory.to_document()), "test"),
            parsed(scenario(robot, trajectory)),
        )
        errors.append(np.abs(run["angle_rad"] - run["reference_angle_rad"]).max())
    assert errors[0] < 0.02
    assert errors[1] > 10.0 * errors[0]


def test_when_drives_lag_expect_mujoco_refused_by_name() -> None:
    content = scenario(lagging(small_robot()), Trajectory.through([[0.0] * 3, [0.1] * 3], [0.0, 1.0]))
    content["integrator"] = MujocoIntegrator().model_dump(mode="json")
    with pytest.raises(InputError, match=r"integrator\.kind: got mujoco, expected ida or rk4 with drives that lag"):
        Scenario.from_document(content, "scenario")
