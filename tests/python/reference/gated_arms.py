"""Closed forms and artifacts for tests of the robust gate, and its loop written out step by step in numpy."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.release import to_artifact
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.synthesis.tracking_design import TrackingDesign, inertia_table, premise_and_gravity
from quasilpv.systems.robots.arm_parameters import ActuatorLimits, Link, OperatingDomain, PayloadSet
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import Robot
from reference.checked import loop_data


def multiple_pole_loop(wc: float, wo: float, filter_s: float, T: float) -> AccelerationLoopData:
    """Continuous triple pole -wc for the feedback, sampled quadruple pole exp(-wo T) for the observer (Ackermann)."""
    A = np.array([[1, T, T**2 / 2, T**3 / 6], [0, 1, T, T**2 / 2], [0, 0, 1, T], [0, 0, 0, 1]])
    shifted = A - np.exp(-wo * T) * np.eye(4)
    observability = np.vstack([np.linalg.matrix_power(A, i)[0] for i in range(4)])
    predictor = np.linalg.matrix_power(shifted, 4) @ np.linalg.solve(observability, np.eye(4)[3])
    l1, l2, l3, l4 = np.linalg.solve(A, predictor).tolist()
    return AccelerationLoopData(T, -3 * wc**2, -3 * wc, -(wc**3), (l1, l2, l3, l4), filter_s)


def full_map(loop: AccelerationLoopData, coupling: FloatArray, delay_samples: float) -> FloatArray:
    """Per-sample map of n joints with ``theta'' = coupling a``, by running the law on every unit state.

    State: theta, omega, predicted angle, speed, disturbance and its rate, filtered disturbance, integral, and the
    commands of the samples before, newest first; each of size n. SI time.
    """
    n, T = len(coupling), loop.sample_period_s
    whole = math.floor(delay_samples)
    late = (delay_samples - whole) * T
    q = math.exp(-T / loop.filter_time_constant_s)
    l1, l2, l3, l4 = loop.observer

    def step(state: FloatArray) -> FloatArray:
        th, w, p1, p2, p3, p4, df, e_I, *old = state.reshape(-1, n)
        innovation = th - p1
        p1, p2, p3, p4 = p1 + l1 * innovation, p2 + l2 * innovation, p3 + l3 * innovation, p4 + l4 * innovation
        df = q * df + (1 - q) * p3
        a = loop.kp * p1 + loop.kd * p2 + loop.ki * e_I - (df if loop.disturbance_compensation else 0)
        e_I = e_I + T * th
        predicted = a + p3
        p1, p2, p3 = p1 + T * p2 + T**2 / 2 * predicted + T**3 / 6 * p4, p2 + T * predicted + T**2 / 2 * p4, p3 + T * p4
        commands = [a, *old]
        for command, duration in ((commands[whole + 1], late), (commands[whole], T - late)):
            pull = coupling @ command
            th, w = th + duration * w + duration**2 / 2 * pull, w + duration * pull
        return np.concatenate([th, w, p1, p2, p3, p4, df, e_I, *commands[: whole + 1]])

    return np.array([step(unit) for unit in np.eye(n * (9 + whole))]).T


def growth_rate(loop: AccelerationLoopData, inertia_ratio: float, delay_samples: float) -> float:
    """Numerical ``log(spectral radius) / T`` of one joint with ``M_t / M_n = inertia_ratio``."""
    eigenvalues = np.linalg.eigvals(full_map(loop, np.array([[1.0 / inertia_ratio]]), delay_samples))
    return float(np.log(np.abs(eigenvalues).max()) / loop.sample_period_s)


def artifact_document(robot: Robot, loop: AccelerationLoopData, inertia_scale: float = 1.0) -> dict[str, Any]:
    """The artifact of these gains for a robot, with the design inertia a multiple of the nominal one."""
    law = {
        "kind": "dob-acceleration",
        "feedback": {"kp": loop.kp, "kd": loop.kd, "ki": loop.ki},
        "observer": list(loop.observer),
        "filter_time_constant_s": loop.filter_time_constant_s,
        "disturbance_compensation": loop.disturbance_compensation,
        "inertia": inertia_table(robot, inertia_scale),
    }
    design = TrackingDesign(
        "dob-acceleration", robot, loop.sample_period_s, law, premise_and_gravity(robot), inputs={"purpose": "test"}
    )
    document = to_artifact(design).content()
    assert loop_data(document) == loop
    return document


@cache
def moving_design() -> TrackingDesign:
    """The five-bar's design with a motion claim, at 2 kHz."""
    return synthesise(DesignRequest.of("fivebar", "dob-moving", Specification(rate_hz=2000.0)))


@cache
def moving_five_bar() -> dict[str, Any]:
    """Its artifact, unchecked."""
    return to_artifact(moving_design()).content()


def quotients(subject: Robot, scale: float, count: int, seed: int) -> FloatArray:
    """``M_t^-1 M_n`` at random postures and payloads of the operating domain."""
    rng = np.random.default_rng(seed)
    low, high = np.array(subject.domain.angle_rad).T
    found = []
    for theta, fraction in zip(rng.uniform(low, high, (count, len(low))), rng.uniform(0, 1, count), strict=True):
        true = subject.with_payload_fraction(float(fraction)).inertia(theta)
        found.append(np.linalg.solve(true, scale * subject.model.inertia(theta)))
    return np.array(found)


def arm4() -> Robot:
    """Four uniform rods; the payload makes every link heavier and moves the last centre of mass outwards."""
    sizes = ((1.0, 5.0), (0.9, 4.9), (0.8, 4.2), (0.5, 2.0))
    links = tuple(Link(length, mass, length / 2, mass * length**2 / 3) for length, mass in sizes)
    angles = ((-0.3, 0.4), (0.96, 2.04), (-1.1, -0.44), (-0.5, 0.5))
    return Robot(
        id="arm4",
        summary="planar serial arm, 4 joints",
        model=PlanarSerialArm("arm4", links),
        domain=OperatingDomain(angles, ((-1.0, 1.0),) * 4),
        limits=ActuatorLimits((500.0,) * 4, (1e6,) * 4),
        payloads=PayloadSet(mass_scale=(1.4, 1.4, 1.4, 2.2), com_scale=(1.0, 1.0, 1.0, 1.4)),
    )
