"""The size of a positive definite matrix as linear matrix inequalities: a lower bound of ``det(P)^(1/n)``.

``[P Z; Z' diag Z] > 0`` with Z lower triangular gives ``det P > prod Z_kk`` (Ben-Tal and Nemirovski 2001, section
4.2), and a tree of ``[a t; t b] > 0`` the geometric mean of the Z_kk. The volume of ``x' P^-1 x <= 1`` is proportional
to ``det(P)^(1/2)``. Logarithms would need another cone, and the trace measures the longest axis instead of the volume.
"""

from __future__ import annotations

import numpy as np

from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.lmi.expressions import as_expression


def geometric_mean_of_eigenvalues(problem: Problem, P: Variable) -> Expression:
    """An unknown below ``det(P)^(1/n)``, 1 x 1, to be maximised; its inequalities are added to the problem."""
    n = P.rows
    entries = {(i, j): Variable(f"Z {i} {j}", 1) for i in range(n) for j in range(i + 1)}
    Z, diagonal = zeros(n, n), zeros(n, n)
    for (i, j), entry in entries.items():
        place = np.zeros((n, n), dtype=int).astype(object)
        place[i, j] = 1
        Z = Z + entry * place
        if i == j:
            diagonal = diagonal + entry * place
    problem.positive("volume", block([[as_expression(P), Z], [Z.T, diagonal]]))
    root = Variable("root", 1)
    _means(problem, [as_expression(entries[k, k]) for k in range(n)], as_expression(root))
    return as_expression(root)


def _means(problem: Problem, leaves: list[Expression], root: Expression) -> None:
    """Require ``root <= (product of the leaves)^(1/n)``: leaves are filled up with the root to a power of two."""
    level = leaves + [root] * ((1 << (len(leaves) - 1).bit_length()) - len(leaves))
    depth = 0
    while len(level) > 1:
        pairs = list(zip(level[::2], level[1::2], strict=True))
        means = [
            root if len(pairs) == 1 else as_expression(Variable(f"mean {depth} {k}", 1)) for k in range(len(pairs))
        ]
        for k, ((left, right), mean) in enumerate(zip(pairs, means, strict=True)):
            problem.positive(f"mean {depth} {k}", block([[left, mean], [mean, right]]))
        level, depth = means, depth + 1
    if len(leaves) == 1:
        problem.positive("mean", leaves[0] - root)
