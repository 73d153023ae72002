"""One inequality for a whole box: the matrix-cube relaxation of a single sum, in D-G scaled form.

In a representation with one block per premise, ``X_i + T_b(i) - mean < 0`` at the 2 r vertices is the same as

    X_c + sum_p S_p < 0,    S_p >= X_p,    S_p >= -X_p,    where X(z) = X_c + sum_p d_p X_p, -1 <= d_p <= 1,

with ``S_p = -(X_c + T_p - mean)/r`` up to a small multiple of I (Ben-Tal and Nemirovski 2002). If ``X_p = He(U_p V_p)``
with U_p constant of k_p columns, such an S_p can be chosen as

    U_p D_p U_p' + (V_p + G_p U_p')' D_p^-1 (V_p + G_p U_p'),    D_p > 0,    G_p = -G_p',

because ``x' U_p G_p U_p' x = 0``, and nothing is lost: D-G scaling is exact for one repeated real scalar (Meinsma,
Shrivastava and Fu 1997). By Schur's complement what remains is

    [X_c + sum_p U_p D_p U_p', (V_p + G_p U_p')'; V_p + G_p U_p', -D_p] < 0,

one inequality of size ``N + sum k_p`` instead of 2 r of size N, with ``k_p^2`` unknowns per premise instead of
``N (N + 1) / 2``. With ``D_p = K_p + K_p'`` and ``G_p = K_p - K_p'`` the unknowns are square matrices K_p.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Values
from quasilpv.conditions.forms.extended import extended_input, extended_state
from quasilpv.conditions.forms.slack import Slack
from quasilpv.lmi import Expression, Problem, Variable, block, he, zeros
from quasilpv.lmi.exact import rank_factors
from quasilpv.lmi.expressions import Operand, as_expression
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix


def is_cube(model: PolytopicModel, slack: Slack) -> bool:
    """Whether a single sum with slack is the relaxation above: several blocks, each of one premise."""
    blocks = model.polytope.blocks
    return slack is not Slack.NONE and len(blocks) > 1 and all(len(block.premises) == 1 for block in blocks)


def cube_sum(problem: Problem, name: str, centre: Operand, terms: Sequence[tuple[ExactMatrix, Operand]]) -> None:
    """Require ``He(X_c + sum_p d_p U_p V_p) < 0`` for all ``-1 <= d_p <= 1`` by the inequality above.

    Args:
        problem: receives it.
        name: of the inequality.
        centre: X_c, N x N; only its symmetric part matters.
        terms: (U_p, V_p) of every premise, N x k_p and k_p x N, U_p of full column rank.
    """
    corner = he(centre)
    below: list[Expression] = []
    scales: list[Expression] = []
    for p, (U, V) in enumerate(terms):
        K = Variable(f"K {name} {p}", U.shape[1])
        corner = corner + U @ he(K) @ U.T
        below.append(as_expression(V) + (K - K.T) @ U.T)
        scales.append(he(K))
    sizes = [scale.shape[0] for scale in scales]
    rows: list[list[Operand | None]] = [[corner, *(V.T for V in below)]]
    for p, V in enumerate(below):
        own = [-scales[p] if k == p else zeros(sizes[p], size) for k, size in enumerate(sizes)]
        rows.append([V, *own])
    problem.negative(name, block(rows))


def cube_with_gains(
    problem: Problem,
    name: str,
    model: PolytopicModel,
    *,
    decay_rate: float,
    right: Expression,
    lift: ExactMatrix | None = None,
    offset: Expression | None = None,
) -> Callable[[Values], FloatArray]:
    """Require ``He(T ((A_e + alpha E_o) Y + B_e [M(z) 0]) + C) < 0`` with gains affine in the premises, B constant.

    Vertex gains M_i of a representation with one block per premise are ``M_c + sum_p d_p M_p`` up to a part of mean
    zero, which the slack takes.

    Args:
        problem, name: as in `cube_sum`.
        model: the system.
        decay_rate: alpha.
        right: Y, N x w.
        lift: T, w x N; None for the identity.
        offset: C, w x w; None for zero.

    Returns:
        From a solution to the vertex gains M_i, (N, m, q).
    """
    q, m = model.differential, model.inputs
    centre, slopes = model.spread(lambda E, A, B: extended_state(E, A, q, decay_rate))
    B = extended_input(model.B[0], q)
    T = np.eye(len(B), dtype=int).astype(object) if lift is None else lift
    M = {p: Variable(f"M {p}", m, q) for p in slopes}
    at_centre = Variable("M centre", m, q)

    def padded(gain: Variable) -> Expression:
        return block([[gain, zeros(m, right.shape[1] - q)]])

    terms: list[tuple[ExactMatrix, Operand]] = []
    for p, slope in slopes.items():
        left, factor = rank_factors(np.hstack([slope, B]))
        terms.append((T @ left, factor[:, : len(B)] @ right + factor[:, len(B) :] @ padded(M[p])))
    total = T @ (centre @ right + B @ padded(at_centre))
    cube_sum(problem, name, total if offset is None else total + offset, terms)

    def gains(values: Values) -> FloatArray:
        low, high = model.polytope.lower, model.polytope.upper
        slopes = np.zeros((model.polytope.premises, m, q))
        for p, Mp in M.items():
            slopes[p] = 2.0 * values[Mp] / (high - low)[p]
        return model.polytope.vertices(values[at_centre] - np.tensordot(0.5 * (low + high), slopes, axes=1), slopes)

    return gains
