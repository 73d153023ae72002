"""Closed loops of the five-bar robot in numpy: shipped law, encoder, held torque, reduced plant, classical Runge-Kutta.

The plant is the general reduction of the constrained system (`FiveBarLinkage.reduced_dynamics`), not the closed form of
the rhombus that the designs know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, evaluate
from quasilpv.systems.robots.fivebar_linkage import FiveBarLinkage
from quasilpv.trajectories import Trajectory
from reference.checked import vertex_table
from reference.step import (
    ComputedTorque,
    DobAcceleration,
    DobTorque,
    OutputStage,
    Pid,
    Sample,
    SpeedFilter,
)

Torque = Callable[[float], FloatArray]
Law = DobAcceleration | DobTorque | Pid | ComputedTorque


def sines(terms: Sequence[tuple[float, float]]) -> Torque:
    """``amplitude * sin(frequency t)`` per joint, N m."""
    amplitude, frequency = np.array(terms).T
    return lambda time_s: np.asarray(amplitude * np.sin(frequency * time_s))


def shipped_law(artifact: Artifact) -> Law:
    """The law of an artifact, written out in numpy."""
    document, programs = artifact.content(), artifact.programs
    law, T, limits = document["law"], document["sample_period_s"], document["limits"]
    output = OutputStage(np.array(limits["torque_nm"]), np.array(limits["slew_nm_per_s"]), T)

    def gravity(angle: FloatArray) -> FloatArray:
        return evaluate(programs["gravity"], angle)

    def table(name: str) -> Callable[[FloatArray], FloatArray]:
        vertices = vertex_table(law[name])
        return lambda angle: vertices.evaluate(evaluate(programs["premises"], angle)[None])[0]

    def speed_torque(name: str) -> Callable[..., FloatArray]:
        return lambda *angles_and_speeds: evaluate(programs[name], *angles_and_speeds)

    def gains(*names: str) -> list[FloatArray]:
        return [np.array(law[name]) for name in names]

    inertia = table("inertia")
    if law["kind"] == "dob-acceleration":
        scalars = (law["feedback"][name] for name in ("kp", "kd", "ki"))
        observer, filter_time = tuple(law["observer"]), law["filter_time_constant_s"]
        return DobAcceleration(
            *scalars, observer, filter_time, inertia, gravity, output, law["disturbance_compensation"]
        )
    if law["kind"] == "dob-torque":
        tables = table("feedback"), table("observer")
        beta = table("premultiplication") if "premultiplication" in law else None
        return DobTorque(*tables, law["filter_time_constant_s"], inertia, gravity, output, beta)
    speed_filter = SpeedFilter(float(np.exp(-T / law["velocity_filter_time_constant_s"])))
    if law["kind"] == "pid":
        reference_torque = speed_torque("coriolis_reference")
        return Pid(*gains("kp", "kd", "ki"), inertia, reference_torque, gravity, speed_filter, output)
    bandwidth = law["disturbance_observer_bandwidth_rad_s"]
    coriolis = speed_torque("coriolis")
    return ComputedTorque(*gains("gp", "gd", "gi"), bandwidth, inertia, coriolis, gravity, speed_filter, output)


def track(
    artifact: Artifact,
    plant: FiveBarLinkage,
    trajectory: Trajectory,
    external: Torque,
    *,
    duration_s: float | None = None,
    encoder_bits: int = 20,
    speed_noise_rad_s: float = 0.05,
    delay_s: float = 0.0,
    substeps: int = 2,
) -> tuple[FloatArray, FloatArray]:
    """Tool error (N, 2), m, and torque (N, 2), N m, at the samples from t = 0."""
    law, T = shipped_law(artifact), artifact.sample_period_s
    rng = np.random.default_rng(1)
    count = 2.0 * np.pi / 2.0**encoder_bits
    start = trajectory.evaluate(0.0)
    state, torque = np.concatenate([start.angle, start.speed]), np.zeros(2)
    errors, torques = [], []

    def rate(time_s: float, at: FloatArray) -> FloatArray:
        M, bias, G = plant.reduced_dynamics(at[:2], at[2:])
        return np.concatenate([at[2:], np.linalg.solve(M, torque + external(time_s) - bias - G)])

    def advance(time_s: float, until_s: float, at: FloatArray) -> FloatArray:
        h = (until_s - time_s) / substeps
        for step in range(substeps if h > 0 else 0):
            t = time_s + step * h
            k1 = rate(t, at)
            k2 = rate(t + h / 2, at + h / 2 * k1)
            k3 = rate(t + h / 2, at + h / 2 * k2)
            k4 = rate(t + h, at + h * k3)
            at = at + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return at

    for k in range(round((duration_s or trajectory.duration_s) / T)):
        time_s = k * T
        reference = trajectory.evaluate(time_s)
        speed = state[2:] + speed_noise_rad_s * rng.standard_normal(2)
        answer = law.step(Sample(np.round(state[:2] / count) * count, speed, *reference))
        errors.append(plant.tool_position(state[:2]) - plant.tool_position(reference.angle))
        torques.append(answer.torque_applied)
        state = advance(time_s, time_s + delay_s, state)
        torque = answer.torque_applied
        state = advance(time_s + delay_s, time_s + T, state)
    return np.array(errors), np.array(torques)
