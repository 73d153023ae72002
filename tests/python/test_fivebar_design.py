"""Designs for the five-bar robot: what their gates prove against closed forms and grids, and closed loops in numpy."""

from __future__ import annotations

import copy
from functools import cache
from itertools import product
from typing import Any

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv import _runtime
from quasilpv.artifact import Artifact
from quasilpv.certificate import verify
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.gate.margin import inertia_margin
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.loops.frozen_loop import FrozenLoop
from quasilpv.loops.torque_law import TorqueLaw
from quasilpv.release import release
from quasilpv.scenarios import tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.fivebar import RhombicFiveBar
from quasilpv.systems.robots.registry import robot
from reference.checked import loop_data, robust_gate
from reference.five_bar_run import sines, track
from reference.gated_arms import artifact_document, full_map, multiple_pole_loop

ROBOT = robot("fivebar")
SPIRAL = tracking_experiment("fivebar-spiral").trajectory
FREQUENCY = ROBOT.disturbance_frequency_rad_s


@cache
def released(rate_hz: float, controller: str = "dob-acceleration", *, compensated: bool = True) -> Artifact:
    specification = Specification(rate_hz=rate_hz, disturbance_frequency_rad_s=FREQUENCY)
    return release(DesignRequest.of("fivebar", controller, specification, compensated=compensated)).artifact


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


def premultiplied() -> dict[str, Any]:
    return copy.deepcopy(released(4000.0, "dob-torque-premultiplied").content())


def test_when_the_equations_are_premultiplied_expect_the_inertia_of_the_thesis_and_its_claims_verified() -> None:
    """``M_a = c_4 [1, sin theta_1; 0, 1]`` (Dehak 2022, IV.5.2), at both ends of the premise."""
    content = premultiplied()
    law, evidence = content["law"], content["verification"]
    (beta,), (inertia,) = law["premultiplication"]["blocks"], law["inertia"]["blocks"]
    c4 = evidence["report"]["inertia_scale"] * ROBOT.model.driven_inertia[0]
    ends = (law["inertia"]["lower"][0], law["inertia"]["upper"][0])
    for sine, factor, M in zip(ends, beta["vertices"], inertia["vertices"], strict=True):
        np.testing.assert_allclose(np.array(factor) @ M, c4 * np.array([[1.0, sine], [0.0, 1.0]]), rtol=1e-15)
    low, high = np.sin(ROBOT.domain.angle_rad[0])
    assert ends[0] < low < high < ends[1]
    assert evidence["report"]["scheduled_premises"] == ["sin(theta_1)"]
    assert evidence["certificate"]["verified"]
    assert evidence["gate"]["passed"]
    assert not evidence["gate"]["proved"]


@pytest.mark.parametrize(
    ("path", "factor", "claim"),
    [
        (("law", "premultiplication", "blocks", 0, "vertices", 0), -1.0, "premultiplication: invertible 0"),
        (("law", "premultiplication", "blocks", 0, "vertices", 1), 1.5, "feedback: "),
        (("law", "observer", "blocks", 0, "vertices", 0), 0.5, "observer: "),
        (("domain", "angle_rad", 0), 1.1, "premise box: output 0 of premises"),
    ],
)
def test_when_a_premultiplied_law_is_changed_expect_the_claim_that_fails(
    path: tuple[Any, ...], factor: float, claim: str
) -> None:
    content = premultiplied()
    part = content
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = (factor * np.array(part[path[-1]])).tolist()
    assert any(name.startswith(claim) for name in verify(content).failed)


def test_when_a_premultiplied_inertia_varies_expect_it_refused() -> None:
    content = premultiplied()
    content["law"]["inertia"]["blocks"][0]["vertices"][0][0][0] *= 1.01
    with pytest.raises(InputError, match="the same at every vertex"):
        verify(content)


def test_when_gains_are_premultiplied_too_expect_the_same_loop() -> None:
    """``K = beta K_0``, ``L_3 = beta L_30``, ``L_4 = beta L_40``: the same law in other torque coordinates."""
    n, period, rng = 2, 5e-4, np.random.default_rng(4)
    inertia, plant = np.diag([0.004, 0.003]), np.array([[0.005, 0.001], [0.001, 0.004]])
    beta = np.array([[1.0, -0.8], [0.0, 1.0]]) + 0.1 * rng.normal(size=(n, n))
    stiffness = [-gain * inertia for gain in (3 * 60.0**2, 3 * 60.0, 60.0**3)]
    correction = [gain * np.eye(n) for gain in (4 * 900.0, 6 * 900.0**2)]
    torque = [gain * inertia for gain in (4 * 900.0**3, 900.0**4)]

    def loop(factor: np.ndarray | None) -> FrozenLoop:
        to = np.eye(n) if factor is None else factor
        feedback = np.hstack([to @ gain for gain in stiffness])
        observer = np.vstack([*correction, *(to @ gain for gain in torque)])
        tables = (inertia[None], feedback[None], observer[None], None if factor is None else factor[None])
        return FrozenLoop(TorqueLaw(period, 1e-3, *tables), plant[None], 0.3 * period)

    plain, other = loop(None), loop(beta)
    for name in ("disturbance_gains", "growth_rates"):
        arguments = (50.0,) if name == "disturbance_gains" else ()
        assert getattr(other, name)(*arguments) == pytest.approx(getattr(plain, name)(*arguments), rel=1e-6)
    assert other.torque_activity([1e-6]) == pytest.approx(plain.torque_activity([1e-6]), rel=1e-9)


@given(
    hnp.arrays(float, (4, 2), elements=st.floats(-1.0, 1.0)),
    st.floats(-1.138, -0.488),
    st.floats(0.521, 1.106),
)
@settings(max_examples=50)
def test_when_ctc_is_stepped_expect_the_parallel_computed_torque_with_passive_joints_reconstructed(
    drawn: np.ndarray, theta_1: float, theta_2: float
) -> None:
    """(IV.78), the sign of N_b corrected: passive angles and speeds from the closure, the constrained M, N and G."""
    errors, omega, speed_error, reference_acceleration = drawn
    y, speed = np.array([theta_1, theta_2]), 2.0 * omega
    reference, rate = y + 1e-4 * errors, speed + 1e-2 * speed_error
    artifact = released(2000.0, "ctc")
    law = artifact.content()["law"]
    controller = _runtime.Controller(_runtime.Artifact.parse(canonical_json(artifact.to_document())))
    acceleration = 10.0 * reference_acceleration
    report = controller.step(y, reference, rate, acceleration, speed)
    command = acceleration + np.array(law["gp"]) * (reference - y) + np.array(law["gd"]) * (rate - speed)

    linkage = ROBOT.model.linkage  # type: ignore[attr-defined]
    phi = linkage.coordinates(y)
    J, M, G = linkage.closure_jacobian(phi), linkage.mass_matrix(phi), linkage.gravity_torque(phi)
    J_a, J_b = J[:, :2], -J[:, 2:]
    whole = np.concatenate([speed, np.linalg.solve(J_b, J_a @ speed)])
    passive = np.linalg.solve(J_b, J_a @ command + linkage.closure_drift(phi, whole))
    N = linkage.speed_torque(phi, whole)
    active = M[:2, :2] @ command + M[:2, 2:] @ passive + N[:2] + G[:2]
    carried = M[2:, :2] @ command + M[2:, 2:] @ passive + N[2:] + G[2:]
    expected = active + J_a.T @ np.linalg.solve(J_b.T, carried)
    np.testing.assert_allclose(report.torque_commanded[:2], expected, rtol=0, atol=1e-11 * (1 + np.abs(command).max()))


# ---- closed loops ----------------------------------------------------------------------------------------------------


def test_when_joints_are_disturbed_expect_the_tool_within_a_tenth_of_a_millimetre_at_2_khz() -> None:
    assert rms(released(2000.0), [(15.0, 50.0), (15.0, 5.0)], 0.25).max() < 1e-4


@pytest.mark.full
def test_when_the_disturbance_is_strong_expect_the_observer_to_make_the_error_five_times_smaller() -> None:
    strong = [(100.0, 50.0), (100.0, 50.0)]
    without, compensated = (rms(released(2000.0, compensated=on), strong, 0.25) for on in (False, True))
    assert np.all(without > 5.0 * compensated)


def test_when_the_equations_are_premultiplied_expect_the_accuracy_of_the_thesis_at_4_khz() -> None:
    """125/145 um are printed for a controller in continuous time (Dehak 2022, IV.5.2)."""
    error = rms(released(4000.0, "dob-torque-premultiplied"), [(15.0, 50.0), (15.0, 5.0)], 0.25)
    assert np.all(error < [2.0e-4, 2.0e-4])


@pytest.mark.full
@pytest.mark.parametrize("second_frequency", [5.0, 50.0])
@pytest.mark.parametrize(("rate_hz", "bound_m"), [(2000.0, 1e-4), (4000.0, 2e-5)])
def test_when_the_whole_spiral_is_tracked_expect_the_stated_accuracy(
    rate_hz: float, bound_m: float, second_frequency: float
) -> None:
    assert rms(released(rate_hz), [(15.0, 50.0), (15.0, second_frequency)], SPIRAL.duration_s).max() < bound_m
