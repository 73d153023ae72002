"""Storages along a chain and one scalar, sought by a linear program over matrices sampled in the coordinates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.synthesis.chain_blocks import Block, minimise


class StorageProgram(ABC):
    """Inequalities ``F + sum_u x_u G_u > 0`` whose unknowns are a scalar, then upper triangles of storages.

    Args:
        sizes: of the storages, base to tip.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        """Know where each storage's unknowns are."""
        self._sizes = list(sizes)

    @abstractmethod
    def _stacked(self) -> list[Block]:
        """The inequalities on the present samples."""

    @property
    def unknowns(self) -> int:
        """The scalar and the storages."""
        return 1 + sum(s * (s + 1) // 2 for s in self._sizes)

    def _places(self, storage: int) -> slice:
        counts = [s * (s + 1) // 2 for s in self._sizes]
        start = 1 + sum(counts[:storage])
        return slice(start, start + counts[storage])

    def first_unknown(self, sign: float) -> float | None:
        """The scalar of least ``sign`` times itself; None if the solver has no answer."""
        cost = np.zeros(self.unknowns)
        cost[0] = sign
        x = minimise(cost, self._stacked())
        return None if x is None else float(x[0])

    def widest(self, first: float) -> tuple[FloatArray, float] | None:
        """Storages with the largest common margin where the first unknown is fixed, and that margin.

        Returns:
            None if the solver has no answer.
        """
        fixed = []
        for F, G in self._stacked():
            size = F.shape[-1]
            margin = np.broadcast_to(-np.eye(size), (len(F), 1, size, size))
            fixed.append((F + first * G[:, 0], np.concatenate([margin, G[:, 1:]], axis=1)))
        cost = np.zeros(self.unknowns)
        cost[0] = -1.0
        x = minimise(cost, fixed)
        return None if x is None else (x[1:], float(x[0]))
