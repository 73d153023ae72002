"""How well constrained plants keep their constraints in closed loop.

The record of a run holds driven joints only. The plant, in its form of index 1, is therefore integrated once more under
the torques of the record, by one Runge-Kutta step of order four per sample and without projection, so that nothing
hides a drift.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.reproduction.closed_loops import Outcome
from quasilpv.scenarios import build_scenario, tracking_experiment
from quasilpv.systems.robots.fivebar import RhombicFiveBar
from quasilpv.systems.robots.rolling_disc import RollingDisc


@dataclass(frozen=True, eq=False)
class Replay:
    """A plant integrated under the torques of a run.

    Attributes:
        time_s: (N,).
        states: (N, size) of the plant.
        torque_nm: (N, joints) of the record.
        angle_rad: (N, joints) of the record, the integration of which the states have to follow.
    """

    time_s: FloatArray
    states: FloatArray
    torque_nm: FloatArray
    angle_rad: FloatArray


@dataclass(frozen=True, eq=False)
class Constraint:
    """A constraint along a run.

    Attributes:
        time_s: (N,).
        error: (N,) its absolute value.
        replay_deviation_rad: largest difference of the driven joints from those of the record.
    """

    time_s: FloatArray
    error: FloatArray
    replay_deviation_rad: float


def closure_along(closed_loop: Outcome, passive_length_m: float) -> Constraint:
    """|h| (m) along the closed loop of a five-bar robot, run again with passive links of another length.

    Args:
        closed_loop: of a five-bar robot.
        passive_length_m: b; everything else of the plant stays, and so does the controller.
    """
    scenario, model = _scenario(closed_loop)
    assert isinstance(model, RhombicFiveBar)
    scenario["plant"]["passive"]["length_m"] = passive_length_m
    replay = _replayed(closed_loop, scenario)[0]
    linkage = replace(model.linkage, passive=replace(model.linkage.passive, length_m=passive_length_m))
    error = np.array([np.linalg.norm(linkage.closure(phi)) for phi in replay.states[:, :4]])
    deviation = float(np.abs(replay.states[:, :2] - replay.angle_rad).max())
    return Constraint(replay.time_s, error, deviation)


def rolling_along(closed_loop: Outcome) -> tuple[Replay, Constraint]:
    """States (x_1, x_2, x_3, lambda) and |x_2 - r x_3| (m/s) along the closed loop of the rolling disc.

    Args:
        closed_loop: of the rolling disc.
    """
    scenario, model = _scenario(closed_loop)
    assert isinstance(model, RollingDisc)
    replay, plant = _replayed(closed_loop, scenario)
    contact = [
        plant.make_consistent(time_s, state, torque)[0][3]
        for time_s, state, torque in zip(replay.time_s, replay.states, replay.torque_nm, strict=True)
    ]
    replay = replace(replay, states=np.column_stack([replay.states[:, :3], contact]))
    x1, x2, x3, _ = replay.states.T
    deviation = float(np.abs(x1 / model.radius_m - replay.angle_rad[:, 0]).max())
    return replay, Constraint(replay.time_s, np.abs(x2 - model.radius_m * x3), deviation)


def _scenario(closed_loop: Outcome) -> tuple[dict[str, Any], Any]:
    """The scenario of a run as a document that may be changed, and the model of its robot."""
    loop, experiment = closed_loop.loop, tracking_experiment(closed_loop.loop.scenario)
    scenario = build_scenario(
        experiment.robot,
        experiment.trajectory,
        plant="perturbed" if loop.plant == "perturbed" else "nominal",
        sensors=loop.sensors,
        external_torque=experiment.external_torque,
        initial_angle_rad=experiment.initial_angle_rad,
        initial_speed_rad_s=experiment.initial_speed_rad_s,
    )
    return scenario.to_document(), experiment.robot.model


def _replayed(closed_loop: Outcome, document: dict[str, Any]) -> tuple[Replay, _runtime.Plant]:
    """Close the loop on a scenario and integrate its plant again."""
    scenario = _runtime.Scenario.parse(canonical_json(document))
    trajectory = tracking_experiment(closed_loop.loop.scenario).trajectory
    columns = _runtime.run_closed_loop(
        _runtime.Artifact.parse(canonical_json(closed_loop.artifact.to_document())),
        _runtime.Trajectory.parse(canonical_json(trajectory.to_document())),
        scenario,
    )
    time_s = columns["time_s"]
    angle, speed, torque = (
        columns[name].reshape(len(time_s), -1) for name in ("angle_rad", "speed_rad_s", "torque_applied_nm")
    )
    plant = _runtime.Plant(scenario)
    states = [plant.initial_state(angle[0], speed[0])]
    period = closed_loop.artifact.sample_period_s
    for t, held in zip(time_s[:-1], torque[:-1], strict=True):
        states.append(_runge_kutta_step(plant, float(t), states[-1], held, period))
    return Replay(time_s, np.array(states), torque, angle), plant


def _runge_kutta_step(
    plant: _runtime.Plant, t: float, state: FloatArray, torque: FloatArray, step: float
) -> FloatArray:
    half = 0.5 * step
    first = plant.derivative(t, state, torque)
    second = plant.derivative(t + half, state + half * first, torque)
    third = plant.derivative(t + half, state + half * second, torque)
    fourth = plant.derivative(t + step, state + step * third, torque)
    return np.asarray(state + step / 6.0 * (first + 2.0 * (second + third) + fourth))
