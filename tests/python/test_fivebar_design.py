"""Designs for the five-bar robot: what their gates prove against closed forms and grids, and closed loops in numpy."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
from flint import fmpq

from quasilpv.artifact import Artifact
from quasilpv.certificate.exact_matrices import rational
from quasilpv.certificate.gate import robust_gate
from quasilpv.certificate.gate_data import loop_data
from quasilpv.certificate.gate_margin import inertia_margin
from quasilpv.experiments.track import TrackingExperiment
from quasilpv.release import release
from quasilpv.synthesis import Specification
from quasilpv.systems.fivebar import RhombicFiveBar
from quasilpv.systems.registry import robot
from reference.five_bar_run import sines, track
from reference.gated_arms import artifact_document, full_map, multiple_pole_loop

ROBOT = robot("fivebar")
SPIRAL = TrackingExperiment.registered("fivebar-spiral").trajectory
FREQUENCY = ROBOT.disturbance_frequency_rad_s


@cache
def released(rate_hz: float, controller: str = "dob-acceleration", *, compensated: bool = True) -> Artifact:
    specification = Specification(rate_hz=rate_hz, disturbance_frequency_rad_s=FREQUENCY)
    return release("fivebar", controller, specification, disturbance_compensation=compensated).artifact


def rms(artifact: Artifact, terms: list[tuple[float, float]], duration_s: float) -> np.ndarray:
    """Of the tool's error with the full payload, (X, Y), m."""
    plant = ROBOT.with_payload_fraction(1.0)
    assert isinstance(plant, RhombicFiveBar)
    error, _ = track(artifact, plant.linkage, SPIRAL, sines(terms), duration_s=duration_s)
    return np.asarray(np.sqrt((error**2).mean(axis=0)))


# ---- proofs ----------------------------------------------------------------------------------------------------------


def test_when_the_domain_is_a_box_of_absolute_angles_expect_the_needed_range_of_the_closed_form() -> None:
    """M_t and M_n share the eigenvectors (1, +-1): ratios are (A_t +- B_t c)/(A +- B c), c = cos(theta_2 - theta_1)."""
    (low_1, high_1), (low_2, high_2) = ROBOT.domain.angle_rad
    c = np.cos(np.linspace(low_2 - high_1, high_2 - low_1, 2001))
    A, B = ROBOT.model.inertia_constants[0]
    ratios = []
    for fraction in np.linspace(0.0, 1.0, 21):
        A_t, B_t = ROBOT.with_payload_fraction(float(fraction)).inertia_constants[0]
        ratios += [(A_t + B_t * c) / (A + B * c), (A_t - B_t * c) / (A - B * c)]
    needed = robust_gate(artifact_document(ROBOT, multiple_pole_loop(180, 1800, 2e-4, 5e-4))).needed
    assert needed is not None
    low, high = needed.to_floats()
    assert 0.997 * np.min(ratios) < low <= np.min(ratios) + 1e-12
    assert np.max(ratios) <= high < 1.003 * np.max(ratios)
    for place in (needed.where_lowest, needed.where_highest):
        assert all(a <= angle <= b for (a, b), angle in zip(ROBOT.domain.angle_rad, place.angle_rad, strict=True))


def test_when_poles_are_placed_at_180_and_1800_expect_the_known_margin_at_2_khz() -> None:
    margin = inertia_margin(multiple_pole_loop(180, 1800, 2e-4, 5e-4), fmpq(1, 2))
    assert margin is not None
    assert margin.to_floats() == pytest.approx((0.72, 2.79), abs=0.006)


def test_when_passive_links_are_lumped_expect_the_gate_to_refuse_what_it_proves_with_them_scheduled() -> None:
    """M_n = c_4 I, the model of the thesis, against M_n(theta): the same gains at 1 kHz without delay."""
    loop = multiple_pole_loop(150, 1500, 2e-4, 1e-3)
    scheduled, lumped = artifact_document(ROBOT, loop), artifact_document(ROBOT, loop)
    c4 = float(ROBOT.model.driven_inertia[0])
    lumped["law"]["inertia"]["blocks"][0]["vertices"] = [[[c4, 0.0], [0.0, c4]]] * 2
    assert robust_gate(scheduled, delay_samples=fmpq(0)).passed
    assert not robust_gate(lumped, delay_samples=fmpq(0)).passed


@pytest.mark.parametrize("rate_hz", [1000.0, 2000.0, 4000.0])
def test_when_a_controller_is_released_expect_its_inequalities_and_its_gate_proved(rate_hz: float) -> None:
    evidence = released(rate_hz).verification
    assert evidence is not None
    assert evidence["certificate"]["verified"]
    assert evidence["gate"]["proved"]
    assert evidence["gate"]["delay_margin_s"] >= 0.5 / rate_hz
    assert evidence["report"]["filter_time_constant_s"] < 2.1 / rate_hz


def test_when_the_gate_is_proved_expect_every_loop_of_a_grid_of_both_joints_stable() -> None:
    content = released(2000.0).content()
    loop, scale = loop_data(content), released(2000.0).verification["report"]["inertia_scale"]  # type: ignore[index]
    worst = -np.inf
    angles = (np.linspace(low, high, 4) for low, high in ROBOT.domain.angle_rad)
    for theta_1, theta_2, fraction, delay in product(*angles, (0.0, 0.5, 1.0), (0.0, 0.5)):
        theta = np.array([theta_1, theta_2])
        plant = ROBOT.with_payload_fraction(fraction)
        coupling = np.linalg.solve(plant.inertia(theta), scale * ROBOT.model.inertia(theta))
        radius = np.abs(np.linalg.eigvals(full_map(loop, coupling, delay))).max()
        worst = max(worst, float(np.log(radius)) / loop.sample_period_s)
    gate = robust_gate(content, delay_samples=rational(0.5)).to_document()
    assert worst < 0.0
    assert worst <= gate["worst_growth_rate_per_s"] + 0.5
    assert worst == pytest.approx(gate["worst_growth_rate_per_s"], rel=0.1)


def test_when_the_torque_level_law_is_released_expect_its_premise_scheduled_and_its_claims_verified() -> None:
    artifact = released(4000.0, "dob-torque")
    evidence = artifact.verification
    assert evidence is not None
    assert evidence["report"]["scheduled_premises"] == ["cos(theta_1 - theta_2)"]
    assert evidence["certificate"]["verified"]
    assert evidence["gate"]["passed"]


# ---- closed loops ----------------------------------------------------------------------------------------------------


def test_when_joints_are_disturbed_expect_the_tool_within_a_tenth_of_a_millimetre_at_2_khz() -> None:
    assert rms(released(2000.0), [(15.0, 50.0), (15.0, 5.0)], 0.25).max() < 1e-4


def test_when_the_disturbance_is_strong_expect_the_observer_to_make_the_error_five_times_smaller() -> None:
    strong = [(100.0, 50.0), (100.0, 50.0)]
    without, compensated = (rms(released(2000.0, compensated=on), strong, 0.25) for on in (False, True))
    assert np.all(without > 5.0 * compensated)


@pytest.mark.full
@pytest.mark.parametrize("second_frequency", [5.0, 50.0])
@pytest.mark.parametrize(("rate_hz", "bound_m"), [(2000.0, 1e-4), (4000.0, 2e-5)])
def test_when_the_whole_spiral_is_tracked_expect_the_stated_accuracy(
    rate_hz: float, bound_m: float, second_frequency: float
) -> None:
    assert rms(released(rate_hz), [(15.0, 50.0), (15.0, second_frequency)], SPIRAL.duration_s).max() < bound_m
