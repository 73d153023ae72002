"""A bound of the L2 gain in the region: how much of a disturbance reaches what should stay small.

With the extended form (`quasilpv.conditions.forms.extended`), ``B_w`` of a disturbance that is added to an input or to
the rate of a state, and ``z = C_z x + D u``,

    sum_ij w_i w_j [He(A_i P_e + B_i [M_j 0]), B_w,i, (C_z P_e + D [M_j 0])'; *, -g I, 0; *, *, -g I] < 0

gives ``V' + z'z/g - g w'w < 0`` along solutions in the region: from rest the energy of z is at most g^2 times that of
w, and the region is not left while ``g int w'w dt < 1 - V(0)``. (The bounded real lemma; Boyd, El Ghaoui, Feron and
Balakrishnan 1994, section 7.5.)
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from quasilpv.conditions.condition import is_single_sum, vertex_sum
from quasilpv.conditions.forms.extended import (
    extended_input,
    extended_inputs,
    extended_lyapunov,
    extended_states,
    on_differential,
)
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.regional.feedback import RegionalStatement
from quasilpv.lmi import Expression, Variable, block, zeros
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix


def require_l2_gain(
    own: RegionalStatement, model: PolytopicModel, disturbance: Sequence[float], output: Sequence[float], gain: Variable
) -> None:
    """Add the inequality.

    Args:
        own: receives it.
        model: as in `regional_statement`.
        disturbance: of every state and input, how much a disturbance of 1 adds to its rate or to it; 0 for none.
        output: of every state and input, its factor in z; 0 if it is not in z.
        gain: g, 1 x 1.
    """
    q, n = model.differential, model.order
    A, B = extended_states(model), extended_inputs(model)
    lyapunov = extended_lyapunov(own.P, own.W, own.Z)
    states, inputs = _chosen(output[:n]), _chosen(output[n:])
    C, D = (
        np.vstack(pair) for pair in ((states, zeros_of(len(inputs), n)), (zeros_of(len(states), model.inputs), inputs))
    )
    C = np.hstack([C[:, :q], zeros_of(len(C), q), C[:, q:]])
    added = _chosen(disturbance[:n]).T, _chosen(disturbance[n:]).T
    Bw = model.vertices(lambda E, A, B: extended_input(np.hstack([E @ added[0], B @ added[1]]), q))
    own.multipliers["l2 gain"] = gain
    z, w = len(C), Bw[0].shape[1]

    def entry(i: int, j: int) -> Expression:
        feedback = on_differential(own.M[j], q, n)
        return block(
            [
                [(A[i] @ lyapunov + B[i] @ feedback) * 2, None, None],
                [Bw[i].T, -(gain * _identity(w)), None],
                [as_expression(C @ lyapunov + D @ feedback), zeros(z, w), -(gain * _identity(z))],
            ]
        )

    single = is_single_sum(model, Slack.THESIS)
    own.slacks["l2"] = vertex_sum(own.problem, "l2", entry, model, Slack.THESIS, single=single)


def zeros_of(rows: int, columns: int) -> ExactMatrix:
    """Exact zeros."""
    return np.zeros((rows, columns), dtype=int).astype(object)


def _identity(size: int) -> ExactMatrix:
    return np.eye(size, dtype=int).astype(object)


def _chosen(factors: Sequence[float]) -> ExactMatrix:
    """A row for every factor that is not 0, with the factor at its place."""
    places = [k for k, factor in enumerate(factors) if factor]
    rows = zeros_of(len(places), len(factors))
    for row, k in enumerate(places):
        rows[row, k] = Fraction(factors[k])
    return rows
