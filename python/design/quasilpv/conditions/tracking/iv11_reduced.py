"""Theorem IV.11 in reduced form: the same inequality at every point of the box, without the eliminated unknowns.

The model is ``M(z) w' = u + d``, ``theta' = w`` with ``M(z) = sum_i w_i(z) M_i``; the disturbance d is observed as a
double integrator. Two independent problems (separation: the estimation error does not depend on the feedback):

* feedback ``u = K(z) xi``, ``xi = (e, e', int e)``, ``K(z) = sum_i w_i(z) Y_i P^-1``;
* observer gain ``L(z) = sum_i w_i(z) Q^-1 W_i`` for ``(theta, w, d, d')``.

The statement of Dehak 2022 carries state derivatives and slack matrices of seven n-blocks per inequality; eliminating
them exactly leaves the inequalities below, which make its proof go through at every z. The derivation is
``docs/concepts/reduced-forms.md``. Two bounds the statement lacks make the gains usable: a disk that bounds the poles
(without it the infimum of the L2 gain is zero and gains are arbitrary), and an L2 gain of the observer from
measurement noise.

Neither problem has a time or inertia scale of its own. With decay rate and disk in a fixed ratio a point found in
some units gives a point for every bandwidth: `FeedbackPoint.scaled` and `ObserverPoint.scaled`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray, symmetric
from quasilpv.conditions.forms.blocks import block_diagonal, double_sum, identity_blocks, single_sum
from quasilpv.lmi import Expression, Problem, Solution, Variable, block, constant, he, to_rational, zeros
from quasilpv.lmi.exact import Matrix

Real = float | Fraction


@dataclass(frozen=True, eq=False)
class FeedbackPoint:
    """A point of the feedback problem.

    Attributes:
        decay: alpha, every solution decays at least like exp(-alpha t).
        disk: rho, every frozen pole lies in |s| < rho.
        gamma: bound on the *squared* L2 gain from a disturbance torque to the error e.
        P: 3n x 3n, V = xi' P^-1 xi.
        gains: vertex gains K_i = [Kp Kd KI], (N, n, 3n).
    """

    decay: float
    disk: float
    gamma: float
    P: FloatArray
    gains: FloatArray

    def scaled(self, rate: float, inertia: float) -> FeedbackPoint:
        """The point of the problem that is ``rate`` times as fast and has inertias ``inertia`` times as large.

        Also a change of units: a point found with times in seconds / rate and inertias in inertia kg m^2, in SI.
        """
        n = self.gains.shape[1]
        state = np.repeat([1.0, rate, 1.0 / rate], n)  # scale of xi
        return FeedbackPoint(
            decay=self.decay * rate,
            disk=self.disk * rate,
            gamma=self.gamma / (rate**4 * inertia**2),
            P=symmetric(self.P * np.outer(state, state) * rate),
            gains=self.gains * (inertia * rate**2) / state,
        )


@dataclass(frozen=True, eq=False)
class FeedbackCondition:
    """The feedback problem for given vertices; see `feedback_condition`."""

    problem: Problem
    P: Variable
    Y: tuple[Variable, ...]
    gamma: Variable
    decay: float
    disk: float

    def point(self, solution: Solution) -> FeedbackPoint:
        """The point of a solution of the problem."""
        P = solution.values[self.P]
        gains = np.array([np.linalg.solve(P, solution.values[Y].T).T for Y in self.Y])
        return FeedbackPoint(self.decay, self.disk, float(solution.values[self.gamma][0, 0]), P, gains)

    def holds_at(self, point: FeedbackPoint) -> bool:
        """Whether the inequalities hold for these very gains, in exact arithmetic: ``Y_i = K_i P``."""
        P = to_rational(point.P)
        values: dict[Variable, Matrix] = {self.P: P, self.gamma: to_rational([[point.gamma]])}
        values.update({Y: to_rational(K) @ P for Y, K in zip(self.Y, point.gains, strict=True)})
        return self.problem.holds_exactly(values)


def feedback_condition(
    inertia: Matrix, decay: Real, disk: Real = math.inf, *, slack_blocks: npt.NDArray[np.intp] | None = None
) -> FeedbackCondition:
    """Feedback ``u = K(z) xi`` with decay rate, pole disk and smallest L2 gain from torque to error.

    With ``E_i = diag(I, M_i, I)``, ``A = [0 I 0; 0 0 0; I 0 0]``, ``B = [0; I; 0]``, ``C = [I 0 0]``; unknowns
    ``P = P' > 0`` and Y_i; minimise gamma subject to (double sums over i, j: `double_sum`)

        [He((A P + B Y_i) E_j') + 2 alpha E_i P E_j',  B,  E_i P C';  *, -gamma I, 0;  *, *, -I] < 0
        [-rho E_i P E_j',  A P + B Y_i;  *, -rho P] < 0

    Args:
        inertia: vertices M_i, (N, n, n).
        decay: alpha >= 0.
        disk: rho; infinite to leave out the second family.
        slack_blocks: block of every vertex, to add zero-mean slack matrices to the double sums; None for none.
    """
    count, n, _ = inertia.shape
    size = 3 * n
    one, none = identity_blocks(n)
    A = np.block([[none, one, none], [none, none, none], [one, none, none]])
    B = np.vstack([none, one, none])
    C = np.hstack([one, none, none])
    E = [block_diagonal(one, M, one) for M in inertia]
    P = Variable("P", size, symmetric=True)
    Y = tuple(Variable(f"Y{i}", n, size) for i in range(count))
    gamma = Variable("gamma", 1)
    closed = [A @ P + B @ Yi for Yi in Y]

    def bounded_real(i: int, j: int) -> Expression:
        decreasing = he(closed[i] @ E[j].T) + (E[i] @ P @ E[j].T) * (2 * decay)
        return block(
            [
                [decreasing, constant(B), E[i] @ P @ C.T],
                [None, -(gamma * one), zeros(n, n)],
                [None, None, constant(-one)],
            ]
        )

    def pole_disk(i: int, j: int) -> Expression:
        return block([[(E[i] @ P @ E[j].T) * -disk, closed[i]], [None, P * -disk]])

    problem = Problem()
    problem.positive("P", P.expression)
    double_sum(problem, "bounded real", bounded_real, count, slack_blocks)
    if math.isfinite(disk):
        double_sum(problem, "pole disk", pole_disk, count, slack_blocks)
        problem.minimise(gamma)  # without the disk its infimum is zero, and not attained
    return FeedbackCondition(problem, P, Y, gamma, float(decay), float(disk))


@dataclass(frozen=True, eq=False)
class ObserverPoint:
    """A point of the observer problem.

    Attributes:
        decay: alpha, the estimation error decays at least like exp(-alpha t).
        disk: rho, every frozen pole lies in |s| < rho.
        noise: nu, the angle is measured as theta + nu n.
        gamma: bound on the *squared* L2 gain from (d'', n) to the error of the estimated disturbance torque.
        Q: 4n x 4n, V = eps' Q eps.
        gains: vertex gains L_i = [L1; L2; L3; L4], (N, 4n, n).
        multipliers: values of the multiplier of each family, by name, (1 or N, 5n, n).
    """

    decay: float
    disk: float
    noise: float
    gamma: float
    Q: FloatArray
    gains: FloatArray
    multipliers: Mapping[str, FloatArray]

    def scaled(self, rate: float, inertia: float) -> ObserverPoint:
        """As `FeedbackPoint.scaled`."""
        n = self.gains.shape[2]
        torque = inertia * rate**2
        state = np.repeat([1.0, rate, torque, torque * rate], n)  # scale of eps
        extended = np.concatenate([state, np.full(n, rate**2)])
        return ObserverPoint(
            decay=self.decay * rate,
            disk=self.disk * rate,
            noise=self.noise / (rate**4 * inertia),
            gamma=self.gamma / rate**4,
            Q=symmetric(self.Q * (torque**2 / rate) / np.outer(state, state)),
            gains=self.gains * state[:, None] * rate,
            multipliers={name: F * torque / extended[:, None] for name, F in self.multipliers.items()},
        )


@dataclass(frozen=True, eq=False)
class ObserverCondition:
    """The observer problem for given vertices; see `observer_condition`."""

    problem: Problem
    Q: Variable
    W: tuple[Variable, ...]
    gamma: Variable
    multipliers: Mapping[str, tuple[Variable, ...]]
    decay: float
    disk: float
    noise: float

    def point(self, solution: Solution) -> ObserverPoint:
        """The point of a solution of the problem."""
        Q = solution.values[self.Q]
        return ObserverPoint(
            decay=self.decay,
            disk=self.disk,
            noise=self.noise,
            gamma=float(solution.values[self.gamma][0, 0]),
            Q=Q,
            gains=np.array([np.linalg.solve(Q, solution.values[W]) for W in self.W]),
            multipliers={name: np.array([solution.values[F] for F in Fs]) for name, Fs in self.multipliers.items()},
        )

    def holds_at(self, point: ObserverPoint) -> bool:
        """Whether the inequalities hold for these very gains, in exact arithmetic: ``W_i = Q L_i``."""
        Q = to_rational(point.Q)
        values: dict[Variable, Matrix] = {self.Q: Q, self.gamma: to_rational([[point.gamma]])}
        values.update({W: Q @ to_rational(L) for W, L in zip(self.W, point.gains, strict=True)})
        for name, variables in self.multipliers.items():
            values.update(zip(variables, map(to_rational, point.multipliers[name]), strict=True))
        return self.problem.holds_exactly(values)


def observer_condition(
    inertia: Matrix,
    decay: Real,
    disk: Real,
    noise: Real,
    *,
    scheduled_multiplier: bool = False,
    slack_blocks: npt.NDArray[np.intp] | None = None,
) -> ObserverCondition:
    """Observer of (theta, w, d, d') with decay rate, pole disk and smallest L2 gain to the disturbance estimate.

    The error ``eps`` obeys ``eps' = (A - L(z) C) eps + G v``, ``M(z) v = eps_3`` with A the chain theta' = w, d' = dd
    and ``G = [0; I; 0; 0]``: with a multiplier F(z) for the second equation (Finsler's lemma), c_i = [0 0 I 0 -M_i],
    ``X_i = Q A - W_i C``, H = [0 0 0 I]', D = [0 0 I 0]; unknowns ``Q = Q' > 0``, W_i, F_j, F^_j; minimise gamma
    subject to (double sums over i, j; single sums over i with one F for all vertices)

        [[He(X_i) + 2 alpha Q, Q G; *, 0] + He(F_j c_i),  [Q H, -nu W_i; 0, 0],  [D 0]';  *, -gamma I, 0;  *, *, -I] < 0
        [[-rho Q, 0; *, 0] + He(F^_j c_i),  [X_i, Q G]';  *, -rho Q] < 0

    Args:
        inertia: vertices M_i, (N, n, n).
        decay: alpha >= 0; at most 1/T_f if d is filtered with T_f afterwards (an exact cascade, left out here).
        disk: rho; infinite to leave out the second family.
        noise: nu.
        scheduled_multiplier: a multiplier per vertex. Less conservative, and several times as expensive.
        slack_blocks: as in `feedback_condition`; only with a scheduled multiplier.
    """
    count, n, _ = inertia.shape
    one, none = identity_blocks(n)
    A = np.kron(np.diag([1, 0, 1], 1).astype(object), one)
    G, H = np.vstack([none, one, none, none]), np.vstack([none, none, none, one])
    C, D = np.hstack([one, none, none, none]), np.hstack([none, none, one, none])
    motion = [np.hstack([none, none, one, none, -M]) for M in inertia]
    Q = Variable("Q", 4 * n, symmetric=True)
    W = tuple(Variable(f"W{i}", 4 * n, n) for i in range(count))
    gamma = Variable("gamma", 1)
    families = ("bounded real", "pole disk") if math.isfinite(disk) else ("bounded real",)
    shared = count if scheduled_multiplier else 1
    multipliers = {name: tuple(Variable(f"F {name} {j}", 5 * n, n) for j in range(shared)) for name in families}
    error = [Q @ A - Wi @ C for Wi in W]

    def constrained(family: str, i: int, j: int, top: Expression) -> Expression:
        F = multipliers[family][j if scheduled_multiplier else 0]
        return top + he(F @ motion[i])

    def bounded_real(i: int, j: int) -> Expression:
        top = block([[he(error[i]) + Q * (2 * decay), Q @ G], [None, zeros(n, n)]])
        inputs = block([[Q @ H, W[i] * -noise], [zeros(n, n), zeros(n, n)]])
        return block(
            [
                [constrained("bounded real", i, j, top), inputs, constant(np.vstack([D.T, none]))],
                [None, -(gamma * np.kron(np.eye(2, dtype=int).astype(object), one)), zeros(2 * n, n)],
                [None, None, constant(-one)],
            ]
        )

    def pole_disk(i: int, j: int) -> Expression:
        top = block([[Q * -disk, zeros(4 * n, n)], [None, zeros(n, n)]])
        return block([[constrained("pole disk", i, j, top), block([[error[i], Q @ G]]).T], [None, Q * -disk]])

    problem = Problem()
    problem.positive("Q", Q.expression)
    for name, entry in zip(families, (bounded_real, pole_disk), strict=False):
        if scheduled_multiplier:
            double_sum(problem, name, entry, count, slack_blocks)
        else:
            single_sum(problem, name, partial(_first_column, entry), count)
    problem.minimise(gamma)
    return ObserverCondition(problem, Q, W, gamma, multipliers, float(decay), float(disk), float(noise))


def _first_column(entry: Callable[[int, int], Expression], i: int) -> Expression:
    return entry(i, 0)
