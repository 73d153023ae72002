"""Stabilisation of a sampled regular system by the law of Theorem II.6, ``u_k = F(z_k) E(z_k)^-T P^-1 x_k``.

The sampled model is Euler's, which keeps the descriptor form and its premises:

    E(z_k) (x_k+1 - x_k) = h (A(z_k) x_k + B(z_k) u_k).

With ``Y = A P E' + B F`` and ``x = P E' xi``, ``V = x' P^-1 x`` changes by ``h xi' (He(Y) + h Y (E P E')^-1 Y') xi``.
It contracts, ``V_k+1 < rho^2 V_k`` with ``rho = exp(-alpha h)``, if by Schur's complement

    sum_ij w_i w_j [-He(Y_ij) - c E_i P E_j', Y_ij; *, E_i P E_j' / h] > 0,    c = (1 - rho^2) / h,

with ``Y_ij = A_i P E_j' + B_i F_j``; slack as in other double sums. For h -> 0 this is `ii6_direct`.

**What is and what is not proved.** The statement is about the model above. In the norm ``|x|_P = sqrt(x' P^-1 x)`` the
law tolerates any error of the model, ``|x_k+1 - x_k+1,model|_P <= mu |x_k|_P``, with ``rho + mu < 1``: the triangle
inequality gives ``|x_k+1|_P <= (rho + mu) |x_k|_P``. Euler's error is ``mu = O(h^2)`` on a bounded domain, ``1 - rho``
about ``alpha h``, so that a small enough h is always covered; whether a given h is, must be bounded for the plant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import exp

from quasilpv.conditions.condition import (
    Condition,
    Options,
    Statement,
    descriptor_statement,
)
from quasilpv.conditions.reliance import Reliance
from quasilpv.lmi import Expression, Variable, block, he
from quasilpv.polytopes import PolytopicModel


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition for a regular system.

    Unknowns ``P = P' > 0`` (n, n) and F_j (m, n) per vertex.
    """
    h = Fraction(options.sample_period_s)
    rate = (1 - Fraction(exp(-2.0 * options.decay_rate * options.sample_period_s))) / h

    def entries(P: Variable, F: Sequence[Variable]) -> Callable[[int, int], Expression]:
        def entry(i: int, j: int) -> Expression:
            Y = model.A[i] @ P @ model.E[j].T + model.B[i] @ F[j]
            image = model.E[i] @ P @ model.E[j].T
            return block([[he(Y) + image * rate, -Y], [-Y.T, image * (-1 / h)]])

        return entry

    return descriptor_statement(model, options, entries)


CONDITION = Condition(
    id="sampled-feedback",
    summary="regular systems: state feedback for Euler's sampled model, contraction per sample",
    reference="this project, after Dehak 2022, Theorem II.6",
    representation="per-premise",
    inequalities=inequalities,
    relies_on=(
        Reliance.REGULAR,
        Reliance.KNOWN_E,
        Reliance.INDEX_ONE,
        Reliance.STATE,
        Reliance.SCHEDULED,
        Reliance.EULER,
        Reliance.DOMAIN,
    ),
)
