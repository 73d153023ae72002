"""One Lyapunov function for all motions exists: the disc of inertias, the circle criterion, wrong claims."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from quasilpv.certificate.exact.cosine_matrices import CosineMatrix
from quasilpv.certificate.exact.matrices import matrix, rational, zero
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.loop import CharacteristicPolynomial, Controller
from quasilpv.certificate.gate.motion import InertiaDisc, satisfies_circle_criterion
from quasilpv.certificate.robot.range import InertiaPair
from quasilpv.errors import InputError
from quasilpv.release import to_artifact
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.synthesis.acceleration.moving_inertia import needed_disc
from quasilpv.systems.robots.registry import robot
from reference.checked import inertia_data, loop_data, robust_gate
from reference.gated_arms import artifact_document, full_map, moving_five_bar, multiple_pole_loop, quotients

LOOP = multiple_pole_loop(60, 1200, 1e-3, 1e-3)


# ---- products of cosines ---------------------------------------------------------------------------------------------


@given(st.integers(0, 2**31))
def test_when_two_cosine_matrices_are_multiplied_expect_the_product_of_their_values(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def random_matrix() -> fmpq_mat:
        return matrix(rng.integers(-9, 9, (2, 2)).tolist())

    def random_terms() -> CosineMatrix:
        combinations = ((0, 0), (1, 0), (0, 1), (1, 1), (1, -2))
        powers = int(rng.integers(1, 4))
        return CosineMatrix({c: tuple(random_matrix() for _ in range(powers)) for c in combinations}, zero(2, 2))

    left, right, middle = random_terms(), random_terms(), random_matrix()
    points = np.column_stack([rng.uniform(-3, 3, (5, 2)), rng.uniform(0, 1, 5)])
    expected = left.at(points) @ np.array(middle.table(), dtype=float) @ right.at(points)
    assert left.times(middle, right).at(points) == pytest.approx(expected, abs=1e-9)


def test_when_factors_are_known_up_to_an_error_expect_the_product_to_carry_its_effect() -> None:
    exact = CosineMatrix({(0,): (matrix([[2]]),), (1,): (matrix([[3]]),)}, zero(1, 1))
    rounded = replace(exact, rest=matrix([[fmpq(1, 10)]]))
    # |2 + 3 cos| <= 5, so (x + e)(x + e) - x x is at most 2 * 5 * 0.1 + 0.01.
    assert rounded.times(matrix([[1]]), rounded).rest[0, 0] == fmpq(101, 100)


# ---- the disc --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm2", "arm3", "fivebar"])
def test_when_a_disc_is_proved_expect_every_sampled_inertia_inside_and_a_smaller_one_refused(name: str) -> None:
    scale, subject = 1.2, robot(name)
    disc = needed_disc(subject).scaled(scale)
    inertia = InertiaPair(inertia_data(artifact_document(subject, LOOP, scale)))
    claim = InertiaDisc(rational(disc.centre), rational(disc.radius), matrix(disc.shape.tolist()))
    assert claim.is_proved(inertia)

    X = quotients(subject, scale, 1500, 1) - disc.centre * np.eye(subject.model.joints)
    gap = disc.radius**2 * disc.shape - X @ disc.shape @ X.swapaxes(1, 2)
    assert np.linalg.eigvalsh(gap).min() > 0.0
    assert not replace(claim, radius=claim.radius * fmpq(97, 100)).is_proved(inertia)


def test_when_the_shape_is_the_identity_expect_the_arm_not_to_stay_near_one_multiple_of_it() -> None:
    inertia = InertiaPair(inertia_data(artifact_document(robot("arm3"), LOOP)))
    disc = needed_disc(robot("arm3"))
    identity = InertiaDisc(rational(disc.centre), rational(0.999 * disc.centre), matrix(np.eye(3).tolist()))
    assert not identity.is_proved(inertia)


# ---- the circle criterion --------------------------------------------------------------------------------------------


def largest_radius(loop: Any, centre: float, delay_samples: fmpq) -> float:
    """The smallest ``|F + c G| / |G|`` on a fine grid of the circle."""
    polynomial = CharacteristicPolynomial.of(Controller.of(loop, loop.filter_poles()[0]), delay_samples)
    z = np.exp(1j * np.geomspace(1e-4, np.pi, 20_000))
    F, G = (np.polyval([to_float(x) for x in part.coeffs()[::-1]], z) for part in (polynomial.F, polynomial.G))
    return float(np.abs(F / G + centre).min())


@settings(max_examples=15, deadline=None)
@given(st.floats(15, 60), st.floats(800, 1600), st.floats(0.2, 1.2), st.fractions(0, 1, max_denominator=8))
def test_when_the_radius_is_at_its_limit_expect_the_criterion_to_tell_just_inside_from_just_outside(
    wc: float, wo: float, centre: float, delay: Any
) -> None:
    loop, longest = multiple_pole_loop(wc, wo, 1e-3, 1e-3), fmpq(delay.numerator, delay.denominator)
    stable = np.abs(np.linalg.eigvals(full_map(loop, np.array([[centre]]), 0.0))).max() < 1.0
    limit = min(largest_radius(loop, centre, longest * k / 32) for k in range(33))
    assume(limit > 0.05 * centre)  # closer to the stability limit the radius changes fast with the delay
    assert satisfies_circle_criterion(loop, rational(centre), rational(0.99 * limit), longest) == stable
    assert not satisfies_circle_criterion(loop, rational(centre), rational(1.01 * limit), longest)


def test_when_the_delay_is_more_than_a_sample_expect_one_line() -> None:
    with pytest.raises(InputError, match="a delay between 0 and 1 sample"):
        satisfies_circle_criterion(LOOP, fmpq(1), fmpq(1, 2), fmpq(3, 2))


# ---- the claim in an artifact ----------------------------------------------------------------------------------------


def test_when_a_design_claims_all_motions_expect_the_gate_to_prove_it() -> None:
    gate = robust_gate(moving_five_bar())
    assert gate.motion is True
    assert gate.passed
    assert gate.to_document()["proved_in_motion"] is True


@pytest.mark.parametrize(
    ("member", "change"), [("radius", 0.9), ("centre", 1.1), ("longest_delay_samples", 1.9), ("radius", 1.4)]
)
def test_when_the_claim_is_not_true_expect_the_gate_not_passed(member: str, change: float) -> None:
    document = copy.deepcopy(moving_five_bar())
    document["witness"]["motion"][member] *= change
    gate = robust_gate(document)
    assert gate.motion is False
    assert not gate.passed


def test_when_the_default_law_is_asked_about_its_own_range_expect_no_common_function() -> None:
    # Its bandwidth uses up the inertia margin: one joint whose mu moves within the needed range has no common V.
    document = to_artifact(
        synthesise(DesignRequest.of("fivebar", specification=Specification(rate_hz=2000.0)))
    ).content()
    needed = robust_gate(document).needed
    assert needed is not None
    low, high = 1 / needed.highest, 1 / needed.lowest
    assert not satisfies_circle_criterion(loop_data(document), (low + high) / 2, (high - low) / 2, fmpq(1, 2))


@pytest.mark.parametrize(
    ("member", "value", "said"),
    [
        ("radius", 9.0, "witness.motion.radius: got 9.0, expected at least 0 and less than the centre"),
        ("shape", [[1.0, 0.5], [0.0, 1.0]], "witness.motion.shape: got another matrix, expected symmetric, 2 x 2"),
    ],
)
def test_when_the_claim_is_malformed_expect_one_line(member: str, value: Any, said: str) -> None:
    document = copy.deepcopy(moving_five_bar())
    document["witness"]["motion"][member] = value
    with pytest.raises(InputError, match=said):
        robust_gate(document)
