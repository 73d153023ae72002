"""Every function a person may write in an equation, from its formula to the plant and the controller in C++."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi

import mpmath
import numpy as np
import pytest
import sympy as sp
from flint import arb
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import quasilpv as ql
from quasilpv import _runtime
from quasilpv.artifact.compilation import compile_program
from quasilpv.artifact.plant_program import QUOTIENTS, residual_expressions
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.documents.programs import Program, abs_chord, asin_chord, atan_chord, evaluate_signals, sinc_slope
from quasilpv.errors import InputError
from quasilpv.experiments.system_run import SystemExperiment, simulate
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release import release_system
from quasilpv.systems.descriptor.factorings import factorings
from quasilpv.systems.descriptor.formula import FUNCTIONS
from quasilpv.systems.intervals.algebra import of_functions
from quasilpv.systems.intervals.chords import CHORDS, sinc_chord
from reference.released_systems import loaded, on_the_border

FULL = pytest.mark.full

WRITTEN: list[tuple[str, Callable[[float], float]] | object] = [
    ("x*abs(x)", lambda x: x * abs(x)),
    ("sat(2*x, 0.5)", lambda x: min(max(2 * x, -0.5), 0.5)),
    ("tan(x + 0.3) - tan(0.3)", lambda x: np.tan(x + 0.3) - np.tan(0.3)),
    ("asin(x/3)", lambda x: np.arcsin(x / 3)),
    ("sinh(x)", np.sinh),
    ("sign(x)*x", abs),
    *(
        pytest.param(*each, marks=FULL)
        for each in (
            ("abs(x)", abs),
            ("abs(x - 1/2) - 1/2", lambda x: abs(x - 0.5) - 0.5),
            ("max(x, 0)", lambda x: max(x, 0.0)),
            ("max(x - 1/2, 0, 2*x - 3/2)", lambda x: max(x - 0.5, 0.0, 2 * x - 1.5)),
            ("min(x, 0.5)", lambda x: min(x, 0.5)),
            ("sat(x)", lambda x: min(max(x, -1.0), 1.0)),
            ("dead_zone(x, 0.3)", lambda x: x - min(max(x, -0.3), 0.3)),
            ("tan(x)", np.tan),
            ("atan(x)", np.arctan),
            ("atan(3*x + 1) - atan(1)", lambda x: np.arctan(3 * x + 1) - pi / 4),
            ("acos(x/3) - acos(0)", lambda x: np.arccos(x / 3) - pi / 2),
            ("cosh(x) - 1", lambda x: np.cosh(x) - 1),
            ("sinh(x - 1) + sinh(1)", lambda x: np.sinh(x - 1) + np.sinh(1)),
            ("cosh(x + 1) - cosh(1)", lambda x: np.cosh(x + 1) - np.cosh(1)),
            ("tanh(x + 1) - tanh(1)", lambda x: np.tanh(x + 1) - np.tanh(1)),
            ("sinh(x)/cosh(x)", np.tanh),
            ("exp(x) - 1", np.expm1),
            ("log(2 + x) - log(2)", lambda x: np.log1p(x / 2)),
            ("sqrt(2 + x) - sqrt(2)", lambda x: np.sqrt(2 + x) - np.sqrt(2)),
            ("(2 + x)^(1/3) - 2^(1/3)", lambda x: np.cbrt(2 + x) - np.cbrt(2)),
            ("(2 + x)^1.5 - 2^1.5", lambda x: (2 + x) ** 1.5 - 2**1.5),
            ("x*sinc(x)", np.sin),
            ("piecewise(x < 1/2, x, x > 1, 3/4, 1/4 + x/2)", lambda x: min(x, 0.25 + x / 2, 0.75)),
        )
    ),
]


@pytest.mark.parametrize(("formula", "function"), WRITTEN)
def test_a_function_reaches_the_plant_and_the_loop_in_cpp(formula: str, function: Callable[[float], float]) -> None:
    system = ql.DescriptorSystem.from_equations(
        [f"x' = {formula} + u"], name="one", state="x", inputs="u", domain={"x": (-1.2, 1.2)}
    )
    artifact = release_system(RegionalRequest(system, input_limits={"u": 20.0}))
    x, u, rate = np.random.default_rng(3).uniform(-1.2, 1.2, (3, 300))
    for v, w, r in zip(x, u, rate, strict=True):
        residual = evaluate_signals(artifact.plant.residual, [v, w, r])[0]
        assert residual == pytest.approx(r - function(v) - w, abs=1e-12)
    for v, w, r in zip(x[:50], u, rate, strict=False):
        slope = evaluate_signals(artifact.plant.jacobian[0], [v, w, r])[1]
        assert slope == pytest.approx(-(function(v + 1e-7) - function(v - 1e-7)) / 2e-7, rel=1e-5, abs=1e-5)

    samples, start = 60, on_the_border(artifact, np.random.default_rng(1), 0.6)["x"]
    found = simulate(artifact, SystemExperiment({"x": start}, {}, samples * artifact.sample_period_s, tolerance=1e-11))
    controller, value = _runtime.SystemController(loaded(artifact)), start
    for k in range(samples):
        assert found.state[k, 0] == pytest.approx(value, abs=1e-8)
        held = controller.step([value], [])["input"][0]
        period = (0.0, artifact.sample_period_s)
        value = solve_ivp(lambda _, y, h=held: [function(y[0]) + h], period, [value], rtol=1e-11, atol=1e-13).y[0, -1]


def test_every_function_of_the_language_has_a_program() -> None:
    w = sp.Symbol("w", real=True)
    numbers = {name: entry for name, entry in FUNCTIONS.items() if name not in {"rate", "piecewise"}}
    for name, (function, least, _) in numbers.items():
        expression = function(*[w / 3, sp.Rational(1, 7), sp.Rational(1, 5)][:least])
        program = compile_program([expression], {w: ("signal", 0)})
        for value in (0.2, 0.9, 2.5):
            expected = float(sp.N(expression.subs(w, sp.Float(value, 40)), 30))
            assert evaluate_signals(program, [value])[0] == pytest.approx(expected, rel=1e-14), name


OFFSETS = st.sampled_from([0.0, 1e-30, 1e-9, 1e-6, 1.1e-5, 1e-3, 0.3]).map(float)


@given(a=st.floats(-0.49, 0.49), size=OFFSETS, sign=st.sampled_from([-1.0, 1.0]), zero=st.booleans())
def test_chords_of_programs_are_chords_to_the_last_digits(a: float, size: float, sign: float, zero: bool) -> None:
    a, w = (0.0 if zero else a), sign * size
    x, y = sp.symbols("x y", real=True)
    with mpmath.workdps(400):
        for function, chord in CHORDS.items():
            if chord is sinc_chord:
                continue  # has no program
            offset = 2.0 if function is sp.log else 0.0
            g = sp.lambdify(x, function(x), "mpmath") if function.__name__ != "Ramp" else (lambda v: max(v, 0))
            begin, step = mpmath.mpf(a + offset), mpmath.mpf(w)
            program = compile_program([chord(x, y)], {x: ("signal", 0), y: ("signal", 1)})
            value = evaluate_signals(program, [a + offset, w])[0]
            if w != 0.0:
                assert value == pytest.approx(float((g(begin + step) - g(begin)) / step), rel=3e-15, abs=1e-15)
            elif not (a == 0.0 and function.__name__ in {"Abs", "Ramp"}):
                slope = sp.lambdify(x, sp.diff(function(x), x), "mpmath")
                assert value == pytest.approx(float(slope(begin)), rel=3e-15, abs=1e-15)


@given(
    a=st.floats(-0.4, 0.4),
    w=st.floats(-0.4, 0.4),
    radii=st.tuples(*[st.sampled_from([0.0, 1e-12, 1e-3, 0.09])] * 2),
    shares=st.tuples(*[st.floats(-1, 1)] * 2),
)
def test_the_checker_encloses_what_the_controller_computes(
    a: float, w: float, radii: tuple[float, float], shares: tuple[float, float]
) -> None:
    at = [a + radii[0] * shares[0], w + radii[1] * shares[1]]
    assume(at[1] == 0.0 or abs(at[1]) > 1e-290)  # below it doubles have fewer digits
    balls = [arb(a, radii[0] * (1 + 1e-9)), arb(w, radii[1] * (1 + 1e-9))]
    chords = {"abs_chord": abs_chord, "atan_chord": atan_chord, "asin_chord": asin_chord}
    for name, chord in chords.items():
        (ball,) = program_values([("signal", 0), ("signal", 1), (name,)], signal=balls)
        value = float(chord(*map(np.float64, at)))
        assert float(ball.lower()) - 1e-14 <= value <= float(ball.upper()) + 1e-14
        (number,) = program_values([("signal", 0), ("signal", 1), (name,)], signal=[np.float64(v) for v in at])
        if not (name == "abs_chord" and abs(at[1]) < 1e-5 and abs(at[0]) < 1e-5):
            assert number == pytest.approx(value, abs=1e-9)
    for name in ("asin", "acos"):
        (ball,) = program_values([("signal", 0), (name,)], signal=balls)
        assert ball.overlaps(getattr(arb(at[0]), name)())


@given(middle=st.floats(-8, 8), radius=st.sampled_from([0.0, 1e-9, 0.01, 0.3]), share=st.floats(-1, 1))
def test_the_slope_of_sinc_is_computed_and_enclosed(middle: float, radius: float, share: float) -> None:
    x = middle + radius * share
    with mpmath.workdps(400):
        exact = float((mpmath.cos(x) - mpmath.sin(x) / mpmath.mpf(x)) / mpmath.mpf(x)) if x else 0.0
    assert sinc_slope(np.float64(x)) == pytest.approx(exact, abs=3e-15)
    (ball,) = program_values([("signal", 0), ("sinc_slope",)], signal=[arb(middle, radius * (1 + 1e-9))])
    assert float(ball.lower()) - 1e-15 <= exact <= float(ball.upper()) + 1e-15
    (number,) = program_values([("signal", 0), ("sinc_slope",)], signal=[np.float64(x)])
    assert number == pytest.approx(exact, abs=1e-11)


def test_a_jump_is_no_function_of_an_equation() -> None:
    with pytest.raises(InputError, match="a continuous function"):
        ql.DescriptorSystem.from_equations(
            ["x' = sign(x) + u"], name="one", state="x", inputs="u", domain={"x": (-1.0, 1.0)}
        )


def test_numbers_beyond_2_to_the_53_are_numbers_of_programs() -> None:
    """As JSON has them, without a point: 0.2 as a fraction has a denominator of 55 bits."""
    large = 54043195528445950
    assert float(large) != large
    program = Program.model_validate_json(f'{{"outputs": 1, "code": [["const", {large}]]}}')
    assert program.code == (("const", 5.404319552844595e16),)
    assert type(Program.model_validate_json('{"outputs": 1, "code": [["const", 3]]}').code[0][1]) is int
    system = ql.DescriptorSystem.from_equations(
        ["X' = 0.4*S/(0.4+S)*X - d*X", "S' = d*(4 - S) - 2.5*0.4*S/(0.4+S)*X"],
        name="bioreactor",
        state="X S",
        inputs="d",
        domain={"X": (1.0, 1.8), "S": (0.2, 0.8)},
        equilibrium=((1.44, 0.4), (0.2,)),
    )
    artifact = release_system(RegionalRequest(system))
    rates = evaluate_signals(artifact.plant.residual, [0.1, -0.1, 0.05, 0.0, 0.0])
    X, S, d = 1.54, 0.3, 0.25
    growth = 0.4 * S / (0.4 + S) * X
    assert rates == pytest.approx([d * X - growth, 2.5 * growth - d * (4 - S)], abs=1e-13)


def test_functions_of_large_fractions_are_factored_as_what_they_are() -> None:
    """A reactor around a trim of doubles: sympy takes its exponential for a power of degree 10^13 and does not end."""
    system = ql.DescriptorSystem.from_equations(
        [
            "x1' = -x1 + 0.072*(1 - x1)*exp(x2/(1 + x2/20))",
            "x2' = -x2 + 8*0.072*(1 - x1)*exp(x2/(1 + x2/20)) + 0.3*(u - x2)",
        ],
        name="reactor",
        state="x1 x2",
        inputs="u",
        domain={"x1": (0.3, 0.7), "x2": (1.8, 3.8)},
        equilibrium=((0.4471593234428909, 2.751749300698748), (-1.6554491830551404e-06,)),
    )
    assert len(system.premises) <= 4
    w = sp.Symbol("w", real=True)
    kept = sp.exp(sp.Rational(10**13 + 1, 7) * w)
    assert of_functions(sp.factor, kept * w + kept) == kept * (w + 1)


def test_near_an_equilibrium_that_is_not_quite_one_the_message_has_one() -> None:
    given = {"name": "pump", "state": "a b", "inputs": "u", "domain": {"a": (0.5, 1.5), "b": (1.0, 3.0)}}
    equations = ["a' = u - sqrt(a)", "b' = a - b/2 + 0*u"]
    with pytest.raises(InputError, match=r"drift at x = 0.*it rests at \(\(") as refused:
        ql.DescriptorSystem.from_equations(equations, equilibrium=((1.01, 2.0), (1.0,)), **given)
    near = str(refused.value).rsplit("it rests at ", 1)[1]
    numbers = [float(part) for part in near.replace("(", " ").replace(")", " ").replace(",", " ").split()]
    assert numbers == pytest.approx([1.0, 2.0, 1.0], abs=0.02)
    system = ql.DescriptorSystem.from_equations(equations, equilibrium=(numbers[:2], numbers[2:]), **given)
    assert system.order == 2
    with pytest.raises(InputError, match=r"or make it an input$"):  # there is none near
        ql.DescriptorSystem.from_equations(
            ["a' = 1 + a^2"], name="none", state="a", inputs="", domain={"a": (-1, 1)}, equilibrium=((0.1,), ())
        )


def test_another_factoring_keeps_the_equilibrium_and_the_equations() -> None:
    """The first factoring with a design is taken: one without the trim would be a controller of another point."""
    system = ql.DescriptorSystem.from_equations(
        ["X' = S*X/(1 + S) - d*X", "S' = d*(2 - S) - 2*S*X/(1 + S)"],
        name="chemostat",
        state="X S",
        inputs="d",
        domain={"X": (0.4, 0.6), "S": (0.8, 1.2)},
        equilibrium=((0.5, 1.0), (0.5,)),
        units={"X": "g/l"},
    )
    others = list(factorings(system))
    assert len(others) > 1
    for other in others:
        assert (other.trim, other.equations, other.units) == (system.trim, system.equations, system.units)
    artifact = release_system(RegionalRequest(system))
    assert [s.trim for s in artifact.signals] == [0.5, 1.0, 0.5]
    run = simulate(artifact, SystemExperiment({"X": 0.5, "S": 1.0}, {}, 0.1))
    assert np.abs(run.state - [0.5, 1.0]).max() < 1e-12


@pytest.mark.parametrize("drift", ["sin(a + 2*b)", "tan(a/3 - b)*(1 + b)", "abs(a + b) - 2*max(a - b, 0)"])
def test_functions_of_sums_are_functions_again_in_the_plant(drift: str) -> None:
    """sinc(a + 2 b) a + 2 sinc(a + 2 b) b has a slope that no program computes at 0; its sum has one everywhere."""
    system = ql.DescriptorSystem.from_equations(
        ["a' = b", f"b' = {drift} + u"],
        name="sum",
        state="a b",
        inputs="u",
        domain={"a": (-0.5, 0.5), "b": (-0.5, 0.5)},
    )
    artifact = release_system(RegionalRequest(system))
    assert artifact.sampling is not None
    rows = [evaluate_signals(row, [0.0] * 5) for row in artifact.plant.jacobian]
    assert np.isfinite(rows).all()


def test_of_matrices_too_a_quotient_times_a_sum_is_the_function_again() -> None:
    """Without its equations, as a system given by matrices: the plant is put together from premises."""
    system = ql.DescriptorSystem.from_equations(
        ["a' = b", "b' = 3*sin(a + 2*b) + u"], name="sum", state="a b", inputs="u", domain={"a": (-1, 1), "b": (-1, 1)}
    )
    signals = sp.symbols("a b u", real=True)
    written, built = (residual_expressions(each, signals) for each in (system, replace(system, equations=())))
    assert not any(row.has(*QUOTIENTS) for row in built)
    for one, other in zip(written, built, strict=True):
        assert abs(sp.N((one - other).subs(dict(zip(signals, (0.3, -0.7, 0.2), strict=True))))) < 1e-12
