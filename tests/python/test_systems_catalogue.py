"""The catalogue of descriptor systems against the printed equations, written again as plain functions of the state."""

from collections.abc import Iterator
from itertools import product
from math import cos, exp, inf, isfinite, nan, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from quasilpv.errors import InputError
from quasilpv.systems.catalogue import SYSTEMS, system
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.enclosure import enclose
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import robot

numbers = st.floats(-30, 30, allow_nan=False)
DIFFERENTIAL = {
    "ex-I.1": 2,
    "ex-II.9": 2,
    "ex-II.5": 1,
    "ex-II.6": 1,
    "ex-II.7": 2,
    "ex-II.8": 6,
    "ex-III.10": 2,
    "ex-III.11": 2,
    "ex-III.12": 2,
    "spring-disc": 2,
    "arm2": 4,
    "arm3": 6,
}


def sinc(x: float) -> float:
    return sin(x) / x if x else 1.0


def sampled_states(model: DescriptorSystem, count: int, seed: int) -> Iterator[np.ndarray]:
    bounds = np.clip([model.domain[symbol] for symbol in model.state], -8.0, 8.0)
    yield from np.random.default_rng(seed).uniform(*bounds.T, size=(count, len(bounds)))


# ---- the catalogue as a whole ----------------------------------------------------------------------------------------


def test_catalogue_has_every_example_of_chapters_one_to_three() -> None:
    assert {name: system(name).differential for name in SYSTEMS} == DIFFERENTIAL
    for name, kind in SYSTEMS.items():
        assert kind.id == name == system(name).name
        assert kind.summary
        assert "\n" not in kind.summary + kind.reference
        assert all(isfinite(p.default) and p.summary for p in kind.parameters.values())


@pytest.mark.parametrize("name", SYSTEMS)
def test_premise_bounds_are_proved_by_interval_arithmetic_and_no_wider_than_that(name: str) -> None:
    model = system(name)
    for premise in model.premises:
        low, high = enclose(premise.expression, model.domain)
        assert premise.lower <= low + 1e-15
        assert premise.upper >= high - 1e-15
        assert_allclose(premise.bounds, (low, high), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", SYSTEMS)
def test_sampled_premises_stay_in_their_bounds(name: str) -> None:
    model = system(name)
    parameters = {symbol: model.domain[symbol][0] for symbol in model.parameters}
    for x in sampled_states(model, 100, seed=1):
        z = model.premise_values(x, parameters)
        assert np.all(z >= model.lower - 1e-14)
        assert np.all(z <= model.upper + 1e-14)


@pytest.mark.parametrize("name", SYSTEMS)
def test_parameters_marked_affine_are_jointly_affine_and_the_others_are_not(name: str) -> None:
    parameters = SYSTEMS[name].parameters
    affine = {key: p.default for key, p in parameters.items() if p.affine}

    def data(values: dict[str, float]) -> np.ndarray:
        model = system(name, **values)
        parts = [m for X in (model.E, model.A, model.B, model.C) for m in (X.constant, X.coefficients)]
        return np.concatenate([np.ravel(m) for m in parts])

    # A function is jointly affine if f(x + u + v) - f(x + u) - f(x + v) + f(x) vanishes for all steps u and v.
    for first, second in product(affine, repeat=2):
        corners = [dict(affine) for _ in range(4)]
        for corner, steps in zip(corners, ([], [first], [second], [first, second]), strict=True):
            for key in steps:
                corner[key] += 3.0
        base, one, other, both = (data(corner) for corner in corners)
        assert_allclose(both - one - other + base, 0, atol=1e-11 * np.abs(both).max())
        assert not np.allclose(one, base)
        moved, still = system(name, **corners[3]), system(name)
        assert [(p.expression, p.bounds) for p in moved.premises] == [(p.expression, p.bounds) for p in still.premises]


def test_when_system_is_unknown_expect_the_known_ones_listed() -> None:
    with pytest.raises(InputError, match=r"got ex-IX.1, expected one of ex-I.1, ex-II.9, .*, arm2, arm3"):
        system("ex-IX.1")


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("ex-I.1", {"c": 1.0}, "ex-I.1: parameter: got c, expected one of a, b"),
        ("ex-I.1", {"a": nan}, "ex-I.1: a: got nan"),
        ("ex-II.7", {"b": inf}, "finite number"),
        ("ex-II.7", {"z2_lower": 0.6}, "z2_lower: got 0.6"),
        ("spring-disc", {"M": 0.0}, "M: got 0.0, expected a number > 0"),
        ("spring-disc", {"c": -1.0}, "c: got -1.0, expected a number >= 0"),
        ("arm2", {"upright": 0.5}, "upright"),
        ("arm2", {"m2": 0.0}, "arm2: m2: got 0.0"),
        ("arm3", {"fv": -1.0}, "friction"),
        ("ex-II.8", {"theta_max": -1.0}, "theta_max"),
    ],
)
def test_when_a_parameter_is_unusable_expect_one_line_saying_which(
    name: str, parameters: dict[str, float], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        system(name, **parameters)


# ---- each system against its printed equations -----------------------------------------------------------------------


@given(numbers, numbers, st.lists(numbers, min_size=5, max_size=5))
@settings(max_examples=30, deadline=None)
def test_example_one_is_the_printed_nonlinear_equations(a: float, b: float, values: list[float]) -> None:
    model = system("ex-I.1", a=a, b=b)
    (x1, x2), rate, u = values[:2], np.array(values[2:4]), values[4]
    x2 *= pi / 30
    cc, rational = cos(x2) ** 2, 1 / (1 + x1**2)
    left = np.array([rate[0] + rate[1], -rate[0] + cc * rate[1]])
    right = np.array(
        [
            cc * x2 - x2 * rational + (1 + rational) * u,
            -1.5 * x1 + (b * (2 + x1**2) * rational * sinc(x2) - 3) * x2 + (a * cc - 2) * u,
        ]
    )
    E, A, B, _ = model.evaluate(model.premise_values([x1, x2]))
    assert_allclose(E @ rate, left, rtol=1e-12, atol=1e-12)
    assert_allclose(A @ [x1, x2] + B[:, 0] * u, right, rtol=1e-12, atol=1e-9)


def test_printed_input_matrix_of_example_one_leaves_an_eigenvalue_zero_that_no_feedback_moves() -> None:
    _, A, B, _ = system("ex-I.1", a=1.0, b=1.0).evaluate([0.0, 0.0, 1.0])

    def least_singular_value(B: np.ndarray) -> float:  # of [sE - A, B] at s = 0 (Hautus)
        return float(np.linalg.svd(np.hstack([-A, B]), compute_uv=False)[-1])

    printed = np.array([[0.0], B[1]])  # z_2 instead of 1 + z_2
    assert least_singular_value(printed) == 0.0
    assert least_singular_value(B) > 0.1


@pytest.mark.parametrize("name", ["ex-II.5", "ex-II.6"])
def test_rotation_example_is_the_printed_matrices(name: str) -> None:
    model = system(name, a=2.5, b=-7.0)
    for x in sampled_states(model, 20, seed=2):
        E, A, B, _ = model.evaluate(model.premise_values(x))
        assert_array_equal(E, [[1, 0], [0, 0]])
        assert_allclose(A, [[-1, cos(x[0]) + 5 * sin(x[0])], [2.5 * sin(x[0]), -7.0]], rtol=1e-14, atol=1e-14)
        assert B.shape == (2, 0)


@pytest.mark.parametrize("name", ["ex-II.7", "ex-III.10", "ex-III.11"])
def test_singular_examples_are_the_printed_matrices(name: str) -> None:
    a, b = -11.0, -23.0
    model = system(name, a=a, b=b)
    Ha = np.array([[0.5], [0.4], [0.6]])
    Wa = np.array([[0.3, 0.1, 0.3]]) - np.array([[0.2, 0.2, 0.0]])
    for x in sampled_states(model, 20, seed=3):
        z1, z2, z3 = exp(-2 * x[0]) / (1 + exp(-2 * x[0])), (1 + sin(x[1]) ** 2) / 2, sin(0.1 * x[0])
        E, A, B, _ = model.evaluate(model.premise_values(x, dict.fromkeys(model.parameters, z3)))
        assert_allclose(E, [[1, 0, 0], [z1, 1, 0], [0, 0, 0]], atol=1e-14)
        nominal = [[-z2 - 5, 1, z2], [z2, b * z2 - b, 1], [(a + 2) * z2 - 2, 0, 1]]
        assert_allclose(A, nominal + Ha @ Wa * z3, atol=1e-13)
        assert_allclose(B[:, 0], [0, 0.16 * z3 + a, 0.12 * z3 + b], atol=1e-13)
    assert model.premises[2].kind is (PremiseKind.MEASURED if name == "ex-II.7" else PremiseKind.UNKNOWN)


def test_lower_bound_of_the_second_premise_can_be_the_printed_one() -> None:
    assert system("ex-III.10").premises[1].bounds == (0.5, 1.0)
    assert system("ex-III.10", z2_lower=0.0).premises[1].bounds == (0.0, 1.0)


def test_arms_are_those_of_the_registry_with_the_mass_and_friction_asked_for() -> None:
    for name, joints, angle in (("arm2", 2, 0.4), ("arm3", 3, 0.7)):
        nominal = robot(name).model.as_descriptor_system(OperatingDomain.symmetric(joints, angle, 1.5))
        model = system(name, theta_max=angle, speed_max=1.5)
        assert [p.bounds for p in model.premises] == [p.bounds for p in nominal.premises]
        for field in ("E", "A", "B"):
            X, Y = getattr(model, field), getattr(nominal, field)
            assert_allclose(X.constant, Y.constant, rtol=1e-14)
            assert_allclose(X.coefficients, Y.coefficients, rtol=1e-14)
    plain, rubbing = system("arm2"), system("arm2", fv1=3.0, fv2=6.0)
    assert_allclose(plain.A.constant - rubbing.A.constant, np.diag([0, 0, 3.0, 6.0]), atol=1e-14)
    plain, rubbing = system("ex-II.8"), system("arm3", fv=5.0)
    assert_allclose(plain.A.constant - rubbing.A.constant, np.diag([0, 0, 0, 5.0, 5.0, 5.0]), atol=1e-14)


@pytest.mark.parametrize(("upright", "stable"), [(0.0, True), (1.0, False)])
def test_arm2_hangs_stably_or_stands_unstably(upright: float, stable: bool) -> None:
    model = system("arm2", upright=upright, fv1=5.0, fv2=5.0)
    E, A, _, _ = model.evaluate(model.premise_values(np.zeros(4)))
    assert bool(np.linalg.eigvals(np.linalg.solve(E, A)).real.max() < 0) is stable


@pytest.mark.parametrize("m3", [1.0, 4.2, 9.0, 15.0])
def test_inertia_of_arm3_is_positive_definite_for_every_mass_only_because_its_moment_of_inertia_follows(
    m3: float,
) -> None:
    model = system("ex-II.8", m3=m3, theta_max=pi)
    smallest = min(
        np.linalg.eigvalsh(model.evaluate(model.premise_values(x)).E)[0] for x in sampled_states(model, 400, seed=4)
    )
    assert smallest > 0.1
    fixed_about_the_joint = 1.3 - m3 * 0.4**2  # what the moment about the centre of mass would be
    assert (fixed_about_the_joint > 0) == (m3 < 8.125)
