"""The scalar loop, its exact stability limits and its delay margin, against eigenvalues, sympy and printed margins."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from flint import fmpq, fmpq_poly
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.polynomials import CircleProduct, critical_values, is_schur, roots_between
from quasilpv.certificate.exact.rationals import float_at_least, float_at_most, to_float
from quasilpv.certificate.gate.delay import DelayMargin, delay_margin
from quasilpv.certificate.gate.exclusion import StabilityBox
from quasilpv.certificate.gate.loop import AccelerationLoopData, CharacteristicPolynomial, Controller
from quasilpv.certificate.gate.margin import InertiaMargin, inertia_margin
from quasilpv.certificate.gate.proof import growth_rates
from quasilpv.errors import InputError
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.systems.robots.registry import robot
from reference.gated_arms import full_map, growth_rate, multiple_pole_loop

DEFAULT = multiple_pole_loop(60, 1200, 1e-3, 1e-3)
LOWEST, HIGHEST = fmpq(99, 100), fmpq(62, 10)  # what the 3-link arm needs

# (wc, wo, Tf, T), then the margins of M_t / M_n without delay, with half a sample, with a sample: independent study.
PRINTED = [
    ((60, 1200, 1e-3, 1e-3), (0.37, 8.2), (0.65, 7.2), None),
    ((50, 1200, 1e-3, 1e-3), (0.36, 10.6), (0.63, 9.6), (0.96, 8.5)),
    ((40, 800, 1e-3, 1e-3), (0.33, 8.3), (0.55, 7.5), (0.80, 6.6)),
    ((60, 1200, 1e-3, 0.5e-3), (0.29, 8.9), (0.45, 8.4), (0.61, 7.8)),
    ((60, 1600, 1e-3, 0.25e-3), (0.26, 12.4), (0.36, 12.1), (0.45, 11.8)),
    ((80, 2000, 0.5e-3, 0.25e-3), (0.29, 12.3), (0.43, 11.8), (0.56, 11.2)),
]

coefficients = st.lists(st.integers(-20, 20), min_size=2, max_size=9).filter(lambda values: values[-1] != 0)
delays = st.fractions(0, Fraction(5, 2), max_denominator=64).map(lambda d: fmpq(d.numerator, d.denominator))


def floats(polynomial: fmpq_poly) -> np.ndarray:
    """Coefficients, highest power first."""
    return np.array([to_float(value) for value in polynomial.coeffs()[::-1]])


# ---- polynomials on the unit circle ----------------------------------------------------------------------------------


@given(coefficients)
def test_when_a_polynomial_is_random_expect_the_jury_table_to_agree_with_its_roots(values: list[int]) -> None:
    largest = np.max(np.abs(np.roots(values[::-1])), initial=0.0)
    assume(abs(largest - 1) > 1e-3)  # double roots on the circle are computed to 1e-4 only
    assert is_schur(fmpq_poly(values)) == (largest < 1)


@pytest.mark.parametrize("shrink", [fmpq(1), fmpq(10**15 - 1, 10**15)])
def test_when_roots_touch_the_circle_expect_the_jury_table_to_tell_the_edge_from_just_inside(shrink: fmpq) -> None:
    on_circle = fmpq_poly([shrink**2, fmpq(-6, 5) * shrink, 1])  # roots shrink * (3 +- 4i)/5
    assert is_schur(on_circle * fmpq_poly([fmpq(1, 3), 1])) == (shrink < 1)


@given(coefficients)
def test_when_real_roots_are_isolated_expect_as_many_between_the_ends_as_sturm_counts(values: list[int]) -> None:
    polynomial = sp.Poly(values[::-1], sp.Symbol("c"))
    squarefree = sp.Poly(sp.prod(factor for factor, _ in polynomial.sqf_list()[1]), polynomial.gen)
    at_ends = sum(squarefree.eval(end) == 0 for end in (-1, 1))
    assert len(roots_between(fmpq_poly(values))) == squarefree.count_roots(-1, 1) - at_ends


@given(coefficients, coefficients, st.floats(0.0, math.pi))
def test_when_z_is_on_the_circle_expect_the_product_as_polynomials_of_its_cosine(
    f: list[int], g: list[int], phase: float
) -> None:
    product = CircleProduct.of(fmpq_poly(f), fmpq_poly(g))
    z, c = np.exp(1j * phase), math.cos(phase)
    expected = np.polyval(f[::-1], z) * np.conj(np.polyval(g[::-1], z))
    got = np.polyval(floats(product.real), c) + 1j * math.sin(phase) * np.polyval(floats(product.imaginary), c)
    assert got == pytest.approx(expected, abs=1e-8)


def test_when_the_loop_is_a_sampled_double_integrator_expect_the_textbook_limits() -> None:
    # p = (z - 1)^2 + mu (z - 1/2): p(1) = mu/2 vanishes at 0, p(-1) = 4 - 3/2 mu at 8/3, and a pair of complex roots is
    # on the circle only if p(0) = 1 - mu/2 = 1.
    values = critical_values(fmpq_poly([1, -2, 1]), fmpq_poly([fmpq(-1, 2), 1]))
    assert sorted(round(float(value.mid()), 12) for value in values) == pytest.approx([0.0, 8 / 3])


def test_when_f_over_g_is_real_everywhere_expect_an_error_and_no_limits() -> None:
    with pytest.raises(ArithmeticError, match="real on the whole unit circle"):
        critical_values(fmpq_poly([1, 2]), fmpq_poly([2, 4]))


@given(st.fractions(max_denominator=10**9))
def test_when_a_rational_is_printed_expect_the_neighbouring_doubles(value: Fraction) -> None:
    exact = fmpq(value.numerator, value.denominator)
    below, above = float_at_most(exact), float_at_least(exact)
    assert Fraction(below) <= value <= Fraction(above)
    assert above <= math.nextafter(below, math.inf)


# ---- the scalar loop -------------------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(
    wc=st.floats(20, 100),
    wo=st.floats(300, 1500),
    filter_s=st.floats(2e-4, 3e-3),
    delay=delays,
    ratio=st.floats(0.2, 10),
    compensated=st.booleans(),
)
def test_when_the_law_is_run_step_by_step_expect_the_exact_characteristic_polynomial(
    *, wc: float, wo: float, filter_s: float, delay: fmpq, ratio: float, compensated: bool
) -> None:
    loop = replace(multiple_pole_loop(wc, wo, filter_s, 1e-3), disturbance_compensation=compensated)
    polynomial = CharacteristicPolynomial.of(Controller.of(loop, loop.filter_poles()[0]), delay)
    exact = floats(polynomial.F + polynomial.G / rational(ratio))
    numeric = np.poly(full_map(loop, np.array([[1 / ratio]]), to_float(delay)))
    assert exact == pytest.approx(numeric, rel=1e-8, abs=1e-8)


def test_when_the_design_loop_is_consulted_expect_the_same_polynomial() -> None:
    feedback = np.array([DEFAULT.kp, DEFAULT.kd, DEFAULT.ki])
    law = AccelerationLaw(1e-3, feedback, np.array(DEFAULT.observer), DEFAULT.filter_time_constant_s)
    for delay in (fmpq(0), fmpq(1, 2), fmpq(17, 10)):
        polynomial = CharacteristicPolynomial.of(Controller.of(DEFAULT, DEFAULT.filter_poles()[0]), delay)
        numeric = np.poly(SampledLoop(law, to_float(delay) * 1e-3).transition(2.0))
        assert floats(polynomial.F + 2 * polynomial.G) == pytest.approx(numeric, abs=1e-10)


@given(st.floats(1e-5, 1e-2), st.floats(1e-5, 1e-2))
def test_when_the_filter_pole_is_bracketed_expect_neighbouring_doubles_around_the_exact_value(
    period: float, constant: float
) -> None:
    loop = replace(DEFAULT, sample_period_s=period, filter_time_constant_s=constant)
    low, high = (to_float(pole) for pole in loop.filter_poles())
    with mpmath.workdps(60):
        assert mpmath.mpf(low) < mpmath.exp(mpmath.mpf(-period / constant)) < mpmath.mpf(high)
    assert high == math.nextafter(low, 1.0)
    assert math.exp(-period / constant) in (low, high)


def test_when_a_posture_is_random_expect_the_spectrum_of_all_joints_to_be_the_union_of_scalar_spectra() -> None:
    arm3, rng = robot("arm3"), np.random.default_rng(5)
    low, high = np.array(arm3.domain.angle_rad).T
    for delay in (fmpq(0), fmpq(1, 2), fmpq(6, 5)):
        theta = rng.uniform(low, high)
        true = arm3.with_payload_fraction(float(rng.uniform())).inertia(theta)
        coupling = np.asarray(np.linalg.solve(true, 1.3 * arm3.model.inertia(theta)), dtype=np.float64)
        full = full_map(DEFAULT, coupling, to_float(delay))
        assert len(full) == 27 + 3 * int(delay.floor())
        polynomial = CharacteristicPolynomial.of(Controller.of(DEFAULT, DEFAULT.filter_poles()[0]), delay)
        F, G = floats(polynomial.F), floats(polynomial.G)
        union = np.ones(1)
        for ratio in np.linalg.eigvals(coupling).real:
            union = np.convolve(union, F + ratio * np.concatenate([np.zeros(F.size - G.size), G]))
        assert np.poly(full) == pytest.approx(union, rel=1e-6, abs=1e-6)


def test_when_growth_rates_are_printed_expect_those_of_the_map() -> None:
    ratios = np.array([0.7, 1.0, 3.0, 7.0])
    expected = [growth_rate(DEFAULT, ratio, 0.5) for ratio in ratios]
    assert growth_rates(DEFAULT, fmpq(1, 2), ratios) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    "change", [{"sample_period_s": 0.0}, {"kp": math.nan}, {"observer": (1.0, 1.0, math.inf, 1.0)}]
)
def test_when_the_law_is_no_law_expect_the_field_named(change: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(change))):
        replace(DEFAULT, **change)


def test_when_the_delay_is_negative_expect_it_refused() -> None:
    with pytest.raises(InputError, match="delay"):
        inertia_margin(DEFAULT, fmpq(-1, 2))


# ---- the inertia margin ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("design", "undelayed", "half", "one"), PRINTED)
def test_when_margins_are_proved_expect_the_independent_values(
    design: tuple[float, float, float, float],
    undelayed: tuple[float, float],
    half: tuple[float, float],
    one: tuple[float, float] | None,
) -> None:
    loop = multiple_pole_loop(*design)
    for delay, expected in ((fmpq(0), undelayed), (fmpq(1, 2), half), (fmpq(1), one)):
        margin = inertia_margin(loop, delay)
        if expected is None:
            assert margin is None
        else:
            assert margin is not None
            assert margin.to_floats() == pytest.approx(expected, rel=0.02, abs=0.006)  # two printed digits


@settings(max_examples=30, deadline=None)
@given(st.floats(20, 80), st.floats(500, 1500), st.floats(2e-4, 2e-3), delays)
def test_when_a_ratio_crosses_a_limit_expect_the_eigenvalues_to_cross_the_circle(
    wc: float, wo: float, filter_s: float, delay: fmpq
) -> None:
    loop = multiple_pole_loop(wc, wo, filter_s, 1e-3)
    margin = inertia_margin(loop, delay)
    if margin is None:
        assert growth_rate(loop, 1.0, to_float(delay)) > -1e-6
        return
    (low, high), (outer_low, outer_high) = margin.inner, margin.outer
    assert high is not None
    assert outer_high is not None
    assert 0 <= low - outer_low <= fmpq(1, 10**6)
    assert 0 <= outer_high - high <= fmpq(1, 10**6)
    for limit, inwards in ((to_float(low), 1.0001), (to_float(high), 0.9999)):
        assert growth_rate(loop, limit * inwards, to_float(delay)) < 0
        assert growth_rate(loop, limit / inwards, to_float(delay)) > 0


@settings(max_examples=60, deadline=None)
@given(st.floats(0, 1), delays)
def test_when_a_ratio_is_random_expect_the_margin_to_agree_with_its_eigenvalues(position: float, delay: fmpq) -> None:
    margin = inertia_margin(DEFAULT, delay)
    ratio = 0.5 * 20**position
    rate = growth_rate(DEFAULT, ratio, to_float(delay))
    assume(abs(rate) > 1e-3)
    if margin is None:
        assert growth_rate(DEFAULT, 1.0, to_float(delay)) > -1e-3
    elif margin.contains(rational(ratio), rational(ratio)):
        assert rate < 0


MUTANTS = [
    {"kp": -DEFAULT.kp},
    {"kd": -DEFAULT.kd},
    {"ki": -DEFAULT.ki},
    {"kd": 0.3 * DEFAULT.kd},
    {"ki": 6.0 * DEFAULT.ki},
    *({"observer": tuple(-x if i == k else x for i, x in enumerate(DEFAULT.observer))} for k in range(4)),
    {"filter_time_constant_s": 6e-3},
]


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: next(iter(mutant)))
def test_when_a_gain_is_wrong_expect_the_needed_range_outside_the_margin(mutant: dict[str, Any]) -> None:
    sound = inertia_margin(DEFAULT, fmpq(1, 2))
    assert sound is not None
    assert sound.contains(LOWEST, HIGHEST)
    margin = inertia_margin(replace(DEFAULT, **mutant), fmpq(1, 2))
    assert margin is None or not margin.contains(LOWEST, HIGHEST)


def test_when_no_larger_inertia_destabilises_expect_no_upper_limit() -> None:
    margin = InertiaMargin((fmpq(1, 2), None), (fmpq(1, 2), None))
    assert margin.to_floats() == (0.5, None)
    assert margin.contains(fmpq(1), fmpq(10**9))
    assert not margin.contains(fmpq(1, 2), fmpq(2))


# ---- the delay margin ------------------------------------------------------------------------------------------------


@cache
def proved_delays(loop: AccelerationLoopData) -> DelayMargin:
    return delay_margin(loop, LOWEST, HIGHEST)


@settings(max_examples=100, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.sampled_from([DEFAULT, multiple_pole_loop(40, 1200, 1e-3, 1e-3)]))
def test_when_delay_and_ratio_lie_in_the_proved_rectangle_expect_stability(
    delay: float, position: float, loop: AccelerationLoopData
) -> None:
    proved = proved_delays(loop).proved
    assert proved is not None
    ratio = to_float(LOWEST) * to_float(HIGHEST / LOWEST) ** position
    assert growth_rate(loop, ratio, delay * to_float(proved)) < 0


@pytest.mark.parametrize(("loop", "at_least"), [(DEFAULT, 0.5), (multiple_pole_loop(40, 1200, 1e-3, 1e-3), 1.0)])
def test_when_the_delay_margin_is_bisected_expect_it_tight(loop: AccelerationLoopData, at_least: float) -> None:
    margins = proved_delays(loop)
    assert margins.proved is not None
    assert margins.not_inside is not None
    assert at_least < to_float(margins.proved) < to_float(margins.not_inside) < 1.01 * to_float(margins.proved)
    beyond = to_float(margins.not_inside)
    assert max(growth_rate(loop, to_float(ratio), beyond) for ratio in (LOWEST, HIGHEST)) > -1e-6


@settings(max_examples=12, deadline=None)
@given(st.fractions(0, Fraction(2, 3), max_denominator=50), st.sampled_from([0, 1]), st.floats(1.0, 1.5))
def test_when_the_rectangle_holds_one_crossing_expect_no_proof(at: Fraction, side: int, longer: float) -> None:
    delay = fmpq(at.numerator, at.denominator)
    margin = inertia_margin(DEFAULT, delay)
    assert margin is not None
    inner, outer = margin.inner[side], margin.outer[side]
    assert inner is not None
    assert outer is not None
    box = StabilityBox.of(DEFAULT, min(inner, outer), max(inner, outer))
    assert not box.is_free_of_crossings((fmpq(0), delay * rational(longer)), budget=1500)
    apart = StabilityBox.of(DEFAULT, fmpq(1), fmpq(2))
    assert apart.is_free_of_crossings((fmpq(0), delay), budget=1500)


def test_when_the_needed_range_does_not_fit_without_delay_expect_no_delay_margin() -> None:
    assert delay_margin(DEFAULT, LOWEST, fmpq(9)) == DelayMargin(None, fmpq(0))
