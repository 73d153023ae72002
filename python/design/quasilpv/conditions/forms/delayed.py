"""Lyapunov functions with memory: what Theorems II.7 and II.8 share.

With ``varpi_k = (1/tau) int_{t-tau}^t w_k(z)`` and ``P(varpi) = sum_k varpi_k P_k``,

    d/dt P = (1/tau) sum_im w_i(z) w_m(z_d) (P_i - P_m),    z_d = z(t - tau),

so that no bound on the speed of the premises is needed. The P_k differ by about tau, hence the unknowns are
``P_k = P + tau D_k``: the derivative is ``sum_im w_i w_m (D_i - D_m)``, whatever tau.

**Limit tau -> 0.** P_k becomes P and drops out; the D_k stay. What holds in the limit holds for all small enough tau
(strict inequalities), and what holds at a tau holds at every smaller one, because the inequalities at tau' = theta tau
are those at tau averaged over k, with weight ``1 - theta``, and kept, with weight theta. So the limit is the largest
region this method can reach.

**What it cannot reach.** The inequalities hold for all w(z), varpi and w(z_d), independent of each other. At z_d = z
the derivative vanishes: for any fixed varpi*, P(varpi*) is a common quadratic Lyapunov matrix, of the memoryless law
with ``gain(z, varpi*, z)``. A system that no such law stabilises quadratically is out of reach for every tau.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from quasilpv.conditions.condition import Feedback, Options, Values
from quasilpv.conditions.gains import DelayedFeedback, MemorylessGain
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.lmi.expressions import as_expression
from quasilpv.polytopes import PolytopicModel


class MovingLyapunov:
    """The unknowns of ``P_k = P + tau D_k``, symmetric and positive definite, or of their limit.

    Attributes:
        P: symmetric, (size, size).
        D: one symmetric matrix per vertex.
        window_s: tau, None for the limit.
        window_indices: number of sums over varpi that remain, 1 or 0 in the limit.
    """

    def __init__(self, problem: Problem, name: str, size: int, count: int, window_s: float | None) -> None:
        """Create the unknowns and require ``P_k > 0``, or ``P > 0`` in the limit."""
        self.P = Variable(name, size, symmetric=True)
        self.D = [Variable(f"D{k}", size, symmetric=True) for k in range(count)]
        self.window_s = window_s
        self.window_indices = 0 if window_s is None else 1
        if window_s is None:
            problem.positive(name, self.P)
        else:
            for k in range(count):
                problem.positive(f"{name}{k}", self.at(k))

    def at(self, k: int | None = None) -> Expression:
        """P_k, P itself in the limit."""
        if self.window_s is None or k is None:
            return self.P.expression
        return self.P + self.D[k] * Fraction(self.window_s)

    def half(self, i: int) -> Expression:
        """``D_i / 2``: half of dP/dt is ``sum_im w_i w_m (D_i - D_m) / 2``, and He doubles it."""
        return as_expression(self.D[i] * Fraction(1, 2))


def require_no_decay_rate(options: Options, condition: str) -> None:
    """Refuse a decay rate, which the theorems with memory do not have.

    Args:
        options: of a statement.
        condition: its id.

    Raises:
        InputError: there is one.
    """
    if options.decay_rate:
        raise InputError(f"condition {condition}", "decay rate", options.decay_rate, "0, the theorem has none")


def delayed_feedback(
    model: PolytopicModel,
    lyapunov: MovingLyapunov,
    values: Values,
    gains: Mapping[tuple[int, ...], Variable],
    *,
    descriptor: bool,
) -> Feedback:
    """The laws of a solution: with memory for a window tau, and without.

    Args:
        model: the system.
        lyapunov, values: the solution.
        gains: F by the indices of w(z), of varpi if there is a window, and of w(z_d).
        descriptor: whether F is multiplied with ``E(z)^-T P(varpi)^-1``, else with ``[P(varpi)^-1 0]``.

    Returns:
        The memoryless law ``gain(z, varpi*, z)`` with equal mean weights varpi*, its Lyapunov matrix P(varpi*), and,
        for a window, the law with memory.
    """
    count = model.vertex_count
    shape = next(iter(gains.values()))
    indices = len(next(iter(gains)))
    delayed = DelayedFeedback(
        polytope=model.polytope,
        vertices=np.stack([values[F] for F in gains.values()]).reshape(*(count,) * indices, shape.rows, shape.cols),
        constant=values[lyapunov.P],
        moving=np.stack([values[D] for D in lyapunov.D]),
        window_s=lyapunov.window_s,
        E=model.system.E if descriptor else None,
        order=model.order,
    )
    return Feedback(
        delayed.lyapunov(np.full(count, 1.0 / count)),
        MemorylessGain(delayed) if model.inputs else None,
        delayed if model.inputs and lyapunov.window_indices else None,
    )
