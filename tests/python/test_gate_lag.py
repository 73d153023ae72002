"""Drives that lag, in the robust gate: against loops run sample by sample, and what is refused."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from flint import fmpq
from scipy.linalg import expm

from quasilpv.artifact import Artifact
from quasilpv.certificate import LAWS, gate, verify
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.gate.delay import delay_margin
from quasilpv.certificate.gate.exclusion import StabilityBox
from quasilpv.certificate.gate.loop import AccelerationLoopData, Controller, LaggingPolynomial
from quasilpv.certificate.gate.margin import inertia_margin
from quasilpv.certificate.gate.proof import RobustGate, growth_rates
from quasilpv.errors import InputError
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.systems.robots.registry import robot
from reference.artifacts import arm3_document
from reference.gated_arms import artifact_document, multiple_pole_loop
from reference.tree_artifacts import small_robot

T = 1e-3
LOOP = multiple_pole_loop(40, 700, 8e-4, T)
BOUNDS = {"angle_rad": 1.0, "speed_rad_s": 1.0, "acceleration_rad_s2": 1.0}
LEVELS = {"P": [[1.0]], "decay_per_s": 1.0, "level": [1.0] * 3, "bounds": BOUNDS}
REACH = {"X": [[1.0]], "multiplier": 0.5, "bounds": BOUNDS}
ENVELOPE = {
    "reference_margin_rad": [0.1] * 3,
    "torque_share": 0.5,
    "box_set": LEVELS,
    "torque_set": LEVELS,
    "disturbance_set": {**REACH, "peak": [1.0] * 3},
    "reference_set": REACH,
}
PHASES = np.geomspace(1e-2, 3.0, 7)


def radius(loop: AccelerationLoopData, ratio: float, delay: float, lag: float) -> float:
    """Spectral radius of the loop run on unit states, drives and arm over a sample by the matrix exponential.

    State: theta, theta' and the acceleration the drives deliver, predicted angle, speed, disturbance and its rate,
    filtered disturbance, integral, and the commands of the samples before, newest first. Delay and lag in samples.
    """
    whole = math.floor(delay)
    late = (delay - whole) * T
    q = math.exp(-T / loop.filter_time_constant_s)
    drives = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0 / ratio, 0.0], [0.0, 0.0, -1.0, 1.0], [0.0] * 4])
    drives[2] /= lag * T
    before, after = expm(drives * late), expm(drives * (T - late))
    l1, l2, l3, l4 = loop.observer

    def step(state: np.ndarray) -> np.ndarray:
        th, w, pull, p1, p2, p3, p4, df, e_I, *old = state
        innovation = th - p1
        p1, p2, p3, p4 = p1 + l1 * innovation, p2 + l2 * innovation, p3 + l3 * innovation, p4 + l4 * innovation
        df = q * df + (1 - q) * p3
        a = loop.kp * p1 + loop.kd * p2 + loop.ki * e_I - df
        predicted = a + p3
        following = (p1 + T * p2 + T**2 / 2 * predicted + T**3 / 6 * p4, p2 + T * predicted + T**2 / 2 * p4)
        commands = [a, *old]
        arm = np.array([th, w, pull])
        for command, transition in ((commands[whole + 1], before), (commands[whole], after)):
            arm = (transition @ np.append(arm, command))[:3]
        return np.array([*arm, *following, p3 + T * p4, p4, df, e_I + T * th, *commands[: whole + 1]])

    # Speeds and accelerations in units of a sample, so that eigenvalues keep their digits.
    units = T ** -np.array([0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 3.0, 2.0, -1.0, *[2.0] * (whole + 1)])
    transition = np.array([step(unit) for unit in np.diag(units)]).T / units[:, None]
    if loop.ki == 0.0:  # nothing reads the integral
        transition = np.delete(np.delete(transition, 8, axis=0), 8, axis=1)
    return float(np.abs(np.linalg.eigvals(transition)).max())


def law(loop: AccelerationLoopData) -> AccelerationLaw:
    feedback = np.array([loop.kp, loop.kd, loop.ki])
    return AccelerationLaw(T, feedback, np.array(loop.observer), loop.filter_time_constant_s)


def samples(value: float) -> fmpq:
    return fmpq(*value.as_integer_ratio())


@pytest.mark.parametrize(("delay", "lag"), [(0.0, 0.3), (0.5, 1.0), (1.0, 0.4), (1.75, 2.5)])
def test_when_drives_lag_expect_exact_loop_and_designs_loop_to_have_the_roots_of_the_loop_that_is_run(
    delay: float, lag: float
) -> None:
    ratios = np.array([0.6, 1.0, 1.9])
    rates = [math.log(radius(LOOP, float(ratio), delay, lag)) / T for ratio in ratios]
    np.testing.assert_allclose(growth_rates(LOOP, samples(delay), ratios, samples(lag)), rates, rtol=1e-4, atol=1e-2)
    own = SampledLoop(law(LOOP), delay * T, lag * T)
    np.testing.assert_allclose([own.growth_rate(1.0 / ratio) for ratio in ratios], rates, rtol=1e-4, atol=1e-2)
    polynomial = LaggingPolynomial.of(Controller.of(LOOP, LOOP.filter_poles()[0]), samples(delay), samples(lag))
    zeta = np.exp(1j * PHASES) - 1.0
    F, G = (np.polyval([float(c.mid()) for c in part.coeffs()[::-1]], zeta) for part in (polynomial.F, polynomial.G))
    np.testing.assert_allclose(own.open_loop(PHASES), -G / F, rtol=1e-8)


def test_when_the_lag_is_short_expect_the_rational_margin_and_a_narrower_one_with_more() -> None:
    without = inertia_margin(LOOP, fmpq(1, 2))
    least, more = (inertia_margin(LOOP, fmpq(1, 2), lag) for lag in (fmpq(1, 1 << 20), fmpq(1)))
    assert without is not None
    assert least is not None
    assert more is not None
    np.testing.assert_allclose(least.to_floats(), without.to_floats(), rtol=1e-4)
    assert more.inner[0] > without.inner[0]
    assert more.inner[1] is not None
    assert without.inner[1] is not None
    assert more.inner[1] < without.inner[1]


@pytest.mark.parametrize("lag", [0.4, 0.9])
def test_when_ratios_lie_on_either_side_of_the_margin_expect_the_loop_that_is_run_to_be_stable_and_not(
    lag: float,
) -> None:
    margin = inertia_margin(LOOP, fmpq(1, 2), samples(lag))
    assert margin is not None
    low, high = margin.to_floats()
    assert high is not None
    assert all(radius(LOOP, ratio, 0.5, lag) < 1.0 for ratio in (1.002 * low, 0.998 * high))
    assert all(radius(LOOP, ratio, 0.5, lag) > 1.0 for ratio in (0.998 * low, 1.002 * high))


@pytest.mark.parametrize(
    ("count", "budget", "share"), [(16, 2500, 0.3), pytest.param(60, 20_000, 0.95, marks=pytest.mark.full)]
)
def test_when_random_laws_are_put_to_the_box_expect_none_accepted_that_diverges_and_most_of_the_stable_ones(
    count: int, budget: int, share: float
) -> None:
    rng = np.random.default_rng(16)
    accepted, stable_ones = 0, 0
    for _ in range(count):
        loop = multiple_pole_loop(*rng.uniform((15.0, 200.0, 3e-4), (70.0, 1200.0, 2e-3)), T)
        low, high = rng.uniform((0.5, 1.05), (0.95, 2.5))
        delay, shortest = float(rng.uniform(0.1, 0.7)), float(rng.uniform(0.01, 0.4))
        longest = shortest + float(rng.uniform(0.1, 0.5))
        box = StabilityBox.of(loop, rational(float(low)), rational(float(high)), (samples(shortest), samples(longest)))
        anchored = inertia_margin(loop, fmpq(0), samples(shortest)) is not None
        proved = anchored and box.is_free_of_crossings((fmpq(0), samples(delay)), budget)
        stable = all(
            radius(loop, float(ratio), d, s) < 1.0
            for ratio in np.geomspace(low, high, 3)
            for d in (0.0, delay)
            for s in (shortest, longest)
        )
        assert stable or not proved
        accepted, stable_ones = accepted + proved, stable_ones + stable
    assert count / 4 <= stable_ones <= 3 * count / 4
    assert accepted >= share * stable_ones


def test_when_an_unstable_lag_lies_inside_the_interval_expect_no_proof() -> None:
    low, high = fmpq(7, 10), fmpq(3, 2)
    assert delay_margin(LOOP, low, high, (fmpq(0), fmpq(1, 2))).proved is not None
    longest = fmpq(6)
    assert radius(LOOP, 0.7, 0.0, 6.0) > 1.0
    assert delay_margin(LOOP, low, high, (fmpq(0), longest)).proved is None
    assert not StabilityBox.of(LOOP, low, high, (fmpq(0), longest)).is_free_of_crossings((fmpq(0), fmpq(0)), 3000)


@cache
def released() -> Artifact:
    """For the small robot with drives that lag."""
    robot = replace(small_robot(coulomb_nm=0.3), lag_s=(2e-4, 8e-4))
    return checked_artifact(
        synthesise(DesignRequest(robot, "dob-acceleration", specification_for(robot, torque_activity=0.05)))
    )


def content() -> dict[str, Any]:
    return deepcopy(dict(released().content()))


def test_when_the_drives_of_a_robot_lag_expect_a_design_whose_gate_covers_their_interval() -> None:
    found = gate(content())
    assert isinstance(found, RobustGate)
    assert found.passed
    assert found.lag_s == pytest.approx((2e-4, 8e-4), rel=1e-15)
    assert found.to_document()["lag_s"] == [2e-4, 8e-4]
    assert found.needed is not None
    for ratio in np.geomspace(*found.needed.to_floats(), 5):
        for delay in (0.0, 0.25, 0.5):
            assert all(radius(found.loop, float(ratio), delay, lag) < 1.0 for lag in (0.2, 0.5, 0.8))


def test_when_an_artifact_states_more_lag_than_its_law_bears_expect_the_gate_not_passed() -> None:
    document = content()
    document["payloads"]["lag_s"] = [2e-4, 3e-3]
    found = gate(document)
    assert isinstance(found, RobustGate)
    assert not found.passed
    assert found.needed is not None
    assert radius(found.loop, found.needed.to_floats()[0], 0.5, 3.0) > 1.0


@pytest.mark.parametrize("lag", [None, [0.0, 0.0], [1e-3, 5e-4], [-1e-4, 1e-3], [1e-3]])
def test_when_a_lag_is_no_interval_expect_it_refused_by_name(lag: Any) -> None:
    document = content()
    document["payloads"]["lag_s"] = lag
    with pytest.raises(InputError, match=r"payloads\.lag_s"):
        gate(document)


def test_when_a_claim_knows_no_lag_expect_it_refused_by_name() -> None:
    document = content()
    document["witness"]["envelope"] = ENVELOPE
    with pytest.raises(InputError, match=r"payloads\.lag_s: .* operating envelope"):
        verify(document)
    document = arm3_document("dob-torque")
    document["payloads"]["lag_s"] = [0.0, 5e-4]
    covered = ", ".join(kind for kind, law in LAWS.items() if law.covers_lag)
    for ask in (gate, verify):
        with pytest.raises(InputError, match=rf"payloads\.lag_s: .*\(covered by {covered}\)"):
            ask(document)


def test_when_the_drives_of_a_planar_arm_lag_expect_the_same_gate_to_cover_them() -> None:
    document = artifact_document(robot("arm2"), LOOP, 1.2)
    assert gate(document).passed
    document["payloads"]["lag_s"] = [0.0, 2e-4]
    assert gate(document).passed
    document["payloads"]["lag_s"] = [0.0, 2e-3]
    assert not gate(document).passed
