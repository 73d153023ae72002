"""The steps of ``docs/concepts/reduced-forms.md``, each on matrices that know nothing of the conditions' code."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import null_space, solve_continuous_lyapunov

from quasilpv.arrays import FloatArray
from quasilpv.polytopes import BlockPolytope

SEEDS = range(8)


def he(X: FloatArray) -> FloatArray:
    return X + X.T


def largest(X: FloatArray) -> float:
    return float(np.linalg.eigvalsh((X + X.T) / 2)[-1])


def random_inertia(rng: np.random.Generator, n: int) -> FloatArray:
    root = rng.normal(size=(n, n))
    return np.asarray(root @ root.T + 0.3 * np.eye(n))


def stable_feedback(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(M, P, Y): an inertia and a point with He(E^-1 (A P + B Y)) + 2 a P < 0 for a = 0.2."""
    M = random_inertia(rng, n)
    K = -np.hstack([30.0 * M, 10.0 * M, 20.0 * M]) @ (np.eye(3 * n) + 0.01 * rng.normal(size=(3 * n, 3 * n)))
    closed = feedback_dynamics(M, K)
    P = solve_continuous_lyapunov(closed + 0.2 * np.eye(3 * n), -np.eye(3 * n))
    return M, P, K @ P


def feedback_dynamics(M: FloatArray, K: FloatArray) -> FloatArray:
    """(e, e', int e) with M e'' = K xi."""
    n = len(M)
    one, none = np.eye(n), np.zeros((n, n))
    return np.block([[none, one, none], [np.linalg.solve(M, K)], [one, none, none]])


def test_step_1_slack_has_mean_zero_at_every_point_and_vanishes_for_one_block() -> None:
    rng = np.random.default_rng(0)
    per_premise, single = (
        make([-1.0, 0.0, 2.0], [1.0, 3.0, 5.0]) for make in (BlockPolytope.per_premise, BlockPolytope.takagi_sugeno)
    )
    for polytope in (per_premise, single):
        T = rng.normal(size=(len(polytope.blocks), 4, 4))
        slack = T[polytope.block_index] - T.mean(axis=0)
        for z in rng.uniform(polytope.lower, polytope.upper, (50, 3)):
            assert np.abs(np.tensordot(polytope.weights(z), slack, 1)).max() < 1e-13
    assert len(single.blocks) == 1


def test_step_2_the_projection_removes_h_and_r_identically() -> None:
    n = 2
    A, H, R, P, S = (sp.MatrixSymbol(name, n, n).as_explicit() for name in "AHRPS")
    X = sp.BlockMatrix([[A * H + S, A * R], [P - H, -R]]).as_explicit()
    N = sp.Matrix.hstack(sp.eye(n), A)
    projected = N * (X + X.T) * N.T
    expected = A * P + S + (A * P + S).T
    assert (projected - expected).expand() == sp.zeros(n, n)


@pytest.mark.parametrize("seed", SEEDS)
def test_step_2_with_h_equal_to_p_and_small_r_expect_the_larger_inequality_to_hold(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, P = rng.normal(size=(6, 6)), rng.normal(size=(6, 6))
    skew = rng.normal(size=(6, 6))
    S = -A @ P - np.diag(rng.uniform(0.1, 2.0, 6)) + skew - skew.T
    assert largest(he(A @ P + S)) < 0
    R = 1e-3 * np.eye(6)
    assert largest(he(np.block([[A @ P + S, A @ R], [0 * A, -R]]))) < 0


def descriptor_parts(M: FloatArray, decay: float) -> tuple[FloatArray, ...]:
    """A_11, A_12, A_21, E, B, C of the state (e, int e) with the accelerations (x') apart, 2n, n and 2n entries."""
    n = len(M)
    one, none = np.eye(n), np.zeros((n, n))
    A_11 = np.block([[none, none, none], [none, none, none], [one, none, none]]) + decay * np.eye(3 * n)
    A_12 = np.vstack([np.eye(2 * n), np.zeros((n, 2 * n))])
    A_21 = np.block([[none, one, none], [none, none, none]])
    E = np.block([[one, none], [none, M]])
    return A_11, A_12, A_21, E, np.vstack([none, one]), np.hstack([one, none, none])


@pytest.mark.parametrize("seed", SEEDS)
def test_step_3_eliminating_the_accelerations_leaves_the_regular_system(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, decay = 2, 0.1
    M, P, Y = stable_feedback(rng, n)
    A_11, A_12, A_21, E, B, C = descriptor_parts(M, decay)
    gamma = 50.0
    P_23 = rng.normal(size=(2 * n, 5 * n))
    lyapunov = np.block([[P, np.zeros((3 * n, 2 * n))], [P_23]])
    dynamics = np.block([[A_11, A_12], [A_21, -E]])
    theta = he(dynamics @ lyapunov + np.block([[np.zeros((3 * n, 5 * n))], [B @ Y, np.zeros((2 * n, 2 * n))]]))
    drive = np.vstack([np.zeros((3 * n, n)), B])
    out = np.vstack([P @ C.T, np.zeros((2 * n, n))])  # the lower left blocks of P do not meet the output
    one, none = np.eye(n), np.zeros((n, n))
    full = np.block([[theta, drive, out], [drive.T, -gamma * one, none], [out.T, none, -one]])
    N = np.block(
        [[np.eye(3 * n), A_12 @ np.linalg.inv(E), np.zeros((3 * n, 2 * n))], [np.zeros((2 * n, 5 * n)), np.eye(2 * n)]]
    )
    closed = feedback_dynamics(M, Y @ np.linalg.inv(P))
    mobility = np.vstack([none, np.linalg.inv(M), none])
    expected = np.block(
        [
            [he(closed @ P) + 2 * decay * P, mobility, P @ C.T],
            [mobility.T, -gamma * one, none],
            [C @ P, none, -one],
        ]
    )
    np.testing.assert_allclose(N @ full @ N.T, expected, atol=1e-9 * np.abs(full).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_step_3_conversely_a_point_of_the_regular_system_extends_to_the_accelerations(seed: int) -> None:
    """The null spaces of the elimination lemma are the two that the text names."""
    rng = np.random.default_rng(seed)
    n = 2
    M = random_inertia(rng, n)
    _, A_12, _, E, _, _ = descriptor_parts(M, 0.1)
    U = np.vstack([A_12, -E, np.zeros((2 * n, 2 * n))])
    N = np.block(
        [[np.eye(3 * n), A_12 @ np.linalg.inv(E), np.zeros((3 * n, 2 * n))], [np.zeros((2 * n, 5 * n)), np.eye(2 * n)]]
    )
    assert np.abs(N @ U).max() < 1e-12
    assert np.linalg.matrix_rank(N) + np.linalg.matrix_rank(U) == 7 * n
    V = np.hstack([np.eye(5 * n), np.zeros((5 * n, 2 * n))])
    assert np.abs(null_space(V)[: 5 * n]).max() < 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_step_4_the_congruence_is_the_double_sum_without_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, count, decay = 2, 3, 0.1
    M = np.array([random_inertia(rng, n) for _ in range(count)])
    P, w = random_inertia(rng, 3 * n), rng.dirichlet(np.ones(count))
    Y = rng.normal(size=(count, n, 3 * n))
    one, none = np.eye(n), np.zeros((n, n))
    A, B = np.block([[none, one, none], [none, none, none], [one, none, none]]), np.vstack([none, one, none])
    E = np.array([np.block([[one, none, none], [none, m, none], [none, none, one]]) for m in M])
    value = sum(
        w[i] * w[j] * (he((A @ P + B @ Y[i]) @ E[j].T) + 2 * decay * E[i] @ P @ E[j].T)
        for i in range(count)
        for j in range(count)
    )
    E_z, Y_z = np.tensordot(w, E, 1), np.tensordot(w, Y, 1)
    inverse = np.linalg.inv(E_z)
    regular = he(inverse @ (A @ P + B @ Y_z)) + 2 * decay * P
    np.testing.assert_allclose(np.asarray(value), E_z @ regular @ E_z.T, atol=1e-10 * np.abs(value).max())


def observer_error(M: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Chain and output of the estimation error (e_1, e_2, e_d, e_d')."""
    n = len(M)
    one, none = np.eye(n), np.zeros((n, n))
    chain = np.block(
        [[none, one, none, none], [none, none, np.linalg.inv(M), none], [none, none, none, one], [none] * 4]
    )
    return chain, np.hstack([one, none, none, none])


def stable_observer(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(M, Q, L) with He(Q (A - L C)) + 2 a Q < 0 for a = 0.3."""
    M = random_inertia(rng, n)
    A, C = observer_error(M)
    L = np.vstack([8 * np.eye(n), 24 * np.eye(n), 32 * M, 16 * M])
    shifted = A - L @ C + 0.3 * np.eye(4 * n)
    return M, solve_continuous_lyapunov(shifted.T, -np.eye(4 * n)), L


@pytest.mark.parametrize("seed", SEEDS)
def test_step_5_the_filter_joins_with_a_small_weight_if_and_only_if_it_is_faster_than_the_decay_rate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, decay = 2, 0.3
    M, Q, L = stable_observer(rng, n)
    A, C = observer_error(M)
    for time_constant, holds in ((1.0, True), (5.0, False)):  # 1/T_f = 1 and 0.2
        rate = np.eye(n) / time_constant
        coupling = np.hstack([np.zeros((n, 2 * n)), rate, np.zeros((n, n))])
        whole = np.block([[A - L @ C, np.zeros((4 * n, n))], [coupling, -rate]])
        weight = np.block([[Q, np.zeros((4 * n, n))], [np.zeros((n, 4 * n)), 1e-4 * np.eye(n)]])
        assert (largest(he(weight @ whole) + 2 * decay * weight) < 0) == holds
        if holds:  # any solution of the whole has one of the rest in its inverse
            full = solve_continuous_lyapunov((whole + decay * np.eye(5 * n)).T, -random_inertia(rng, 5 * n))
            rest = np.linalg.inv(full)[: 4 * n, : 4 * n]
            assert largest(he((A - L @ C) @ rest) + 2 * decay * rest) < 0


@pytest.mark.parametrize("seed", SEEDS)
def test_step_6_gains_in_the_algebraic_equation_add_to_those_in_the_dynamics(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 2
    M, Q, L = stable_observer(rng, n)
    A, C = observer_error(M)
    L_x = rng.normal(size=(2 * n, n))
    E = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), M]])
    split = L.copy()
    split[: 2 * n] -= np.linalg.solve(E, L_x)
    state, drive = np.block([[np.zeros((n, n)), np.eye(n)], [np.zeros((n, 2 * n))]]), np.zeros((2 * n, 2 * n))
    drive[n:, :n] = np.eye(n)
    solved = np.linalg.solve(E, np.hstack([state - L_x @ C[:, : 2 * n], drive]))  # e_eta as a function of eps
    error = np.vstack([solved, np.hstack([np.zeros((n, 3 * n)), np.eye(n)]), np.zeros((n, 4 * n))]) - split @ C
    np.testing.assert_allclose(error, A - L @ C, atol=1e-10 * np.abs(L).max())
    assert largest(he(Q @ error)) < 0


@pytest.mark.parametrize("seed", SEEDS)
def test_step_7_a_multiplier_exists_exactly_when_the_inequality_holds_on_the_constraint(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, decay = 2, 0.3
    M, Q, L = stable_observer(rng, n)
    one, none = np.eye(n), np.zeros((n, n))
    chain = np.block([[none, one, none, none], [none] * 4, [none, none, none, one], [none] * 4])
    C, G = np.hstack([one, none, none, none]), np.vstack([none, one, none, none])
    error = chain - L @ C
    form = np.block([[he(Q @ error) + 2 * decay * Q, Q @ G], [G.T @ Q, none]])
    motion = np.hstack([none, none, one, none, -M])
    F = -1e6 * motion.T / 2
    assert largest(form + he(F @ motion)) < 0
    basis = null_space(motion)
    assert largest(basis.T @ form @ basis) < 0
    too_fast = form + np.block([[20 * Q, np.zeros((4 * n, n))], [np.zeros((n, 5 * n))]])
    assert largest(basis.T @ too_fast @ basis) > 0
    assert largest(too_fast + he(F @ motion)) > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_step_8_rates_and_inertias_scale_a_solution_into_a_solution(seed: int) -> None:
    """The state transformation of the scaled loop, for the feedback and for the observer."""
    rng = np.random.default_rng(seed)
    n, rate, heavier = 2, 7.0, 3.0
    M, P, Y = stable_feedback(rng, n)
    K = Y @ np.linalg.inv(P)
    state = np.repeat([1.0, rate, 1.0 / rate], n)
    scaled = feedback_dynamics(heavier * M, K * heavier * rate**2 / state)
    np.testing.assert_allclose(scaled, rate * feedback_dynamics(M, K) * state[:, None] / state, rtol=1e-9, atol=1e-9)
    M, _, L = stable_observer(rng, n)
    torque = heavier * rate**2
    state = np.repeat([1.0, rate, torque, torque * rate], n)
    A, C = observer_error(M)
    A_scaled, _ = observer_error(heavier * M)
    np.testing.assert_allclose(
        A_scaled - rate * state[:, None] * L @ C, rate * (A - L @ C) * state[:, None] / state, rtol=1e-9, atol=1e-9
    )
