"""Exact factoring: the row times the state is the expression, and the bounds of the row hold."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.factoring import factored, split
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.chords import CHORDS, Ramp
from quasilpv.systems.intervals.enclosure import enclose

x, y, p = sp.symbols("x y p", real=True)
HALF, LEVEL = sp.Rational(1, 2), sp.Rational(7, 10)
DOMAIN = {x: (-0.6, 0.7), y: (-0.5, 0.8), p: (1.0, 2.0)}

EXPRESSIONS = [
    sp.sin(1) * sp.sin(x),
    sp.sin(x + HALF) - sp.sin(HALF),
    sp.cos(x - 1) - sp.cos(1),
    1 / (1 + x) - 1,
    sp.sqrt(1 + x) - 1,
    1 / sp.sqrt(1 + x) - 1,
    sp.sqrt(LEVEL + x) - sp.sqrt(LEVEL),
    sp.exp(x + 2) - sp.exp(2),
    sp.exp(2 * x + y) - 1,
    sp.log(1 + x),
    sp.log(2 + x - y) - sp.log(2),
    sp.tan(x),
    sp.tan(x + HALF) - sp.tan(HALF),
    sp.atan(x),
    sp.atan(1 + 3 * x) - sp.pi / 4,
    sp.sinh(x),
    sp.sinh(x - 1) + sp.sinh(1),
    sp.cosh(x) - 1,
    sp.tanh(2 * x) + sp.tanh(y - x) / 3,
    sp.tanh(x + 1) - sp.tanh(1),
    sp.Abs(x) * y,
    sp.Abs(x) * x,
    sp.Abs(x + y),
    sp.Abs(x - sp.Rational(1, 5)) - sp.Rational(1, 5),
    sp.sign(x) * x**2,
    sp.Min(sp.Max(x, -HALF), HALF),
    x - sp.Min(sp.Max(x, -HALF), HALF),
    sp.Max(x, y),
    sp.Piecewise((x, x < HALF), (2 * x - HALF, True)),
    sp.Piecewise((x - HALF, x > HALF), (x + HALF, x < -HALF), (0, True)),
    sp.Piecewise((x**2 * y, x > 0), (x * y, True)),
    sp.Piecewise((sp.sqrt(x) * x, x >= 0), (sp.sin(x), True)),
    x / (1 + x**2),
    x * y / (1 + x + y**2),
    (1 + x) ** sp.Rational(3, 2) - 1,
    (1 + x) ** -sp.Rational(2, 3) - 1,
    (1 + x) ** 5 / (1 + y) - 1,
    2**x - 1,
    (2 + x) ** y - 1,
    sp.exp(y) * sp.sin(x + 1) - sp.sin(1),
    sp.sin(x + 1) * sp.cos(y - 1) * sp.exp(x) - sp.sin(1) * sp.cos(1),
    sp.exp(sp.sin(x)) - 1,
    sp.log(1 + sp.tanh(x) ** 2),
    sp.asin(x / 2 + y / 5),
    sp.acos(x / 2) - sp.pi / 2,
    sp.sinc(x + 1) - sp.sinc(1),
    sp.sqrt(p + x) - sp.sqrt(p),  # around a parameter
    sp.sin(p + x) - sp.sin(p),
    sp.atan(p * x),
    sp.log(p + x) - sp.log(p),
]


def residual_and_bounds(expression: sp.Expr, count: int, seed: int, tolerance: float = 1e-9) -> tuple[float, float]:
    """Largest residual, and by how much a value leaves its bounds at worst, both relative to the values."""
    row = factored("toy", expression, (x, y))
    function = sp.lambdify((x, y, p), [*row, expression], "numpy")
    unit = np.random.default_rng(seed).uniform(-1, 1, (3, count))
    points = np.array([(a + b) / 2 + (b - a) / 2 * u for (a, b), u in zip(DOMAIN.values(), unit, strict=True)])
    first, second, exact = (np.broadcast_to(np.asarray(v, dtype=float), count) for v in function(*points))
    size = 1 + np.abs(first) + np.abs(second) + np.abs(exact)
    residual = np.abs(first * points[0] + second * points[1] - exact) / size
    outside = 0.0
    for entry, values in zip(row, (first, second), strict=True):
        low, high = enclose(entry, DOMAIN, tolerance)
        outside = max(outside, *(np.maximum(low - values, values - high) / (1 + np.abs(values))))
    return float(residual.max()), outside


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_row_times_state_is_the_expression_and_bounds_hold(expression: sp.Expr) -> None:
    residual, outside = residual_and_bounds(expression, 200, 1)
    assert residual <= 1e-14
    assert outside <= 1e-10  # of a premise near w = 0 the rounded quotient is that inexact, not the bound


@st.composite
def compositions(draw: st.DrawFn, depth: int = 3) -> sp.Expr:
    """Smooth and cornered functions of each other whose arguments stay where they are defined."""
    if depth == 0:
        return draw(st.sampled_from([x, y, x + y, x - 2 * y, x * y]))
    inner = draw(compositions(depth - 1))
    bounded = sp.tanh(inner) if draw(st.booleans()) else sp.sin(inner)  # in [-1, 1]
    shift = sp.Rational(draw(st.integers(-3, 3)), 4)
    functions = [
        sp.sin(inner + shift),
        sp.exp(bounded + shift),
        sp.sqrt(2 + bounded),
        sp.log(2 + bounded),
        1 / (2 + bounded),
        sp.atan(inner + shift),
        sp.Abs(bounded - shift),
        sp.Max(bounded, shift),
        sp.cosh(bounded + shift),
        (2 + bounded) ** sp.Rational(1, 3),
        bounded * draw(compositions(depth - 1)),
    ]
    return draw(st.sampled_from(functions))


def check_composition(expression: sp.Expr, seed: int) -> None:
    constant, _ = split("toy", expression, (x, y))
    residual, outside = residual_and_bounds(expression - constant, 50, seed, tolerance=0.1)
    assert residual <= 1e-14
    assert outside <= 1e-9


@given(compositions(depth=2), st.integers(0, 2**32 - 1))
@settings(max_examples=4, deadline=None, derandomize=True)
def test_compositions_are_factored_exactly_within_their_bounds(expression: sp.Expr, seed: int) -> None:
    check_composition(expression, seed)


@pytest.mark.full
@given(compositions(depth=3), st.integers(0, 2**32 - 1))
@settings(max_examples=300, deadline=None)
def test_deeper_compositions_are_factored_exactly_within_their_bounds(expression: sp.Expr, seed: int) -> None:
    check_composition(expression, seed)


INSIDE = {sp.log: (0.2, 4.0), sp.tan: (-1.4, 1.4), sp.asin: (-0.98, 0.98)}


@pytest.mark.parametrize("function", CHORDS, ids=str)
def test_chord_is_enclosed_and_the_bounds_are_attained(function: type[sp.Function]) -> None:
    low, high = INSIDE.get(function, (-3.0, 3.0))
    rng = np.random.default_rng(2)
    value = sp.lambdify(x, function(x), "numpy")
    for _ in range(4):
        ends = np.sort(rng.uniform(low, high, 4))
        a_box, b_box = sorted([(ends[0], ends[2]), (ends[1], ends[3])], key=lambda _: rng.uniform())
        w_box = (max(b_box[0] - a_box[1], low - a_box[0]), min(b_box[1] - a_box[0], high - a_box[1]))
        if w_box[0] >= w_box[1]:
            continue
        bounds = enclose(CHORDS[function](x, y), {x: a_box, y: w_box}, 1e-2)
        a, w = (np.concatenate([box, rng.uniform(*box, 400)]) for box in (a_box, w_box))
        a, w = (grid.ravel() for grid in np.meshgrid(a, w))
        away = np.abs(w) > 1e-3
        sampled = (value(a[away] + w[away]) - value(a[away])) / w[away]  # the definition
        assert bounds[0] <= sampled.min() + 1e-12
        assert sampled.max() - 1e-12 <= bounds[1]
        size = sampled.max() - sampled.min()
        assert bounds[1] - bounds[0] <= 1.1 * size + 2e-2 * (1 + abs(bounds[0]) + abs(bounds[1]))


@pytest.mark.parametrize("function", CHORDS, ids=str)
def test_numbers_of_a_chord_are_those_of_its_definition(function: type[sp.Function]) -> None:
    chord = sp.lambdify((x, y), CHORDS[function](x, y), "numpy")
    for a, w in [(0.5, 0.3), (0.5, -0.2), (0.3, 1e-9), (0.3, -1e-4), (0.7, 0.0)]:
        exact = sp.sinc if function is sp.sinc else function
        first, at = sp.Float(a, 60), sp.Float(a, 60) + sp.Float(w, 60)
        slope = 1.0 if function in (Ramp, sp.Abs) else sp.diff(exact(x), x).subs(x, first)
        expected = (exact(at) - exact(first)) / sp.Float(w, 60) if w else slope
        assert float(chord(a, w)) == pytest.approx(float(expected), rel=1e-8)


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        (sp.sign(x), r"got sign\(x\), expected a continuous function"),
        (sp.sign(1 + x) - 1, r"got sign\(x \+ 1\), expected a continuous"),
        (sp.Heaviside(x), r"got Heaviside\(x\)"),
        (sp.floor(x), r"got floor\(x\)"),
        (sp.Piecewise((1 + x, x > 0), (x, True)), r"at x = 0 it jumps from 0 to 1"),
        (sp.Piecewise((1, x > HALF), (0, True)), r"at x = 1/2 it jumps from 0 to 1"),
        (sp.Piecewise((x, x * y > 0), (0, True)), r"conditions that compare one symbol with numbers"),
        (sp.Piecewise((x, x > 0)), r"a value everywhere"),
        (sp.sqrt(x), r"slope is infinite"),
        (sp.Abs(x) ** sp.Rational(1, 3), r"slope is infinite"),
        (1 / x - 1, r"division by 0"),
        (sp.log(x), r"log\(x\) at x = 0"),
        (sp.erf(x), r"got erf\(x\), expected a continuous function, one of"),
        (sp.cos(x), r"drift at x = 0: got 1, expected 0: give the equilibrium"),
    ],
)
def test_when_an_expression_cannot_be_factored_expect_the_function_named(expression: sp.Expr, words: str) -> None:
    with pytest.raises(InputError, match=words) as raised:
        factored("toy", expression, (x, y))
    assert "\n" not in str(raised.value)


def test_a_saturated_actuator_state_and_a_dead_zone_are_sectors() -> None:
    model = DescriptorSystem.from_equations(
        ["x' = -sat(x, 1/2) + u", "y' = dead_zone(y, 1/4)"],
        state="x y",
        inputs="u",
        domain={"x": (-2, 2), "y": (-1, 1)},
    )
    # Each is affine in sat(w, limit)/w: 1 inside, limit/|w| outside.
    assert [premise.bounds for premise in model.premises] == [pytest.approx((0.25, 1.0))] * 2
    for at in ([0.1, 0.1], [1.0, -0.5], [-2.0, 1.0]):
        A = model.evaluate(model.premise_values(at)).A
        expected = [-np.clip(at[0], -0.5, 0.5), at[1] - np.clip(at[1], -0.25, 0.25)]
        np.testing.assert_allclose(A @ at, expected, atol=1e-15)
