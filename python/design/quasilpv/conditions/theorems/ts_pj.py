"""Theorem I.2 with vertex-dependent lower blocks: ``P_j = [V 0; W_j Z_j]``.

    sum_ij w_i w_j He((A_i + alpha E_o) P_j + B_i [M_j 0]) < 0,    V = V' > 0

implies that ``u = M(z) V^-1 x_d`` makes ``x_d' V^-1 x_d`` decrease: the double sum is
``He((A(z) + alpha E_o) P(z) + B(z) [M(z) 0])`` because P_j carries one index only. With matrices P_ij instead, the sum
over i and j no longer factors, and the inequalities prove nothing.
"""

from __future__ import annotations

from quasilpv.conditions.condition import (
    Condition,
    Feedback,
    Options,
    Statement,
    Values,
    polytopic_gain,
    shared_gains,
)
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.forms.extended import extended_inputs, extended_lyapunov, extended_states, on_differential
from quasilpv.conditions.gains import on_state
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition.

    Unknowns ``V = V' > 0`` (q, q), and per vertex W_j (n, q), Z_j (n, n) and M_j (m, q).
    """
    q, n, count = model.differential, model.order, model.vertex_count
    V = Variable("V", q, symmetric=True)
    P = [extended_lyapunov(V, Variable(f"W{j}", n, q), Variable(f"Z{j}", n)) for j in range(count)]
    M = shared_gains(model, q, "M")
    A, B = extended_states(model, options.decay_rate), extended_inputs(model)
    problem = Problem()
    problem.positive("V", V)

    def entry(i: int, j: int) -> Expression:
        return as_expression(A[i] @ P[j] + B[i] @ on_differential(M[j], q, n))

    slacks = double_sum(problem, "Upsilon", entry, count, model.polytope.block_index, slack=options.slack)

    def feedback(values: Values) -> Feedback:
        return Feedback(values[V], polytopic_gain(model, M, values, on_state(values[V], n)))

    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="TS-Pj",
    summary="I.2 with lower blocks of the Lyapunov matrix that depend on the premises",
    reference="this project, after Dehak 2022, Theorem I.2, and Guerra, Bernal, Kruszewski and Afroun 2007",
    representation="ts",
    inequalities=inequalities,
    relies_on=COMPENSATION,
)
