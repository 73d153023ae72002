"""Law (I.53): extended parallel distributed compensation, ``u = sum_j w_j(z) K_j x_e`` with ``x_e = (x_d, x_d', x_a)``.

Theorem I.2 with full gain unknowns: ``sum_ij w_i w_j He((A_i + alpha E_o) P + B_i M_j) < 0``, M_j (m, N), and
``K(z) = M(z) P^-1``. The controller needs the derivatives of the differential states.

Reduced form, B constant and no slack or a single block: without the gains (`elimination`). For a robot, ``B = [0; I]``,
no premise is left: the law exists whatever friction, inertia and bounds are.
"""

from __future__ import annotations

import numpy as np

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
from quasilpv.conditions.forms.elimination import (
    compensated,
    completed,
    gains_are_free,
    gains_on_extended,
    unactuated_rows,
)
from quasilpv.conditions.forms.extended import (
    extended_inputs,
    extended_lyapunov,
    extended_states,
    extended_states_in_double,
)
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.gains import PolytopicGain
from quasilpv.conditions.reliance import Reliance
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel

_SINGULAR = 1e10
"""Condition of a P that has no inverse to speak of."""
_ROUNDING = 1e-6


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition.

    Unknowns ``P_11 = P_11' > 0`` (q, q), P_21 (n, q), P_22 (n, n) and M_j (m, N) per vertex.
    """
    q, n = model.differential, model.order
    P11, P21, P22 = Variable("P11", q, symmetric=True), Variable("P21", n, q), Variable("P22", n)
    P = extended_lyapunov(P11, P21, P22)
    problem = Problem()
    problem.positive("P11", P11)
    free = bool(model.inputs) and gains_are_free(model)
    slackless = len(model.polytope.blocks) == 1 or options.slack is Slack.NONE
    if options.form is Form.REDUCED and slackless and free:
        unactuated_rows(problem, model, P, options.decay_rate)
        return Statement(problem, lambda values: _recovered(model, options, values[P11], P.at(values).astype(float)))
    M = shared_gains(model, q + n, "M")
    A, B = extended_states(model, options.decay_rate), extended_inputs(model)

    def entry(i: int, j: int) -> Expression:
        return as_expression(A[i] @ P + B[i] @ M[j])

    single = is_single_sum(model, options.slack)
    slacks = vertex_sum(problem, "Upsilon", entry, model, options.slack, single=single)

    def feedback(values: Values) -> Feedback:
        value = P.at(values).astype(float)
        if free:
            return _recovered(model, options, values[P11], value)
        if model.inputs and np.linalg.cond(value) > _SINGULAR:
            gains = np.stack([values[each] for each in M])
            return _completed(model, options, values[P11], value, gains)
        return Feedback(values[P11], polytopic_gain(model, M, values, np.linalg.inv(value)))

    return Statement(problem, feedback, slacks)


def _recovered(model: PolytopicModel, options: Options, lyapunov: FloatArray, P: FloatArray) -> Feedback:
    """The law of a solution for a constant B: the gains of a solver may come with a singular P, those of P never do."""
    extended = extended_states_in_double(model, options.decay_rate)
    whole = completed(P, model)
    M = gains_on_extended(extended, extended_inputs(model)[0].astype(float), whole)
    K = M @ np.linalg.inv(whole)
    return Feedback(lyapunov, PolytopicGain(model.polytope, K))


def _completed(
    model: PolytopicModel, options: Options, lyapunov: FloatArray, P: FloatArray, gains: FloatArray
) -> Feedback:
    """The law of a solution whose P is singular: where B is constant, P sees of ``Z B`` no more than the gains do.

    Raises:
        InputError: what unknown premises multiply in E, A_12 or A_22 would have to be compensated by gains that know
            them.
    """
    if model.constant_input:
        whole = completed(P, model)
        extended = extended_states_in_double(model, options.decay_rate)
        kept = compensated(extended, extended_inputs(model)[0].astype(float), P, whole, gains)
        shared = list(model.polytope.shared_gain)
        if np.allclose(kept, kept[shared], rtol=_ROUNDING, atol=_ROUNDING * float(np.abs(kept).max())):
            law = PolytopicGain(model.polytope, kept[shared] @ np.linalg.inv(whole))
            return Feedback(lyapunov, law)
    got = "a solution whose Lyapunov matrix P is singular"
    raise InputError("condition I.53", model.system.name, got, "one that has a law K = M P^-1: another representation")


CONDITION = Condition(
    id="I.53",
    summary="extended compensation K(z) (x_d, x_d', x_a), needs derivatives of the states",
    reference="Dehak 2022, (I.53) with Theorem I.2",
    representation="reduced",
    inequalities=inequalities,
    relies_on=(
        Reliance.CLOSED_INDEX_ONE,
        Reliance.ASSUMPTION_1,
        Reliance.STATE,
        Reliance.DERIVATIVES,
        Reliance.SCHEDULED,
        Reliance.DOMAIN,
    ),
)
