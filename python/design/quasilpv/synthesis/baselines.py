"""The controllers the default design is compared with, with the gains of the thesis.

All place a triple pole at ``w = 15 pi`` rad/s: PID with feedforward through the largest diagonal inertia of each joint
(Dehak 2022, III.54-III.55), computed torque through the inertia matrix (III.56-III.57), without and with a disturbance
observer (Mohammadi et al. 2013). They read measured speeds, noisy and filtered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
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


@dataclass(frozen=True)
class Tuning:
    """The numbers of a baseline.

    Attributes:
        bandwidth_rad_s: w of the poles.
        integral_ratio: slowest pole over the others; 1 for a triple pole.
        velocity_filter_time_constant_s: of the measured speed.
        observer_bandwidth_rad_s: of the disturbance observer; 0 for none.
        inertia_scale: s, the design inertia over the nominal one. The feedforward of PID stays nominal.
        payload_fraction: of PID, whose gains per joint are in the ratios of the inertia with this payload.
    """

    bandwidth_rad_s: float = BANDWIDTH_RAD_S
    integral_ratio: float = 1.0
    velocity_filter_time_constant_s: float = VELOCITY_FILTER_TIME_CONSTANT_S
    observer_bandwidth_rad_s: float = 0.0
    inertia_scale: float = 1.0
    payload_fraction: float = 0.0

    def unit_gains(self) -> tuple[float, float, float]:
        """Gains (kp, kd, ki) per unit inertia: ``s^3 + kd s^2 + kp s + ki = (s + w)^2 (s + rho w)``."""
        w, rho = self.bandwidth_rad_s, self.integral_ratio
        return (1.0 + 2.0 * rho) * w**2, (2.0 + rho) * w, rho * w**3


def stretched_inertia(robot: Robot, payload_fraction: float) -> npt.NDArray[np.float64]:
    """Largest diagonal entries of the inertia with a payload, (n,): of a serial arm, where all cosines are 1.

    They are scaled so that their sum is that of the nominal arm: the payload changes their ratios only.
    """
    nominal = np.diag(robot.model.inertia(np.zeros(robot.model.joints)))
    if payload_fraction == 0.0:
        return nominal
    loaded = np.diag(robot.with_payload_fraction(payload_fraction).inertia(np.zeros(robot.model.joints)))
    return np.asarray(loaded * (nominal.sum() / loaded.sum()))


def pid(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PID with feedforward, gains of the thesis."""
    return pid_design(robot, specification, Tuning())


def computed_torque(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Computed torque without disturbance observer, gains of the thesis."""
    return computed_torque_design(robot, specification, Tuning())


def computed_torque_with_observer(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque with a disturbance observer of `DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S`."""
    tuning = Tuning(observer_bandwidth_rad_s=DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S)
    return computed_torque_design(robot, specification, tuning)


def pid_design(robot: Robot, specification: Specification, tuning: Tuning) -> TrackingDesign:
    """PID with feedforward: unit gains times s times the `stretched_inertia` of each joint."""
    symbolic = robot.model.symbolic
    speeds = sp.Matrix(reference_speeds(robot))
    per_joint = tuning.inertia_scale * stretched_inertia(robot, tuning.payload_fraction)
    gains = zip(("kp", "kd", "ki"), tuning.unit_gains(), strict=True)
    law = {
        "kind": "pid",
        **{name: (gain * per_joint).tolist() for name, gain in gains},
        "velocity_filter_time_constant_s": tuning.velocity_filter_time_constant_s,
        "inertia": inertia_table(robot),
    }
    return _design(robot, specification, law, {"coriolis_reference": tuple(symbolic.coriolis * speeds)})


def computed_torque_design(robot: Robot, specification: Specification, tuning: Tuning) -> TrackingDesign:
    """Computed torque, unit gains for every joint, with M = s M_nominal."""
    symbolic = robot.model.symbolic
    gains = zip(("gp", "gd", "gi"), tuning.unit_gains(), strict=True)
    law = {
        "kind": "ctc-dob" if tuning.observer_bandwidth_rad_s > 0.0 else "ctc",
        **{name: [gain] * robot.model.joints for name, gain in gains},
        "velocity_filter_time_constant_s": tuning.velocity_filter_time_constant_s,
        "disturbance_observer_bandwidth_rad_s": tuning.observer_bandwidth_rad_s,
        "inertia": inertia_table(robot, tuning.inertia_scale),
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
