"""Gains eliminated from a design condition of an extended form whose input matrix is constant.

The unknown gains M_i of ``He(A_i P + B M_i S) < 0`` (A_i, B extended, P = [V 0; W Z] common, S = [I 0] for a feedback
of x_d or S = I for one of x_e) appear in one inequality each. By the projection lemma such an M_i exists if and only if

    N' He(A_i P) N < 0    for the columns of N spanning the null space of B', and
    He([-E_1 A_12; 0 A_22]_i Z) < 0    (the null space of [I 0]; void for S = I).

Neither depends on all premises: of a robot, B = [0; I] leaves the rows of theta' = omega, without any premise, and Z
sees the inertia matrix alone. Equal inequalities are written once.

A gain that does it, from the values of P, when ``Q = He(A_i P)`` is split after the q-th row into Q_11, Q_21, Q_22 < 0:

    S = [I 0]:  M_i = -(B' X B)^-1 B' X Q_21,   X = -Q_22^-1,

the minimiser of ``Q_11 + (Q_21 + B M_i)' X (Q_21 + B M_i)``, in the order of matrices.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.linalg

from quasilpv.arrays import FloatArray
from quasilpv.conditions.forms.extended import extended_state
from quasilpv.lmi import Expression, Problem
from quasilpv.lmi.exact import null_space, to_rational
from quasilpv.lmi.expressions import Operand
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix, Vertices


def gains_are_free(model: PolytopicModel) -> bool:
    """Whether B is constant and every vertex has a gain of its own (no unknown premise), which elimination needs."""
    return model.constant_input and model.polytope.shared_gain == tuple(range(model.vertex_count))


def unactuated(model: PolytopicModel) -> ExactMatrix:
    """Basis of the vectors with ``N' B = 0`` of a constant B, as columns, (n, n - rank B)."""
    return null_space(to_rational(model.system.B.constant).T)


def distinct(vertices: Vertices) -> Iterable[ExactMatrix]:
    """Vertices without repetition."""
    return {id(vertex): vertex for vertex in vertices}.values()


def unactuated_rows(problem: Problem, model: PolytopicModel, P: Expression, decay_rate: float) -> None:
    """Require ``N' He((A_i + alpha E_o) P) N < 0``, N the null space of the transposed extended input matrix.

    Args:
        problem: receives the inequalities.
        model: the system, whose input matrix is constant.
        P: the extended Lyapunov matrix, (N, N).
        decay_rate: alpha.
    """
    q, basis = model.differential, unactuated(model)
    identity = np.eye(q, dtype=int).astype(object)
    across = np.zeros((q, basis.shape[1]), dtype=int).astype(object)
    N = np.block([[identity, across], [np.zeros((len(basis), q), dtype=int).astype(object), basis]])
    rows = model.vertices(lambda E, A, B: N.T @ extended_state(E, A, q, decay_rate))
    for k, row in enumerate(distinct(rows)):
        problem.negative(f"unactuated {k}", row @ P @ N)


def algebraic_part(problem: Problem, model: PolytopicModel, Z: Operand) -> None:
    """Require ``He([-E_1 A_12; 0 A_22]_i Z) < 0``.

    Args:
        problem: receives the inequalities.
        model: the system.
        Z: lower right block of the extended Lyapunov matrix, (n, n).
    """
    q = model.differential
    lower = model.vertices(lambda E, A, B: extended_state(E, A, q)[q:, q:])
    for k, A22 in enumerate(distinct(lower)):
        problem.negative(f"algebraic {k}", A22 @ Z)


def gains_on_differential(
    extended: FloatArray, inputs: FloatArray, lyapunov: FloatArray, differential: int
) -> FloatArray:
    """The gains of the module's last formula, one per vertex.

    Args:
        extended: vertices of ``A_e + alpha E_o``, (count, N, N).
        inputs: B, (n, m).
        lyapunov: P_e, (N, N).
        differential: q.

    Returns:
        M_i, (count, m, q).
    """
    q = differential
    product = extended @ lyapunov
    Q = product + product.transpose(0, 2, 1)
    basis, back = _independent(inputs)
    weighted = np.linalg.solve(
        -Q[:, q:, q:], np.concatenate([np.broadcast_to(basis, (len(Q), *basis.shape)), Q[:, q:, :q]], axis=2)
    )
    k = basis.shape[1]
    normal = basis.T @ weighted
    return np.asarray(-back @ np.linalg.solve(normal[:, :, :k], normal[:, :, k:]))


def _independent(inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns R that span those of B, (n, k), and what makes them of B: ``B S = R``, S (m, k)."""
    basis = scipy.linalg.orth(inputs) if inputs.size else inputs
    if basis.shape[1] == inputs.shape[1]:
        return inputs, np.eye(inputs.shape[1])
    return basis, np.linalg.pinv(inputs) @ basis


def completed(lyapunov: FloatArray, model: PolytopicModel) -> FloatArray:
    """P with the part that `unactuated_rows` does not see, ``Z B``, replaced so that P is invertible.

    ``Z N`` has full column rank, because ``N' [-E_1 A_12; 0 A_22] Z N`` is definite; the columns of B are sent to its
    orthogonal complement. A gain exists for every such P.
    """
    q, N = model.differential, unactuated(model).astype(float)
    Z = lyapunov[q:, q:]
    seen = Z @ N
    complement = np.linalg.qr(seen, mode="complete")[0][:, N.shape[1] :] if seen.size else np.eye(len(Z))
    scale = np.linalg.norm(seen, 2) if seen.size else np.linalg.norm(lyapunov, 2)
    across = scipy.linalg.orth(model.system.B.constant)
    whole = lyapunov.copy()
    whole[q:, q:] = seen @ np.linalg.pinv(N) + scale * complement @ across.T
    return whole


def gains_on_extended(extended: FloatArray, inputs: FloatArray, lyapunov: FloatArray) -> FloatArray:
    """Gains on the whole extended state: ``He(A_i P + B M_i)`` becomes block diagonal and negative.

    In the coordinates of ``[N, B (B'B)^-1]`` the rows of B are those of M_i, which removes what couples them to the
    others and makes the own block ``-c I``, c the mean size of all ``A_i P``. The gains are affine in A_i, so that at
    every z their weighted sum does the same to ``A(z) P``.

    Args:
        extended, lyapunov: as in `gains_on_differential`.
        inputs: extended input matrix, (N, m).

    Returns:
        M_i, (count, m, N).
    """
    product = extended @ lyapunov
    return _removing(product, inputs, float(np.abs(product).mean()))


def compensated(
    extended: FloatArray, inputs: FloatArray, before: FloatArray, after: FloatArray, gains: FloatArray
) -> FloatArray:
    """Gains that keep ``He(A_i P + B M_i)`` as it is while P changes to what `completed` makes of it.

    Args:
        extended, inputs: as in `gains_on_extended`.
        before, after: P of the solution, and completed, (N, N).
        gains: M_i of the solution, (count, m, N).
    """
    return np.asarray(gains + _removing(extended @ (after - before), inputs, 0.0))


def _removing(product: FloatArray, inputs: FloatArray, own_size: float) -> FloatArray:
    """M_i so that ``He(X_i + B M_i)`` is block diagonal in those coordinates, its own block ``-own_size I``."""
    acting, back = _independent(inputs)
    k = acting.shape[1]
    orthonormal, _ = np.linalg.qr(acting, mode="complete")
    basis = np.hstack([orthonormal[:, k:], acting @ np.linalg.inv(acting.T @ acting)])
    Q = basis.T @ (product + product.transpose(0, 2, 1)) @ basis
    free = len(basis) - k
    own = -0.5 * (Q[:, free:, free:] + own_size * np.eye(k))
    return np.asarray(back @ np.concatenate([-Q[:, free:, :free], own], axis=2) @ np.linalg.inv(basis))
