"""Feedback and observer for sampled models: contraction at random premises, and what it tolerates of the true plant."""

import numpy as np
import pytest
import scipy.linalg

from closed_loops import decided, premises, stated
from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import condition
from quasilpv.errors import InputError

RATE = 0.05

CASES = [("ex-I.1", {"b": 1.0}, 0.0, 0.05), ("ex-I.1", {"b": 0.2}, 0.1, 0.01), ("ex-II.9", {"b": 1.0}, 0.1, 0.001)]


@pytest.mark.parametrize(("name", "parameters", "rate", "period"), CASES)
def test_sampled_feedback_contracts_its_model(
    name: str, parameters: dict[str, float], rate: float, period: float
) -> None:
    options = Options(decay_rate=rate, sample_period_s=period)
    plant, statement = stated(condition("sampled-feedback"), name, options, "per-premise", **parameters)
    decision = decided(statement.problem)
    assert decision.feasible
    law = statement.feedback(decision.values)
    assert law.gain is not None
    root = np.linalg.cholesky(law.lyapunov)
    for z in premises(plant, np.random.default_rng(0), 300):
        E, A, B, _ = plant.evaluate(z)
        step = np.linalg.solve(E, E + period * (A + B @ law.gain(z)))
        assert np.linalg.norm(np.linalg.solve(root, step @ root), 2) < np.exp(-rate * period)


def test_margin_of_the_contraction_covers_the_error_of_euler() -> None:
    """At frozen premises, exact sampling with held input stays within ``1 - rho`` of the model in the norm of P."""
    rate, period = RATE, 0.001
    options = Options(decay_rate=rate, sample_period_s=period)
    plant, statement = stated(condition("sampled-feedback"), "ex-I.1", options, "per-premise", b=0.2)
    law = statement.feedback(decided(statement.problem).values)
    assert law.gain is not None
    root = np.linalg.cholesky(law.lyapunov)
    for z in premises(plant, np.random.default_rng(0), 100):
        E, A, B, _ = plant.evaluate(z)
        drift, inputs = np.linalg.solve(E, A), np.linalg.solve(E, B)
        held = scipy.linalg.expm(period * np.block([[drift, inputs], [np.zeros((1, 3))]]))
        exact = held[:2, :2] + held[:2, 2:] @ law.gain(z)
        euler = np.eye(2) + period * (drift + inputs @ law.gain(z))
        error = np.linalg.norm(np.linalg.solve(root, (exact - euler) @ root), 2)
        assert np.linalg.norm(np.linalg.solve(root, exact @ root), 2) < np.exp(-rate * period) + error
        assert np.linalg.norm(np.linalg.solve(root, exact @ root), 2) < 1.0


@pytest.mark.parametrize(("rate", "period"), [(0.5, 0.01), (0.0, 0.001)])
def test_sampled_observer_contracts_its_error(rate: float, period: float) -> None:
    options = Options(decay_rate=rate, sample_period_s=period)
    plant, statement = stated(condition("sampled-observer"), "ex-I.1", options)
    decision = decided(statement.problem)
    assert decision.feasible
    design = statement.feedback(decision.values)
    assert design.observer is not None
    root = np.linalg.cholesky(design.lyapunov)
    for z in premises(plant, np.random.default_rng(0), 300):
        E, A, _, C = plant.evaluate(z)
        step = np.linalg.solve(E, E + period * A - design.observer(z) @ C)
        assert np.linalg.norm(np.linalg.solve(root, step @ root), 2) < np.exp(-rate * period)


@pytest.mark.parametrize("name", ["sampled-feedback", "sampled-observer"])
def test_algebraic_states_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="algebraic"):
        stated(condition(name), "ex-II.7", Options())


def test_sample_period_must_be_a_time() -> None:
    with pytest.raises(InputError, match="sample period"):
        Options(sample_period_s=0.0)
