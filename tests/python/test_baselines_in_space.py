"""Baselines of robots in space: their loops decouple as the search assumes, and keep what the tuning was asked for."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from quasilpv.loops.frozen_loop import FrozenLoop
from quasilpv.loops.velocity_law import VelocityLaw
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.synthesis.baselines.printed import Tuning
from quasilpv.synthesis.specification import VELOCITY_NOISE_RAD_S
from quasilpv.synthesis.tracking_design import TrackingDesign
from reference.tree_artifacts import small_robot

ROBOT = small_robot(coulomb_nm=0.3)
PD_AND_PID = ("pd-tuned", "pid-tuned")
TUNED = (
    "pd-tuned",
    *(pytest.param(name, marks=pytest.mark.full) for name in ("pid-tuned", "ctc-tuned", "ctc-dob-tuned")),
)
"""The search is the same for all; the shortest is the quick one."""


@cache
def designed(controller: str) -> TrackingDesign:
    return synthesise(DesignRequest(ROBOT, controller, specification_for(ROBOT, torque_activity=0.1)))


def frozen(controller: str, postures: np.ndarray) -> VelocityLaw:
    """The law as it is shipped, frozen at postures, from its document alone."""
    law = designed(controller).law
    period = designed(controller).sample_period_s
    filter_time = law["velocity_filter_time_constant_s"]
    empty = ROBOT.tree.inertia(postures)
    if controller in PD_AND_PID:
        gains = (np.broadcast_to(np.diag(law[name]), empty.shape) for name in ("kp", "kd", "ki"))
        return VelocityLaw(period, *gains, empty, filter_time)
    inertia = designed(controller).report["inertia_scale"] * empty
    gains = (inertia * np.array(law[name]) for name in ("gp", "gd", "gi"))
    return VelocityLaw(period, *gains, inertia, filter_time, law["disturbance_observer_bandwidth_rad_s"])


@pytest.mark.parametrize("controller", TUNED)
def test_every_posture_and_load_is_stable_with_delay_and_noise_stays_within_the_activity(controller: str) -> None:
    """All joints together, at postures the search has not seen: it looks at scalar loops over a range of inertias."""
    rng = np.random.default_rng(11)
    low, high = np.array(ROBOT.domain.angle_rad).T
    postures = rng.uniform(low, high, (60, 3))
    law, specification = frozen(controller, postures), specification_for(ROBOT, torque_activity=0.1)
    noise = [specification.angle_noise_rad, VELOCITY_NOISE_RAD_S]
    for true in (ROBOT.lightest(), *ROBOT.heaviest()):
        inertia = true.inertia(postures)
        for delay in (0.0, specification.delay_s):
            assert FrozenLoop(law, inertia, delay).growth_rates().max() < 0.0
    activity = FrozenLoop(law, ROBOT.lightest().inertia(postures)).torque_activity(noise).max()
    assert activity < 0.1 * np.linalg.norm(ROBOT.limits.torque_nm)


@pytest.mark.full
def test_pd_has_no_integral_and_pid_has_one_that_rejects_slow_disturbances_better() -> None:
    pd, pid = designed("pd-tuned"), designed("pid-tuned")
    assert pd.law["ki"] == [0.0, 0.0, 0.0]
    assert min(pid.law["ki"]) > 0.0
    assert pid.report["disturbance_gain_s2"] < pd.report["disturbance_gain_s2"]


def test_torques_of_a_positive_definite_gain_decouple_into_scalar_loops_of_its_ratios() -> None:
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    true, driven = A @ A.T + np.eye(4), np.diag(rng.uniform(0.5, 3.0, 4))
    gains, ones = Tuning(60.0, integral_ratio=0.2).unit_gains(), np.ones((4, 1, 1))
    joint = VelocityLaw(1e-3, *(gain * driven[None] for gain in gains), driven[None], 2e-3)
    ratios = np.linalg.eigvals(np.linalg.solve(driven, true)).real[:, None, None]
    scalar = VelocityLaw(1e-3, *(gain * ones for gain in gains), ones, 2e-3)
    together, apart = FrozenLoop(joint, true[None], 5e-4), FrozenLoop(scalar, ratios, 5e-4)
    assert together.growth_rates()[0] == pytest.approx(apart.growth_rates().max(), abs=1e-6)
