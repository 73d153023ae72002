"""Ellipsoids a linear system does not leave: the largest inside given bounds, the smallest that holds a disturbance.

For ``x+ = A x + v``; by the S-procedure for quadratic functions (Boyd, El Ghaoui, Feron and Balakrishnan 1994, sections
5.2 and 6.1). For polytopic systems in continuous time: `quasilpv.conditions.tracking.polytopic_sets`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from quasilpv.arrays import FloatArray
from quasilpv.lmi import Expression, Problem, Variable, block, identity, zeros

SPARE = 1e-6
"""By how much a least set is widened, relative, so that exact arithmetic finds its inequality strict."""


def sampled_level_set(
    transition: FloatArray, output: FloatArray, directions: FloatArray, contraction: float
) -> tuple[Problem, Variable]:
    """Set ``x' P x <= 1`` that ``x+ = A x`` does not leave, in which ``|C x| <= 1``, wide along given directions.

    Unknown ``P = P' > 0``; minimise ``trace(N' P N)``, the sum of the inverse squares of the set's extents along the
    columns of N, subject to ``contraction P - A' P A > 0`` and ``[[P, C'], [*, 1]] > 0``.

    Args:
        transition: A, (s, s).
        output: C, (1, s).
        directions: N, (s, m).
        contraction: factor in (0, 1] by which ``x' P x`` shrinks per sample.

    Returns:
        The problem and P.
    """
    P = Variable("P", len(transition), symmetric=True)
    problem = Problem()
    problem.positive("decrease", P * contraction - transition.T @ P @ transition)
    problem.positive("output", block([[P, output.T], [None, identity(1)]]))
    problem.minimise(trace_along(directions, P.expression))
    return problem, P


def trace_along(directions: FloatArray, matrix: Expression) -> Expression:
    """``trace(N' X N)``."""
    total = zeros(1, 1)
    for direction in directions.T:
        total = total + direction[None] @ matrix @ direction[:, None]
    return total


@dataclass(frozen=True, eq=False)
class PeakSet:
    """A set ``x' X^-1 x <= 1`` that holds every state reachable from 0.

    Attributes:
        X: (s, s), positive definite.
        multiplier: of the S-procedure.
    """

    X: FloatArray
    multiplier: float


def sampled_peak_set(transition: FloatArray, inputs: FloatArray, output: FloatArray) -> PeakSet:
    """Smallest set, as seen through one output, that holds every state of ``x+ = A x + v``, ``v v' <= W``, from 0.

    For a multiplier ``lambda`` in (rho(A)^2, 1) the set is invariant if ``X > A X A' / lambda + W / (1 - lambda)``; the
    least such X is the solution of the Lyapunov equation, whatever the output, so that only lambda is searched for.

    Args:
        transition: A, (s, s), all eigenvalues inside the unit circle.
        inputs: W, (s, s), positive semidefinite.
        output: C, (1, s), the output whose bound ``C X C'`` is to be smallest.
    """

    def least(multiplier: float, spare: FloatArray | float = 0.0) -> FloatArray:
        shrunk = transition / math.sqrt(multiplier)
        X = scipy.linalg.solve_discrete_lyapunov(shrunk, inputs / (1.0 - multiplier) + spare, method="bilinear")
        return np.asarray((X + X.T) / 2.0)

    slowest = float(np.max(np.abs(np.linalg.eigvals(transition)))) ** 2
    found = line_search(lambda x: (output @ least(x) @ output.T).item(), slowest, 1.0)
    spare = SPARE * np.diag(least(found).diagonal())
    return PeakSet(least(found, spare), found)


def line_search(objective: Callable[[float], float], low: float, high: float, tolerance: float = 1e-4) -> float:
    """Where a function of one variable is smallest between two bounds; ``tolerance`` is relative to their distance."""
    options = {"xatol": tolerance * (high - low)}
    return float(scipy.optimize.minimize_scalar(objective, bounds=(low, high), method="bounded", options=options).x)
