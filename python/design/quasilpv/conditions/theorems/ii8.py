"""Theorem II.8: stabilisation of regular systems with a Lyapunov function with memory (`delayed`).

``u = F E(z)^-T P(varpi)^-1 x`` makes ``x' P(varpi)^-1 x`` decrease if ``He(A P E' + B F) - E (dP/dt) E' < 0``:

    He [A_i L_jkm + B_i F_jkm - E_l (D_i - D_m) E_j' / 2, A_i R_jkm; P_k E_i' - L_jkm, -R_jkm] + slack < 0

for all sums over i, j, l of w(z), k of varpi and m of w(z_d), ``P_k = P + tau D_k > 0``. i and j share a double sum. As
in the published tables, multipliers and gains carry three indices. In the limit tau -> 0, the default, k drops out.
"""

from __future__ import annotations

from functools import cache
from itertools import product

from quasilpv.conditions.condition import (
    Condition,
    Feedback,
    Options,
    Statement,
    Values,
)
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.forms.delayed import MovingLyapunov, delayed_feedback, require_no_decay_rate
from quasilpv.conditions.reliance import Reliance
from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem II.8 for a regular system.

    Unknowns ``P = P' > 0`` and D_k symmetric (n, n), L_jkm, R_jkm (n, n) and F_jkm (m, n); no k in the limit.

    Raises:
        InputError: a decay rate.
    """
    require_no_decay_rate(options, "II.8")
    n, count = model.order, model.vertex_count
    problem = Problem()
    P = MovingLyapunov(problem, "P", n, count, options.window_s)
    gains = list(product(range(count), repeat=2 + P.window_indices))
    L, R = ({index: Variable(f"{name} {index}", n) for index in gains} for name in "LR")
    F = {index: Variable(f"F {index}", model.inputs, n) for index in gains}

    @cache
    def still(i: int, j: int, m: int, *window: int) -> Expression:
        own = (j, *window, m)
        drift = model.A[i] @ L[own] + model.B[i] @ F[own]
        return block([[drift, model.A[i] @ R[own]], [P.at(*window) @ model.E[i].T - L[own], -R[own]]])

    @cache
    def moving(i: int, j: int, ell: int) -> Expression:
        rate = model.E[ell] @ P.half(i) @ model.E[j].T
        return block([[rate, zeros(n, n)], [zeros(n, n), zeros(n, n)]])

    def entry(i: int, j: int, ell: int, m: int, *window: int) -> Expression:
        return still(i, j, m, *window) - moving(i, j, ell) + moving(m, j, ell)

    others = 2 + P.window_indices
    slacks = double_sum(problem, "Pi", entry, count, model.polytope.block_index, slack=options.slack, others=others)

    def feedback(values: Values) -> Feedback:
        return delayed_feedback(model, P, values, F, descriptor=True)

    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="II.8",
    summary="regular systems: Lyapunov function with memory, no bound on the speed of the premises",
    reference="Dehak 2022, Theorem II.8, with five slacks averaged and P_k = P + tau D_k",
    representation="per-premise@0",
    inequalities=inequalities,
    relies_on=(
        Reliance.REGULAR,
        Reliance.NO_UNKNOWN,
        Reliance.INVERTIBLE_E,
        Reliance.STATE,
        Reliance.SCHEDULED,
        Reliance.DOMAIN,
    ),
)
