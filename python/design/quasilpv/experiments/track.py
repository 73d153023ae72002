"""Tracking experiments in one process: a scenario, a controller, one closed-loop run, its numbers."""

from __future__ import annotations

import os
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, write_artifact
from quasilpv.artifact.envelope import OperatingEnvelope
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.robot import read_mechanism
from quasilpv.errors import InputError
from quasilpv.experiments.disturbance import true_disturbance
from quasilpv.experiments.metrics import compute_metrics
from quasilpv.experiments.mujoco_plant import MujocoPlant
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import RunSetup
from quasilpv.scenarios import (
    MujocoIntegrator,
    Sensors,
    TrackingExperiment,
    build_scenario,
    read_scenario,
    write_scenario,
)
from quasilpv.systems.robots.drawing import Drawing
from quasilpv.systems.robots.registry import AnyRobot, all_robots
from quasilpv.telemetry import LOG_NAME, Mode, RunHeader
from quasilpv.telemetry.recording import RunDocuments, write_run
from quasilpv.trajectories import write_trajectory

TRAJECTORY_NAME = "trajectory.json"
SCENARIO_NAME = "scenario.json"
TURN = 2.0 * pi


def robot_of(artifact: Artifact) -> AnyRobot:
    """The robot of the registry that an artifact was designed for.

    Raises:
        InputError: the registry does not know it, or knows another one by this name.
    """
    known = {entry.id: entry for entry in all_robots()}
    source = known.get(artifact.robot.id)
    if source is None:
        expected = f"one of the registry, {', '.join(known)}, or the robot itself beside the artifact"
        raise InputError(artifact.name, "robot.id", artifact.robot.id, expected)
    return require_robot_of(artifact, source)


def require_robot_of(artifact: Artifact, source: AnyRobot) -> AnyRobot:
    """The robot, if an artifact was designed for it.

    Raises:
        InputError: another robot, or another set of payloads.
    """
    if artifact.robot.id != source.id:
        raise InputError(artifact.name, "robot.id", artifact.robot.id, source.id)
    own = read_mechanism(source.model.parameters_document(), source=source.id)
    for field, same in (
        ("robot.parameters", artifact.mechanism == own),
        ("payloads", canonical_json(artifact.payloads) == canonical_json(source.payloads.to_document())),
    ):
        if not same:
            expected = f"those of {source.id} as it is known here, or the robot itself beside the artifact"
            raise InputError(artifact.name, field, "others", expected)
    return source


@dataclass(frozen=True)
class RunFiles:
    """The files of one run, as the executables and the bindings read them.

    Attributes:
        artifact: the controller.
        trajectory: the reference.
        scenario: the experiment, true plant included.
    """

    artifact: Path
    trajectory: Path
    scenario: Path


def write_run_files(folder: Path, setup: RunSetup) -> RunFiles:
    """Write artifact, trajectory and scenario of one run into ``folder``.

    Raises:
        InputError: the controller is for another robot, the reference shorter than its sample or beyond the motions
            the controller is proved for, or the folder cannot be written.
    """
    experiment, artifact = setup.experiment, setup.artifact
    require_fit(experiment, artifact)
    if experiment.trajectory.duration_s < artifact.sample_period_s:
        got, expected = (
            f"{experiment.trajectory.duration_s:g} s",
            f"at least one sample, {artifact.sample_period_s:g} s",
        )
        raise InputError(experiment.name, "duration_s", got, expected)
    _require_motion_limits(artifact, experiment)
    scenario = build_scenario(
        experiment.robot,
        experiment.trajectory,
        plant=setup.plant,
        sensors=setup.sensors,
        external_torque=experiment.external_torque,
        transport_delay_s=setup.transport_delay_s,
        initial_angle_rad=experiment.initial_angle_rad,
        initial_speed_rad_s=experiment.initial_speed_rad_s,
    )
    return RunFiles(
        artifact=write_artifact(folder, artifact)[0],
        trajectory=write_trajectory(folder / TRAJECTORY_NAME, experiment.trajectory),
        scenario=write_scenario(folder / SCENARIO_NAME, scenario),
    )


def require_fit(experiment: TrackingExperiment, artifact: Artifact) -> None:
    """Raise InputError for a controller of another robot than that of the experiment."""
    if artifact.robot.id != experiment.robot.id:
        expected = f"{experiment.robot.id}, which {experiment.name} is for"
        raise InputError(artifact.name, "robot.id", artifact.robot.id, expected)


def _require_motion_limits(artifact: Artifact, experiment: TrackingExperiment) -> None:
    """Raise InputError where a reference leaves what a law in motion is proved for, and the run time enforces."""
    limits = getattr(artifact.law, "motion_limits", None)
    if limits is None:
        return
    trajectory, T = experiment.trajectory, artifact.sample_period_s
    for k in range(int(trajectory.duration_s / T) + 1):
        at = trajectory.evaluate(k * T)
        for j, ((low, high), fastest) in enumerate(zip(limits.angle_rad, limits.speed_rad_s, strict=True)):
            where = f"law.motion_limits of joint {j}"
            if abs(at.speed[j]) > fastest:
                got = f"{abs(at.speed[j]):.3g} rad/s at {k * T:.3f} s of {experiment.name}"
                raise InputError(artifact.name, where, got, f"at most {fastest:g} rad/s: a slower reference")
            if not low <= at.angle[j] <= high and high - low < TURN:
                got = f"{at.angle[j]:.4g} rad at {k * T:.3f} s of {experiment.name}"
                raise InputError(artifact.name, where, got, f"an angle in [{low:g}, {high:g}]")


def track(setup: RunSetup, folder: Path) -> TrackResult:
    """Run one controller on one experiment in closed loop, in this process.

    Args:
        setup: what runs.
        folder: where the run's files and its log are written; the run reads them from there.

    Raises:
        InputError: robot and controller do not fit, or the folder cannot be written.
        PlantError: the plant could not be integrated.
    """
    files = write_run_files(folder, setup)
    columns = closed_loop(files)
    if setup.log:
        write_run(folder / LOG_NAME, run_documents("in-process", files, setup), columns)
    return summarise(run_from_columns(columns, setup.artifact.joints, setup.artifact.sample_period_s), setup)


def closed_loop(files: RunFiles) -> dict[str, FloatArray]:
    """The columns of a run, by name: (N,) or (N, n).

    Raises:
        InputError: a file cannot be read, they do not fit each other, or MuJoCo is asked for and not installed.
        PlantError: the plant could not be integrated.
    """
    # As bytes: a name need not be text.
    artifact = _runtime.Artifact.load(os.fsencode(files.artifact))
    loaded = (
        artifact,
        _runtime.Trajectory.load(os.fsencode(files.trajectory)),
        _runtime.Scenario.load(os.fsencode(files.scenario)),
    )
    scenario = read_scenario(files.scenario)
    if not isinstance(scenario.integrator, MujocoIntegrator):
        return _runtime.run_closed_loop(*loaded)
    plant = MujocoPlant(scenario, artifact.sample_period_s)
    with plant.running():
        return _runtime.run_closed_loop(*loaded, advance=plant.advance)


def disturbance_beyond_limits(experiment: TrackingExperiment, artifact: Artifact) -> str | None:
    """Half a line if the external torque of a joint exceeds what its actuator has; None if all can be withstood."""
    peak = np.zeros(experiment.robot.model.joints)
    for term in experiment.external_torque:
        peak[term.joint] += abs(term.amplitude_nm)
    limit = np.array(artifact.limits.torque_nm)
    joint = int(np.argmax(peak / limit))
    if peak[joint] <= limit[joint]:
        return None
    return f"an external torque of {peak[joint]:.4g} N m on joint {joint}, whose torque limit is {limit[joint]:.4g} N m"


def start_outside_domain(experiment: TrackingExperiment, artifact: Artifact) -> str | None:
    """Half a line if a joint starts where no controller over a wire would: outside the operating domain; else None."""
    start = experiment.initial_angle_rad or experiment.trajectory.evaluate(0.0).angle
    for joint, (angle, (low, high)) in enumerate(zip(start, artifact.domain.angle_rad, strict=True)):
        if high - low < 2.0 * np.pi and not low <= angle <= high:
            interval = f"outside its operating domain, {low:.4g} to {high:.4g} rad"
            return f"joint {joint} starts at {angle:.4g} rad, {interval}: there nothing is proved"
    return None


def run_documents(mode: Mode, files: RunFiles, setup: RunSetup) -> RunDocuments:
    """What the log of a run says of it before the first sample.

    Args:
        mode: how the run was made.
        files: of the run.
        setup: what ran.
    """
    header = RunHeader(mode=mode, controller=setup.row.controller)
    return RunDocuments(header, setup.artifact, setup.experiment.trajectory, read_scenario(files.scenario))


def run_from_columns(columns: dict[str, FloatArray], joints: int, sample_period_s: float) -> Run:
    """The record of a run from the columns the run-time side names.

    Args:
        columns: by name, shape (N,) or (N, n).
        joints: n.
        sample_period_s: T.
    """

    def per_joint(name: str) -> FloatArray:
        return columns[name].reshape(-1, joints)

    return Run(
        sample_period_s=sample_period_s,
        time_s=columns["time_s"],
        reference_angle_rad=per_joint("reference_angle_rad"),
        reference_speed_rad_s=per_joint("reference_speed_rad_s"),
        true_angle_rad=per_joint("angle_rad"),
        true_speed_rad_s=per_joint("speed_rad_s"),
        true_acceleration_rad_s2=per_joint("acceleration_rad_s2"),
        measured_angle_rad=per_joint("measured_angle_rad"),
        estimated_angle_rad=per_joint("estimated_angle_rad"),
        estimated_speed_rad_s=per_joint("estimated_speed_rad_s"),
        estimated_disturbance=per_joint("estimated_disturbance"),
        filtered_disturbance=per_joint("filtered_disturbance"),
        torque_nm=per_joint("torque_applied_nm"),
        flags=columns["flags"].astype(np.int64),
        premise_excess=columns["premise_excess"],
    )


def summarise(run: Run, setup: RunSetup) -> TrackResult:
    """The numbers of a run, however it was made."""
    return summarise_as(
        run,
        setup.experiment.name,
        setup.experiment.robot.model,
        setup.artifact,
        plant=setup.plant,
        sensors=setup.sensors,
        variant=setup.row,
    )


def summarise_as(
    run: Run,
    name: str,
    mechanism: Drawing,
    artifact: Artifact,
    *,
    plant: str,
    sensors: Sensors,
    variant: Variant,
) -> TrackResult:
    """The numbers of a run that is known by its name and its robot only; other arguments as of `RunSetup`.

    Args:
        run: the record.
        name: of the experiment.
        mechanism: what moves the tool; its masses do not matter.
        artifact, plant, sensors, variant: as of `RunSetup`; the plant by its label.
    """
    actual, wanted = mechanism.tool_path(run.true_angle_rad), mechanism.tool_path(run.reference_angle_rad)
    runtime = _runtime.Artifact.parse(canonical_json(artifact.to_document()), artifact.name)
    return TrackResult(
        scenario=name,
        variant=variant,
        rate_hz=round(1.0 / artifact.sample_period_s, 6),
        plant=plant,
        velocity_noise_rad_s=sensors.velocity_noise_rad_s,
        metrics=compute_metrics(run, actual - wanted, has_premises=bool(artifact.programs)),
        worst_growth_rate_per_s=worst_growth_rate(artifact),
        run=run,
        robot=mechanism,
        torque_limit_nm=np.array(artifact.limits.torque_nm),
        tool_position_m=actual,
        reference_position_m=wanted,
        true_disturbance=true_disturbance(run, artifact, runtime),
        envelope=OperatingEnvelope.of(artifact),
    )


def worst_growth_rate(artifact: Artifact) -> float | None:
    """Worst growth rate (1/s, half a sample of delay included) in the design's report; ``None`` if it has no report."""
    report = (artifact.verification or {}).get("report", {})
    rate = report.get("worst_growth_rate_per_s") if isinstance(report, dict) else None
    return None if rate is None else float(rate)
