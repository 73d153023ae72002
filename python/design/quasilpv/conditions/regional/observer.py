"""An observer for a sampled law with a region: contraction of the estimation error at every slope, in one norm.

With e = x - h, D a slope df/dx, N the projection on the states that are not measured and y = C x, one sample is
``e+ = (I + T D N - L C) e`` (and what Euler's method leaves over). In coordinates in which the region is the unit ball,
with ``w^2 = e' X e``, ``L = T lam X^-1 Y`` and ``M_i = D_i N / lam - X^-1 Y C``:

    error i       [-He(X M_i) - (2 - lam T) X, (X M_i)'; *, X/(lam T)] > 0     w+ <= (1 - lam T) w at the slope D_i
    unseen        X - N'N > 0                                                  |N e| <= w
    coupling k    X - Delta_k' Delta_k / (s lam)^2 > 0                         |(df/dx - A_cl) N e| <= s lam w
    largest       t I - N' X N / |N|^2 > 0,  t BOUND I - X > 0                 w <= sqrt(t) |e| of what is not measured
    remainder i   t I - D_i' X D_i / max |D_j|^2 > 0                           w of what a step leaves over

The first is Schur's complement of ``(I + lam T M)' X (I + lam T M) < (1 - lam T)^2 X``, in which the problem keeps its
scale however short the period is. The least t allows the largest errors, because the region of state and error is
``|x| + w <= 1``, and the longest periods. Slopes are those of samples: the certificate encloses all of them afterwards.
(Discrete Lyapunov inequality of the dual; as `quasilpv.conditions.theorems.sampled_observer` states it for vertices.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.lmi import Problem, Variable, block
from quasilpv.lmi.expressions import as_expression

BOUND = 1e4
"""Of the weight of what is measured over that of what is not."""


@dataclass(frozen=True, eq=False)
class ObserverStatement:
    """The inequalities and their unknowns: X, Y of the module."""

    problem: Problem
    X: Variable
    Y: Variable


def observer_statement(
    slopes: Sequence[FloatArray],
    unseen: FloatArray,
    outputs: FloatArray,
    coupling: Sequence[FloatArray],
    *,
    rate: float,
    period_s: float,
    share: float,
) -> ObserverStatement:
    """State it.

    Args:
        slopes: D_i, (q, q) each.
        unseen: N, (q, q).
        outputs: C, (o, q).
        coupling: ``Delta_k``, (q, q) each, those of the slope and of the closed loop times N.
        rate: lam, 1/s.
        period_s: T; ``lam T < 1``.
        share: s.
    """
    q, o = len(unseen), len(outputs)
    X, Y, t = Variable("X", q, symmetric=True), Variable("Y", q, o), Variable("t", 1)
    own = ObserverStatement(Problem(), X, Y)
    part, identity = rate * period_s, np.eye(q)
    own.problem.positive("unseen", X - unseen.T @ unseen)
    own.problem.positive("bounded", t * (BOUND * identity) - X)
    alone = unseen / np.linalg.norm(unseen, 2)
    own.problem.positive("largest", t * identity - as_expression(alone.T @ X @ alone))
    size = max(float(np.linalg.norm(D, 2)) for D in slopes)
    for k, Delta in enumerate(coupling):
        own.problem.positive(f"coupling {k}", X - Delta.T @ Delta / (share * rate) ** 2)
    for i, D in enumerate(slopes):
        moved = as_expression(X @ (D @ unseen / rate)) - Y @ outputs
        loss = as_expression(X * (part - 2.0)) - moved - moved.T
        own.problem.positive(f"error {i}", block([[loss, moved.T * part**0.5], [moved * part**0.5, X]]))
        own.problem.positive(f"remainder {i}", t * identity - as_expression((D / size).T @ X @ (D / size)))
    own.problem.minimise(t)
    return own
