"""Theorem II.6: quadratic stabilisation of regular descriptor systems without an extended state.

For ``E(z) x' = A(z) x + B(z) u`` with E(z) invertible, the law ``u = F(z) E(z)^-T P^-1 x`` makes ``V = x' P^-1 x``
decrease if ``He[(A + alpha E) P E' + B F] < 0`` at every z. Slack matrices L(z), R(z) separate A(z) from P E(z)', so
that the inequality is quadratic in the weights:

    He [A_i L_j + B_i F_j, A_i R_j; P E_i' - L_j, -R_j] + slack < 0    for all sums over i, j

(A_i stands for A_i + alpha E_i.) The printed slack sums run over the wrong index; here they have mean zero.

Reduced form: the closed form of `matched` for systems like robots, whose premises act only where the inputs do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from quasilpv.conditions.condition import (
    Condition,
    Form,
    Options,
    Statement,
    descriptor_statement,
    is_single_sum,
)
from quasilpv.conditions.reliance import DESCRIPTOR_LAW
from quasilpv.conditions.theorems import matched
from quasilpv.lmi import Expression, Variable, block
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State Theorem II.6 for a regular system.

    Unknowns ``P = P' > 0`` (n, n), and per vertex L_j, R_j (n, n) and F_j (m, n).
    """
    if options.form is Form.REDUCED and matched.applies(model):
        return matched.build(model, options)
    n, count = model.order, model.vertex_count
    labels = [""] * count if options.common else [str(j) for j in range(count)]
    unknowns = {label: (Variable(f"L{label}", n), Variable(f"R{label}", n)) for label in labels}
    alpha = Fraction(options.decay_rate)

    def entries(P: Variable, F: Sequence[Variable]) -> Callable[[int, int], Expression]:
        def entry(i: int, j: int) -> Expression:
            A = model.A[i] + model.E[i] * alpha
            L, R = unknowns[labels[j]]
            return block([[A @ L + model.B[i] @ F[j], A @ R], [P @ model.E[i].T - L, -R]])

        return entry

    return descriptor_statement(model, options, entries, single=options.common and is_single_sum(model, options.slack))


CONDITION = Condition(
    id="II.6",
    summary="regular systems: descriptor law F(z) E(z)^-T P^-1 x, no extended state",
    reference="Dehak 2022, Theorem II.6, with the slack sums corrected",
    representation="per-premise@0",
    inequalities=inequalities,
    relies_on=DESCRIPTOR_LAW,
    has_multipliers=True,
)
