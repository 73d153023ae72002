"""Systems given by implicit equations: the matrices say the same as the equations, in a fixed way."""

from math import pi

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from quasilpv.errors import InputError
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.equations import rate
from quasilpv.systems.descriptor.factoring import factored
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient
from quasilpv.systems.robots.registry import robots

x1, x2, x3, u, force, delta = sp.symbols("x1 x2 x3 u lambda delta", real=True)
z3 = sp.Symbol("z3", real=True)
INTERVALS = {x1: (-3.0, 3.0), x2: (-2.0, 2.0), x3: (-1.0, 1.0), force: (-9.0, 9.0)}
FACTORS = [
    x1,
    x2,
    x3,
    sp.sin(x1),
    sp.sin(x1 - 2 * x3),
    sp.cos(x2),
    1 / (1 + x2**2),
    sp.exp(-x1),
    sp.sin(x1 * x2),
    sp.tanh(2 * x3),
]


def box(*names: sp.Symbol) -> dict[sp.Symbol, tuple[float, float]]:
    return {name: INTERVALS[name] for name in names}


@st.composite
def drifts(draw: st.DrawFn) -> sp.Expr:
    total = 2 * (1 - sp.cos(x1)) * draw(st.integers(0, 1)) + (sp.exp(3 * x2 - x1) - 1) * draw(st.integers(0, 1))
    for _ in range(draw(st.integers(1, 4))):
        factors = draw(st.lists(st.sampled_from(FACTORS), min_size=1, max_size=3))
        term = draw(st.integers(1, 9)) * sp.Mul(*factors)
        total += term if term.subs({x1: 0, x2: 0, x3: 0}) == 0 else term * x2
    return total


@given(drifts(), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
@settings(max_examples=60, deadline=None)
def test_factored_row_times_the_state_is_the_drift(drift: sp.Expr, values: list[float]) -> None:
    row = factored("toy", drift, (x1, x2, x3))
    at = dict(zip((x1, x2, x3), values, strict=True))
    product = sum(float(a.subs(at)) * v for a, v in zip(row, values, strict=True))
    assert_allclose(product, float(drift.subs(at)), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    ("drift", "row"),
    [
        (x1**3, [x1**2, 0]),
        (x1 * x2**2, [0, x1 * x2]),  # the last state
        (x1**2 * x2, [0, x1**2]),
        (sp.sin(x1), [sp.sinc(x1), 0]),
        (sp.sin(x1) * x2, [0, sp.sin(x1)]),  # a state before a sine
        (sp.sin(x1 + 2 * x2) * sp.cos(x1), [sp.sinc(x1 + 2 * x2) * sp.cos(x1), 2 * sp.sinc(x1 + 2 * x2) * sp.cos(x1)]),
        (1 - sp.cos(x1), [x1 / 2 * sp.sinc(x1 / 2) ** 2, 0]),
        (3 * sp.tanh(x2 / 2), [0, 3 * tanh_quotient(x2 / 2) / 2]),
        (sp.exp(2 * x1) - 1, [2 * expm1_quotient(2 * x1), 0]),
    ],
)
def test_terms_are_divided_by_the_documented_rule(drift: sp.Expr, row: list[sp.Expr]) -> None:
    assert factored("toy", drift, (x1, x2)) == row


def test_products_go_to_an_algebraic_state_so_that_premises_depend_on_differential_ones() -> None:
    assert factored("toy", x1 * x2 * x3, (x1, x2, x3)) == [0, 0, x1 * x2]
    assert factored("toy", x1 * x2, (x1, x2), algebraic=(x1,)) == [x2, 0]


# ---- the catalogue, rebuilt from its equations -----------------------------------------------------------------------


def rebuilt_regular() -> DescriptorSystem:
    cc, rational = sp.cos(x2) ** 2, 1 / (1 + x1**2)
    return DescriptorSystem.from_equations(
        [
            sp.Eq(rate(x1) + rate(x2), cc * x2 - x2 * rational + (1 + rational) * u),
            sp.Eq(
                -rate(x1) + cc * rate(x2),
                -sp.Rational(3, 2) * x1 + (5 * (2 + x1**2) * rational * sp.sinc(x2) - 3) * x2 + (2 * cc - 2) * u,
            ),
        ],
        name="ex-I.1",
        state=(x1, x2),
        inputs=(u,),
        domain=box(x1, x2),
    )


def rebuilt_rotation() -> DescriptorSystem:
    return DescriptorSystem.from_equations(
        [rate(x1) + x1 - (sp.cos(x1) + 5 * sp.sin(x1)) * x2, 2 * sp.sin(x1) * x1 + 5 * x2],
        name="ex-II.6",
        state=(x1, x2),
        inputs=(),
        domain={x1: (-pi, pi)},
    )


def rebuilt_singular(name: str) -> DescriptorSystem:
    a, b, third = -10, -20, z3 if name == "ex-III.10" else sp.sin(x1 / 10)
    z1, z2 = sp.exp(-2 * x1) / (1 + sp.exp(-2 * x1)), (1 + sp.sin(x2) ** 2) / 2
    known = sp.Matrix([[-z2 - 5, 1, z2], [z2, b * z2 - b, 1], [(a + 2) * z2 - 2, 0, 1]])
    unknown = third * sp.Matrix([5, 4, 6]) * sp.Matrix([[1, -1, 3]]) / 100
    gain = sp.Matrix([0, a, b]) + third * sp.Matrix([0, 16, 12]) / 100
    right = (known + unknown) * sp.Matrix([x1, x2, x3]) + gain * u
    return DescriptorSystem.from_equations(
        [rate(x1) - right[0], z1 * rate(x1) + rate(x2) - right[1], right[2]],
        name=name,
        state=(x1, x2, x3),
        inputs=(u,),
        domain={**box(x1, x2, x3), **({z3: (-1.0, 1.0)} if third is z3 else {})},
        unknown=(z3,) if third is z3 else (),
    )


def rebuilt_disc() -> DescriptorSystem:
    speed_rate = (-x1 - x1**3 - 2 * x2 + force) / sp.Rational(1, 2)
    spin_rate = (-2 * force + u) * (1 + delta) / 4  # 1/J_delta = 1/4 + delta/4
    return DescriptorSystem.from_equations(
        [x2 - 2 * x3, speed_rate - 2 * spin_rate, rate(x1) - x2, rate(x2) - speed_rate],
        name="ex-III.12",
        state=(x1, x2, x3, force),
        inputs=(u,),
        domain={**box(x1), delta: (0.0, 3.0)},
        unknown=(delta,),
    )


@pytest.mark.parametrize(
    ("rebuilt", "parameters"),
    [
        (rebuilt_regular(), {"a": 2.0, "b": 5.0}),
        (rebuilt_rotation(), {"a": -2.0, "b": -5.0}),
        (rebuilt_singular("ex-II.7"), {}),
        (rebuilt_singular("ex-III.10"), {}),
        (rebuilt_disc(), {"M": 0.5, "c": 3.0}),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_examples_rebuilt_from_their_equations_are_those_of_the_catalogue(
    rebuilt: DescriptorSystem, parameters: dict[str, float]
) -> None:
    known = system(rebuilt.name, **parameters)
    assert rebuilt.state == known.state
    assert rebuilt.differential == known.differential
    assert [p.kind for p in rebuilt.premises] == [p.kind for p in known.premises]
    rng = np.random.default_rng(6)
    for _ in range(20):
        at = {symbol: rng.uniform(-1, 1) for symbol in (*known.state, z3, delta)}
        ours, theirs = (
            model.evaluate(model.premise_values([at[s] for s in model.state], at)) for model in (rebuilt, known)
        )
        assert_allclose(ours.E, theirs.E, atol=1e-13)
        assert_allclose(_in_order(ours.A, rebuilt), _in_order(theirs.A, known), atol=1e-12)
        assert_allclose(_in_order(ours.B, rebuilt), _in_order(theirs.B, known), atol=1e-12)


def _in_order(matrix: np.ndarray, model: DescriptorSystem) -> np.ndarray:
    """Algebraic equations up to their sign and order, which an equation = 0 leaves open."""
    q = model.differential
    signs = [np.sign(row[np.flatnonzero(model.A.constant[q + k])[-1]]) for k, row in enumerate(model.A.constant[q:])]
    return np.vstack([matrix[:q], np.array(signs)[:, None] * matrix[q:]])


@pytest.mark.parametrize("entry", robots(), ids=lambda entry: entry.id)
def test_arm_rebuilt_from_its_equation_of_motion_moves_like_the_arm(entry) -> None:  # type: ignore[no-untyped-def]
    arm = entry.model
    n, symbols = arm.joints, arm.symbolic
    torque = sp.symbols(f"torque_1:{n + 1}")
    speeds, accelerations = (sp.Matrix([rate(s) for s in part]) for part in (symbols.theta, symbols.omega))
    motion = symbols.inertia * accelerations + symbols.coriolis * sp.Matrix(symbols.omega) + symbols.gravity
    intervals = zip(symbols.theta + symbols.omega, entry.domain.angle_rad + entry.domain.speed_rad_s, strict=True)
    model = DescriptorSystem.from_equations(
        [*(speeds - sp.Matrix(symbols.omega)), *(motion - sp.Matrix(torque))],
        name="rebuilt",
        state=symbols.theta + symbols.omega,
        inputs=torque,
        domain=dict(intervals),
        outputs=symbols.theta,
    )
    # Any factorisation of N spans the same functions of the angles. There cannot be fewer premises of M and H: a cosine
    # for each pair of joints, a stiffness for each joint.
    assert len([p for p in model.premises if not p.expression.free_symbols & set(symbols.omega)]) == n * (n + 1) // 2
    rng = np.random.default_rng(7)
    for _ in range(20):
        x, load = rng.uniform(-0.4, 0.4, 2 * n), rng.uniform(-50, 50, n)
        E, A, B, C = model.evaluate(model.premise_values(x))
        acceleration = np.linalg.solve(E, A @ x + B @ load)[n:]
        assert_allclose(acceleration, arm.forward_dynamics(x[:n], x[n:], load), rtol=1e-10, atol=1e-10)
        assert_array_equal(C @ x, x[:n])


# ---- order of states, unknown parameters, refusals -------------------------------------------------------------------


def test_algebraic_states_and_equations_are_moved_behind_the_others() -> None:
    model = DescriptorSystem.from_equations(
        [x1 + 3 * x3 + u, rate(x3) + x2, 2 * rate(x2) - x1 * x3**2],
        name="toy",
        state=(x1, x2, x3),
        inputs=(u,),
        domain=box(x1, x2, x3),
        outputs=[x2 + sp.sin(x3)],
    )
    assert model.state == (x2, x3, x1)
    assert model.differential == 2
    E, A, B, C = model.evaluate(model.premise_values([0.0, 0.5, 0.0]))
    assert_array_equal(E, [[0, 1, 0], [2, 0, 0], [0, 0, 0]])
    assert_array_equal(A, [[-1, 0, 0], [0, 0, 0.25], [0, -3, -1]])
    assert_array_equal(B[:, 0], [0, 0, -1])
    assert_allclose(C, [[1, np.sin(0.5) / 0.5, 0]])


def test_unknown_parameters_of_the_equations_are_unknown_premises() -> None:
    model = DescriptorSystem.from_equations(
        [rate(x1) + delta * x1 + x1**3 - u],
        name="toy",
        state=(x1,),
        inputs=(u,),
        domain={**box(x1), delta: (0.5, 2.0)},
        unknown=(delta,),
    )
    assert [(p.expression, p.kind, p.bounds) for p in model.premises] == [
        (x1**2, PremiseKind.MEASURED, (0.0, 9.0)),
        (delta, PremiseKind.UNKNOWN, (0.5, 2.0)),
    ]


def test_a_diode_and_smooth_friction_are_factored_and_bounded() -> None:
    model = DescriptorSystem.from_equations(
        [rate(x1) + 2 * (sp.exp(x1 / 3) - 1) - x2, rate(x2) + x1 + sp.tanh(5 * x2) - u],
        name="diode",
        state=(x1, x2),
        inputs=(u,),
        domain=box(x1, x2),
    )
    assert_allclose(model.premises[0].bounds, [1 - np.exp(-1.0), np.e - 1.0])  # (e^w - 1)/w for |w| <= 1
    assert_allclose(model.premises[1].bounds, [np.tanh(10.0) / 10.0, 1.0])
    for v, w in [(0.0, 0.0), (1.5, -0.3), (-3.0, 2.0)]:
        A = model.evaluate(model.premise_values([v, w])).A
        assert_allclose(A @ [v, w], [-2 * np.expm1(v / 3) + w, -v - np.tanh(5 * w)], rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    ("equations", "words"),
    [
        ([rate(x1) - x2, rate(x2) - 9.81 + u], r"equation 2: drift at x = 0: got 9.81"),
        ([rate(x1) - x2, rate(x2) - sp.sign(x1)], r"equation 2: drift: got sign\(x1\), expected a continuous function"),
        ([rate(x1) ** 2 - x2, rate(x2) - u], r"equation 1: coefficient of x1'"),
        ([rate(x1) - x2, rate(x2) - u**2], r"equation 2: coefficient of u"),
        ([rate(x1) - x2, u * rate(x2) - x1], r"equation 2: coefficient of x2'"),
        ([rate(x1) - x2, sp.Eq(1, 2)], r"equation 2: got False"),
        ([rate(x1) - x2], r"got 1 equations, expected 2"),
        ([rate(x1) + rate(x2) - u, x1 + x2], r"expected diag\(E_1, 0\)"),
    ],
)
def test_when_equations_have_no_descriptor_form_expect_the_equation_named(
    equations: list[sp.Expr | sp.Eq], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        DescriptorSystem.from_equations(equations, name="toy", state=(x1, x2), inputs=(u,), domain=box(x1, x2))
