"""A shape in which all quotients of two inertias are close to one multiple of the identity.

With ``X = M_t^-1 M_n``, the unknown ``Y = Y' > 0`` (n x n) is asked to satisfy, at every X given,

    r^2 Y - (X - c I) Y (X - c I)' > 0.

Then, with ``T' T = Y^-1``, every ``T X T^-1`` is within r of ``c I`` in the spectral norm, whichever X follows which:
what a common Lyapunov function of a moving robot needs (``docs/concepts/motion.md``). The eigenvalues of X are those of
``M_t^-1/2 M_n M_t^-1/2``, so ``|lambda - c| < r`` is necessary; as the X have no common eigenvectors it is not
sufficient.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from quasilpv.lmi import Problem, Variable
from quasilpv.lmi.exact import Matrix, to_rational


def disc_problem(quotients: npt.NDArray[np.float64], centre: float, radius: float) -> tuple[Problem, Variable]:
    """State the condition.

    Args:
        quotients: X, (N, n, n).
        centre: c.
        radius: r > 0.

    Returns:
        The homogeneous problem and Y.
    """
    n = quotients.shape[-1]
    Y = Variable("Y", n, symmetric=True)
    problem = Problem()
    problem.positive("Y", Y)
    for k, X in enumerate(quotients):
        deviation: Matrix = to_rational((X - centre * np.eye(n)).tolist())
        problem.positive(f"disc {k}", Y * Fraction(radius) ** 2 - deviation @ Y @ deviation.T)
    return problem, Y
