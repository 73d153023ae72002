"""Inertia premises held at the middle of their interval: what the schedule, the gate and the design make of them."""

from functools import cache

import numpy as np
import pytest

from quasilpv.loops.loop_grid import configurations
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.synthesis.acceleration.inertia_range import needed_inertia_range
from quasilpv.synthesis.acceleration.lumped_premises import lumped_acceleration_law, with_premises_lumped
from quasilpv.synthesis.inertia_schedule import schedule_of
from quasilpv.synthesis.torque.design import TorqueBandwidth, holds_exactly, torque_design_at
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot

ARM = robot("arm3")
PARTITIONS = [(0, 1, 2), (1, 2), (2,), ()]


@cache
def default_design() -> TrackingDesign:
    return synthesise(DesignRequest.of(ARM))


@pytest.mark.parametrize("chosen", PARTITIONS)
def test_lumped_premises_sit_at_the_middle_of_their_interval(chosen: tuple[int, ...]) -> None:
    angles = configurations(ARM.domain.angle_rad, 20)
    premises = ARM.model.inertia_premises(ARM.domain)
    expected = []
    for theta in angles:
        z = np.cos([theta[1], theta[2], theta[1] + theta[2]])
        middle = np.array([(p.lower + p.upper) / 2.0 for p in premises])
        middle[list(chosen)] = z[list(chosen)]
        expected.append(ARM.model.inertia_affine().evaluate(middle))
    np.testing.assert_allclose(schedule_of(ARM, chosen).inertia_at(ARM, angles), expected, rtol=1e-12)


def test_schedule_by_all_premises_is_the_robots_own_inertia() -> None:
    angles = configurations(ARM.domain.angle_rad, 20)
    own = [ARM.model.inertia(theta) for theta in angles]
    np.testing.assert_allclose(schedule_of(ARM, (0, 1, 2)).inertia_at(ARM, angles), own, rtol=1e-12)


@pytest.mark.parametrize("chosen", PARTITIONS)
def test_proved_range_of_a_partition_holds_all_sampled_ratios_and_little_more(chosen: tuple[int, ...]) -> None:
    scheduled = schedule_of(ARM, chosen)
    artifact = checked_artifact(with_premises_lumped(default_design(), scheduled), allow_unverified=True)
    low, high = (artifact.verification or {})["gate"]["needed_range"]
    sampled = needed_inertia_range(ARM, scheduled=scheduled)
    scale = default_design().report["inertia_scale"]
    assert low < sampled.lowest / scale < 1.02 * low
    assert high / 1.02 < sampled.highest / scale < high


def test_at_the_same_bandwidth_the_gate_refuses_every_lumped_premise() -> None:
    passed = {}
    for chosen in PARTITIONS:
        design = with_premises_lumped(default_design(), schedule_of(ARM, chosen))
        passed[chosen] = (checked_artifact(design, allow_unverified=True).verification or {})["gate"]["passed"]
    assert passed == {(0, 1, 2): True, (1, 2): False, (2,): False, (): False}


def test_without_premises_a_slower_design_has_its_margin_proved() -> None:
    design = lumped_acceleration_law(ARM, Specification(), schedule_of(ARM, ()))
    gate = (checked_artifact(design).verification or {})["gate"]  # raises if a claim or the gate fails
    assert gate["proved"]
    assert design.report["feedback_bandwidth_rad_s"] < default_design().report["feedback_bandwidth_rad_s"]


@pytest.mark.parametrize("chosen", [(2,), ()])
def test_torque_level_gains_of_a_partition_satisfy_their_inequalities_exactly(chosen: tuple[int, ...]) -> None:
    bandwidth = TorqueBandwidth(200.0, 3200.0, 0.5e-3, 0.7)
    design = torque_design_at(ARM, Specification(rate_hz=4000.0), schedule_of(ARM, chosen), bandwidth)
    assert holds_exactly(design.law, design.feedback, design.observer)
    assert (design.feedback.disk, design.observer.disk) == (200.0, 3200.0)
