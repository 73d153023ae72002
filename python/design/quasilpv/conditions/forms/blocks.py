"""Inequalities and relaxations that several conditions share."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import product

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.forms.slack import Slack, slack_family
from quasilpv.lmi import Expression, Problem, Variable, block, budget, zeros
from quasilpv.lmi.budget import TooLargeError
from quasilpv.lmi.exact import Matrix
from quasilpv.lmi.expressions import Operand, as_expression

__all__ = ["Slack", "block_diagonal", "double_sum", "identity_blocks", "pole_disk", "single_sum"]

MAX_INEQUALITIES = 20_000
"""Of one multiple sum."""


def pole_disk(lyapunov: Operand, product: Operand, centre: Fraction, radius: Fraction) -> Expression:
    """Positive if and only if the poles lie in the open disk ``|z - centre| < radius``.

    ``[[r P, (X - c P)'], [X - c P, r P]] > 0`` with ``X = A P`` (or ``X = Q A`` in observer form): the Lyapunov
    inequality of ``(A - c I) / r`` (Chilali and Gahinet 1996, LMI regions).

    Args:
        lyapunov: ``P`` or ``Q``, n x n symmetric.
        product: ``X``, n x n, affine in the unknowns.
        centre: c, on the real axis.
        radius: r > 0.
    """
    matrix = as_expression(lyapunov)
    shifted = as_expression(product) - matrix * centre
    return block([[matrix * radius, None], [shifted, matrix * radius]])


def identity_blocks(size: int) -> tuple[Matrix, Matrix]:
    """The exact identity and zero matrices of one size, the bricks of constant matrices."""
    return np.eye(size, dtype=int).astype(object), np.zeros((size, size), dtype=int).astype(object)


def block_diagonal(*blocks: Matrix) -> Matrix:
    """Constant block-diagonal matrix; exact when the blocks are."""
    grid: list[list[Operand | None]] = [
        [across if i == j else zeros(len(down), across.shape[1]) for j, across in enumerate(blocks)]
        for i, down in enumerate(blocks)
    ]
    return block(grid).constant


def single_sum(
    problem: Problem,
    name: str,
    entry: Callable[[int], Expression],
    count: int,
    slack_blocks: npt.NDArray[np.intp] | None = None,
) -> tuple[Variable, ...]:
    """Require ``sum_i w_i X_i < 0`` for all convex weights: ``X_i < 0``, or ``X_i + T_b(i) - mean < 0`` with slack.

    Args:
        problem, name, count, slack_blocks: as in `double_sum`.
        entry: X_i; only its symmetric part matters.

    Returns:
        The slack matrices.
    """
    entries = [entry(i) for i in range(count)]
    slack = slack_family(Slack.THESIS, name, slack_blocks, entries[0].shape[0], sums=1)
    for i, X in enumerate(entries):
        problem.negative(f"{name} {i}", X + slack.at((i,)))
    return slack.variables


def require_affordable(count: int, sums: int) -> None:
    """Refuse a multiple sum that would take longer to write down than anybody waits.

    Args:
        count: number of vertices.
        sums: how many sums over them.

    Raises:
        TooLargeError: there would be more than `MAX_INEQUALITIES`.
    """
    if count**sums > MAX_INEQUALITIES:
        expected = f"at most {MAX_INEQUALITIES}: a representation of fewer vertices"
        raise TooLargeError("condition", "inequalities", f"{count**sums} on {count} vertices", expected)


def double_sum(
    problem: Problem,
    name: str,
    entry: Callable[..., Expression],
    count: int,
    slack_blocks: npt.NDArray[np.intp] | None = None,
    *,
    slack: Slack = Slack.THESIS,
    others: int = 0,
) -> tuple[Variable, ...]:
    """Require ``sum_ij w_i w_j X_ij < 0`` for all convex weights (Tuan et al. 2001, Theorem 2.2).

    ``X_ii < 0`` and ``2/(N-1) X_ii + X_ij + X_ji < 0`` for all ordered i != j; N vertices. Slack matrices are added to
    X_ij first, see `Slack`.

    Args:
        problem: receives the inequalities, named ``"<name> i j"``.
        name: of the family.
        entry: X_ij; only its symmetric part matters. With `others` it has that many more indices.
        count: N.
        slack_blocks: block of every vertex, or None for no slack (a single block has none: T - mean = 0).
        slack: which family.
        others: number of further sums over the same vertices, each with weights of its own: the inequalities are
            required for all values of their indices.

    Returns:
        The slack matrices.

    Raises:
        TooLargeError: there would be more than `MAX_INEQUALITIES`, or their cones alone exceed the memory limit.
    """
    require_affordable(count, 2 + others)
    size = entry(*(0,) * (2 + others)).shape[0]
    budget.require_cones(count ** (2 + others), size)
    shift = slack_family(slack, name, slack_blocks, size, sums=2 + others)
    own = Fraction(2, max(count - 1, 1))
    for rest in product(range(count), repeat=others):
        grid = [[entry(i, j, *rest) for j in range(count)] for i in range(count)]
        label = " ".join(map(str, rest))
        for i in range(count):
            problem.negative(f"{name} {i} {i} {label}".rstrip(), grid[i][i] + shift.at((i, i, *rest)))
            diagonal = grid[i][i] * own
            for j in range(count):
                if i != j:
                    added = shift.sum({(i, i, *rest): own, (i, j, *rest): Fraction(1), (j, i, *rest): Fraction(1)})
                    tuan = diagonal + grid[i][j] + grid[j][i]
                    problem.negative(f"{name} {i} {j} {label}".rstrip(), tuan + added)
    return shift.variables
