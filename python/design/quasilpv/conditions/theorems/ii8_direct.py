"""Theorem II.8 without multipliers: a Lyapunov function with memory, inequalities of the size of the state.

For ``E(z) x' = A(z) x + B(z) u`` with E(z) invertible, ``u = F E(z)^-T P(varpi)^-1 x`` makes ``V = x' P(varpi)^-1 x``
decrease with ``V' < -2 alpha V`` if ``He[(A + alpha E) P E' + B F] - E (dP/dt) E' < 0`` (`delayed`). With
``F = sum_jkm w_j(z) varpi_k w_m(z_d) F_jkm`` the left side is cubic in w(z); it is enough that

    mean over the permutations (a, b, c) of (i, j, l) of
        He[(A_a + alpha E_a) P_k E_b' + B_a F_bkm] - E_a (D_c - D_m) E_b'  < 0

for all i <= j <= l and all k, m: the coefficient of every monomial. Fewer unknowns than `ii8`, no slack.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, permutations, product

from quasilpv.conditions.forms.delayed import MovingLyapunov
from quasilpv.conditions.reliance import Reliance, refuse_refuted
from quasilpv.lmi import Expression, Problem, Variable, zeros
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel


@dataclass(frozen=True, eq=False)
class DelayedDesign:
    """The inequalities and their unknowns.

    Attributes:
        problem: the inequalities, homogeneous.
        lyapunov: P and D_k.
        F: gain unknowns by (j, k, m), (inputs, n).
    """

    problem: Problem
    lyapunov: MovingLyapunov
    F: Mapping[tuple[int, int, int], Variable]


def delayed_design(model: PolytopicModel, decay_rate: float, window_s: float) -> DelayedDesign:
    """State the inequalities.

    Args:
        model: the system.
        decay_rate: alpha, 1/s.
        window_s: tau.

    Raises:
        InputError: algebraic states, unknown premises, or an E(z) that is not proved invertible.
    """
    refuse_refuted("II.8-direct", (Reliance.REGULAR, Reliance.NO_UNKNOWN, Reliance.INVERTIBLE_E), model)
    n, count = model.order, model.vertex_count
    problem = Problem()
    P = MovingLyapunov(problem, "P", n, count, window_s)
    vertices = range(count)
    F = {(j, k, m): Variable(f"F {j} {k} {m}", model.inputs, n) for j, k, m in product(vertices, vertices, vertices)}
    alpha = Fraction(decay_rate)

    def entry(place: Sequence[int], k: int, m: int) -> Expression:
        a, b, c = place
        drift = (model.A[a] + model.E[a] * alpha) @ P.at(k) @ model.E[b].T + model.B[a] @ F[b, k, m]
        return as_expression(drift - model.E[a] @ (P.half(c) - P.half(m)) @ model.E[b].T)

    for indices in combinations_with_replacement(vertices, 3):
        orders = sorted(set(permutations(indices)))
        for k, m in product(vertices, repeat=2):
            total = sum((entry(order, k, m) for order in orders), zeros(n, n))
            problem.negative(f"decrease {indices} {k} {m}", total * Fraction(1, len(orders)))
    return DelayedDesign(problem, P, F)
