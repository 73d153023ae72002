"""Ellipsoids a linear system does not leave: the largest inside given bounds, the smallest that holds a disturbance.

Statements about ``x+ = A x + v`` (sampled) and ``E(z) x' = A(z) x + B v`` with vertices ``E_i, A_i`` (continuous). Both
are the S-procedure for quadratic functions (Boyd, El Ghaoui, Feron and Balakrishnan 1994, sections 5.2 and 6.1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.optimize

from quasilpv.conditions.blocks import double_sum
from quasilpv.lmi import Expression, Problem, Variable, block, he, identity, zeros

FloatArray = npt.NDArray[np.float64]

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
    problem.minimise(_trace(directions, P.expression))
    return problem, P


def polytopic_level_set(
    inertia: Sequence[FloatArray],
    system: Sequence[FloatArray],
    outputs: FloatArray,
    directions: FloatArray,
    decay: float,
) -> tuple[Problem, Variable]:
    """Set ``x' S^-1 x <= 1`` that ``E(z) x' = A(z) x`` does not leave however z moves, in which every ``|C_k x| <= 1``.

    Unknowns ``S = S' > 0`` and Z; minimise ``trace Z`` subject to ``[[Z, N'], [*, S]] > 0`` (Z bounds ``N' S^-1 N``),
    ``C_k S C_k' < 1`` and, as a double sum, ``He(A_i S E_j') + 2 decay E_i S E_j' < 0``.

    Args:
        inertia: vertices E_i, (s, s) each.
        system: vertices A_i, (s, s) each.
        outputs: rows C_k, (k, s).
        directions: N, (s, m).
        decay: rate of decay of ``sqrt(x' S^-1 x)``.

    Returns:
        The problem and S.
    """
    S = Variable("S", len(system[0]), symmetric=True)
    Z = Variable("Z", directions.shape[1], symmetric=True)
    problem = Problem()

    def decrease(i: int, j: int) -> Expression:
        return he(system[i] @ S @ inertia[j].T) + (inertia[i] @ S @ inertia[j].T) * (2.0 * decay)

    double_sum(problem, "decrease", decrease, len(system))
    for k, row in enumerate(outputs):
        problem.positive(f"output {k}", identity(1) - row[None] @ S @ row[:, None])
    problem.positive("extent", block([[Z, directions.T], [None, S]]))
    problem.minimise(_trace(np.eye(directions.shape[1]), Z.expression))
    return problem, S


def _trace(directions: FloatArray, matrix: Expression) -> Expression:
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
        X = scipy.linalg.solve_discrete_lyapunov(shrunk, inputs / (1.0 - multiplier) + spare)
        return np.asarray((X + X.T) / 2.0)

    slowest = float(np.max(np.abs(np.linalg.eigvals(transition)))) ** 2
    found = _line_search(lambda x: (output @ least(x) @ output.T).item(), slowest, 1.0)
    spare = SPARE * np.diag(least(found).diagonal())
    return PeakSet(least(found, spare), found)


def _line_search(objective: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that tends to infinity at both ends of an interval is smallest."""
    options = {"xatol": 1e-4 * (high - low)}
    return float(scipy.optimize.minimize_scalar(objective, bounds=(low, high), method="bounded", options=options).x)
