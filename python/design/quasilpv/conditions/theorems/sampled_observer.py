"""Observer of a sampled regular system whose premises are measured.

For Euler's sampled model (`sampled_feedback`, which says what that proves) with output y = C x, the observer

    E(z_k) (x^_k+1 - x^_k) = h (A(z_k) x^_k + B(z_k) u_k) + L(z_k) (y_k - C x^_k)

has the error ``E(z) d = (A(z) - L~(z) C) e``, ``e_k+1 = e + h d``, ``L = h L~``. ``V = e' Q e`` contracts,
``V_k+1 < rho^2 V_k`` with ``rho = exp(-alpha h)``, if ``2 e' Q d + h d' Q d + c e' Q e < 0``, ``c = (1 - rho^2) / h``,
on that equation: by Finsler's lemma with multipliers H and t H,

    sum_ij w_i w_j [c Q + He(X_ij), *; Q - E_i' H_j + t X_ij, h Q - t He(H_j' E_i)] < 0,    X_ij = H_j' A_i - Y_j C,

where ``L~(z) = H(z)^-T Y(z)`` and the time t is `MULTIPLIER_SAMPLES` h, no less than what the lower block needs.
``t He(H' E) > h Q > 0`` makes H(z) invertible.
"""

from __future__ import annotations

from fractions import Fraction
from math import exp

import numpy as np

from quasilpv.conditions.condition import Condition, Feedback, Options, Statement, Values
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.gains import ObserverGain
from quasilpv.conditions.reliance import Reliance
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable, block, he, to_rational
from quasilpv.polytopes import PolytopicModel

MULTIPLIER_SAMPLES = 20
"""Ratio t/h of the two multipliers; any value is sound."""


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition.

    Unknowns ``Q = Q' > 0`` (n, n), and per vertex H_j (n, n) and Y_j (n, outputs).

    Raises:
        InputError: the output matrix depends on premises.
    """
    if model.system.C.coefficients.any():
        raise InputError("condition sampled-observer", model.system.name, "C with premises", "a constant C")
    n, count = model.order, model.vertex_count
    C = to_rational(model.system.C.constant)
    h = Fraction(options.sample_period_s)
    t = h * MULTIPLIER_SAMPLES
    rate = (1 - Fraction(exp(-2.0 * options.decay_rate * options.sample_period_s))) / h
    Q = Variable("Q", n, symmetric=True)
    H, Y = [Variable(f"H{j}", n) for j in range(count)], [Variable(f"Y{j}", n, len(C)) for j in range(count)]

    def entry(i: int, j: int) -> Expression:
        X = H[j].T @ model.A[i] - Y[j] @ C
        image = H[j].T @ model.E[i]
        return block([[he(X) + Q * rate, None], [Q - image.T + X * t, Q * h - he(image) * t]])

    problem = Problem()
    problem.positive("Q", Q)
    slacks = double_sum(problem, "Xi", entry, count, model.polytope.block_index, slack=options.slack)

    def feedback(values: Values) -> Feedback:
        H_vertices, Y_vertices = (np.stack([values[X] for X in unknowns]) for unknowns in (H, Y))
        observer = ObserverGain(model.polytope, H_vertices, Y_vertices, options.sample_period_s)
        return Feedback(np.asarray(np.linalg.inv(values[Q])), None, observer=observer)

    return Statement(problem, feedback, slacks)


CONDITION = Condition(
    id="sampled-observer",
    summary="regular systems with measured premises: observer for Euler's sampled model",
    reference="this project, by Finsler's lemma",
    representation="per-premise",
    inequalities=inequalities,
    relies_on=(
        Reliance.REGULAR,
        Reliance.NO_UNKNOWN,
        Reliance.INDEX_ONE,
        Reliance.OUTPUTS,
        Reliance.MEASURED,
        Reliance.EULER,
        Reliance.DOMAIN,
    ),
)
