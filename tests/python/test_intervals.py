"""Guaranteed ranges: they contain every value, they are tight, and their ends are rounded outward."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from quasilpv.errors import InputError
from quasilpv.systems.intervals.enclosure import enclose
from quasilpv.systems.intervals.interval_function import IntervalFunction, lower, upper
from quasilpv.systems.intervals.quotients import expm1_quotient, tanh_quotient

x, y, w = sp.symbols("x y w", real=True)

finite = st.floats(-20, 20, allow_nan=False)


@st.composite
def intervals(draw: st.DrawFn) -> tuple[float, float]:
    ends = sorted((draw(finite), draw(finite)))
    return ends[0], ends[1]


def sinc(values: np.ndarray) -> np.ndarray:
    return np.sinc(values / np.pi)


@given(intervals())
def test_sinc_range_contains_every_value_and_is_attained(interval: tuple[float, float]) -> None:
    low, high = enclose(sp.sinc(x), {x: interval})
    grid = sinc(np.linspace(*interval, 20_001))
    spacing = (interval[1] - interval[0]) / 20_000
    assert low <= grid.min() + 1e-15
    assert grid.max() - 1e-15 <= high
    # A grid misses a smooth extremum by at most |f''| spacing^2 / 8, and |sinc''| <= 1/3.
    assert_allclose([low, high], [grid.min(), grid.max()], atol=spacing**2 / 20 + 1e-14)


def test_sinc_minimum_is_at_the_first_solution_of_tan_x_equals_x() -> None:
    stationary = brentq(lambda t: np.tan(t) - t, 4.4, 4.6, xtol=1e-14)
    for reach in (4.5, 10.0, 1000.0):
        low, high = enclose(sp.sinc(x), {x: (-reach, reach)})
        assert_allclose(low, np.cos(stationary), rtol=1e-14)
        assert high == 1.0
    assert enclose(sp.sinc(x), {x: (0.0, 4.4)})[0] > np.cos(stationary)


def test_sinc_of_a_tiny_argument_is_close_to_one_and_at_zero_is_one() -> None:
    low, high = enclose(sp.sinc(x), {x: (1e-9, 1e-6)})
    assert 1 - 1e-12 <= low <= high <= 1.0
    assert enclose(sp.sinc(x), {x: (0.0, 0.0)}) == (1.0, 1.0)


@pytest.mark.parametrize(
    ("expression", "domain", "expected"),
    [
        (x**2 - x, {x: (0.0, 1.0)}, (-0.25, 0.0)),
        (x**3 - 3 * x, {x: (-2.0, 2.0)}, (-2.0, 2.0)),
        (sp.sin(x) * sp.cos(x), {x: (-3.0, 3.0)}, (-0.5, 0.5)),
        (x / (1 + x**2), {x: (-5.0, 5.0)}, (-0.5, 0.5)),
        (x * sp.exp(-(x**2)), {x: (-3.0, 3.0)}, (-np.exp(-0.5) / np.sqrt(2), np.exp(-0.5) / np.sqrt(2))),
        (sp.sqrt(x) - x, {x: (0.0, 4.0)}, (-2.0, 0.25)),
        ((1 - x) ** 2 + 100 * (y - x**2) ** 2, {x: (-2.0, 2.0), y: (-2.0, 2.0)}, (0.0, 3609.0)),
        ((x - y) * (x + y), {x: (-1.0, 2.0), y: (-1.0, 3.0)}, (-9.0, 4.0)),
        (sp.pi * x + sp.Rational(1, 3), {x: (0.0, 1.0)}, (1 / 3, np.pi + 1 / 3)),
        (sp.Integer(7), {}, (7.0, 7.0)),
    ],
)
def test_ranges_known_by_calculus_are_found_within_the_tolerance(
    expression: sp.Expr, domain: dict[sp.Symbol, tuple[float, float]], expected: tuple[float, float]
) -> None:
    low, high = enclose(expression, domain)
    assert low <= expected[0] + 1e-15
    assert high >= expected[1] - 1e-15
    assert_allclose((low, high), expected, rtol=2e-9, atol=2e-9)


@given(intervals(), intervals(), st.integers(0, 2**32 - 1))
def test_repeated_symbols_stay_enclosed(first: tuple[float, float], second: tuple[float, float], seed: int) -> None:
    assume(first[1] - first[0] < 8 and second[1] - second[0] < 8)
    expression = -80 * sp.sinc(x) - 22 * sp.sinc(x + y) + sp.cos(x)
    low, high = enclose(expression, {x: first, y: second}, tolerance=1e-3)
    rng = np.random.default_rng(seed)
    xs, ys = rng.uniform(*first, 3000), rng.uniform(*second, 3000)
    values = -80 * sinc(xs) - 22 * sinc(xs + ys) + np.cos(xs)
    assert low <= values.min() + 1e-12
    assert high >= values.max() - 1e-12


def test_extremum_on_a_curve_is_still_bounded_though_not_within_the_tolerance() -> None:
    low, high = enclose(x * y - x**2 * y**2, {x: (-2.0, 2.0), y: (-2.0, 2.0)})  # every x y = 1/2 is a maximum
    assert_allclose(low, -20.0)
    assert 0.25 <= high <= 0.26


def test_bounds_are_rounded_outward() -> None:
    low, high = enclose(x / 3, {x: (1.0, 1.0)})
    assert Fraction(low) < Fraction(1, 3) < Fraction(high)
    assert high - low <= 2 * np.spacing(1 / 3)


def test_a_product_of_independent_factors_is_exact() -> None:
    low, high = enclose((2 * w + y) * sp.sin(x), {w: (-1.0, 2.0), y: (-3.0, 0.5), x: (1.0, 2.0)})
    assert_allclose((low, high), (-5.0, 4.5), rtol=1e-15)


QUOTIENTS = {sp.tanh: np.tanh, tanh_quotient: tanh_quotient._imp_, expm1_quotient: expm1_quotient._imp_}


@pytest.mark.parametrize("function", QUOTIENTS, ids=str)
@given(intervals(), st.sampled_from([1.0, 1e-3, 1e-6]))
def test_monotone_functions_are_enclosed_exactly(
    function: type[sp.Function], interval: tuple[float, float], scale: float
) -> None:
    ends = (interval[0] * scale, interval[1] * scale)
    low, high = enclose(function(x), {x: ends})
    values = QUOTIENTS[function](np.append(np.linspace(*ends, 2001), 0.0 if ends[0] <= 0 <= ends[1] else ends[0]))
    assert low <= values.min() + 1e-15 * abs(values.min())  # the samples are rounded too
    assert high >= values.max() - 1e-15 * abs(values.max())
    assert_allclose([low, high], [values.min(), values.max()], rtol=1e-13, atol=1e-22)  # 80 bits around 1


@pytest.mark.parametrize("function", [sp.tanh, sp.sinc, tanh_quotient, expm1_quotient], ids=str)
@given(intervals())
def test_slopes_of_functions_contain_their_difference_quotients(
    function: type[sp.Function], interval: tuple[float, float]
) -> None:
    _, (slope,) = IntervalFunction(function(x), [x]).value_and_gradient((interval,))
    values = sp.lambdify([x], function(x), "numpy")
    points = np.linspace(*interval, 401)
    rises = np.diff(np.broadcast_to(values(points), points.shape))
    widths = np.diff(points)
    rounding = 1e-14 * (1 + np.abs(values(points[1:])))
    assert np.all(rises >= lower(slope) * widths - rounding)
    assert np.all(rises <= upper(slope) * widths + rounding)


REALS = (-float("inf"), float("inf"))


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (1 / (1 + x**2), (0.0, 1.0)),
        (1 / (1 + sp.exp(2 * x)), (0.0, 1.0)),
        ((1 + sp.sin(x) ** 2) / 2, (0.5, 1.0)),
        ((1 + 1 / (1 + x**2)) * sp.cos(y), (-2.0, 2.0)),
    ],
)
def test_when_every_symbol_occurs_once_the_domain_may_be_the_whole_line(
    expression: sp.Expr, expected: tuple[float, float]
) -> None:
    assert enclose(expression, {x: REALS, y: REALS}) == expected


@pytest.mark.parametrize(
    ("expression", "domain", "words"),
    [
        (x + y, {x: (0.0, 1.0)}, "domain: y"),
        (1 / x, {x: (-1.0, 1.0)}, "division"),
        (sp.sqrt(x), {x: (-1.0, 1.0)}, "square root"),
        (sp.erf(x), {x: (-1.0, 1.0)}, "operation"),
        (sp.log(x), {x: (-1.0, 1.0)}, "argument > 0"),
        (sp.tan(x), {x: (1.0, 2.0)}, "between two poles"),
        (sp.asin(x), {x: (0.0, 2.0)}, "argument in"),
        (x ** sp.Rational(1, 3), {x: (-1.0, 1.0)}, "argument >= 0"),
        (x, {x: (1.0, -1.0)}, "lower <= upper"),
        (x, {x: (float("nan"), 1.0)}, "lower <= upper"),
        (x, {x: (0.0, float("inf"))}, "bounded range"),
        (x**2 - x, {x: (0.0, float("inf"))}, "occurs more than once"),
        (sp.exp(sp.exp(x)), {x: (0.0, 20.0)}, "bounded range"),
    ],
)
def test_when_no_range_can_be_given_expect_one_line_saying_why(
    expression: sp.Expr, domain: dict[sp.Symbol, tuple[float, float]], words: str
) -> None:
    with pytest.raises(InputError, match=words) as raised:
        enclose(expression, domain)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "function",
    [
        sp.sqrt,
        sp.log,
        lambda square: 1 / square,
        lambda square: square ** sp.Rational(-1, 3),
        lambda square: sp.asin(1 - square / 10),
    ],
    ids=["sqrt", "log", "quotient", "root", "asin"],
)
def test_an_argument_that_only_seems_to_leave_where_its_function_is_defined_is_bounded_first(
    function: Callable[[sp.Expr], sp.Expr], seed: int
) -> None:
    """Squares, multiplied out, seem to be negative; with a little taken from them they are, and that is refused."""
    rng = np.random.default_rng(seed)
    a, b = (sp.Rational(int(k), 4) for k in rng.integers(1, 5, 2))
    square = sp.expand((a * x - b * y) ** 2 + (b * x + a * y) ** 2 / 4)
    domain = {x: (-1.0, 1.0), y: (-1.0, 1.0)}
    assert IntervalFunction(square, [x, y]).bounds(tuple(domain.values()))[0] < -0.01
    low, high = enclose(function(square + sp.Rational(1, 100)), domain)
    at = sp.lambdify([x, y], function(square + sp.Rational(1, 100)), "numpy")
    values = at(*rng.uniform(-1.0, 1.0, (2, 500)))
    assert low <= values.min() <= values.max() <= high
    assert min(at(0.0, 0.0) - low, high - at(0.0, 0.0)) <= 1e-3 * max(1.0, abs(at(0.0, 0.0)))  # where the square is 0
    with pytest.raises(InputError, match="expected"):
        enclose(function(square - sp.Rational(1, 100)), domain)
