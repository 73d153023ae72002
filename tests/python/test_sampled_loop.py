"""The scalar loop against the full arm, against step-by-step simulation, and against printed margins."""

import numpy as np
import pytest

from quasilpv.synthesis.acceleration.inertia_range import needed_inertia_range
from quasilpv.synthesis.acceleration.sampled_loop import AccelerationLaw, SampledLoop
from quasilpv.systems.robots.registry import robot


def multiple_pole_law(wc: float, wo: float, filter_s: float, T: float) -> AccelerationLaw:
    """Closed forms: continuous triple pole for the feedback, sampled quadruple pole for the observer (Ackermann)."""
    A = np.array([[1, T, T**2 / 2, T**3 / 6], [0, 1, T, T**2 / 2], [0, 0, 1, T], [0, 0, 0, 1]])
    shifted = A - np.exp(-wo * T) * np.eye(4)
    observability = np.vstack([np.eye(4)[[0]] @ np.linalg.matrix_power(A, i) for i in range(4)])
    predictor = np.linalg.matrix_power(shifted, 4) @ np.linalg.solve(observability, np.eye(4)[3])
    feedback = -np.array([3 * wc**2, 3 * wc, wc**3])
    return AccelerationLaw(T, feedback, np.linalg.solve(A, predictor), filter_s)


# (wc, wo, Tf, T) and the margins of M_t / M_n without delay and with half a sample, from an independent study.
PRINTED = [
    ((60, 1200, 1e-3, 1e-3), (0.37, 8.2), (0.65, 7.2)),
    ((50, 1200, 1e-3, 1e-3), (0.36, 10.6), (0.63, 9.6)),
    ((40, 800, 1e-3, 1e-3), (0.33, 8.3), (0.55, 7.5)),
    ((60, 1200, 1e-3, 0.5e-3), (0.29, 8.9), (0.45, 8.4)),
    ((60, 1600, 1e-3, 0.25e-3), (0.26, 12.4), (0.36, 12.1)),
    ((80, 2000, 0.5e-3, 0.25e-3), (0.29, 12.3), (0.43, 11.8)),
]


@pytest.mark.parametrize(("design", "undelayed", "delayed"), PRINTED)
def test_when_margins_are_computed_expect_the_independent_values(
    design: tuple[float, float, float, float], undelayed: tuple[float, float], delayed: tuple[float, float]
) -> None:
    law = multiple_pole_law(*design)
    for delay, expected in ((0.0, undelayed), (law.sample_period_s / 2, delayed)):
        margin = SampledLoop(law, delay).inertia_margin()
        assert margin is not None
        assert margin == pytest.approx(expected, rel=0.02, abs=0.006)  # two printed digits


@pytest.mark.parametrize("delay_samples", [0.0, 0.3, 0.5, 1.0, 1.7])
def test_when_the_ratio_crosses_the_margin_expect_the_growth_rate_to_change_sign(delay_samples: float) -> None:
    law = multiple_pole_law(40, 800, 1e-3, 1e-3)
    loop = SampledLoop(law, delay_samples * 1e-3)
    margin = loop.inertia_margin()
    if margin is None:
        assert loop.growth_rate(1.0) >= 0
        return
    for limit, inside, outside in ((margin[0], 1.001, 0.999), (margin[1], 0.999, 1.001)):
        assert loop.growth_rate(1 / (limit * inside)) < 0 < loop.growth_rate(1 / (limit * outside))


def test_when_the_full_arm_is_frozen_expect_the_union_of_scalar_spectra() -> None:
    arm3 = robot("arm3")
    theta = np.array([0.1, 1.3, -0.7])
    design, plant = 1.2 * arm3.model.inertia(theta), arm3.with_payload_fraction(0.7).inertia(theta)
    law = multiple_pole_law(60, 1200, 1e-3, 1e-3)
    loop = SampledLoop(law, 0.5e-3)
    coupling = np.linalg.solve(plant, design)
    at_zero, slope = loop.transition(0.0), loop.transition(1.0) - loop.transition(0.0)
    full = np.kron(at_zero, np.eye(3)) + np.kron(slope, coupling)
    ratios = np.linalg.eigvals(coupling).real
    union = np.concatenate([np.linalg.eigvals(loop.transition(ratio)) for ratio in ratios])
    spectrum = np.linalg.eigvals(full)
    for value in union:
        assert np.min(np.abs(spectrum - value)) < 1e-5  # clustered observer poles are sensitive: 1e-16 ** (1/4)
    assert np.allclose(np.poly(full), np.poly(union), rtol=1e-6, atol=1e-6)


def simulate(
    law: AccelerationLaw, ratio: float, noise: np.ndarray, disturbance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The law written out step by step on theta'' = ratio (a + d), as a person would; angles and commands."""
    T = law.sample_period_s
    kp, kd, ki = law.feedback
    l1, l2, l3, l4 = law.observer
    forget = np.exp(-T / law.filter_time_constant_s)
    th = w = p1 = p2 = p3 = p4 = df = eI = 0.0
    angles, commands = [], []
    for nu, d in zip(noise, disturbance, strict=True):
        y = th + nu
        innovation = y - p1
        p1, p2, p3, p4 = p1 + l1 * innovation, p2 + l2 * innovation, p3 + l3 * innovation, p4 + l4 * innovation
        df = forget * df + (1 - forget) * p3
        a = -df + kp * p1 + kd * p2 + ki * eI
        eI += T * y
        p1, p2, p3 = p1 + T * p2 + T**2 / 2 * (a + p3) + T**3 / 6 * p4, p2 + T * (a + p3) + T**2 / 2 * p4, p3 + T * p4
        angles.append(th)
        commands.append(a)
        th, w = th + T * w + T**2 / 2 * ratio * (a + d), w + T * ratio * (a + d)
    return np.array(angles), np.array(commands)


def test_when_a_sine_disturbs_the_loop_expect_the_predicted_amplitude() -> None:
    law = multiple_pole_law(60, 1200, 1e-3, 1e-3)
    for ratio in (0.4, 1.0):
        time = np.arange(6000) * 1e-3
        angles, _ = simulate(law, ratio, np.zeros(time.size), np.sin(20.0 * time))
        amplitude = np.max(np.abs(angles[-700:]))
        assert SampledLoop(law).disturbance_gain(ratio, 20.0) == pytest.approx(amplitude, rel=1e-3)


def test_when_the_angle_is_noisy_expect_the_predicted_command_increments() -> None:
    law = multiple_pole_law(60, 1200, 1e-3, 1e-3)
    noise = np.random.default_rng(3).normal(size=200_000)
    for ratio in (0.3, 1.0):
        _, commands = simulate(law, ratio, noise, np.zeros(noise.size))
        measured = np.std(np.diff(commands[1000:]))
        assert SampledLoop(law).command_activity(ratio) == pytest.approx(measured, rel=0.02)


def test_when_the_loop_is_unstable_expect_no_margin_and_infinite_activity() -> None:
    law = multiple_pole_law(60, 1200, 1e-3, 1e-3)
    assert SampledLoop(law, 3e-3).inertia_margin() is None
    assert SampledLoop(law).command_activity(10.0) == np.inf


def test_when_payloads_are_scanned_expect_the_known_range_and_places_inside_the_domain() -> None:
    arm3 = robot("arm3")
    needed = needed_inertia_range(arm3)
    assert 0.99 <= needed.lowest <= 1.001
    assert 6.0 <= needed.highest <= 6.2
    theta, fraction = needed.where_highest
    ratios = np.linalg.eigvals(
        np.linalg.solve(
            arm3.model.inertia(np.array(theta)), arm3.with_payload_fraction(fraction).inertia(np.array(theta))
        )
    )
    assert np.max(ratios.real) == pytest.approx(needed.highest, rel=1e-9)
    for value, (low, high) in zip(theta, arm3.domain.angle_rad, strict=True):
        assert low <= value <= high
