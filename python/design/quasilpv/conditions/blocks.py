"""Inequalities and relaxations that several conditions share."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.lmi.exact import Matrix
from quasilpv.lmi.expressions import Operand, as_expression


class Slack(StrEnum):
    """Which slack matrices a sum over vertices is given: additions whose weighted mean is zero by construction.

    The weights of every block of a block polytope sum to 1/G, so ``sum_i w_i (T_b(i) - (1/G) sum_b T_b) = 0`` whatever
    the T_b. In a double sum T may depend on the other index.
    """

    NONE = "none"
    THESIS = "thesis"
    """One T_b and one S_b per block b: ``X_ij + T_b(i) + S_b(j) - mean`` (Dehak 2022, Lemma II.1)."""
    FULL = "full"
    """One T_i,b per vertex i and block b: ``X_ij + T_i,b(j) - (1/G) sum_b T_i,b``, a larger family."""


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
    slacks: tuple[Variable, ...] = ()
    if slack_blocks is not None and len(set(slack_blocks)) > 1:
        slack, slacks = _zero_mean(f"T {name}", slack_blocks, entries[0].shape[0])
        entries = [X + T for X, T in zip(entries, slack, strict=True)]
    for i, X in enumerate(entries):
        problem.negative(f"{name} {i}", X)
    return slacks


def double_sum(
    problem: Problem,
    name: str,
    entry: Callable[[int, int], Expression],
    count: int,
    slack_blocks: npt.NDArray[np.intp] | None = None,
    *,
    slack: Slack = Slack.THESIS,
) -> tuple[Variable, ...]:
    """Require ``sum_ij w_i w_j X_ij < 0`` for all convex weights (Tuan et al. 2001, Theorem 2.2).

    ``X_ii < 0`` and ``2/(N-1) X_ii + X_ij + X_ji < 0`` for all ordered i != j; N vertices. Slack matrices are added to
    X_ij first, see `Slack`.

    Args:
        problem: receives the inequalities, named ``"<name> i j"``.
        name: of the family.
        entry: X_ij; only its symmetric part matters.
        count: N.
        slack_blocks: block of every vertex, or None for no slack (a single block has none: T - mean = 0).
        slack: which family.

    Returns:
        The slack matrices.
    """
    grid = [[entry(i, j) for j in range(count)] for i in range(count)]
    slacks: tuple[Variable, ...] = ()
    if slack_blocks is not None and len(set(slack_blocks)) > 1 and slack is not Slack.NONE:
        shift, slacks = _double_slack(name, slack_blocks, grid[0][0].shape[0], slack)
        grid = [[grid[i][j] + shift(i, j) for j in range(count)] for i in range(count)]
    for i in range(count):
        problem.negative(f"{name} {i} {i}", grid[i][i])
        for j in range(count):
            if i != j:
                problem.negative(f"{name} {i} {j}", grid[i][i] * Fraction(2, count - 1) + grid[i][j] + grid[j][i])
    return slacks


def _double_slack(
    name: str, blocks: npt.NDArray[np.intp], size: int, slack: Slack
) -> tuple[Callable[[int, int], Expression], tuple[Variable, ...]]:
    """The addition to X_ij, and its unknowns."""
    if slack is Slack.THESIS:
        (T, ofT), (S, ofS) = (_zero_mean(f"{letter} {name}", blocks, size) for letter in "TS")
        return lambda i, j: T[i] + S[j], ofT + ofS
    rows = [_zero_mean(f"T {name} {i}", blocks, size) for i in range(len(blocks))]
    return lambda i, j: rows[i][0][j], tuple(variable for _, row in rows for variable in row)


def _zero_mean(name: str, blocks: npt.NDArray[np.intp], size: int) -> tuple[list[Expression], tuple[Variable, ...]]:
    """``T_b(i) - (1/G) sum_b T_b`` for every vertex i, and the symmetric unknowns T_b, one per block b."""
    groups = sorted(set(blocks.tolist()))
    T = {b: Variable(f"{name} {b}", size, symmetric=True) for b in groups}
    mean = sum((variable.expression for variable in T.values()), zeros(size, size)) * Fraction(-1, len(groups))
    return [T[b] + mean for b in blocks.tolist()], tuple(T.values())
