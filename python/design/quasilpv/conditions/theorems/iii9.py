"""Theorem III.9: stabilisation with unknown premises.

Theorem II.5 (`ii5`) on known and unknown premises together, where vertices that differ in unknown premises only share
their gain, and with a Lyapunov matrix per block b of vertices,

    He [A_i L_j + B_i [F_j 0], A_i R_j; P_b(j) - L_j, -R_j] + slack < 0,    P_b = [V_b 0; W_b Z_b],    sum_b V_b > 0.

The weights of a block sum to 1/G, hence ``sum_j w_j P_b(j) = (1/G) sum_b P_b =: P`` is constant: ``u = F(z) V^-1 x_d``.

Reduced form, with slack: one P. What P_b differs from P is an addition ``He [0 0; P_b - P, 0]`` of mean zero, which S_b
can take.
"""

from __future__ import annotations

from fractions import Fraction

from quasilpv.conditions.condition import Condition, Form, Options, Statement
from quasilpv.conditions.forms.extended import extended_lyapunov
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.conditions.theorems.ii5 import with_multipliers
from quasilpv.lmi import Expression, Problem, Variable, zeros
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem III.9.

    Unknowns per block V_b symmetric (q, q), W_b (n, q) and Z_b (n, n), and per vertex L_j, R_j (N, N) and F_j (m, q).
    """
    q, n = model.differential, model.order
    block_of = model.polytope.block_index
    if options.form is Form.REDUCED and options.slack is not Slack.NONE:
        block_of = 0 * block_of
    V: list[Variable] = []
    P: list[Expression] = []
    for b in range(int(block_of[-1]) + 1):
        V.append(Variable(f"V{b}", q, symmetric=True))
        P.append(extended_lyapunov(V[-1], Variable(f"W{b}", n, q), Variable(f"Z{b}", n)))
    mean = sum((matrix.expression for matrix in V), zeros(q, q)) * Fraction(1, len(V))
    problem = Problem()
    problem.positive("V", mean)

    def lyapunov(i: int, j: int) -> Expression:
        return P[int(block_of[j])]

    return with_multipliers(model, options, problem, mean, lyapunov)


CONDITION = Condition(
    id="III.9",
    summary="uncertain singular systems: F(z) x_d, unknown premises as blocks of their own",
    reference="Dehak 2022, Theorem III.9",
    representation="uncertain@0",
    inequalities=inequalities,
    relies_on=COMPENSATION,
    has_multipliers=True,
)
