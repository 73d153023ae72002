"""The controllers the default design is compared with, with the gains of the thesis.

All place a triple pole at a bandwidth w of the robot, 15 pi rad/s for the serial arms and 80 pi for the five-bar robot:
PID with feedforward through the largest inertia that each joint drives (Dehak 2022, III.54-III.55), computed torque
through the inertia matrix (III.56-III.57), without and with a disturbance observer (Mohammadi et al. 2013). They read
measured speeds, noisy and filtered. For the five-bar robot computed torque on the reduced model is the law (IV.78),
whose passive angles and speeds the rhombus gives in closed form; the printed k_d and g_d carry a factor 1e4 too much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from quasilpv.certificate.laws.ctc import CtcDobLaw, CtcLaw
from quasilpv.certificate.laws.pid import PidLaw
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign, inertia_table, premise_and_gravity
from quasilpv.systems.robots.registry import Robot

ARM_BANDWIDTH_RAD_S = 15.0 * math.pi

PRINTED_BANDWIDTHS_RAD_S = {"fivebar": 80.0 * math.pi}
"""Triple poles of the gains that Dehak (2022) prints, by robot, where they are not those of the arms."""

ARM_VELOCITY_FILTER_S = 2e-3
"""First-order filter of the measured speed at that bandwidth, faster in proportion for faster robots; the thesis names
the filter, not its time constant."""

DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S = 250.0
"""The thesis gives no gain for the observer. With the full payload the loop of integral action and observer is only
conditionally stable: slower observers saturate the actuators on the default scenarios, and 250 rad/s is the slowest
multiple of 50 that does not; its torque activity is about that of the default design."""


@dataclass(frozen=True)
class Tuning:
    """The numbers of a baseline.

    Attributes:
        bandwidth_rad_s: w of the poles.
        velocity_filter_time_constant_s: of the measured speed; 0 for no filter.
        integral_ratio: slowest pole over the others; 1 for a triple pole.
        observer_bandwidth_rad_s: of the disturbance observer; 0 for none.
        inertia_scale: s, the design inertia over the nominal one. The feedforward of PID stays nominal.
        payload_fraction: of PID, whose gains per joint are in the ratios of the inertia with this payload.
    """

    bandwidth_rad_s: float
    velocity_filter_time_constant_s: float = 0.0
    integral_ratio: float = 1.0
    observer_bandwidth_rad_s: float = 0.0
    inertia_scale: float = 1.0
    payload_fraction: float = 0.0

    @classmethod
    def printed(cls, robot: Robot, observer_bandwidth_rad_s: float = 0.0) -> Tuning:
        """The printed gains of a robot."""
        bandwidth = printed_bandwidth_rad_s(robot)
        filter_time = ARM_VELOCITY_FILTER_S * (ARM_BANDWIDTH_RAD_S / bandwidth)
        return cls(bandwidth, filter_time, observer_bandwidth_rad_s=observer_bandwidth_rad_s)

    def unit_gains(self) -> tuple[float, float, float]:
        """Gains (kp, kd, ki) per unit inertia: ``s^3 + kd s^2 + kp s + ki = (s + w)^2 (s + rho w)``."""
        w, rho = self.bandwidth_rad_s, self.integral_ratio
        return (1.0 + 2.0 * rho) * w**2, (2.0 + rho) * w, rho * w**3


def printed_bandwidth_rad_s(robot: Robot) -> float:
    """Triple pole of the gains that Dehak (2022) prints for a robot, rad/s; that of the arms if it prints none."""
    return PRINTED_BANDWIDTHS_RAD_S.get(robot.id, ARM_BANDWIDTH_RAD_S)


def stretched_inertia(robot: Robot, payload_fraction: float) -> npt.NDArray[np.float64]:
    """Largest inertias driven by the joints with a payload, (n,): of a serial arm, those of the stretched one.

    They are scaled so that their sum is that of the nominal robot: the payload changes their ratios only.
    """
    nominal = robot.model.driven_inertia
    if payload_fraction == 0.0:
        return nominal
    loaded = robot.with_payload_fraction(payload_fraction).driven_inertia
    return np.asarray(loaded * (nominal.sum() / loaded.sum()))


def pid(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """PID with feedforward, gains of the thesis."""
    return pid_design(robot, specification, Tuning.printed(robot))


def computed_torque(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Computed torque without disturbance observer, gains of the thesis."""
    return computed_torque_design(robot, specification, Tuning.printed(robot))


def computed_torque_with_observer(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque with a disturbance observer of `DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S`."""
    tuning = Tuning.printed(robot, DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S)
    return computed_torque_design(robot, specification, tuning)


def pid_design(robot: Robot, specification: Specification, tuning: Tuning) -> TrackingDesign:
    """PID with feedforward: unit gains times s times the `stretched_inertia` of each joint."""
    symbolic = robot.model.symbolic
    speeds = sp.Matrix(reference_speeds(robot))
    per_joint = tuning.inertia_scale * stretched_inertia(robot, tuning.payload_fraction)
    gains = zip(("kp", "kd", "ki"), tuning.unit_gains(), strict=True)
    law = {
        "kind": PidLaw.tag(),
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
        "kind": (CtcDobLaw if tuning.observer_bandwidth_rad_s > 0.0 else CtcLaw).tag(),
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
