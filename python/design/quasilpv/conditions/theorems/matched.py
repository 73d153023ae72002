"""Theorem II.6 in closed form, for systems whose premises act only where the inputs do.

Let B be constant with full column rank and ``N' B = 0``, and let ``N' E`` and ``N' A`` be constant: of a robot,
``B = [0; I]`` leaves the rows ``theta' = omega``. Then Theorem II.6 and its form without multipliers (`ii6`,
`ii6_direct`), with or without slack and in any representation without unknown premises, are feasible if and only if

    N' He((A + alpha E) P E') N < 0,    P = P' > 0,

one inequality without premises. It is necessary because ``N' He[(A + alpha E) P E' + B F] N`` is its left side at
every z. It is sufficient: in the rows ``T' = [N, B (B'B)^-1]'`` write A~ = T' (A + alpha E), E~ = T' E, T' B = [0; I],
t and b for the upper and lower rows, and

    C_i = P E~_i' + rho A~_i' = [C_1, C_2i],    L = [C_1, L_2],    R = rho I,    L_2 the mean of the C_2i,
    F_i = [-A~_bi C_1 - (A~_t L_2)',  -A~_bi L_2 - ((C_2i - L_2)' (C_2i - L_2) / (2 rho) + eta I) / 2] T^-1.

Schur's complement of -2 rho I then leaves ``diag(He(A~_t P E~_t') + 2 rho A~_t A~_t', -eta I)``, negative for small
rho, for i = j, which is enough because B is constant. Without multipliers
``F_j = [-(A~_t P E~_bj')' - A~_bj P E~_t', -c I] T^-1`` with large c does the same.

For a robot and ``P = [p_1 I, -p_2 I; -p_2 I, p_3 I]`` the first block is ``-2 (p_2 - alpha p_1 - rho (1 + alpha^2))``
times I: there is always a solution, whatever masses, friction, bounds and alpha. So feasibility says nothing about
manipulators; gain limits or a pole region would.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import scipy.linalg

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Feedback, Options, Statement, Values, descriptor_law
from quasilpv.conditions.forms.elimination import gains_are_free, unactuated
from quasilpv.lmi import Problem, Variable
from quasilpv.polytopes import PolytopicModel


def applies(model: PolytopicModel) -> bool:
    """Whether the premises act only where the inputs do, and no vertices have to share a gain."""
    if not model.inputs or not gains_are_free(model):
        return False
    N = unactuated(model)
    full_rank = N.shape[1] == model.order - model.inputs
    return full_rank and not model.premises_of(lambda E, A, B: np.hstack([N.T @ E, N.T @ A]))


def build(model: PolytopicModel, options: Options) -> Statement:
    """State the inequality; unknown ``P = P' > 0`` (n, n)."""
    N = unactuated(model)
    E, A = N.T @ model.E[0], N.T @ model.A[0]
    P = Variable("P", model.order, symmetric=True)
    problem = Problem()
    problem.positive("P", P)
    problem.negative("unactuated", (A + E * Fraction(options.decay_rate)) @ P @ E.T)

    def feedback(values: Values) -> Feedback:
        vertices = _gains(model, values[P], options.decay_rate)
        return descriptor_law(model, values[P], vertices)

    return Statement(problem, feedback)


def _gains(model: PolytopicModel, P: FloatArray, decay_rate: float) -> FloatArray:
    """The F_i of the module's description, (count, m, n)."""
    B, N = model.system.B.constant, unactuated(model).astype(float)
    free = N.shape[1]
    T = np.hstack([N, B @ np.linalg.inv(B.T @ B)])
    E, A = (
        T.T @ model.polytope.vertices(matrix.constant, matrix.coefficients)
        for matrix in (model.system.E, model.system.A)
    )
    A = A + decay_rate * E
    top, below = A[0, :free], A[:, free:]
    decrease = -(top @ P @ E[0, :free].T + E[0, :free] @ P @ top.T)
    largest = scipy.linalg.eigh(2.0 * top @ top.T, decrease, eigvals_only=True)[-1] if free else 0.0
    rho = 0.5 / largest if largest > 0.0 else 1.0
    C = P @ E.transpose(0, 2, 1) + rho * A.transpose(0, 2, 1)
    L1, L2 = C[0, :, :free], C[:, :, free:].mean(axis=0)
    rest = C[:, :, free:] - L2
    eta = float(np.abs(below @ L2).max()) or float(np.abs(L2).max())
    own = -below @ L2 - 0.5 * (rest.transpose(0, 2, 1) @ rest / (2.0 * rho) + eta * np.eye(model.inputs))
    return np.asarray(np.concatenate([-below @ L1 - (top @ L2).T, own], axis=2) @ np.linalg.inv(T))
