"""Theorem II.6 without multipliers: a double sum of n x n inequalities.

``He[(A + alpha E) P E' + B F] < 0`` at every z (`ii6`) holds if

    sum_ij w_i w_j He((A_i + alpha E_i) P E_j' + B_i F_j) + slack < 0,    P = P' > 0.

Fewer unknowns and rows than Theorem II.6, which is a little less conservative. The law is the same,
``u = F(z) E(z)^-T P^-1 x``.
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
)
from quasilpv.conditions.reliance import DESCRIPTOR_LAW
from quasilpv.conditions.theorems import matched
from quasilpv.lmi import Expression, Variable
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition for a regular system.

    Unknowns ``P = P' > 0`` (n, n) and F_j (m, n) per vertex.
    """
    if options.form is Form.REDUCED and matched.applies(model):
        return matched.build(model, options)
    alpha = Fraction(options.decay_rate)

    def entries(P: Variable, F: Sequence[Variable]) -> Callable[[int, int], Expression]:
        def entry(i: int, j: int) -> Expression:
            drift = (model.A[i] + model.E[i] * alpha) @ P @ model.E[j].T
            return as_expression(drift + model.B[i] @ F[j])

        return entry

    return descriptor_statement(model, options, entries)


CONDITION = Condition(
    id="II.6-direct",
    summary="II.6 without multipliers: smaller, slightly more conservative",
    reference="this project, after Dehak 2022, Theorem II.6",
    representation="per-premise@0",
    inequalities=inequalities,
    relies_on=DESCRIPTOR_LAW,
)
