"""Inequalities and relaxations that several conditions share."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.lmi.exact import Matrix
from quasilpv.lmi.expressions import Operand, as_expression


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
) -> None:
    """Require ``sum_i w_i X_i < 0`` for all convex weights: ``X_i < 0``, or ``X_i + T_k(i) - mean < 0`` with slack.

    Args:
        problem, name, count, slack_blocks: as in `double_sum`.
        entry: X_i; only its symmetric part matters.
    """
    entries = [entry(i) for i in range(count)]
    if slack_blocks is not None and len(set(slack_blocks)) > 1:
        slack = _zero_mean(f"T {name}", slack_blocks, entries[0].shape[0])
        entries = [X + T for X, T in zip(entries, slack, strict=True)]
    for i, X in enumerate(entries):
        problem.negative(f"{name} {i}", X)


def double_sum(
    problem: Problem,
    name: str,
    entry: Callable[[int, int], Expression],
    count: int,
    slack_blocks: npt.NDArray[np.intp] | None = None,
) -> None:
    """Require ``sum_ij w_i w_j X_ij < 0`` for all convex weights (Tuan et al. 2001, Theorem 2.2).

    ``X_ii < 0`` and ``2/(N-1) X_ii + X_ij + X_ji < 0`` for all ordered i != j; N vertices. With slack matrices
    ``T_k, S_k``, one pair per block k of a block polytope, X_ij is replaced by ``X_ij + T_k(i) + S_k(j) - mean``: the
    weights of a block sum to 1/G, so the addition has mean zero (Dehak 2022, Lemma II.1).

    Args:
        problem: receives the inequalities, named ``"<name> i j"``.
        name: of the family.
        entry: X_ij; only its symmetric part matters.
        count: N.
        slack_blocks: block of every vertex, or None for no slack (a single block has none: T - mean = 0).
    """
    grid = [[entry(i, j) for j in range(count)] for i in range(count)]
    if slack_blocks is not None and len(set(slack_blocks)) > 1:
        T, S = (_zero_mean(f"{letter} {name}", slack_blocks, grid[0][0].shape[0]) for letter in "TS")
        grid = [[grid[i][j] + T[i] + S[j] for j in range(count)] for i in range(count)]
    for i in range(count):
        problem.negative(f"{name} {i} {i}", grid[i][i])
        for j in range(count):
            if i != j:
                problem.negative(f"{name} {i} {j}", grid[i][i] * Fraction(2, count - 1) + grid[i][j] + grid[j][i])


def _zero_mean(name: str, blocks: npt.NDArray[np.intp], size: int) -> list[Expression]:
    """``T_k(i) - (1/G) sum_k T_k`` for every vertex i, one symmetric unknown T_k per block k."""
    groups = sorted(set(blocks.tolist()))
    T = {k: Variable(f"{name} {k}", size, symmetric=True).expression for k in groups}
    mean = sum((T[k] for k in groups), zeros(size, size)) * Fraction(-1, len(groups))
    return [T[k] + mean for k in blocks.tolist()]
