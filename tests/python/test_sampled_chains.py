"""Gains of the exactly sampled chains, checked by means other than the inequalities they came from."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov

from quasilpv.conditions.tracking.sampled_chains import (
    FEEDBACK_DISK,
    OBSERVER_DISK,
    disk_of,
    feedback_chain,
    feedback_gains,
    observer_chain,
    observer_gains,
)

T = 1e-3


@pytest.mark.parametrize("t", [1e-3, 0.07, 1.3])
def test_when_chains_are_sampled_expect_the_matrix_exponential(t: float) -> None:
    integrators = np.diag(np.ones(3), 1)
    transition, drive, _ = observer_chain(t)
    assert np.allclose(transition.astype(float), expm(integrators * t), rtol=1e-14)
    held = np.zeros((5, 5))
    held[:4, :4], held[3, 4] = integrators, 1.0
    assert np.allclose(drive.astype(float)[:, 0], expm(held * t)[:4, 4], rtol=1e-14)

    transition, drive = feedback_chain(t)
    held = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    step = expm(held * t)
    assert np.allclose(transition.astype(float)[:2, :2], step[:2, :2])
    assert np.allclose(drive.astype(float)[:2, 0], step[:2, 2])
    assert transition.astype(float)[2].tolist() == [t, 0.0, 1.0]  # forward sum of the angle


@pytest.mark.parametrize("bandwidth", [20.0, 60.0, 120.0, 250.0])
def test_when_feedback_is_designed_expect_poles_in_the_disk_and_the_covariance_it_promises(bandwidth: float) -> None:
    chain = feedback_gains(bandwidth, T)
    assert chain.solution.verified
    t = bandwidth * T
    A, B = (matrix.astype(float) for matrix in feedback_chain(t))
    closed = A + B @ (chain.gains / bandwidth ** np.array([2.0, 1.0, 3.0]))[None]
    centre, radius = (float(value) for value in disk_of(bandwidth, T, FEEDBACK_DISK))
    assert np.all(np.abs(np.linalg.eigvals(closed) - centre) < radius)
    covariance = solve_discrete_lyapunov(closed, B @ B.T)
    assert covariance[0, 0] <= chain.objective * (1 + 1e-9)
    assert np.all(chain.gains < 0)


@pytest.mark.parametrize("bandwidth", [300.0, 800.0, 1500.0, 2600.0])
def test_when_the_observer_is_designed_expect_poles_in_the_disk_and_the_variance_it_promises(bandwidth: float) -> None:
    chain = observer_gains(bandwidth, T)
    assert chain.solution.verified
    A, G, C = (matrix.astype(float) for matrix in observer_chain(bandwidth * T))
    gains = (chain.gains / bandwidth ** np.arange(4.0))[:, None]
    error = A @ (np.eye(4) - gains @ C)
    centre, radius = (float(value) for value in disk_of(bandwidth, T, OBSERVER_DISK))
    assert np.all(np.abs(np.linalg.eigvals(error) - centre) < radius)
    inputs = np.hstack([A @ gains, G])
    covariance = solve_discrete_lyapunov(error, inputs @ inputs.T)
    assert covariance[2, 2] <= chain.objective * (1 + 1e-9)


def test_when_the_time_unit_changes_expect_scaled_gains() -> None:
    slow, fast = feedback_gains(60.0, 1e-3), feedback_gains(240.0, 0.25e-3)
    assert np.allclose(fast.gains, slow.gains * 4.0 ** np.array([2, 1, 3]), rtol=1e-6)
