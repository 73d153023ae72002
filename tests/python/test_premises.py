"""Premises of the robots: guaranteed, tight, and equal to the printed box of the 3-DoF arm."""

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose, assert_array_equal

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import Robot, robots

# The design box of the default trajectories was printed with speeds rounded to three decimals.
PRINTED_ARM3_BOX = {
    "z1": (-0.4554, 0.5732),
    "z2": (0.429, 0.905),
    "z3": (-0.0333, 1.0),
    "z4": (-5.579, 5.579),
    "z5": (-1.775, 1.775),
    "z6": (-1.775, 1.775),
    "z7": (-3.437, 3.437),
    "z8": (-5.202, 5.202),
    "z9": (-5.758, 5.758),
    "z10": (0.978, 1.0),
    "z11": (0.278, 0.9216),
    "z12": (0.4683, 1.0),
}


def random_states(domain: OperatingDomain, count: int, seed: int) -> np.ndarray:
    bounds = np.array(domain.angle_rad + domain.speed_rad_s)
    states = np.random.default_rng(seed).uniform(*bounds.T, size=(count, len(bounds)))
    at_corner = np.random.default_rng(seed + 1).random(states.shape)  # extremes are often at faces of the box
    states = np.where(at_corner < 0.3, bounds[:, 0], states)
    return np.where(at_corner > 0.7, bounds[:, 1], states)


@pytest.mark.parametrize("robot", robots(), ids=lambda robot: robot.id)
def test_premise_bounds_contain_every_sampled_state_and_are_attained(robot: Robot) -> None:
    system = robot.model.as_descriptor_system(robot.domain)
    z = np.array([system.premise_values(state) for state in random_states(robot.domain, 20_000, seed=3)])
    width = system.upper - system.lower
    assert np.all(z >= system.lower - 1e-14)
    assert np.all(z <= system.upper + 1e-14)
    assert_allclose(z.min(axis=0), system.lower, atol=0.01 * width.max(), rtol=0.01)
    assert_allclose(z.max(axis=0), system.upper, atol=0.01 * width.max(), rtol=0.01)


def test_arm3_premises_have_the_printed_box() -> None:
    robot = robots()[1]
    system = robot.model.as_descriptor_system(robot.domain)
    assert [premise.name for premise in system.premises] == list(PRINTED_ARM3_BOX)
    for premise in system.premises:
        assert_allclose(premise.bounds, PRINTED_ARM3_BOX[premise.name], atol=1.5e-3)


def test_arm2_premises_have_the_closed_form_bounds() -> None:
    robot = robots()[0]
    T, V = robot.domain.angle_rad[0][1], robot.domain.speed_rad_s[0][1]
    c2, c4, c5 = 1.125, 80.9325, 22.0725
    sinc_T, sinc_2T = np.sin(T) / T, np.sin(2 * T) / (2 * T)
    expected = [
        (np.cos(T), 1.0),
        (-(c4 + c5), -c4 * sinc_T - c5 * sinc_2T),
        (-c5, -c5 * sinc_2T),
        (-c2 * V * np.sin(T), c2 * V * np.sin(T)),
        (-c2 * V * np.sin(T), c2 * V * np.sin(T)),
    ]
    system = robot.model.as_descriptor_system(robot.domain)
    assert_allclose([premise.bounds for premise in system.premises], expected, rtol=2e-9)


@pytest.mark.parametrize("robot", robots(), ids=lambda robot: robot.id)
def test_premises_of_angles_are_measured_and_those_of_speeds_estimated(robot: Robot) -> None:
    symbols = robot.model.symbolic
    for premise in robot.model.as_descriptor_system(robot.domain).premises:
        moving = bool(premise.expression.free_symbols & set(symbols.omega))
        assert premise.kind is (PremiseKind.ESTIMATED if moving else PremiseKind.MEASURED)


def test_when_bounds_are_not_in_order_expect_refusal() -> None:
    with pytest.raises(InputError, match="premise z1: bounds"):
        Premise("z1", sp.Symbol("x"), (1.0, 0.0))


def test_affine_matrix_is_the_sum_of_its_terms_and_cannot_be_changed() -> None:
    X = AffineMatrix(np.eye(2), np.array([[[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [2.0, 0.0]]]))
    assert_array_equal(X.evaluate([3.0, -1.0]), [[1.0, 3.0], [-2.0, 1.0]])
    with pytest.raises(ValueError, match="read-only"):
        X.constant[0, 0] = 5.0


@pytest.mark.parametrize(
    ("constant", "coefficients", "words"),
    [
        (np.zeros(3), np.zeros((1, 3)), "a matrix"),
        (np.zeros((2, 2)), np.zeros((1, 2, 3)), r"shape \(p, 2, 2\)"),
        (np.full((1, 1), np.nan), np.zeros((0, 1, 1)), "finite numbers"),
    ],
)
def test_when_affine_matrix_is_malformed_expect_refusal(
    constant: np.ndarray, coefficients: np.ndarray, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        AffineMatrix(constant, coefficients)


def test_when_premise_vector_has_the_wrong_length_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"got shape \(1,\), expected shape \(2,\)"):
        AffineMatrix(np.eye(2), np.zeros((2, 2, 2))).evaluate([1.0])
