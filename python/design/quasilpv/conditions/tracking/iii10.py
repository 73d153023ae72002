"""Theorem III.10: H-infinity tracking with gains that stay within a bound.

Full state feedback for the tracking error ``xi = (e, e', int e)`` of an uncertain descriptor system
``E(z) xi' = (A(z) + B K(z)) xi + B d``, ``psi = C xi``, with measured and unknown premises in one representation. The
gain is rational in z, ``K(z) = Y(z) E(z)^-T P^-1``, because the Lyapunov matrix meets the descriptor matrix in
``P E(z)'``; slack matrices L, R separate ``A(z)`` from it, so the inequalities are linear in the weights.

As printed (Dehak 2022, Theorem III.10) nothing bounds P from below or Y from above, and solvers return gains of 1e10.
Here a limit kappa is part of the problem: ``P > beta I`` and ``||Y_i|| < kappa beta`` with an unknown beta give
``||K(z)|| < kappa ||E(z)^-1||``, and the L2 gain is as small as that allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.conditions.forms.blocks import block_diagonal, identity_blocks, single_sum
from quasilpv.lmi import Expression, Problem, Solution, Variable, block, constant, he, zeros
from quasilpv.lmi.exact import Matrix


@dataclass(frozen=True, eq=False)
class TrackingCondition:
    """The problem and its unknowns; see `tracking_condition`."""

    problem: Problem
    P: Variable
    Y: tuple[Variable, ...]
    gamma: Variable

    def gain(self, solution: Solution, weights: FloatArray, descriptor: FloatArray) -> FloatArray:
        """``K(z) = Y(z) E(z)^-T P^-1``, (m, N_xi).

        Args:
            solution: of the problem.
            weights: w_i(z), (N,); those of vertices that differ in unknown premises only may be split at will.
            descriptor: E(z) at the measured premises.
        """
        Y = sum(w * solution.values[Yi] for w, Yi in zip(weights, self.Y, strict=True))
        return np.asarray(np.linalg.solve(descriptor @ solution.values[self.P], np.asarray(Y).T).T)


def tracking_condition(
    descriptor: Matrix,
    state: Matrix,
    drive: Matrix,
    output: Matrix,
    *,
    decay: float,
    gain_limit: float,
    blocks: npt.NDArray[np.intp],
    shared_gain: Sequence[int],
) -> TrackingCondition:
    """Feedback of limited gain with decay rate alpha and the smallest squared L2 gain gamma from d to psi.

    Unknowns ``P = P'``, L, R, Y_i, beta and one symmetric T_k per block (premise); minimise gamma subject to
    ``P > beta I``, ``[kappa beta I, Y_i; *, kappa beta I] > 0`` and, with ``mean = (1/G) sum_k T_k``,

        He [A_i L + S_i, A_i R; P_i - L, -R] + T_k(i) - mean < 0
        A_i = [[A_i + alpha E_i, 0, 0], [0, 0, 0], [C, 0, 0]],  P_i = diag(P E_i', I, I)
        S_i = [[B Y_i, B, 0], [0, -gamma/2 I, 0], [0, 0, -1/2 I]]

    Args:
        descriptor, state: vertices E_i and A_i of the extended system, (N, N_xi, N_xi).
        drive: B, (N_xi, m).
        output: C, (n, N_xi).
        decay: alpha; it multiplies an unknown, so a line search is the way to the largest.
        gain_limit: kappa, N m per unit of the state times the norm of E.
        blocks: block (premise) of every vertex.
        shared_gain: for every vertex, the vertex whose gain it must share (`BlockPolytope.shared_gain`): the gain must
            not depend on unknown premises.
    """
    count, size, _ = descriptor.shape
    m, n = drive.shape[1], output.shape[0]
    inputs, outputs = identity_blocks(m)[0], identity_blocks(n)[0]
    width = size + m + n
    P = Variable("P", size, symmetric=True)
    L, R = Variable("L", width), Variable("R", width)
    own = {vertex: Variable(f"Y{vertex}", m, size) for vertex in sorted(set(shared_gain))}
    Y = tuple(own[vertex] for vertex in shared_gain)
    gamma, beta = Variable("gamma", 1), Variable("beta", 1)

    def entry(i: int) -> Expression:
        A = np.zeros((width, width), dtype=int).astype(object)
        A[:size, :size] = state[i] + decay * descriptor[i]
        A[size + m :, :size] = output
        S = block(
            [
                [drive @ Y[i], constant(drive), zeros(size, n)],
                [zeros(m, size), gamma * (inputs * Fraction(-1, 2)), zeros(m, n)],
                [zeros(n, size), zeros(n, m), constant(outputs * -0.5)],
            ]
        )
        rest = constant(block_diagonal(inputs, outputs))
        lyapunov = block([[P @ descriptor[i].T, zeros(size, m + n)], [zeros(m + n, size), rest]])
        return he(block([[A @ L + S, A @ R], [lyapunov - L, -R.expression]]))

    problem = Problem()
    states = identity_blocks(size)[0]
    problem.positive("beta", beta.expression)
    problem.positive("P > beta I", P - beta * states)
    for vertex, gain in own.items():
        limit = beta * gain_limit
        problem.positive(f"gain {vertex}", block([[limit * inputs, gain], [None, limit * states]]))
    single_sum(problem, "Xi", entry, count, blocks)
    problem.minimise(gamma)
    return TrackingCondition(problem, P, Y, gamma)
