"""Claims about sums over the vertices of two tables with the same weights."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.claims import Claim


def he(square: fmpq_mat) -> fmpq_mat:
    """``X + X'``."""
    return square + square.transpose()


def double_sum(name: str, entry: Callable[[int, int], fmpq_mat], count: int) -> Iterator[Claim]:
    """Claims that ``sum_ij w_i w_j X_ij < 0`` for all convex weights; X_ij + X_ji must be symmetric."""
    grid = [[entry(i, j) for j in range(count)] for i in range(count)]
    for i in range(count):
        yield Claim.positive(f"{name} {i} {i}", -grid[i][i])
        for j in range(count):
            if i != j:
                relaxed = fmpq(2, count - 1) * grid[i][i] + grid[i][j] + grid[j][i]
                yield Claim.positive(f"{name} {i} {j}", -relaxed)
