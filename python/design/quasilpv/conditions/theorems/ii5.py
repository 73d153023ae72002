"""Theorem II.5: admissibility and stabilisation in the extended form, with multipliers L_j and R_j.

``u = F(z) V^-1 x_d`` makes ``x_d' V^-1 x_d`` decrease if ``He((A_e + alpha E_o) P + B_e [F 0]) < 0`` with
``P = [V 0; W Z]`` at every z (`extended`). The multipliers separate A_e(z) from P(z), which may then depend on both
indices of a double sum:

    He [A_i L_j + B_i [F_j 0], A_i R_j; P_ij - L_j, -R_j] + slack < 0    for all sums over i, j

(A_i and B_i extended, A_i with alpha E_o). The slack T_b(i) + S_b(j) - mean has mean zero; only T_b + S_b counts, since
X_ij and X_ji appear in one sum.

With `Options.common` (L, R, W, Z without index) and B constant, ``X_ij + X_ji = X_ii + X_jj`` leaves a single sum.

Reduced form:

- ``W_ij = W_ji`` and ``Z_ij = Z_ji``, since the sums hold ``P_ij + P_ji`` only.
- the single sum, without slack or with a single block, is Theorem I.2 without gains: ``[I A_i]`` times the inequality
  times its transpose is ``He(A_i P + B [F_i 0]) < 0``, and ``L = P``, ``R = rho I`` with small rho gives the converse.
- the single sum with one block per premise and slack is one D-G scaled inequality (`cube`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

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
from quasilpv.conditions.forms.blocks import require_affordable
from quasilpv.conditions.forms.cube import cube_with_gains, is_cube
from quasilpv.conditions.forms.elimination import gains_are_free
from quasilpv.conditions.forms.extended import extended_inputs, extended_lyapunov, extended_states, on_differential
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.gains import PolytopicGain, on_state
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.conditions.theorems import i2
from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.polytopes import PolytopicModel

LyapunovMatrix = Callable[[int, int], Expression]
"""From vertex indices to P_ij."""


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem II.5.

    Unknowns ``V = V' > 0`` (q, q), W_ij (n, q), Z_ij (n, n), and per vertex L_j, R_j (N, N) and F_j (m, q).
    """
    slackless = len(model.polytope.blocks) == 1 or options.slack is Slack.NONE
    if options.form is Form.REDUCED and options.common and slackless and gains_are_free(model):
        return i2.without_gains(model, options)
    problem = Problem()
    V = Variable("V", model.differential, symmetric=True)
    problem.positive("V", V)
    return with_multipliers(model, options, problem, V.expression, _free_lyapunov(model, options, V))


def without_slack(model: PolytopicModel, options: Options) -> Statement:
    """State Corollary 1: Theorem II.5 without slack, whatever the options say."""
    return inequalities(model, replace(options, slack=Slack.NONE))


def with_multipliers(
    model: PolytopicModel, options: Options, problem: Problem, V: Expression, P: LyapunovMatrix
) -> Statement:
    """Add multipliers, gains and slack to given Lyapunov matrices: what Theorems II.5 and III.9 share.

    Args:
        model, options: of the statement.
        problem: holds ``V > 0``; receives the inequalities.
        V: upper left block of the mean of all P_ij, (q, q).
        P: the extended Lyapunov matrices.
    """
    q, n, count = model.differential, model.order, model.vertex_count
    single = options.common and is_single_sum(model, options.slack)
    if options.form is Form.REDUCED and single and is_cube(model, options.slack) and gains_are_free(model):
        return _as_cube(model, options, problem, V, P(0, 0))
    if not single:
        require_affordable(count, 2)
    labels = [""] * count if options.common else [str(j) for j in range(count)]
    unknowns = {label: (Variable(f"L{label}", q + n), Variable(f"R{label}", q + n)) for label in labels}
    LR = [unknowns[label] for label in labels]
    F = shared_gains(model, q)
    A, B = extended_states(model, options.decay_rate), extended_inputs(model)

    def entry(i: int, j: int) -> Expression:
        L, R = LR[j]
        return block([[A[i] @ L + B[i] @ on_differential(F[j], q, n), A[i] @ R], [P(i, j) - L, -R]])

    slacks = vertex_sum(problem, "Xi", entry, model, options.slack, single=single)

    def feedback(values: Values) -> Feedback:
        lyapunov = V.at(values).astype(float)
        return Feedback(lyapunov, polytopic_gain(model, F, values, on_state(lyapunov, n)))

    return Statement(problem, feedback, slacks)


def _as_cube(model: PolytopicModel, options: Options, problem: Problem, V: Expression, P: Expression) -> Statement:
    """Single sum with slack and common multipliers, one inequality."""
    size = model.differential + model.order
    L, R = Variable("L", size), Variable("R", size)
    top = np.vstack([np.eye(size, dtype=int), np.zeros((size, size), dtype=int)]).astype(object)
    rest = block([[zeros(size, size), zeros(size, size)], [P - L, -R]])
    gains = cube_with_gains(
        problem, "Xi", model, decay_rate=options.decay_rate, right=block([[L, R]]), lift=top, offset=rest
    )

    def feedback(values: Values) -> Feedback:
        lyapunov = V.at(values).astype(float)
        vertices = gains(values) @ on_state(lyapunov, model.order)
        return Feedback(lyapunov, PolytopicGain(model.polytope, vertices) if model.inputs else None)

    return Statement(problem, feedback)


def _free_lyapunov(model: PolytopicModel, options: Options, V: Variable) -> LyapunovMatrix:
    """P_ij with common V; W and Z without index, symmetric in the indices, or free."""
    q, n = model.differential, model.order
    made: dict[tuple[int, ...], Expression] = {}

    def lyapunov(i: int, j: int) -> Expression:
        key: tuple[int, ...] = (i, j)
        if options.form is Form.REDUCED:
            key = (min(i, j), max(i, j))
        if options.common:
            key = ()
        if key not in made:
            label = " ".join(map(str, key))
            made[key] = extended_lyapunov(V, Variable(f"W{label}", n, q), Variable(f"Z{label}", n))
        return made[key]

    return lyapunov


CONDITION = Condition(
    id="II.5",
    summary="singular systems: F(z) x_d, multipliers and slack",
    reference="Dehak 2022, Theorem II.5",
    representation="per-premise@0",
    inequalities=inequalities,
    relies_on=COMPENSATION,
    has_multipliers=True,
)

COROLLARY = Condition(
    id="II.5-cor1",
    summary="II.5 without slack",
    reference="Dehak 2022, Corollary 1 of Theorem II.5",
    representation="per-premise@0",
    inequalities=without_slack,
    relies_on=COMPENSATION,
    has_multipliers=True,
)
