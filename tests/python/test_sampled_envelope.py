"""The operating envelope of the acceleration-level law: model, sets, and what is refused."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from flint import fmpq_mat
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.arrays import FloatArray
from quasilpv.certificate import verify
from quasilpv.certificate.laws.sampled_envelope import ErrorDynamics
from quasilpv.conditions.tracking.sampled_errors import SampledErrors, sampled_errors
from quasilpv.errors import InputError
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from quasilpv.synthesis.acceleration.envelope import acceleration_envelope
from quasilpv.systems.robots.registry import robot
from reference.checked import loop_data

Document = dict[str, Any]
SAMPLES = 4000
seeds = st.integers(0, 2**32 - 1)


@cache
def kept() -> Document:
    return release(DesignRequest.of("arm3")).artifact.content()


def envelope() -> Document:
    member: Document = kept()["witness"]["envelope"]
    return member


@cache
def errors() -> SampledErrors:
    """Error dynamics of the shipped law, in SI (time unit 1 s)."""
    law = kept()["law"]
    feedback = np.array([law["feedback"][name] for name in ("kp", "kd", "ki")])
    period = kept()["sample_period_s"]
    return sampled_errors(feedback, np.array(law["observer"]), law["filter_time_constant_s"], period, 1.0)


def doubles(exact: fmpq_mat) -> FloatArray:
    return np.array([[int(x.p) / int(x.q) for x in row] for row in exact.table()])


def simulated(initial_angle: float, initial_d: float, initial_rate: float, second: FloatArray) -> dict[str, FloatArray]:
    """One joint under the law as its documentation writes it, the reference at rest at 0, d'' held over each sample."""
    T, law = kept()["sample_period_s"], kept()["law"]
    kp, kd, ki = (law["feedback"][name] for name in ("kp", "kd", "ki"))
    gains = np.array(law["observer"])
    q = math.exp(-T / law["filter_time_constant_s"])
    angle, speed, d, rate = initial_angle, 0.0, initial_d, initial_rate
    estimate, filtered, integral = np.array([angle, 0.0, 0.0, 0.0]), 0.0, 0.0
    record: dict[str, list[Any]] = {name: [] for name in ("plant", "integral", "estimate", "filtered", "acceleration")}
    for w in second:
        record["plant"].append([angle, speed, d, rate])
        record["integral"].append(integral)
        record["estimate"].append(estimate.copy())
        record["filtered"].append(filtered)
        estimate = estimate + gains * (angle - estimate[0])
        filtered = q * filtered + (1.0 - q) * estimate[2]
        command = -filtered + kp * estimate[0] + kd * estimate[1] + ki * integral
        record["acceleration"].append(command + d)
        integral += T * angle
        th, om, dh, jh = estimate
        net = command + dh
        estimate = np.array(
            [th + T * om + T**2 / 2 * net + T**3 / 6 * jh, om + T * net + T**2 / 2 * jh, dh + T * jh, jh]
        )
        angle += T * speed + T**2 / 2 * (command + d) + T**3 / 6 * rate + T**4 / 24 * w
        speed += T * (command + d) + T**2 / 2 * rate + T**3 / 6 * w
        d += T * rate + T**2 / 2 * w
        rate += T * w
    return {name: np.array(values) for name, values in record.items()}


def shifted_state(record: dict[str, FloatArray]) -> FloatArray:
    """The state of the envelope, (N, 8), from the formulas of its documentation."""
    T, law = kept()["sample_period_s"], kept()["law"]
    kd, ki = law["feedback"]["kd"], law["feedback"]["ki"]
    q = math.exp(-T / law["filter_time_constant_s"])
    angle, speed, d, rate = record["plant"].T
    c = -(T / 2 + q * T / (1 - q) + kd * T**2 / 12) / ki
    estimation = record["plant"] - record["estimate"]
    lag = d - record["filtered"] - T / (1 - q) * rate
    return np.column_stack([angle, speed - T**2 / 12 * rate, record["integral"] - c * rate, estimation, lag])


def scaled_close(actual: FloatArray, expected: FloatArray) -> None:
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(actual / scale, expected / scale, rtol=0.0, atol=1e-8)


@given(seeds)
def test_when_the_law_runs_as_written_expect_the_error_dynamics_to_follow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    second = rng.normal(size=60) * 1e6
    record = simulated(1e-3 * rng.normal(), 10.0 * rng.normal(), 1e3 * rng.normal(), second)
    x = shifted_state(record)
    T = kept()["sample_period_s"]
    A, law = errors().transition, kept()["law"]
    kd, ki = law["feedback"]["kd"], law["feedback"]["ki"]
    q = math.exp(-T / law["filter_time_constant_s"])
    v = np.array([T**4 / 24, T**3 / 6, T**2 / 2, T])
    integral_shift = (T / 2 + q * T / (1 - q) + kd * T**2 / 12) / ki
    held = np.array([v[0], v[1] - T**2 / 12 * v[3], integral_shift * v[3], *v, v[2] - T / (1 - q) * v[3]])
    scaled_close(x[1:], x[:-1] @ A.T + second[:-1, None] * held)
    acceleration = (x @ errors().acceleration.T)[:, 0] - T / 2 * record["plant"][:, 3]
    scaled_close(acceleration[:, None], record["acceleration"][:, None])
    row = rng.normal(size=8) / np.sqrt(errors().disturbance.diagonal())
    assert (row @ held) ** 2 <= row @ errors().disturbance @ row * (1.0 + 1e-6) + 1e-12


def test_when_the_checker_writes_the_error_dynamics_expect_those_of_the_design() -> None:
    law = loop_data(kept())
    for pole in law.filter_poles():
        exact = ErrorDynamics.of_disturbance(law, pole)
        scale = np.sqrt(errors().disturbance.diagonal())
        for mine, theirs in ((exact.transition, errors().transition), (exact.effects, errors().disturbance)):
            difference = doubles(mine) - theirs
            relative = difference / np.outer(scale, 1.0 / scale if mine is exact.transition else scale)
            assert np.abs(relative).max() < 1e-9
        np.testing.assert_allclose(doubles(exact.outputs[2]), errors().acceleration, rtol=1e-9, atol=1e-9)
    reference = ErrorDynamics.of_reference(law)
    np.testing.assert_allclose(doubles(reference.transition), errors().transition[:3, :3], rtol=1e-12)
    np.testing.assert_allclose(doubles(reference.effects), errors().reference, rtol=1e-12)


@given(seeds)
def test_when_errors_start_on_the_border_of_a_level_set_expect_them_to_stay_and_to_keep_its_bounds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for name in ("box_set", "torque_set"):
        P = np.array(envelope()[name]["P"])
        R = np.linalg.cholesky(P)
        x = np.linalg.solve(R.T, rng.normal(size=8))
        x /= math.sqrt(x @ P @ x)
        bounds = envelope()[name]["bounds"]
        previous = 1.0 + 1e-9
        for _ in range(60):
            level = math.sqrt(x @ P @ x)
            assert level <= previous
            previous = level * (1.0 + 1e-9)
            assert abs(x[0]) <= bounds["angle_rad"]
            assert abs(x[1]) <= bounds["speed_rad_s"]
            assert abs((errors().acceleration @ x).item()) <= bounds["acceleration_rad_s2"]
            x = errors().transition @ x


def test_when_only_the_angle_is_off_expect_the_set_of_the_box_to_waste_little_of_it() -> None:
    """No set can do better than the angle itself; nor than the largest angle that a speed error leads to."""
    P = np.array(envelope()["box_set"]["P"])
    assert 0.95 < P[0, 0] ** -0.5 / envelope()["box_set"]["bounds"]["angle_rad"] <= 1.0
    for start in (np.eye(8)[1], np.eye(8)[5] + np.eye(8)[7]):
        x, largest = start, 0.0
        for _ in range(200):
            largest, x = max(largest, abs(x[0])), errors().transition @ x
        assert 0.25 < (start @ P @ start) ** -0.5 * largest <= 1.0


def test_when_the_worst_disturbance_acts_expect_it_inside_the_peak_set_and_near_its_border() -> None:
    found = envelope()["disturbance_set"]
    A, W = errors().transition, errors().disturbance
    rows = {
        "angle_rad": np.eye(8)[0],
        "speed_rad_s": np.eye(8)[1],
        "acceleration_rad_s2": errors().acceleration[0],
    }
    impulse = shifted_state(simulated(0.0, 0.0, 0.0, np.array([1.0, 0.0])))[1]
    for name, row in rows.items():
        held, any_shape, x = 0.0, 0.0, row
        for _ in range(SAMPLES):
            held += abs(x @ impulse)  # exact gain for d'' held over each sample
            any_shape += math.sqrt(max(x @ W @ x, 0.0))  # upper bound for any d''
            x = A.T @ x
        assert held <= any_shape * (1.0 + 1e-6)
        assert held <= found["bounds"][name]
    assert found["bounds"]["angle_rad"] < 1.25 * held_gain(impulse)


def held_gain(impulse: FloatArray) -> float:
    """Sum of the magnitudes of the impulse response of the angle."""
    total, x = 0.0, impulse
    for _ in range(SAMPLES):
        total, x = total + abs(float(x[0])), errors().transition @ x
    return total


def test_when_a_disturbance_flips_at_the_worst_times_expect_the_simulated_law_to_keep_the_bound() -> None:
    impulse = shifted_state(simulated(0.0, 0.0, 0.0, np.array([1.0, 0.0])))[1]
    response, x = [], impulse
    for _ in range(400):
        response.append(x[0])
        x = errors().transition @ x
    peak = 1e6
    worst = peak * np.sign(response[::-1])
    record = simulated(0.0, 0.0, 0.0, np.append(worst, 0.0))
    bound = peak * envelope()["disturbance_set"]["bounds"]["angle_rad"]
    reached = np.abs(record["plant"][:, 0]).max()
    assert 0.8 * bound < reached <= bound


@given(seeds)
def test_when_d_flips_within_a_sample_expect_its_effect_inside_the_ellipsoid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    switches = np.sort(np.concatenate([[0.0, 1.0], rng.uniform(size=int(rng.integers(0, 6)))]))
    signs = rng.choice([-1.0, 1.0], size=len(switches) - 1)
    powers, factorials = np.arange(3, -1, -1), np.array([6.0, 2.0, 1.0, 1.0])
    primitive = switches[:, None] ** (powers + 1) / ((powers + 1) * factorials)
    v = signs @ np.diff(primitive, axis=0)  # T = 1, time from the end of the sample
    gram = 1.0 / ((powers[:, None] + powers + 1) * np.outer(factorials, factorials))
    assert v @ np.linalg.solve(gram, v) <= 1.0 + 1e-9


Change = Callable[[Document], None]


def scaled(*path: Any, by: float) -> Change:
    def change(document: Document) -> None:
        place = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = np.asarray(np.array(place[path[-1]]) * by).tolist()

    return change


def member(*path: Any, by: float) -> Change:
    return scaled("witness", "envelope", *path, by=by)


@pytest.mark.parametrize(
    ("change", "claim"),
    [
        (member("box_set", "level", 0, by=1.0 + 1e-6), "box set, levels"),
        (member("box_set", "level", 1, by=-1.0), "box set, levels"),
        (member("torque_set", "level", 2, by=1.01), "torque set, levels"),
        (member("torque_share", by=0.99), "torque set, levels"),
        (member("torque_share", by=2.0), "torque set, levels"),
        (member("disturbance_set", "peak", 2, by=1.0 + 1e-6), "disturbance set, peaks"),
        (member("reference_margin_rad", 0, by=0.9), "levels"),
        (member("reference_margin_rad", by=10.0), "room for a reference"),
        (member("box_set", "P", by=0.99), "box set, bound of angle_rad"),
        (member("torque_set", "P", by=0.99), "torque set, bound of acceleration_rad_s2"),
        (member("box_set", "P", 0, 0, by=0.9), "box set"),
        (member("box_set", "P", 4, 5, by=1.1), "box set, decrease"),
        (member("box_set", "bounds", "angle_rad", by=0.99), "box set, bound of angle_rad"),
        (member("box_set", "bounds", "speed_rad_s", by=0.99), "box set, bound of speed_rad_s"),
        (member("torque_set", "bounds", "acceleration_rad_s2", by=-1.0), "torque set, decay rate and bounds"),
        (member("torque_set", "decay_per_s", by=20.0), "torque set, decrease"),
        (member("torque_set", "decay_per_s", by=-1.0), "torque set, decay rate and bounds"),
        (member("disturbance_set", "X", by=0.99), "disturbance set, invariance"),
        (member("disturbance_set", "X", by=1.01), "disturbance set, outputs"),
        (member("disturbance_set", "X", 0, 0, by=0.999), "disturbance set, invariance"),
        (member("disturbance_set", "multiplier", by=1.01), "disturbance set, invariance"),
        (member("disturbance_set", "multiplier", by=1.1), "disturbance set, multiplier"),
        (member("disturbance_set", "bounds", "speed_rad_s", by=0.99), "disturbance set, outputs"),
        (member("reference_set", "X", by=0.99), "reference set, invariance"),
        (member("reference_set", "bounds", "angle_rad", by=0.99), "reference set, outputs"),
        (scaled("law", "feedback", "kp", by=0.97), "disturbance set, invariance"),
        (scaled("law", "feedback", "ki", by=1.02), "reference set, invariance"),
        (scaled("law", "observer", 3, by=0.9), "disturbance set, invariance"),
        (scaled("law", "filter_time_constant_s", by=1.05), "disturbance set, invariance"),
        (scaled("limits", "torque_nm", by=0.99), "torque set, levels"),
        (scaled("law", "inertia", "blocks", 0, "vertices", by=1.05), "torque set, levels"),
    ],
)
def test_when_a_number_of_the_envelope_or_of_its_law_changes_expect_that_claim_refused(
    change: Change, claim: str
) -> None:
    document = copy.deepcopy(kept())
    change(document)
    verdict = verify(document)
    assert any(f"envelope: {claim}" in failed or claim in failed for failed in verdict.failed), verdict.failed


@pytest.mark.parametrize("value", [None, [], {}, "one", [[1.0]]])
@pytest.mark.parametrize("name", ["box_set", "disturbance_set", "reference_margin_rad"])
def test_when_the_envelope_is_malformed_expect_an_input_error(name: str, value: Any) -> None:
    document = copy.deepcopy(kept())
    document["witness"]["envelope"][name] = value
    with pytest.raises(InputError, match="witness"):
        verify(document)


def test_when_the_disturbance_is_not_compensated_expect_no_envelope_and_none_accepted() -> None:
    content = release(DesignRequest.of("arm3", compensated=False), allow_unverified=True).artifact.content()
    assert "envelope" not in content["witness"]
    assert not any("envelope" in claim.name for claim in verify(content).claims)
    content["witness"]["envelope"] = envelope()
    with pytest.raises(InputError, match="does not compensate"):
        verify(content)


def test_when_the_usual_room_inside_the_inequalities_is_not_enough_expect_a_level_set_all_the_same() -> None:
    # Gains of dob-moving for arm3 at 2 kHz: 2 % of the optimum leave exact arithmetic no room.
    law = kept()["law"] | {
        "feedback": {"kp": -5901.441566279088, "kd": -132.07447078043936, "ki": -80519.203199032},
        "observer": [0.9965569726662122, 2954.9900360262554, 4645904.5192633085, 3024492837.480565],
        "filter_time_constant_s": 0.0006777015027073835,
    }
    found = acceleration_envelope(robot("arm3"), law, 0.0005, 47.885616674642094)
    assert np.linalg.eigvalsh(found["box_set"]["P"]).min() > 0.0


def test_when_the_levels_are_read_expect_the_stated_margin_of_the_operating_domain() -> None:
    half = np.array([(high - low) / 2.0 for low, high in robot("arm3").domain.angle_rad])
    margin = np.array(envelope()["reference_margin_rad"])
    np.testing.assert_allclose(margin, 0.15 * half, rtol=1e-12)
    box = envelope()["box_set"]
    np.testing.assert_allclose(np.array(box["level"]) * box["bounds"]["angle_rad"], margin, rtol=1e-8)
