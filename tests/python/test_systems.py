"""Descriptor systems built from symbols, and the registry of robots."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.printed_arms import PrintedSerialArm
from quasilpv.systems.robots.registry import robot, robots

x1, x2 = sp.symbols("x1 x2", real=True)
DOMAIN = {x1: (-1.0, 2.0), x2: (0.5, 3.0)}
FUNCTIONS = [sp.cos(x1), x2 * sp.sin(x1) + 2 * x1, sp.sinc(x1 + x2) - 3 * sp.cos(x1), x1**2 * x2]


PREMISES = [Premise.over(DOMAIN, f"z{k}", f) for k, f in enumerate(FUNCTIONS, 1)]


def build(A: sp.Matrix, premises: list[Premise] = PREMISES) -> DescriptorSystem:
    E, B, C = sp.eye(2), sp.Matrix([0, 1]), sp.Matrix([[1, 0]])
    return DescriptorSystem.from_symbols(
        name="toy", state=(x1, x2), inputs=("u",), E=E, A=A, B=B, C=C, premises=premises, domain=DOMAIN
    )


@given(st.lists(st.floats(-100, 100).map(lambda v: round(v, 3)), min_size=20, max_size=20))
def test_coefficients_of_an_affine_matrix_are_recovered(numbers: list[float]) -> None:
    coefficients = np.array(numbers).reshape(5, 2, 2)
    A = sp.zeros(2, 2)
    for function, matrix in zip([sp.S.One, *FUNCTIONS], coefficients, strict=True):
        A += function * sp.Matrix(matrix)
    system = build(A)
    assert_allclose(system.A.constant, coefficients[0], atol=1e-9)
    assert_allclose(system.A.coefficients, coefficients[1:], atol=1e-9)
    assert_array_equal(system.E.constant, np.eye(2))
    assert_array_equal(system.E.coefficients, np.zeros((4, 2, 2)))


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (sp.sin(x1), r"A\[0,1\].*sin\(x1\)"),
        (sp.cos(x1) ** 2, r"cos\(x1\)\*\*2"),
        (x2 * sp.sin(x1), r"affine in the premises z1, z2, z3, z4"),  # a part of z2 that is not a multiple of it
    ],
)
def test_when_an_entry_is_not_affine_in_the_premises_expect_refusal(entry: sp.Expr, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build(sp.Matrix([[0, entry], [1, 0]]))


@pytest.mark.parametrize("functions", [[sp.cos(x1), 2 * sp.cos(x1)], [sp.cos(x1), 1 - sp.cos(x1)], [sp.Integer(3)]])
def test_when_premises_are_dependent_expect_refusal(functions: list[sp.Expr]) -> None:
    premises = [Premise.over(DOMAIN, f"z{k}", f) for k, f in enumerate(functions, 1)]
    with pytest.raises(InputError, match="linearly independent"):
        build(sp.zeros(2, 2), premises)


def test_when_a_part_has_the_wrong_shape_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"toy: A: got shape \(3, 3\), expected shape \(2, 2\)"):
        build(sp.zeros(3, 3))


def test_when_a_premise_is_an_uncertain_parameter_its_value_is_no_function_of_the_state() -> None:
    delta = sp.Symbol("delta")
    system = DescriptorSystem.from_symbols(
        name="toy",
        state=(x1,),
        inputs=("u",),
        E=sp.eye(1),
        A=sp.Matrix([[delta]]),
        B=sp.eye(1),
        C=sp.eye(1),
        premises=[Premise("delta", delta, (-1.0, 1.0))],
        domain={},
    )
    assert_array_equal(system.evaluate([0.5]).A, [[0.5]])
    assert [parameter.name for parameter in system.parameters] == ["delta"]
    assert_array_equal(system.premise_values([0.0], {delta: -0.25}), [-0.25])
    with pytest.raises(InputError, match="toy: parameters: got none for delta, expected a value"):
        system.premise_values([0.0])


def arms() -> list[PlanarSerialArm]:
    nominal = [entry.model for entry in robots()]
    three = nominal[1]
    return [
        *nominal,
        PrintedSerialArm("upright2", nominal[0].links, equilibrium="upright"),
        PlanarSerialArm("christoffel3", three.links),
        PlanarSerialArm("single", three.links[:1]),
        PlanarSerialArm("four", three.links + three.links[:1]),
        PlanarSerialArm("weightless", three.links, gravity_m_s2=0.0),
        PlanarSerialArm("rubbing", tuple(type(link)(**{**vars(link), "friction_nm_s": 3.0}) for link in three.links)),
    ]


@pytest.mark.parametrize("arm", arms(), ids=lambda arm: arm.name)
def test_descriptor_model_of_an_arm_is_its_forward_dynamics(arm: PlanarSerialArm) -> None:
    n = arm.joints
    system = arm.as_descriptor_system(OperatingDomain.symmetric(n, angle_rad=2.5, speed_rad_s=3.0))
    rng = np.random.default_rng(5)
    for _ in range(50):
        x = np.concatenate([rng.uniform(-2.5, 2.5, n), rng.uniform(-3, 3, n)])
        torque = rng.uniform(-100, 100, n)
        E, A, B, C = system.evaluate(system.premise_values(x))
        rate = np.linalg.solve(E, A @ x + B @ torque)
        assert_array_equal(rate[:n], x[n:])
        assert_allclose(rate[n:], arm.forward_dynamics(x[:n], x[n:], torque), rtol=1e-10, atol=1e-9)
        assert_array_equal(C @ x, x[:n])


def test_registry_knows_all_robots_and_gives_each_one_line() -> None:
    assert {entry.id for entry in robots()} == {"arm2", "arm2-upright", "arm3", "arm3-light", "fivebar", "spring-disc"}
    for entry in robots():
        assert robot(entry.id) == entry
        assert entry.summary
        assert "\n" not in entry.summary
        assert entry.domain.joints == entry.model.joints == len(entry.limits.torque_nm)


def test_when_robot_is_unknown_expect_the_known_ones_listed() -> None:
    with pytest.raises(InputError, match="got arm9, expected one of arm2, arm3"):
        robot("arm9")
