"""The extended form of a descriptor system, in which E is constant (Dehak 2022, (I.25)).

With ``E = diag(E_1, 0)`` and ``x_e = (x_d, x_d', x_a)`` of N = q + n entries,

    E_o x_e' = A_e(z) x_e + B_e(z) u,    E_o = diag(I, 0, 0),    A_e = [0 I 0; A_11 -E_1 A_12; A_21 0 A_22],
    B_e = [0; B_1; B_2].

A Lyapunov function ``x_d' V^-1 x_d`` is ``x_e' E_o P_e^-1 x_e`` with ``P_e = [V 0; W Z]``, V (q, q) symmetric, W (n, q)
and Z (n, n) free: ``He((A_e + alpha E_o) P_e) < 0`` at every z gives ``V' <= -2 alpha V``, and makes the algebraic
equations solvable, because ``[-E_1 A_12; 0 A_22] Z`` then has an invertible symmetric part.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.lmi import Expression, block, zeros
from quasilpv.lmi.expressions import Operand
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix, Vertices


def extended_state(E: ExactMatrix, A: ExactMatrix, differential: int, decay_rate: float = 0.0) -> ExactMatrix:
    """``A_e + alpha E_o``, (N, N), of exact E and A with q differential states."""
    q, n = differential, len(A)
    extended = np.zeros((q + n, q + n), dtype=int).astype(object)
    extended[:q, :q] = np.eye(q, dtype=int).astype(object) * Fraction(decay_rate)
    extended[:q, q : 2 * q] = np.eye(q, dtype=int)
    extended[q:, :q] = A[:, :q]
    extended[q : 2 * q, q : 2 * q] = -E[:q, :q]
    extended[q:, 2 * q :] = A[:, q:]
    return extended


def extended_input(B: ExactMatrix, differential: int) -> ExactMatrix:
    """``B_e = [0; B]``, (N, m)."""
    return np.vstack([np.zeros((differential, B.shape[1]), dtype=int).astype(object), B])


def extended_states(model: PolytopicModel, decay_rate: float = 0.0) -> Vertices:
    """Vertices of ``A_e + alpha E_o``; equal ones are one object."""
    return model.vertices(lambda E, A, B: extended_state(E, A, model.differential, decay_rate))


def extended_states_in_double(model: PolytopicModel, decay_rate: float = 0.0) -> FloatArray:
    """`extended_states` in double, (count, N, N), for the recovery of gains."""
    q, n = model.differential, model.order
    E, A = (
        model.polytope.vertices(matrix.constant, matrix.coefficients) for matrix in (model.system.E, model.system.A)
    )
    extended = np.zeros((model.vertex_count, q + n, q + n))
    extended[:, :q, :q] = decay_rate * np.eye(q)
    extended[:, :q, q : 2 * q] = np.eye(q)
    extended[:, q:, :q] = A[:, :, :q]
    extended[:, q : 2 * q, q : 2 * q] = -E[:, :q, :q]
    extended[:, q:, 2 * q :] = A[:, :, q:]
    return extended


def extended_inputs(model: PolytopicModel) -> Vertices:
    """Vertices of ``B_e``; equal ones are one object."""
    return model.vertices(lambda E, A, B: extended_input(B, model.differential))


def extended_lyapunov(V: Operand, W: Operand, Z: Expression | Operand) -> Expression:
    """``P_e = [V 0; W Z]``."""
    lower = block([[W, Z]])
    q, n = lower.shape[1] - lower.shape[0], lower.shape[0]
    return block([[V, zeros(q, n)], [W, Z]])


def on_differential(gain: Operand, differential: int, order: int) -> Expression:
    """``[F 0]``, (m, N), for F (m, q)."""
    rows = block([[gain]]).shape[0]
    return block([[gain, zeros(rows, order)]])
