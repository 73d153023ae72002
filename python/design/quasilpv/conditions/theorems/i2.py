"""Theorem I.2: stabilisation by parallel distributed compensation, ``u = F(z) x_d`` with ``F(z) = sum_j w_j(z) F_j``.

With the extended form (`extended`), ``V = x_d' P_11^-1 x_d`` and ``F_j = M_j P_11^-1`` it is enough that

    sum_ij w_i w_j He((A_i + alpha E_o) P + B_i [M_j 0]) < 0,    P = [P_11 0; P_21 P_22],    P_11 = P_11' > 0,

which is required as a double sum (`blocks.double_sum`; the printed constant 2/(r-1) is unsound: N vertices need
2/(N-1)).

If B is constant, ``X_ij + X_ji = X_ii + X_jj``: the inequalities of i = j imply the others, slack T_b(i) + S_b(j) is
one matrix T_b + S_b per block, and a single sum is left. In the reduced form it is written

- without slack, or with a single block: without the gains (`elimination`);
- with one block per premise and slack: as one D-G scaled inequality (`cube`), gains ``M(z) = M_c + sum_p d_p M_p``.

Every step is an equivalence. Larger slack families are not reduced: they prove more than the single sum.
"""

from __future__ import annotations

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import (
    Condition,
    Feedback,
    Form,
    Options,
    Statement,
    Values,
    is_single_sum,
    polytopic_gain,
    shared_gains,
    vertex_sum,
)
from quasilpv.conditions.forms.cube import cube_with_gains, is_cube
from quasilpv.conditions.forms.elimination import algebraic_part, gains_are_free, gains_on_differential, unactuated_rows
from quasilpv.conditions.forms.extended import (
    extended_inputs,
    extended_lyapunov,
    extended_states,
    extended_states_in_double,
    on_differential,
)
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.gains import PolytopicGain, on_state
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel


class _Lyapunov:
    """The unknowns ``P_11 = P_11' > 0`` (q, q), P_21 (n, q) and P_22 (n, n), common to all forms."""

    def __init__(self, model: PolytopicModel) -> None:
        q, n = model.differential, model.order
        self.P11, self.P21, self.P22 = Variable("P11", q, symmetric=True), Variable("P21", n, q), Variable("P22", n)
        self.matrix = extended_lyapunov(self.P11, self.P21, self.P22)

    def value(self, values: Values) -> FloatArray:
        """Value of P."""
        return self.matrix.at(values).astype(float)


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem I.2.

    Unknowns ``P_11 = P_11' > 0`` (q, q), P_21 (n, q), P_22 (n, n) and M_j (m, q) per vertex.
    """
    single_block = len(model.polytope.blocks) == 1
    if options.form is Form.REDUCED and model.constant_input:
        if gains_are_free(model) and (single_block or options.slack is Slack.NONE):
            return without_gains(model, options)
        if gains_are_free(model) and is_cube(model, options.slack) and options.slack is Slack.THESIS:
            return _as_cube(model, options)
    return with_gains(model, options, single=is_single_sum(model, options.slack))


def with_gains(model: PolytopicModel, options: Options, *, single: bool) -> Statement:
    """Theorem I.2 with all its unknowns.

    Args:
        model, options: of the statement.
        single: write the double sum as a single one, see `is_single_sum`.
    """
    q, n = model.differential, model.order
    P = _Lyapunov(model)
    M = shared_gains(model, q, "M")
    A, B = extended_states(model, options.decay_rate), extended_inputs(model)
    problem = Problem()
    problem.positive("P11", P.P11)

    def entry(i: int, j: int) -> Expression:
        return as_expression(A[i] @ P.matrix + B[i] @ on_differential(M[j], q, n))

    slacks = vertex_sum(problem, "Upsilon", entry, model, options.slack, single=single)

    def feedback(values: Values) -> Feedback:
        gain = polytopic_gain(model, M, values, on_state(values[P.P11], n))
        return Feedback(values[P.P11], gain)

    return Statement(problem, feedback, slacks)


def without_gains(model: PolytopicModel, options: Options) -> Statement:
    """Theorem I.2 without slack for a constant B and gains that are free: its single sum, gains eliminated."""
    q = model.differential
    P = _Lyapunov(model)
    problem = Problem()
    problem.positive("P11", P.P11)
    unactuated_rows(problem, model, P.matrix, options.decay_rate)
    algebraic_part(problem, model, P.P22)

    def feedback(values: Values) -> Feedback:
        if model.inputs == 0:
            return Feedback(values[P.P11], None)
        extended = extended_states_in_double(model, options.decay_rate)
        M = gains_on_differential(extended, model.system.B.constant, P.value(values), q)
        vertices = M @ on_state(values[P.P11], model.order)
        return Feedback(values[P.P11], PolytopicGain(model.polytope, vertices))

    return Statement(problem, feedback)


def _as_cube(model: PolytopicModel, options: Options) -> Statement:
    """Single sum with slack, one inequality."""
    P = _Lyapunov(model)
    problem = Problem()
    problem.positive("P11", P.P11)
    gains = cube_with_gains(problem, "Upsilon", model, decay_rate=options.decay_rate, right=P.matrix)

    def feedback(values: Values) -> Feedback:
        right = on_state(values[P.P11], model.order)
        return Feedback(values[P.P11], PolytopicGain(model.polytope, gains(values) @ right) if model.inputs else None)

    return Statement(problem, feedback)


CONDITION = Condition(
    id="I.2",
    summary="parallel distributed compensation F(z) x_d, quadratic Lyapunov function",
    reference="Dehak 2022, Theorem I.2, with the constant of the double sum corrected",
    representation="ts",
    inequalities=inequalities,
    relies_on=COMPENSATION,
)
