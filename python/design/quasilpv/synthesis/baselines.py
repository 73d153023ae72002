"""The controllers the default design is compared with, with the gains of the thesis.

All place a triple pole at ``w = 15 pi`` rad/s: PID with feedforward through the largest diagonal inertia of each joint
(Dehak 2022, III.54-III.55), computed torque through the inertia matrix (III.56-III.57), without and with a disturbance
observer (Mohammadi et al. 2013). They read measured speeds, noisy and filtered.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.synthesis.acceleration_design import Progress, no_progress
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign, inertia_table, premise_and_gravity
from quasilpv.systems.registry import Robot

BANDWIDTH_RAD_S = 15.0 * math.pi
"""Triple pole of all three baselines: reproduces every printed digit of III.55 and III.57."""

VELOCITY_FILTER_TIME_CONSTANT_S = 2e-3
"""First-order filter of the measured speed; the thesis names the filter, not its time constant."""

DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S = 250.0
"""The thesis gives no gain for the observer. With the full payload the loop of integral action and observer is only
conditionally stable: slower observers saturate the actuators on the default scenarios, and 250 rad/s is the slowest
multiple of 50 that does not; its torque activity is about that of the default design."""


def pid(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PID with feedforward: ``kp = 3 a w^2``, ``kd = 3 a w``, ``ki = a w^3``, a the largest diagonal inertia.

    Every diagonal entry of the inertia of a serial arm is largest where all cosines are 1.
    """
    w = BANDWIDTH_RAD_S
    stretched = np.diag(robot.model.inertia(np.zeros(robot.model.joints)))
    symbolic = robot.model.symbolic
    speeds = sp.Matrix(reference_speeds(robot))
    law = {
        "kind": "pid",
        "kp": (3.0 * w**2 * stretched).tolist(),
        "kd": (3.0 * w * stretched).tolist(),
        "ki": (w**3 * stretched).tolist(),
        "velocity_filter_time_constant_s": VELOCITY_FILTER_TIME_CONSTANT_S,
        "inertia": inertia_table(robot),
    }
    return _design(robot, specification, law, {"coriolis_reference": tuple(symbolic.coriolis * speeds)})


def computed_torque(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Computed torque without disturbance observer."""
    return _computed_torque(robot, specification, "ctc", 0.0)


def computed_torque_with_observer(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque with a disturbance observer of `DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S`."""
    return _computed_torque(robot, specification, "ctc-dob", DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S)


def _computed_torque(robot: Robot, specification: Specification, kind: str, bandwidth: float) -> TrackingDesign:
    w, n = BANDWIDTH_RAD_S, robot.model.joints
    symbolic = robot.model.symbolic
    law = {
        "kind": kind,
        "gp": [3.0 * w**2] * n,
        "gd": [3.0 * w] * n,
        "gi": [w**3] * n,
        "velocity_filter_time_constant_s": VELOCITY_FILTER_TIME_CONSTANT_S,
        "disturbance_observer_bandwidth_rad_s": bandwidth,
        "inertia": inertia_table(robot),
    }
    return _design(robot, specification, law, {"coriolis": tuple(symbolic.coriolis * sp.Matrix(symbolic.omega))})


def _design(
    robot: Robot, specification: Specification, law: dict[str, Any], expressions: dict[str, tuple[sp.Expr, ...]]
) -> TrackingDesign:
    numbers = {name: value for name, value in law.items() if name != "inertia"}
    inputs = {"controller": law["kind"], "rate_hz": specification.rate_hz, **numbers}
    return TrackingDesign(
        controller=law["kind"],
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law=law,
        expressions={**premise_and_gravity(robot), **expressions},
        inputs=inputs,
    )


def reference_speeds(robot: Robot) -> tuple[sp.Symbol, ...]:
    """The symbols of the reference joint speeds r'_1 ... r'_n."""
    return sp.symbols(f"rho_1:{robot.model.joints + 1}", real=True)  # type: ignore[no-any-return]
