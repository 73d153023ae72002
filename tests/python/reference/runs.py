"""Records of runs that never happened, for what is computed from records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.experiments.metrics import compute_metrics
from quasilpv.experiments.result import Disturbance, TrackResult, Variant
from quasilpv.experiments.run import Run
from quasilpv.systems.robots.arm_parameters import Link
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.tree_mechanism import TreeMechanism


def synthetic_run(samples: int, joints: int) -> Run:
    """Smooth joint motions with small errors."""
    time_s = np.arange(samples, dtype=np.float64) * 1e-3
    phase = np.arange(joints)
    angle = np.sin(2.0 * time_s[:, None] + phase)
    speed = 2.0 * np.cos(2.0 * time_s[:, None] + phase)
    ripple = np.sin(90.0 * time_s[:, None] + phase)
    return Run(
        sample_period_s=1e-3,
        time_s=time_s,
        reference_angle_rad=angle,
        reference_speed_rad_s=speed,
        true_angle_rad=angle + 1e-5 * ripple,
        true_speed_rad_s=speed + 1e-3 * ripple,
        true_acceleration_rad_s2=-4.0 * angle,
        measured_angle_rad=angle + 1e-5 * ripple,
        estimated_angle_rad=angle,
        estimated_speed_rad_s=speed,
        estimated_disturbance=20.0 * ripple + 1.0,
        filtered_disturbance=20.0 * ripple,
        torque_nm=300.0 * ripple,
        flags=np.zeros(samples, dtype=np.int64),
        premise_excess=np.zeros(samples),
    )


def tool_position(angle: FloatArray) -> FloatArray:
    """A tool on a circle about (1.5, -1.5) m."""
    return np.stack([1.5 + 0.2 * np.cos(angle[:, 0]), -1.5 + 0.2 * np.sin(angle[:, 0])], axis=1)


def synthetic_robot(joints: int) -> PlanarSerialArm:
    """An arm of equal links."""
    link = Link(length_m=0.5, mass_kg=2.0, com_m=0.25, inertia_kg_m2=0.2)
    return PlanarSerialArm("synthetic", (link,) * joints)


def result_of_motion(robot: PlanarMechanism | TreeMechanism, run: Run, variant: Variant) -> TrackResult:
    """What a robot shows that makes the motions of a record."""
    plain = synthetic_result(variant, run.joints, run.time_s.size)
    tool, reference = robot.tool_path(run.true_angle_rad), robot.tool_path(run.reference_angle_rad)
    metrics = compute_metrics(run, tool - reference)
    return replace(plain, run=run, robot=robot, metrics=metrics, tool_position_m=tool, reference_position_m=reference)


def synthetic_result(variant: Variant, joints: int = 3, samples: int = 2000) -> TrackResult:
    """A result with every figure's data."""
    run = synthetic_run(samples, joints)
    return TrackResult(
        scenario="synthetic",
        variant=variant,
        rate_hz=1000.0,
        plant="perturbed",
        velocity_noise_rad_s=0.05,
        metrics=compute_metrics(run, tool_position(run.true_angle_rad) - tool_position(run.reference_angle_rad)),
        worst_growth_rate_per_s=None,
        run=run,
        robot=synthetic_robot(joints),
        torque_limit_nm=np.linspace(400.0, 350.0, joints),
        tool_position_m=tool_position(run.true_angle_rad),
        reference_position_m=tool_position(run.reference_angle_rad),
        true_disturbance=Disturbance(run.filtered_disturbance + 0.5, "rad/s²", "acceleration"),
    )
