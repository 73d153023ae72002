"""What a user calls things: one name is one thing, nothing is declared in vain, and what is refused is named."""

import math
import pickle
from fractions import Fraction
from math import inf, nan

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from quasilpv.errors import MOST_NAMES, InputError
from quasilpv.systems.descriptor.equations import rate
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

x, v, P, u = sp.symbols("x v P u", real=True)
t = sp.Symbol("t")
MOTION = ["x' = v", "v' = -P*x - v*x**2 + u"]


def build(equations=MOTION, **changes) -> DescriptorSystem:  # type: ignore[no-untyped-def]
    given = {
        "name": "toy",
        "state": "x v",
        "inputs": "u",
        "domain": {"x": (-1, 1), "P": (1, 2)},
        "unknown": "P",
        **changes,
    }
    return DescriptorSystem.from_equations(equations, **given)


def assert_same(one: DescriptorSystem, other: DescriptorSystem) -> None:
    assert one.state == other.state
    assert one.inputs == other.inputs
    assert [(p.expression, p.bounds, p.kind) for p in one.premises] == [
        (p.expression, p.bounds, p.kind) for p in other.premises
    ]
    for first, second in zip((one.E, one.A, one.B, one.C), (other.E, other.A, other.B, other.C), strict=True):
        assert_allclose(first.constant, second.constant)
        assert_allclose(first.coefficients, second.coefficients)


def in_symbols(*assumptions: dict[str, bool]) -> DescriptorSystem:
    """The toy in symbols; those given for the unknown have other assumptions than those in the equations."""
    of_equations, of_names = assumptions
    a, b, p, w = (sp.Symbol(name, **of_equations) for name in "xvPu")
    q, s = sp.Symbol("P", **of_names), sp.Symbol("x", **of_names)
    return build(
        [sp.Eq(rate(a), b), rate(b) + p * a + b * a**2 - w],
        state=(s, b),
        inputs=(w,),
        domain={s: (-1, 1), q: (1, 2)},
        unknown=(q,),
        outputs=[s, b],
    )


@pytest.mark.parametrize("first", [{}, {"real": True}, {"finite": True}])
@pytest.mark.parametrize("second", [{}, {"real": True}, {"extended_real": True}])
def test_symbols_of_one_name_are_one_thing(first: dict[str, bool], second: dict[str, bool]) -> None:
    model = in_symbols(first, second)
    assert_same(model, build())
    assert [p.kind for p in model.premises] == [PremiseKind.MEASURED, PremiseKind.UNKNOWN]
    assert_allclose(model.premise_values([0.5, 1.0], {sp.Symbol("P"): 1.5}), [0.25, 1.5])
    assert_allclose(model.premise_values([0.5, 1.0], {"P": 1.5}), [0.25, 1.5])


def test_functions_of_time_and_their_derivatives_are_states_and_rates() -> None:
    X, V = (sp.Function(name)(t) for name in "xv")
    model = build([sp.Eq(X.diff(t), V), V.diff(t) + P * X + V * X**2 - u], state=(X, V))
    assert_same(model, build())


def test_both_constructors_take_text_and_symbols() -> None:
    from_text = DescriptorSystem.from_symbols(
        name="toy",
        state="x, v",
        inputs="u",
        E=[[1, 0], [0, 1]],
        A=[[0, 1], ["-P", "-x**2"]],
        B=[[0], [1]],
        C=[["1", 0], [0, 1.0]],
        domain={"x": (-1, 1), "P": (1, 2)},
        unknown=["P"],
    )
    from_symbols = DescriptorSystem.from_symbols(
        name="toy",
        state=sp.symbols("x v"),
        inputs=[sp.Symbol("u")],
        E=sp.eye(2),
        A=sp.Matrix([[0, 1], [-sp.Symbol("P", positive=True), -(sp.Symbol("x") ** 2)]]),
        B=sp.Matrix([0, 1]),
        C=sp.eye(2),
        domain={sp.Symbol("x"): (-1, 1), "P": (1, 2)},
        unknown=[P],
    )
    assert_same(from_text, from_symbols)
    assert {p.expression for p in from_text.premises} == {P, x**2}


def test_numbers_in_text_are_exact_and_doubles_the_rationals_they_are() -> None:
    model = build(["x' = 0.1*v", "v' = -P*x + 0.1*0.1*x + u"])
    assert model.A.constant[0, 1] == 0.1
    assert model.A.constant[1, 0] == float(Fraction(1, 100))  # 0.1 * 0.1 in doubles is another number


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"domain": {"x": (-1, 1), "p": (1, 2)}}, r"toy: domain: got p, which occurs nowhere"),
        ({"domain": {"x": (-1, 1), "Pow": (1, 2)}, "unknown": ()}, r"column 7: got P, .*one of x, v, Pow"),
        ({"domain": {"x": (-1, 1), "P": (1, 2), "xx": (0, 1)}}, r"toy: domain: got xx, which occurs nowhere.*mean x\?"),
        ({"unknown": "P, Q", "domain": {"x": (-1, 1), "P": (1, 2), "Q": (1, 2)}}, r"Q, which occurs nowhere"),
        ({"unknown": "x"}, r"toy: unknown: got x, expected a parameter"),
        ({"state": "x x"}, r"toy: state and inputs: got x twice"),
        ({"state": "x v", "inputs": "v"}, r"v twice"),
        ({"state": ""}, r"toy: state: got no name"),
        ({"state": ["x y", "v"]}, r"name: got x y, expected a name"),
        ({"domain": {"x": (1, -1), "P": (1, 2)}}, r"domain of x: got \(1.0, -1.0\).*reversed"),
        ({"domain": {"x": (1, 1), "P": (1, 2)}}, r"domain of x: got \(1.0, 1.0\), expected two numbers, lower < upper"),
        ({"domain": {"x": (nan, 1), "P": (1, 2)}}, r"domain of x: got \(nan, 1\)"),
        ({"domain": {"x": (inf, inf), "P": (1, 2)}}, r"domain of x: got \(inf, inf\)"),
        ({"domain": {"x": 3, "P": (1, 2)}}, r"domain of x: got 3, expected two numbers"),
        ({"domain": {"x": (1, 2, 3), "P": (1, 2)}}, r"domain of x: got \(1, 2, 3\)"),
        ({"domain": {"x": ("a", "b"), "P": (1, 2)}}, r"domain of x: got \('a', 'b'\)"),
        ({"domain": {"x": (-inf, inf), "P": (-inf, inf)}}, r"bounded range"),
        ({"domain": {x: (-1, 1), sp.Symbol("x"): (0, 1), P: (1, 2)}}, r"domain: got x twice"),
        ({"domain": {sp.Symbol("x", positive=True): (-1, 1), P: (1, 2)}}, r"because the symbol says positive"),
        ({"outputs": ["x", "u"]}, r"toy: output 2: column 1: got u"),
        ({"outputs": ["1 + x"]}, r"toy: output 1: value at x = 0: got 1"),
        ({"equilibrium": 3}, r"equilibrium: got 3"),
        ({"equilibrium": ([0], [0])}, r"equilibrium x0: got 1 values, expected 2"),
        ({"equilibrium": ({"y": 0}, {})}, r"equilibrium x0: got y, expected one of x, v"),
        ({"equilibrium": ({"x": nan}, {})}, r"equilibrium x0, x: got nan, expected a finite number"),
        ({"equilibrium": ({"x": 5}, {})}, r"toy: equation 2: drift at x = 0: got -5"),
    ],
)
def test_when_names_or_bounds_say_nothing_expect_one_line(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as raised:
        build(**changes)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("equations", "words"),
    [
        (["x' = v", "v' = -P*x + q"], r"equation 2: column 13: got q"),
        (["x' = v", "v' = -P*x + w'"], r"got w'"),
        ([x.diff(t) - v, x + P * v], r"equations: got no rate of a state, expected a rate, x' or rate\(x\)"),
        ([sp.Function("x")(t).diff(t, 2) - v, x + P * v], r"expected rates of states"),
        ([rate("y") - v, x + P * v], r"got the rate y', expected a rate of a state"),
        ([rate(x) - sp.Symbol("q") * v, rate(v) + P * x], r"equation 1: got q, expected a name that is declared"),
        ([rate(x) - v, sp.sign(x) + P * x + rate(v)], r"equation 2: drift: got sign\(x\)"),
    ],
)
def test_when_an_equation_says_nothing_expect_it_named(equations: list[object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        build(equations)


def test_equilibrium_shifts_exactly_and_what_is_left_is_reported() -> None:
    tank = {
        "name": "tank",
        "state": "h",
        "inputs": "q",
        "domain": {"h": (0.1, 0.9)},
        "outputs": ["2*h"],
    }
    equations = ["h' = q - sqrt(h)"]
    exact = DescriptorSystem.from_equations(equations, **tank, equilibrium=([0.25], [0.5]))
    assert exact.disturbance == ()
    assert exact.domain[sp.Symbol("h", real=True)] == pytest.approx((-0.15, 0.65))
    low, high = exact.domain[sp.Symbol("h", real=True)]
    assert Fraction(low) <= Fraction(0.1) - Fraction(1, 4)  # outward
    assert Fraction(high) >= Fraction(0.9) - Fraction(1, 4)
    for deviation in (-0.1, 0.0, 0.4):
        _, A, B, C = exact.evaluate(exact.premise_values([deviation]))
        assert_allclose(A @ [deviation] + B @ [0.1], [0.6 - np.sqrt(0.25 + deviation)], atol=1e-15)
        assert_allclose(C @ [deviation], [2 * deviation])
    rounded = DescriptorSystem.from_equations(equations, **tank, equilibrium=({"h": 0.3}, {"q": np.sqrt(0.3)}))
    (left,) = rounded.disturbance
    expected = sp.Rational(float(np.sqrt(0.3))) - sp.sqrt(sp.Rational(0.3))
    assert left == pytest.approx(float(sp.N(expected, 30)), rel=1e-6)
    assert 0 < abs(left) < 1e-15
    assert "constant disturbance of at most" in repr(rounded)
    assert "disturbance" not in repr(exact)
    with pytest.raises(InputError, match="tank: equation 1: drift at x = 0"):
        DescriptorSystem.from_equations(equations, **tank, equilibrium=({"h": 0.3}, {"q": 0.5477}))
    with pytest.raises(InputError, match="an interval that holds the equilibrium"):
        DescriptorSystem.from_equations(equations, **tank, equilibrium=({"h": 1}, {"q": 1}))


def test_an_equilibrium_in_doubles_of_a_balance_of_large_terms_is_one() -> None:
    """A boost converter: 12 = (1 - d) v + i/10 and (1 - d) i = 50/v up to the rounding of i and d."""
    i0 = (12 - math.sqrt(144 - 20)) / 0.2
    model = DescriptorSystem.from_equations(
        ["0.001*i' = 12 - (1-d)*v - 0.1*i", "0.0001*v' = (1-d)*i - 50/v"],
        state="i v",
        inputs="d",
        domain={"i": (0, 20), "v": (20, 30)},
        equilibrium=({"i": i0, "v": 24.0}, {"d": 1 - (12 - 0.1 * i0) / 24}),
    )
    assert max(map(abs, model.disturbance), default=0.0) < 1e-13


def test_premises_of_a_shifted_quotient_have_values_of_size_one() -> None:
    """A magnet: the doubles of the equilibrium must not become factors of 2^-180."""
    current = 0.01 * math.sqrt(981.0)
    model = DescriptorSystem.from_equations(
        ["x' = v", "v' = 9.81 - 0.01*i**2/x**2", "i' = u - i"],
        name="magnet",
        state="x v i",
        inputs="u",
        domain={"x": (0.005, 0.02), "i": (0.1, 1)},
        equilibrium=({"x": 0.01, "i": current}, {"u": current}),
    )
    for premise in model.premises:
        assert premise.upper - premise.lower > 1e-3
        assert max(abs(premise.lower), abs(premise.upper)) < 1e7
    for x, i in [(-0.004, 0.1), (0.005, -0.2), (0.0, 0.0)]:
        _, A, _, _ = model.evaluate(model.premise_values([x, 0.0, i]))
        force = 9.81 - 0.01 * (current + i) ** 2 / (0.01 + x) ** 2
        assert_allclose((A @ [x, 0.0, i])[1], force, rtol=1e-11, atol=1e-11)


def test_two_ways_of_writing_one_term_make_no_premise_that_is_zero() -> None:
    model = DescriptorSystem.from_equations(
        ["c' = -c - (1 + c)*exp(T/(1 + T/20)) + u + 1", "T' = -T + exp(T/(1 + T/20))/2 - 1/2"],
        state="c T",
        inputs="u",
        domain={"c": (-0.5, 0.5), "T": (-1, 1)},
    )
    assert len(model.premises) == 2
    assert all(premise.lower < premise.upper for premise in model.premises)


# ---- what the controller can compute ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outputs", "kinds"),
    [
        (["x", "v"], ["measured", "measured"]),
        (["x"], ["measured", "estimated"]),
        (["v"], ["estimated", "measured"]),
        (["x + v"], ["estimated", "estimated"]),
        (["x + v", "x - v"], ["measured", "measured"]),
        (["sin(x)", "v"], ["estimated", "measured"]),  # x has to be computed from a premise first
    ],
)
def test_a_premise_that_no_output_shows_is_not_measured(outputs: list[str], kinds: list[str]) -> None:
    model = build(["x' = v - x**3", "v' = -v**3 + u"], domain={"x": (-1, 1), "v": (-1, 1)}, unknown=(), outputs=outputs)
    found = {p.expression: p.kind.value for p in model.premises}
    assert [found[x**2], found[v**2]] == kinds


def test_a_premise_of_a_combination_is_measured_with_it() -> None:
    model = build(
        ["x' = v", "v' = -sin(x + v) + u"], domain={"x": (-1, 1), "v": (-1, 1)}, unknown=(), outputs=["x + v"]
    )
    assert [p.kind for p in model.premises] == [PremiseKind.MEASURED]


def test_a_premise_given_by_hand_is_not_measured_either_if_no_output_shows_it() -> None:
    model = DescriptorSystem.from_symbols(
        name="toy",
        state="x v",
        E=[[1, 0], [0, 1]],
        A=[[0, 1], ["cos(v)", 0]],
        B=[[], []],
        C=[[1, 0]],
        premises=[Premise("z1", sp.cos(sp.Symbol("v")), (-1.0, 1.0))],
        domain={"v": (-1, 1)},
    )
    assert [p.kind for p in model.premises] == [PremiseKind.ESTIMATED]


def test_a_system_travels_between_processes() -> None:
    model = build()
    model.premise_values([0.5, 1.0], {"P": 1.0})  # compiles
    assert_same(pickle.loads(pickle.dumps(model)), model)


def test_a_stranger_among_many_names_is_looked_for_in_the_system() -> None:
    """Names of a system are in no listing of the command line."""
    names = [f"x{k}" for k in range(MOST_NAMES + 1)]
    with pytest.raises(InputError, match="or another of the system") as caught:
        DescriptorSystem.from_equations([f"{name}' = -{name} + x99" for name in names], state=names, domain={})
    assert "design list" not in str(caught.value)
