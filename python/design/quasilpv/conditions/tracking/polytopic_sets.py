"""Ellipsoids that hold the errors of the torque-level law, however the premises move: Theorem IV.11 in reduced form.

The systems are those of `quasilpv.conditions.tracking.iv11_reduced` with gains given: the feedback
``E(z) xi' = A(z) xi + B d`` and the observer ``eps' = (A - L(z) C) eps + G v + H d''``, ``M(z) v = D eps``.
By the S-procedure for quadratic functions (Boyd, El Ghaoui, Feron and Balakrishnan 1994, sections 5.2 and 6.1).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.forms.blocks import double_sum, single_sum
from quasilpv.conditions.tracking.invariant_sets import trace_along
from quasilpv.lmi import Expression, Problem, Variable, block, constant, he, identity, zeros


def feedback_system(inertia: FloatArray, gains: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vertices E_i and A_i, (N, 3n, 3n) each, and B, (3n, n), of the feedback error ``xi = (e, e', int e)``.

    Args:
        inertia: vertices M_i, (N, n, n).
        gains: vertices [Kp Kd KI], (N, n, 3n).
    """
    count, n, _ = inertia.shape
    E = np.tile(np.eye(3 * n), (count, 1, 1))
    E[:, n : 2 * n, n : 2 * n] = inertia
    A = np.tile(np.kron(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.eye(n)), (count, 1, 1))
    A[:, n : 2 * n] = gains
    return E, A, np.eye(3 * n)[:, n : 2 * n]


def polytopic_level_set(
    inertia: FloatArray, system: FloatArray, outputs: FloatArray, directions: FloatArray, decay: float
) -> tuple[Problem, Variable]:
    """Set ``x' X^-1 x <= 1`` that ``E(z) x' = A(z) x`` does not leave, in which every ``|C_k x| <= 1``, wide along N.

    Unknowns ``X = X' > 0`` and Z; minimise ``trace Z`` subject to ``[[Z, N'], [*, X]] > 0`` (Z bounds ``N' X^-1 N``),
    ``C_k X C_k' < 1`` and, as a double sum, ``He(A_i X E_j') + 2 decay E_i X E_j' < 0``.

    Args:
        inertia: vertices E_i, (N, s, s).
        system: vertices A_i, (N, s, s).
        outputs: rows C_k, (k, s).
        directions: N, (s, m).
        decay: rate of decay of ``sqrt(x' X^-1 x)``.

    Returns:
        The problem and X.
    """
    X = Variable("X", system.shape[1], symmetric=True)
    width = directions.shape[1]
    Z = Variable("Z", width, symmetric=True)
    problem = Problem()
    problem.positive("extent", block([[Z, directions.T], [None, X]]))

    def decrease(i: int, j: int) -> Expression:
        total: Expression = he(system[i] @ X @ inertia[j].T) + (inertia[i] @ X @ inertia[j].T) * (2.0 * decay)
        return total

    double_sum(problem, "decrease", decrease, len(system))
    for k, row in enumerate(outputs):
        problem.positive(f"output {k}", identity(1) - row[None] @ X @ row[:, None])
    problem.minimise(trace_along(np.eye(width), Z.expression))
    return problem, X


def polytopic_peak_set(
    inertia: FloatArray, system: FloatArray, drive: FloatArray, outputs: FloatArray, multiplier: float
) -> tuple[Problem, Variable]:
    """Small set ``x' X^-1 x <= 1`` that ``E(z) x' = A(z) x + B d``, ``|d| <= 1``, does not leave from 0.

    Unknown ``X = X' > 0``; minimise ``trace(C X C')`` subject to, as a double sum,
    ``He(A_i X E_j') + lambda E_i X E_j' + B B' / lambda < 0``.

    Args:
        inertia: vertices E_i, (N, s, s).
        system: vertices A_i, (N, s, s).
        drive: B, (s, n).
        outputs: C, (k, s).
        multiplier: lambda > 0.

    Returns:
        The problem and X.
    """
    X = Variable("X", system.shape[1], symmetric=True)
    reached = constant(drive @ drive.T / multiplier)
    problem = Problem()
    problem.positive("X", X.expression)

    def decrease(i: int, j: int) -> Expression:
        total: Expression = he(system[i] @ X @ inertia[j].T) + (inertia[i] @ X @ inertia[j].T) * multiplier + reached
        return total

    double_sum(problem, "decrease", decrease, len(system))
    problem.minimise(trace_along(outputs.T, X.expression))
    return problem, X


def estimation_peak_set(
    inertia: FloatArray, gains: FloatArray, outputs: Sequence[FloatArray], multiplier: float, peak: float = 1.0
) -> tuple[Problem, Variable, Variable]:
    """Small set ``eps' Q eps <= 1`` that the estimation error does not leave from 0 while ``|d''| <= peak``.

    Unknowns ``Q = Q' > 0``, F and bounds b_k; minimise ``sum b_k`` subject to ``[[Q, C_k'], [*, b_k I]] > 0``, so that
    ``|C_k eps|^2 <= b_k``, and for every vertex, with ``X_i = Q (A - L_i C)`` and ``c_i = [D, -M_i]``,
    ``[He(X_i) + lambda Q, Q G, peak Q H; *, 0, 0; *, *, -lambda I] + He([F; 0] [c_i, 0]) < 0``.

    Args:
        inertia: vertices M_i, (N, n, n).
        gains: vertices L_i, (N, 4n, n).
        outputs: C_k, (r_k, 4n) each.
        multiplier: lambda > 0.
        peak: scales Q; of use to a solver if bounds and Q are of order one.

    Returns:
        The problem, Q and F.
    """
    count, n, _ = inertia.shape
    one, none = np.eye(n), np.zeros((n, n))
    A = np.kron(np.diag([1.0, 0.0, 1.0], 1), one)
    G, H = np.vstack([none, one, none, none]), np.vstack([none, none, none, one])
    C = np.hstack([one, none, none, none])
    Q = Variable("Q", 4 * n, symmetric=True)
    F = Variable("F", 5 * n, n)

    def decrease(i: int) -> Expression:
        top = block([[he(Q @ (A - gains[i] @ C)) + Q * multiplier, Q @ G], [None, zeros(n, n)]])
        top = top + he(F @ np.hstack([none, none, one, none, -inertia[i]]))
        return block([[top, block([[Q @ (peak * H)], [zeros(n, n)]])], [None, constant(-multiplier * one)]])

    problem = Problem()
    problem.positive("Q", Q.expression)
    single_sum(problem, "decrease", decrease, count)
    total = zeros(1, 1)
    for k, output in enumerate(outputs):
        bound = Variable(f"bound {k}", 1)
        problem.positive(f"output {k}", block([[Q, output.T], [None, bound * np.eye(len(output))]]))
        total = total + bound
    problem.minimise(total)
    return problem, Q, F
