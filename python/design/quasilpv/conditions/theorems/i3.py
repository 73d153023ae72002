"""Theorem I.3: robust stabilisation, unknown premises as norm-bounded uncertainty.

For ``E(z) x' = (A(z) + H_a D_a W_a) x + (B(z) + H_b D_b W_b) u`` with ``|D_a|, |D_b| <= 1`` and z known, the law
``u = F(z) x_d`` of Theorem I.2 (`i2`), ``F_j = M_j P_11^-1``, is robust if

    sum_ij w_i w_j [He((A_i + alpha E_o) P + B_i [M_j 0]) + e_a H_a H_a' + e_b H_b H_b', (W_a P)', (W_b [M_j 0])';
                    W_a P, -e_a I, 0;  W_b [M_j 0], 0, -e_b I] < 0

with H extended by zero rows above and ``W_a`` by zero columns for x_d'. Printed are W_a = [W_a 0], right for a system
without algebraic states only, P_21 and P_22 of wrong size, and F_j where the inequality is linear in M_j.
"""

from __future__ import annotations

import numpy as np

from quasilpv.conditions.condition import Condition, Feedback, Options, Statement, Values
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.forms.extended import (
    extended_input,
    extended_inputs,
    extended_lyapunov,
    extended_states,
    on_differential,
)
from quasilpv.conditions.gains import PolytopicGain, on_state
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable, block, he, identity, to_rational, zeros
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem I.3 on the known premises of a system.

    Unknowns ``P_11 = P_11' > 0`` (q, q), P_21 (n, q), P_22 (n, n), ``e_a, e_b > 0``, and M_j (m, q) per vertex.

    Raises:
        InputError: no premise is unknown, or E depends on one that is.
    """
    uncertainty = model.system.uncertainty
    if uncertainty is None:
        raise InputError("condition I.3", model.system.name, "no unknown premise", "a system with one")
    known = [p for p in range(model.polytope.premises) if p not in model.polytope.unknown]
    nominal = PolytopicModel(uncertainty.nominal, model.polytope.restricted(known))
    q, n, count = nominal.differential, nominal.order, nominal.vertex_count
    P11, P21, P22 = Variable("P11", q, symmetric=True), Variable("P21", n, q), Variable("P22", n)
    P = extended_lyapunov(P11, P21, P22)
    scales = {name: Variable(f"epsilon {name}", 1) for name in "ab"}
    M = [Variable(f"M{j}", nominal.inputs, q) for j in range(count)]
    A, B = extended_states(nominal, options.decay_rate), extended_inputs(nominal)
    Ha, Hb = (extended_input(to_rational(H), q) for H in (uncertainty.Ha, uncertainty.Hb))
    Wa, Wb = to_rational(uncertainty.Wa), to_rational(uncertainty.Wb)
    Wa = np.hstack([Wa[:, :q], np.zeros((len(Wa), q), dtype=int).astype(object), Wa[:, q:]])
    problem = Problem()
    problem.positive("P11", P11)
    for name, scale in scales.items():
        problem.positive(f"epsilon {name}", scale)

    def entry(i: int, j: int) -> Expression:
        gain = on_differential(M[j], q, n)
        loop = he(A[i] @ P + B[i] @ gain) + scales["a"] * (Ha @ Ha.T) + scales["b"] * (Hb @ Hb.T)
        rows = [[loop, None, None], [Wa @ P, -scales["a"] * identity(len(Wa)).constant, None]]
        return block([*rows, [Wb @ gain, zeros(len(Wb), len(Wa)), -scales["b"] * identity(len(Wb)).constant]])

    slacks = double_sum(problem, "Upsilon", entry, count, nominal.polytope.block_index, slack=options.slack)

    def feedback(values: Values) -> Feedback:
        vertices = np.stack([values[Mj] for Mj in M]) @ on_state(values[P11], n)
        gain = PolytopicGain(nominal.polytope, vertices, tuple(known))
        return Feedback(values[P11], gain if nominal.inputs else None)

    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="I.3",
    summary="robust compensation F(z) x_d, unknown premises as norm-bounded uncertainty",
    reference="Dehak 2022, Theorem I.3, corrected",
    representation="ts",
    inequalities=inequalities,
    relies_on=COMPENSATION,
)
