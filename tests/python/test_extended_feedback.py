"""Extended compensation (I.53) in simulation: the loop through the acceleration against the robot's own dynamics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from quasilpv.conditions.condition import Feedback
from quasilpv.errors import InputError
from quasilpv.experiments.extended_feedback import extended_feedback, simulate_extended
from quasilpv.systems.catalogue import system
from quasilpv.systems.robots.registry import arm2

DECAY = 1.0
START = [np.pi / 8.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("upright", [0.0, 1.0])
def test_when_the_loop_through_the_acceleration_is_closed_expect_v_to_decrease_and_the_torque_of_the_arm(
    upright: float,
) -> None:
    plant = system("arm2", upright=upright, theta_max=np.pi / 4.0, speed_max=2.0)
    feedback = extended_feedback(plant, DECAY)
    run = simulate_extended(plant, feedback, START, np.linspace(0.0, 5.0, 501))
    assert np.all(run.lyapunov <= run.lyapunov[0] * np.exp(-2.0 * DECAY * run.time_s) * (1.0 + 1e-6) + 1e-12)
    arm = replace(arm2(), equilibrium="upright" if upright else "hanging")
    for x, rate, torque in zip(run.state[::50], run.derivative[::50], run.input[::50], strict=True):
        np.testing.assert_allclose(rate[:2], x[2:], rtol=1e-9, atol=1e-9)
        needed = arm.inverse_dynamics(x[:2], x[2:], rate[2:])
        np.testing.assert_allclose(torque, needed, rtol=1e-7, atol=1e-7 * np.abs(run.input).max())


def test_when_a_system_has_algebraic_states_expect_them_solved_with_the_derivative() -> None:
    plant = system("ex-II.7", a=-5.0, b=-5.0)
    q, n = plant.differential, plant.order
    assert q < n
    gain = 0.1 * np.random.default_rng(2).normal(size=(len(plant.inputs), n + q))
    run = simulate_extended(plant, Feedback(np.eye(q), lambda _: gain), np.full(q, 0.1), np.linspace(0.0, 0.5, 6))
    for x, rate, algebraic, u in zip(run.state, run.derivative, run.algebraic, run.input, strict=True):
        whole = np.concatenate([x, algebraic])
        E, A, B, _ = plant.evaluate(plant.premise_values(whole))
        residual = E[:, : plant.differential] @ rate - A @ whole - B @ u
        assert np.abs(residual).max() < 1e-9 * max(1.0, np.abs(u).max())


def test_when_the_start_or_the_gain_does_not_fit_expect_the_field_named() -> None:
    plant = system("arm2")
    feedback = Feedback(np.eye(4), lambda _: np.zeros((2, 8)))
    with pytest.raises(InputError, match=r"start: got shape \(2,\), expected \(4,\)"):
        simulate_extended(plant, feedback, [0.1, 0.0], [0.0, 1.0])
    with pytest.raises(InputError, match=r"gain: got shape \(2, 4\), expected \(2, 8\)"):
        simulate_extended(plant, Feedback(np.eye(4), lambda _: np.zeros((2, 4))), START, [0.0, 1.0])


def test_when_the_derivative_fed_back_cancels_the_inertia_expect_the_singular_loop_reported() -> None:
    plant = system("arm2")

    def gain(z: np.ndarray) -> np.ndarray:
        return np.hstack([np.zeros((2, 6)), plant.evaluate(z).E[2:, 2:]])

    with pytest.raises(InputError, match="loop: got singular"):
        simulate_extended(plant, Feedback(np.eye(4), gain), START, [0.0, 1.0])
