"""Theorem IV.11 in the structure in which it is printed, its errors corrected: an oracle for the reduced form.

Extended state ``(e, int e, e')`` of five n-blocks with the disturbance w and the output psi on one side, ``(e_x, e_d,
e_eta)`` of seven n-blocks on the other, Peaucelle slack matrices H, R that separate A(z) from the Lyapunov matrix, a
full set of unknowns per pair of vertices and zero-mean slack T, S per premise (Dehak 2022, Theorem IV.11). What was
corrected, and why, is listed in ``docs/concepts/reduced-forms.md``. Use it for one or two joints: the inequalities are
14n x 14n and there are (2p)^2 of each family.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.forms.blocks import block_diagonal, double_sum, identity_blocks
from quasilpv.lmi import Expression, Problem, Variable, block, constant, he, zeros
from quasilpv.lmi.exact import Matrix


def literal_feedback(
    inertia: Matrix, decay: float, gamma: float, blocks: npt.NDArray[np.intp], *, slack: bool = True
) -> Problem:
    """Inequalities (IV.48), (IV.49): decay rate and squared L2 gain gamma of the feedback, as a feasibility problem.

    ``F_ij = He [A_i H_j + Sigma_ij, A_i R_j; P_ij - H_j, -R_j]`` with

        A_i = [[A_ci + alpha E_c, 0, 0], [0, 0, 0], [C, 0, 0]],  A_ci = [0 0 I; C 0 0; A 0 -E_i],  E_c = diag(I, I, 0)
        Sigma_ij = [[B_c [Y_ij 0], B_c, 0], [0, -gamma/2 I, 0], [0, 0, -1/2 I]]
        P_ij = diag([P_1 0; P_2ij P_3ij], I, I)

    Args:
        inertia: vertices M_i, (N, n, n); A = [0 I; 0 0].
        decay: alpha_c.
        gamma: bound on the squared L2 gain from w to the error.
        blocks: block (premise) of every vertex.
        slack: with the slack matrices T_c, S_c.
    """
    count, n, _ = inertia.shape
    one, none = identity_blocks(n)
    two = np.kron(np.eye(2, dtype=int).astype(object), one)
    C, B = np.hstack([one, none]), np.vstack([none, one])
    A = np.block([[none, one], [none, none]])
    gap = np.zeros((2 * n, n), dtype=int).astype(object)
    E_c = block_diagonal(two, one, 0 * two)
    B_c = np.vstack([gap, none, B])
    C_c = np.hstack([C, none, 0 * C])
    P_1 = Variable("P1", 3 * n, symmetric=True)
    shape = 7 * n
    H = [Variable(f"H{j}", shape) for j in range(count)]
    R = [Variable(f"R{j}", shape) for j in range(count)]

    def state_matrix(i: int) -> Matrix:
        descriptor = block_diagonal(one, inertia[i])
        A_c = np.block([[0 * two, gap, two], [C, none, 0 * C], [A, gap, -descriptor]])
        extended = np.zeros((shape, shape), dtype=int).astype(object)
        extended[: 5 * n, : 5 * n] = A_c + decay * E_c
        extended[6 * n :, : 5 * n] = C_c
        return extended

    matrices = [state_matrix(i) for i in range(count)]

    def entry(i: int, j: int) -> Expression:
        Y = Variable(f"Y{i}{j}", n, 3 * n)
        lower = [Variable(f"P2 {i}{j}", 2 * n, 3 * n).expression, Variable(f"P3 {i}{j}", 2 * n).expression]
        P = block([[P_1, zeros(3 * n, 2 * n)], lower])
        fed_back = block([[B_c @ Y, zeros(5 * n, 2 * n)]])
        Sigma = block(
            [
                [fed_back, constant(B_c), zeros(5 * n, n)],
                [zeros(n, 5 * n), constant(one * (-gamma / 2)), zeros(n, n)],
                [zeros(n, 5 * n), zeros(n, n), constant(one * -0.5)],
            ]
        )
        extended = block([[P, zeros(5 * n, 2 * n)], [zeros(2 * n, 5 * n), constant(two)]])
        left = matrices[i]
        return he(block([[left @ H[j] + Sigma, left @ R[j]], [extended - H[j], -R[j].expression]]))

    problem = Problem()
    problem.positive("P1", P_1.expression)
    double_sum(problem, "Xi", entry, count, blocks if slack else None)
    return problem


def literal_observer(
    inertia: Matrix,
    decay: float,
    filter_time_constant: float,
    blocks: npt.NDArray[np.intp],
    *,
    slack: bool = True,
) -> Problem:
    """Inequalities (IV.46), (IV.47): decay rate of the estimation error, as a feasibility problem.

    ``Lambda_ij = He [A_i' H_j - C_o' W_ij', A_i' R_j; Q_ij - H_j, -R_j]`` with

        A_i = [0 0 I; 0 D 0; A B_o -E_i] + alpha E_o,  E_o = diag(I, I, 0),  C_o = [C 0 0],  Q_ij = [Q_1 0; Q_2ij Q_3ij]

    and D the model of (d_f, d, d') with the filter ``T_f d_f' = d - d_f``.

    Args:
        inertia: vertices M_i, (N, n, n); A = [0 I; 0 0].
        decay: alpha_o.
        filter_time_constant: T_f.
        blocks: block (premise) of every vertex.
        slack: with the slack matrices T_o, S_o.
    """
    count, n, _ = inertia.shape
    one, none = identity_blocks(n)
    two = np.kron(np.eye(2, dtype=int).astype(object), one)
    rate = one * (1 / filter_time_constant)
    D = np.block([[-rate, rate, none], [none, none, one], [none, none, none]])
    A = np.block([[none, one], [none, none]])
    B_o = np.block([[none, none, none], [none, one, none]])
    E_o = block_diagonal(two, block_diagonal(one, one, one), 0 * two)
    C_o = np.hstack([one, *([none] * 6)])
    wide = np.zeros((2 * n, 3 * n), dtype=int).astype(object)
    Q_1 = Variable("Q1", 5 * n, symmetric=True)
    H = [Variable(f"H{j}", 7 * n) for j in range(count)]
    R = [Variable(f"R{j}", 7 * n) for j in range(count)]
    matrices = [
        np.block([[0 * two, wide, two], [wide.T, D, wide.T], [A, B_o, -block_diagonal(one, M)]]) + decay * E_o
        for M in inertia
    ]

    def entry(i: int, j: int) -> Expression:
        W = Variable(f"W{i}{j}", 7 * n, n)
        lower = [Variable(f"Q2 {i}{j}", 2 * n, 5 * n).expression, Variable(f"Q3 {i}{j}", 2 * n).expression]
        Q = block([[Q_1, zeros(5 * n, 2 * n)], lower])
        left = matrices[i].T
        return he(block([[left @ H[j] - C_o.T @ W.T, left @ R[j]], [Q - H[j], -R[j].expression]]))

    problem = Problem()
    problem.positive("Q1", Q_1.expression)
    double_sum(problem, "Upsilon", entry, count, blocks if slack else None)
    return problem
