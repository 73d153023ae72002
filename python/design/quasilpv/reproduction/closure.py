"""How well a five-bar robot in closed loop stays closed: |h| along a run.

The record of a run holds driven angles only. The constrained plant, index 1 with Baumgarte's stabilisation, is
therefore integrated once more under the torques of the record, by one Runge-Kutta step of order four per sample and
without projection, so that nothing hides a drift.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from quasilpv import _runtime
from quasilpv.artifact.canonical import canonical_json
from quasilpv.experiments.run import FloatArray
from quasilpv.experiments.track import TrackingExperiment
from quasilpv.reproduction.closed_loops import Outcome
from quasilpv.scenarios import build_scenario
from quasilpv.systems.fivebar import RhombicFiveBar


@dataclass(frozen=True, eq=False)
class Closure:
    """The constraint along a run.

    Attributes:
        time_s: (N,).
        error_m: (N,) |h|.
        replay_deviation_rad: largest difference of the driven angles from those of the record.
    """

    time_s: FloatArray
    error_m: FloatArray
    replay_deviation_rad: float


def closure_along(closed_loop: Outcome, passive_length_m: float) -> Closure:
    """The closed loop again with passive links of another length, and the constraint along it.

    Args:
        closed_loop: of a five-bar robot with full payload.
        passive_length_m: b; everything else of the plant stays, and so does the controller.
    """
    experiment = TrackingExperiment.registered(closed_loop.loop.scenario)
    model = experiment.robot.model
    assert isinstance(model, RhombicFiveBar)
    document = build_scenario(
        experiment.robot,
        experiment.trajectory,
        plant="perturbed",
        sensors=closed_loop.loop.sensors,
        external_torque=experiment.external_torque,
    ).to_document()
    document["plant"]["passive"]["length_m"] = passive_length_m
    scenario = _runtime.Scenario.parse(canonical_json(document))
    columns = _runtime.run_closed_loop(
        _runtime.Artifact.parse(canonical_json(closed_loop.artifact.to_document())),
        _runtime.Trajectory.parse(canonical_json(experiment.trajectory.to_document())),
        scenario,
    )
    states = _replayed(scenario, columns, closed_loop.artifact.sample_period_s)
    linkage = replace(model.linkage, passive=replace(model.linkage.passive, length_m=passive_length_m))
    error = np.array([np.linalg.norm(linkage.closure(phi)) for phi in states[:, :4]])
    deviation = float(np.abs(states[:, :2] - columns["angle_rad"]).max())
    return Closure(columns["time_s"], error, deviation)


def _replayed(scenario: _runtime.Scenario, columns: dict[str, FloatArray], period_s: float) -> FloatArray:
    """States of the plant at the samples, (N, 10): phi, phi', lambda."""
    plant = _runtime.Plant(scenario)
    state = plant.initial_state(columns["angle_rad"][0], columns["speed_rad_s"][0])
    half, states = 0.5 * period_s, []
    for time_s, torque in zip(columns["time_s"], columns["torque_applied_nm"], strict=True):
        states.append(state)
        first = plant.derivative(time_s, state, torque)
        second = plant.derivative(time_s + half, state + half * first, torque)
        third = plant.derivative(time_s + half, state + half * second, torque)
        fourth = plant.derivative(time_s + period_s, state + period_s * third, torque)
        state = state + period_s / 6.0 * (first + 2.0 * (second + third) + fourth)
    return np.array(states)
