"""Theorem III.10 in reduced form, for a tracking error whose only measured premises are those of the inertia.

The error ``xi = (e, e', int e)`` of ``M(z) w' = u + d - sum_k delta_k b_k c_k' xi``, ``theta' = w``, with unknown
``|delta_k| <= r_k`` (Coriolis, gravity and friction, one term each):

    E(z) xi' = (A + sum_k delta_k B b_k c_k' + B K(z)) xi + B d,  E = diag(I, M, I),  K(z) = Y(z) E(z)^-T P^-1

The theorem's slack matrices L, R only serve to separate A(z) from E(z) in ``He(A(z) P E(z)') + ...``. Here A(z) is
constant but for the unknown terms, so this is affine in z without them, save for ``2 alpha E(z) P E(z)'``, which is
convex: the inequality at the vertices implies it everywhere (Jensen). For one unknown number with a factor of rank
one, the theorem's slack matrix of that premise is ``tau r^2 b b' + c c' / tau`` without loss (Petersen 1987), which
leaves one unknown tau_k for each. Derivation: ``docs/concepts/hinf-tracking.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.forms.blocks import block_diagonal, identity_blocks, single_sum
from quasilpv.lmi import Expression, Problem, Solution, Variable, block, constant, he, zeros


@dataclass(frozen=True, eq=False)
class UnknownTorques:
    """Torques ``delta_k b_k c_k' xi`` with ``|delta_k| <= r_k``, m of them.

    Attributes:
        torque: b_k, (m, n).
        state: c_k, (m, 3n); each depends on angles or on speeds only.
        radius: r_k, (m,), N m per rad or per rad/s.
    """

    torque: FloatArray
    state: FloatArray
    radius: FloatArray

    def in_units(self, rate: float, inertia: float) -> UnknownTorques:
        """The same with times in seconds / rate and inertias in inertia kg m^2."""
        return UnknownTorques(self.torque, self.state, self.radius * self.speeds(rate) / (inertia * rate**2))

    def speeds(self, rate: float) -> FloatArray:
        """``rate`` for the terms that depend on speeds, 1 for those that depend on angles, (m,)."""
        n = self.torque.shape[1]
        return np.where(self.state[:, n : 2 * n].any(axis=1), rate, 1.0)


@dataclass(frozen=True, eq=False)
class TrackingPoint:
    """A point of the problem.

    Attributes:
        decay: alpha.
        gain_limit: kappa, torque per unit of ``(e, e'/rate, rate int e)`` times the norm of ``inertia_unit E^-1``.
        gamma: bound on the squared L2 gain from d to e.
        beta: ``P > beta diag(I, rate^2 I, I / rate^2)``.
        P: 3n x 3n, V = xi' P^-1 xi.
        Y: vertices, (N, n, 3n).
        tau: multipliers of the unknown terms, (m,).
        rate, inertia_unit: of the units the gain limit is stated in.
    """

    decay: float
    gain_limit: float
    gamma: float
    beta: float
    P: FloatArray
    Y: FloatArray
    tau: FloatArray
    rate: float = 1.0
    inertia_unit: float = 1.0

    def scaled(self, rate: float, inertia: float, unknown: UnknownTorques) -> TrackingPoint:
        """A point found with times in seconds / rate and inertias in inertia kg m^2, in SI.

        Args:
            rate, inertia: the units.
            unknown: the terms tau belongs to.
        """
        n = self.Y.shape[1]
        state = np.repeat([1.0, rate, 1.0 / rate], n)  # scale of xi
        momentum = np.repeat([1.0, inertia, 1.0], n)  # scale of E
        P = self.P * np.outer(state, state) * rate
        return TrackingPoint(
            decay=self.decay * rate,
            gain_limit=self.gain_limit * inertia * rate**2,
            gamma=self.gamma / (rate**4 * inertia**2),
            beta=self.beta * rate,
            P=(P + P.T) / 2.0,
            Y=self.Y * (inertia * rate**3) * state * momentum,
            tau=self.tau * unknown.speeds(rate) ** 2,
            rate=rate,
            inertia_unit=inertia,
        )


@dataclass(frozen=True, eq=False)
class ReducedTrackingCondition:
    """The problem and its unknowns; see `reduced_tracking_condition`."""

    problem: Problem
    P: Variable
    Y: tuple[Variable, ...]
    gamma: Variable
    beta: Variable
    tau: tuple[Variable, ...]
    decay: float
    gain_limit: float

    def point(self, solution: Solution) -> TrackingPoint:
        """The point of a solution of the problem."""
        values = solution.values
        return TrackingPoint(
            decay=self.decay,
            gain_limit=self.gain_limit,
            gamma=float(values[self.gamma][0, 0]),
            beta=float(values[self.beta][0, 0]),
            P=values[self.P],
            Y=np.array([values[Y] for Y in self.Y]),
            tau=np.array([float(values[tau][0, 0]) for tau in self.tau]),
        )


def reduced_tracking_condition(
    inertia: FloatArray, unknown: UnknownTorques, *, decay: float, gain_limit: float
) -> ReducedTrackingCondition:
    """Feedback of limited gain with decay rate alpha and the smallest squared L2 gain gamma from d to e.

    With ``E_i = diag(I, M_i, I)``, ``A = [0 I 0; 0 0 0; I 0 0]``, ``B = [0; I; 0]``, ``C = [I 0 0]``; unknowns
    ``P = P'``, Y_i, beta and tau_k; minimise gamma subject to ``P > beta I``,
    ``[kappa beta I, Y_i; *, kappa beta I] > 0`` and, for every vertex i,

        [X_i, B, E_i P C', E_i P c_1, ..., E_i P c_m;  *, -gamma I, 0;  *, *, -I, 0;  *, *, *, -diag(tau)] < 0
        X_i = He(A P E_i' + B Y_i) + 2 alpha E_i P E_i' + sum_k tau_k r_k^2 B b_k b_k' B'

    Args:
        inertia: vertices M_i, (N, n, n).
        unknown: what is not scheduled.
        decay: alpha >= 0; it multiplies an unknown, so a line search is the way to the largest.
        gain_limit: kappa, see `TrackingPoint`.
    """
    count, n, _ = inertia.shape
    size, terms = 3 * n, len(unknown.radius)
    one, none = identity_blocks(n)
    states = identity_blocks(size)[0]
    A = np.block([[none, one, none], [none, none, none], [one, none, none]])
    B = np.vstack([none, one, none])
    C = np.hstack([one, none, none])
    E = [block_diagonal(one, M, one) for M in inertia]
    P = Variable("P", size, symmetric=True)
    Y = tuple(Variable(f"Y{i}", n, size) for i in range(count))
    tau = tuple(Variable(f"tau{k}", 1) for k in range(terms))
    gamma, beta = Variable("gamma", 1), Variable("beta", 1)
    acting = [B @ b * r for b, r in zip(unknown.torque, unknown.radius, strict=True)]
    multipliers = block(
        [[tau[k] if k == j else zeros(1, 1) for j in range(terms)] for k in range(terms)] if terms else [[zeros(0, 0)]]
    )

    def entry(i: int) -> Expression:
        decreasing = he(A @ P @ E[i].T + B @ Y[i]) + (E[i] @ P @ E[i].T) * (2 * decay)
        for multiplier, b in zip(tau, acting, strict=True):
            decreasing = decreasing + multiplier * np.outer(b, b)
        return block(
            [
                [decreasing, constant(B), E[i] @ P @ C.T, E[i] @ P @ unknown.state.T],
                [None, -(gamma * one), zeros(n, n), zeros(n, terms)],
                [None, None, constant(-one), zeros(n, terms)],
                [None, None, None, -multipliers],
            ]
        )

    problem = Problem()
    problem.positive("beta", beta.expression)
    problem.positive("P > beta I", P - beta * states)
    for i, gain in enumerate(Y):
        limit = beta * gain_limit
        problem.positive(f"gain {i}", block([[limit * one, gain], [None, limit * states]]))
    single_sum(problem, "Xi", entry, count)
    problem.minimise(gamma)
    return ReducedTrackingCondition(problem, P, Y, gamma, beta, tau, float(decay), float(gain_limit))
