"""A Lyapunov function that decreases for every sequence of gains in a disc, at every constant delay up to the longest.

One sample of a loop is ``s+ = (A + b delta k) s`` with an unknown number delta, |delta| <= r, another one at every
sample. A and b depend on the share u in [0, 1] of the longest delay and are quadratic in it; k does not. Unknown are
``P(u) = (1 - u) P_0 + u P_1`` and a multiplier t, and asked for is, at every u,

    [ P - t k'k      0      A'P ]
    [     0       t / r^2   b'P ]  >  0.
    [    P A        P b      P  ]

By Schur's complement and the S-procedure ``V(s) = s' P s`` then decreases at every s other than 0. The matrix is a
cubic polynomial of u; that its four Bernstein coefficients on [0, 1] are positive definite is asked for, and enough.

Source: Boyd, El Ghaoui, Feron, Balakrishnan (1994), *Linear Matrix Inequalities in System and Control Theory*, section
5.1 (in continuous time); Farouki (2012), *The Bernstein polynomial basis* (products and degree elevation).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.lmi import Problem, Variable, block, to_rational, zeros
from quasilpv.lmi.exact import Matrix

DEGREE = 3
"""Of the inequality in the share of the delay."""


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """The loop of one gain; what depends on the delay by its three Bernstein coefficients on [0, 1].

    Attributes:
        transition: A_l, (3, m, m).
        drive: b_l, (3, m, 1).
        output: k, (1, m).
    """

    transition: FloatArray
    drive: FloatArray
    output: FloatArray

    def in_coordinates(self, change: FloatArray) -> DelayedLoop:
        """The loop of the signals ``change s``."""
        back = np.linalg.inv(change)
        return DelayedLoop(change @ self.transition @ back, change @ self.drive, self.output @ back)


@dataclass(frozen=True, eq=False)
class CommonLyapunovProblem:
    """The inequalities of a loop, homogeneous in their unknowns.

    Attributes:
        no_delay, longest_delay: P_0 and P_1.
        multiplier: t.
        problem: the inequalities.
    """

    no_delay: Variable
    longest_delay: Variable
    multiplier: Variable
    problem: Problem


def common_lyapunov_problem(loop: DelayedLoop, radius: float) -> CommonLyapunovProblem:
    """State the condition.

    Args:
        loop: of one gain.
        radius: r > 0.
    """
    size = loop.output.shape[1]
    P_0, P_1 = Variable("P_0", size, symmetric=True), Variable("P_1", size, symmetric=True)
    t = Variable("t", 1)
    k = to_rational(loop.output.tolist())
    one = np.broadcast_to(np.eye(size), loop.transition.shape)
    factors = [_factors(parts) for parts in (one, loop.transition, loop.drive)]
    problem = Problem()
    for j in range(DEGREE + 1):
        P, PA, Pb = (P_0 @ first[j] + P_1 @ second[j] for first, second in factors)
        corner = t * (1 / Fraction(radius) ** 2)
        inequality = [[P - k.T @ t @ k, zeros(size, 1), PA.T], [None, corner, Pb.T], [None, None, P]]
        problem.positive(f"decrease {j}", block(inequality))
    return CommonLyapunovProblem(P_0, P_1, t, problem)


def _factors(parts: FloatArray) -> tuple[list[Matrix], list[Matrix]]:
    """What P_0 and P_1 are multiplied with in the cubic ``P(u) A(u)``, A by its three coefficients."""
    A = [to_rational(part.tolist()) for part in parts]
    none, third = 0 * A[0], Fraction(1, 3)
    return [A[0], 2 * third * A[1], third * A[2], none], [none, third * A[0], 2 * third * A[1], A[2]]
