"""Postfix programs against sympy's own numerics, the mathematics of their operations, and the rules of the format."""

import itertools

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from quasilpv.artifact.compilation import compile_program
from quasilpv.documents.programs import MAX_LENGTH, MAX_STACK, OPERATIONS, Program, evaluate
from quasilpv.errors import InputError

THETA = sp.symbols("theta_1:4", real=True)
OMEGA = sp.symbols("omega_1:4", real=True)
RATE = sp.symbols("rdot_1:4", real=True)
INPUTS = {
    symbol: (name, i)
    for name, symbols in (("angle", THETA), ("speed", OMEGA), ("reference_speed", RATE))
    for i, symbol in enumerate(symbols)
}

LEAVES = st.sampled_from([*INPUTS]) | st.fractions(-5, 5, max_denominator=20).map(
    lambda x: sp.Rational(x.numerator, x.denominator)
)


def grow(inner: st.SearchStrategy) -> st.SearchStrategy:
    """Operations that are defined for every real operand, so that any nesting of them can be compared."""
    unary = st.sampled_from(
        [
            sp.sin,
            sp.cos,
            sp.sinc,
            sp.atan,
            lambda x: sp.tan(sp.cos(x)),
            lambda x: -x,
            lambda x: x**2,
            lambda x: sp.sqrt(x**2 + 1),
            lambda x: 1 / (x**2 + 1),
            lambda x: sp.asin(x / sp.sqrt(x**2 + 1)),
            lambda x: sp.acos(x / sp.sqrt(x**2 + 2)),
            lambda x: sp.exp(-(x**2)),
        ]
    )
    binary = st.sampled_from(
        [
            lambda a, b: a + b,
            lambda a, b: a - b,
            lambda a, b: a * b,
            lambda a, b: a / (b**2 + 1),
            lambda a, b: sp.atan2(a, b**2 + 1),
        ]
    )
    return st.builds(lambda f, x: f(x), unary, inner) | st.builds(lambda f, a, b: f(a, b), binary, inner, inner)


EXPRESSIONS = st.recursive(LEAVES, grow, max_leaves=8)
STATES = st.lists(st.floats(-3, 3), min_size=9, max_size=9).map(lambda values: np.array(values).reshape(3, 3))


@given(st.lists(EXPRESSIONS, min_size=1, max_size=3), STATES)
def test_when_expressions_are_compiled_expect_the_values_sympy_computes_to_30_digits(expressions: list, state) -> None:
    program = compile_program(expressions, INPUTS)
    values = evaluate(program, *state)
    # The doubles as they are, with more digits than are asked for: sympy computes with no more than its numbers have.
    exactly = (sp.Float(number, 50) for number in state.ravel().tolist())
    substitution = dict(zip(itertools.chain(THETA, OMEGA, RATE), exactly, strict=True))
    for expression, value in zip(expressions, values, strict=True):
        exact = complex(sp.N(sp.sympify(expression).subs(substitution), 30))
        # sympy takes atan2 and roots through complex numbers, whose imaginary part is then rounding.
        assert abs(exact.imag) <= 1e-25 * max(1.0, abs(exact))
        # Rounding is relative to the intermediate values, which nested squares of operands up to 3 can make large.
        assert value == pytest.approx(exact.real, rel=1e-9, abs=1e-9)


@given(EXPRESSIONS, st.lists(STATES, min_size=2, max_size=4))
def test_when_many_samples_are_evaluated_at_once_expect_the_values_of_one_at_a_time(expression, states: list) -> None:
    program = compile_program([expression], INPUTS)
    together = evaluate(program, *np.moveaxis(np.array(states), 0, -1))
    one_by_one = np.array([evaluate(program, *state) for state in states]).T
    np.testing.assert_array_equal(together, one_by_one)


def test_when_gravity_and_coriolis_of_a_double_pendulum_are_compiled_expect_lambdify() -> None:
    energy = 3 * sp.cos(THETA[0]) + sp.Rational(3, 2) * sp.cos(THETA[0] + THETA[1])
    coupling = sp.sin(THETA[1]) * (2 * OMEGA[0] * OMEGA[1] + OMEGA[1] ** 2)
    expressions = [-sp.diff(energy, THETA[0]), -sp.diff(energy, THETA[1]), -coupling, sp.sin(THETA[1]) * OMEGA[0] ** 2]
    compiled = compile_program(expressions, INPUTS)
    reference = sp.lambdify([*THETA, *OMEGA], expressions, "numpy")
    rng = np.random.default_rng(1)
    for _ in range(200):
        theta, omega = rng.uniform(-3, 3, (2, 3))
        np.testing.assert_allclose(evaluate(compiled, theta, omega), reference(*theta, *omega), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("x", [0.0, 5e-324, 1e-300, 1e-160, 1e-9, 1e-4, 0.01, 1.0, 3.0, 4.493409457909064, 30.0])
def test_when_sinc_is_near_or_far_from_zero_expect_sin_x_over_x_to_the_last_digits(x: float) -> None:
    program = compile_program([sp.sinc(THETA[0])], INPUTS)
    with mpmath.workdps(40):
        exact = float(mpmath.sin(x) / x) if x else 1.0
    for value in (x, -x):
        assert evaluate(program, [value])[0] == pytest.approx(exact, rel=4e-16, abs=1e-17)


def test_when_equal_expressions_are_written_differently_expect_equal_code() -> None:
    a, b, c = THETA
    one = compile_program([a + b * c - sp.cos(a), a * b * c], INPUTS)
    other = compile_program([-sp.cos(a) + c * b + a, c * a * b], INPUTS)
    assert one == other


def test_when_a_difference_or_quotient_is_compiled_expect_sub_and_div_and_the_deeper_value_on_the_left() -> None:
    a, b, _ = THETA
    assert compile_program([a - b], INPUTS).code == (("angle", 0), ("angle", 1), ("sub",))
    assert compile_program([a / b], INPUTS).code == (("angle", 0), ("angle", 1), ("div",))
    assert evaluate(Program(outputs=1, code=(("const", 1), ("const", -1), ("atan2",))), [0.0])[0] == 3 * np.pi / 4


def test_when_no_joint_is_read_expect_constants_of_the_shape_of_the_samples() -> None:
    program = compile_program([sp.Integer(0), sp.pi, sp.sqrt(2)], INPUTS)
    assert evaluate(program, np.zeros((3, 4))).shape == (3, 4)
    np.testing.assert_array_equal(evaluate(program, np.zeros(3)), [0.0, np.pi, np.sqrt(2)])


def test_when_an_operation_leaves_its_domain_expect_nan_without_a_warning() -> None:
    program = compile_program([sp.asin(THETA[0]), sp.sqrt(THETA[1]), 1 / THETA[2]], INPUTS)
    values = evaluate(program, [2.0, -1.0, 0.0])
    assert np.isnan(values[:2]).all()
    assert np.isinf(values[2])


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (sp.Symbol("friction"), "got friction, expected one of theta_1"),
        (sp.erf(THETA[0]), "got erf.*expected one of const, angle"),
        (THETA[0] ** 17, "integer power of at most 16"),
        (THETA[0] ** THETA[1], "integer power"),
        (sp.I * THETA[0], "a finite real number"),
        (sp.nan, "a finite real number"),
        (THETA[0] + sp.Integer(10) ** 400, "a finite real number"),
    ],
)
def test_when_an_expression_has_no_program_expect_what_is_wrong_with_it(expression, message: str) -> None:
    with pytest.raises(InputError, match=message):
        compile_program([expression], INPUTS)


def test_when_code_would_be_too_long_or_too_deep_expect_input_error() -> None:
    term = sum((sp.cos(k * THETA[0]) for k in range(1, 100)), sp.Integer(0))
    assert len(compile_program([term], INPUTS).code) < MAX_LENGTH
    with pytest.raises(InputError, match=f"at most {MAX_LENGTH}"):
        compile_program([term] * 20, INPUTS)
    with pytest.raises(InputError, match=f"stack of at most {MAX_STACK}"):
        compile_program([THETA[0]] * (MAX_STACK + 1), INPUTS)


@pytest.mark.parametrize(
    ("outputs", "code", "message"),
    [
        (1, (("add",),), r"code\[0\]: got add on a stack of 0, expected 2 values"),
        (1, (("const", 1), ("mul",)), r"code\[1\]: got mul on a stack of 1"),
        (2, (("const", 1),), "outputs: got 2, expected 1"),
        (0, (("const", 1),), "outputs: got 0, expected 1"),
        (1, (("const",),), "one number of at most"),
        (1, (("const", True),), "one number of at most"),
        (1, (("const", "1"),), "one number of at most"),
        (1, (("const", float("inf")),), "one number of at most"),
        (1, (("const", float("nan")),), "one number of at most"),
        (1, (("const", 1, 2),), "one number of at most"),
        (1, (("angle", -1),), "one joint index from 0 to 6"),
        (1, (("angle", 7),), "one joint index from 0 to 6"),
        (1, (("angle", 0.5),), "one joint index from 0 to 6"),
        (1, (("angle", 0), ("pow_int", 0)), "one integer exponent from 1 to 16"),
        (1, (("angle", 0), ("pow_int", 17)), "one integer exponent from 1 to 16"),
        (1, (("angle", 0), ("sin", 1)), "no argument"),
        (1, (("tan",),), "an operation of the list"),
        (1, ((),), "an operation of the list"),
        (1, ((1,),), "an operation of the list"),
    ],
)
def test_when_code_breaks_a_rule_expect_the_instruction_in_the_error(outputs: int, code: tuple, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Program(outputs=outputs, code=code)


def test_when_the_stack_is_exactly_full_expect_it_accepted_and_one_more_refused() -> None:
    full = (("const", 1),) * MAX_STACK
    adds = (("add",),) * (MAX_STACK - 1)
    assert evaluate(Program(outputs=1, code=full + adds), [0.0])[0] == MAX_STACK
    with pytest.raises(ValidationError, match="stack depth 65"):
        Program(outputs=1, code=(*full, ("const", 1), ("add",), *adds))


def test_when_an_input_is_missing_or_too_short_expect_its_name_and_the_joints_it_needs() -> None:
    program = compile_program([THETA[2] * OMEGA[1]], INPUTS)
    assert program.inputs() == {"angle": 2, "speed": 1}
    with pytest.raises(InputError, match="speed: got nothing, expected at least 2 joints"):
        evaluate(program, [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"angle: got shape \(2,\), expected at least 3 joints"):
        evaluate(program, [1.0, 2.0], [1.0, 2.0])


def test_when_the_list_of_operations_is_read_expect_exactly_that_of_the_format() -> None:
    operands = {"const", "angle", "speed", "reference_speed", "signal"}
    unary = {"neg", "sin", "cos", "asin", "acos", "exp", "sqrt", "sinc", "pow_int"}
    unary |= {"log", "tanh", "abs", "sinc_slope", "expm1_quotient", "tanh_quotient"}
    binary = {"add", "sub", "mul", "div", "atan2", "min", "max"} | {
        f"{name}_chord" for name in ("log", "abs", "atan", "asin")
    }
    pops = {name: operation.pops for name, operation in OPERATIONS.items()}
    assert pops == {**dict.fromkeys(operands, 0), **dict.fromkeys(unary, 1), **dict.fromkeys(binary, 2)}
