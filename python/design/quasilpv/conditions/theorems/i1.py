"""Theorem I.1: admissibility of an unforced descriptor system.

``V = x_d' P_11 x_d`` decreases, and the algebraic states are determined, if with the extended form (`extended`)

    He(P' (A_e(z) + alpha E_o)) < 0,    P = [P_11 0; P_21 P_22],    P_11 = P_11' > 0

at every z. The left side is affine in z, so that it is required at the vertices; in a representation with several
blocks, with slack matrices of mean zero. Inputs are taken to be zero.

Reduced form, one block per premise: one D-G scaled inequality instead of vertices with slack (`cube`), equivalent.
"""

from __future__ import annotations

import numpy as np

from quasilpv.conditions.condition import Condition, Feedback, Form, Options, Statement, Values, single_sum_blocks
from quasilpv.conditions.forms.blocks import single_sum
from quasilpv.conditions.forms.cube import cube_sum, is_cube
from quasilpv.conditions.forms.extended import extended_lyapunov, extended_state, extended_states
from quasilpv.conditions.reliance import Reliance
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.lmi.exact import rank_factors
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem I.1.

    Unknowns ``P_11 = P_11' > 0`` (q, q), P_21 (n, q) and P_22 (n, n).
    """
    q, n = model.differential, model.order
    P11, P21, P22 = Variable("P11", q, symmetric=True), Variable("P21", n, q), Variable("P22", n)
    P = extended_lyapunov(P11, P21, P22)
    problem = Problem()
    problem.positive("P11", P11)

    def feedback(values: Values) -> Feedback:
        return Feedback(np.asarray(np.linalg.inv(values[P11])), None)

    if options.form is Form.REDUCED and is_cube(model, options.slack):
        centre, slopes = model.spread(lambda E, A, B: extended_state(E, A, q, options.decay_rate))
        factors = [rank_factors(slope) for slope in slopes.values()]
        cube_sum(problem, "A", P.T @ centre, [(right.T, left.T @ P) for left, right in factors])
        return Statement(problem, feedback)

    A = extended_states(model, options.decay_rate)

    def entry(i: int) -> Expression:
        return P.T @ A[i]

    slacks = single_sum(problem, "A", entry, model.vertex_count, single_sum_blocks(model, options.slack))
    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="I.1",
    summary="admissibility of an unforced system, quadratic Lyapunov function",
    reference="Dehak 2022, Theorem I.1",
    representation="ts",
    inequalities=inequalities,
    relies_on=(
        Reliance.INDEX_ONE,
        Reliance.ASSUMPTION_1,
        Reliance.DOMAIN,
    ),
)
