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
_LIFTS = 17
"""Sizes that are tried for the singular values of P_22, each a quarter of the one before: down to 1e-10."""


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
            kept = _completed(model, options, values[P11], value, gains)
            if kept is not None:
                return kept
            lifted = _lifted(problem, values, P22, float(np.abs(value).max()))
            if lifted is None:
                got = "a solution whose Lyapunov matrix P is singular"
                raise InputError("condition I.53", model.system.name, got, "one that has a law K = M P^-1")
            values, value = lifted, P.at(lifted).astype(float)
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
) -> Feedback | None:
    """The law of a solution whose P is singular: where B is constant, P sees of ``Z B`` no more than the gains do.

    None where B is not, or where gains would have to know the unknown premises that enter E, A_12 or A_22.
    """
    if model.constant_input:
        whole = completed(P, model)
        extended = extended_states_in_double(model, options.decay_rate)
        kept = compensated(extended, extended_inputs(model)[0].astype(float), P, whole, gains)
        shared = list(model.polytope.shared_gain)
        if np.allclose(kept, kept[shared], rtol=_ROUNDING, atol=_ROUNDING * float(np.abs(kept).max())):
            law = PolytopicGain(model.polytope, kept[shared] @ np.linalg.inv(whole))
            return Feedback(lyapunov, law)
    return None


def _lifted(problem: Problem, values: Values, P22: Variable, largest: float) -> Values | None:
    """A solution near one whose P_22 is singular: what is strict holds near it too, and is checked exactly.

    The singular values of P_22 become at least as large as the inequalities bear, up to the `largest` entry of P: that
    keeps the gains ``M P^-1`` small. None where they bear nothing that a law in double can be had from.
    """
    left, sizes, right = np.linalg.svd(values[P22])
    for least in largest * 0.25 ** np.arange(_LIFTS):
        for sign in (1.0, -1.0):
            near = {**values, P22: left @ np.diag(np.where(sizes < least, sign * least, sizes)) @ right}
            if problem.holds_exactly(near):
                return near
    return None


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
