"""Theorem II.7: stabilisation in the extended form with a Lyapunov function with memory (`delayed`).

``u = F V(varpi)^-1 x_d`` makes ``x_d' V(varpi)^-1 x_d`` decrease if, with the extended form (`extended`),

    He [A_i L_jkm + B_i [F_jkm 0] - diag(D_i - D_m, 0)/2, A_i R_jkm; P_k - L_jkm, -R_jkm] + slack < 0

for all sums over i, j of w(z), k of varpi and m of w(z_d), ``P_k = [V_k 0; W_k Z_k]``, ``V_k = V + tau D_k > 0``. i and
j share a double sum. The printed (II.50a), ``Z_k + Z_k' > 0``, is left out: it is not needed, and it excludes systems
whose A_22 has an eigenvalue on the right. In the limit tau -> 0, the default, k drops out: the inequalities hold with
the means of L, R, F, W and Z over k.
"""

from __future__ import annotations

from itertools import product

from quasilpv.conditions.condition import Condition, Feedback, Options, Statement, Values
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.forms.delayed import MovingLyapunov, delayed_feedback, require_no_decay_rate
from quasilpv.conditions.forms.extended import extended_inputs, extended_lyapunov, extended_states, on_differential
from quasilpv.conditions.reliance import Reliance
from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem II.7.

    Unknowns ``V = V' > 0`` and D_k symmetric (q, q), W_k (n, q), Z_k (n, n), L_jkm, R_jkm (N, N) and F_jkm (m, q); no k
    but that of D_k in the limit.

    Raises:
        InputError: a decay rate.
    """
    require_no_decay_rate(options, "II.7")
    q, n, count = model.differential, model.order, model.vertex_count
    problem = Problem()
    V = MovingLyapunov(problem, "V", q, count, options.window_s)
    windows = list(product(range(count), repeat=V.window_indices))
    P = {k: extended_lyapunov(V.at(*k), Variable(f"W {k}", n, q), Variable(f"Z {k}", n)) for k in windows}
    gains = [(j, *k, m) for j in range(count) for k in windows for m in range(count)]
    L, R = ({index: Variable(f"{name} {index}", q + n) for index in gains} for name in "LR")
    F = {index: Variable(f"F {index}", model.inputs, q) for index in gains}
    rate = [block([[V.half(i), zeros(q, n)], [zeros(n, q), zeros(n, n)]]) for i in range(count)]
    A, B = extended_states(model), extended_inputs(model)

    def entry(i: int, j: int, m: int, *k: int) -> Expression:
        own = (j, *k, m)
        drift = A[i] @ L[own] + B[i] @ on_differential(F[own], q, n) - rate[i] + rate[m]
        return block([[drift, A[i] @ R[own]], [P[k] - L[own], -R[own]]])

    others = 1 + V.window_indices
    slacks = double_sum(problem, "Xi", entry, count, model.polytope.block_index, slack=options.slack, others=others)

    def feedback(values: Values) -> Feedback:
        return delayed_feedback(model, V, values, F, descriptor=False)

    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="II.7",
    summary="singular systems: Lyapunov function with memory, no bound on the speed of the premises",
    reference="Dehak 2022, Theorem II.7, without (II.50a) and with P_k = P + tau D_k",
    representation="per-premise@0",
    inequalities=inequalities,
    relies_on=(
        Reliance.INDEX_ONE,
        Reliance.ASSUMPTION_1,
        Reliance.NO_UNKNOWN,
        Reliance.STATE,
        Reliance.SCHEDULED,
        Reliance.DOMAIN,
    ),
)
