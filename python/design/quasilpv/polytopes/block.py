"""A group of premises with vertices of its own: a box or a simplex around the group's sub-box."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Block:
    """A group of premises with vertices of its own.

    Attributes:
        kind: ``"box"`` (2^g vertices), ``"simplex"`` around the box (g + 1 vertices) or ``"memberships"`` (g + 1
            vertices): the part of the box where the sector coordinates sum to at most 1, for premises that are the
            weights of all rules of a Takagi-Sugeno model but one.
        premises: indices of its premises, in the order of the vertex bits.
    """

    kind: Literal["box", "simplex", "memberships"]
    premises: tuple[int, ...]

    @property
    def vertices(self) -> int:
        """Number of vertices."""
        return 2 ** len(self.premises) if self.kind == "box" else len(self.premises) + 1

    def corners(self) -> NDArray[np.float64]:
        """Vertices in sector coordinates omega (0 at the lower bound, 1 at the upper), shape (vertices, g)."""
        g = len(self.premises)
        if self.kind == "box":
            return np.array(list(product((0.0, 1.0), repeat=g))).reshape(self.vertices, g)
        if self.kind == "memberships":
            return np.vstack([np.eye(g), np.zeros((1, g))])
        # Corners 1, 2, 3, 7, ... of Lemma I.6: all lower; only the first premise upper; premises 2 ... k upper.
        corners = np.zeros((g + 1, g))
        corners[1, 0] = 1.0
        for k in range(2, g + 1):
            corners[k, 1:k] = 1.0
        # Theorem I.4 stretches them around all but corners 2 and 2^g - 1, which makes the weights non-negative.
        kept = np.delete(corners, (1, g), axis=0)
        stretched: NDArray[np.float64] = g * corners - kept.sum(axis=0)
        return stretched

    def weights(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Barycentric weights, summing to 1, of sector coordinates (..., g): shape (..., vertices)."""
        g = len(self.premises)
        if self.kind == "memberships":
            return np.concatenate((omega, 1.0 - omega.sum(axis=-1, keepdims=True)), axis=-1)
        if self.kind == "simplex":
            if g == 1:
                return np.concatenate((1.0 - omega, omega), axis=-1)
            first = 2.0 - omega[..., :1] - omega[..., 1:2]
            middle = 1.0 + omega[..., 1:-1] - omega[..., 2:]
            return np.concatenate((first, omega[..., :1], middle, omega[..., -1:]), axis=-1) / g
        weights = np.ones((*omega.shape[:-1], 1))
        for p in range(g):
            sector = np.stack((1.0 - omega[..., p], omega[..., p]), axis=-1)
            weights = (weights[..., :, None] * sector[..., None, :]).reshape(*omega.shape[:-1], -1)
        return weights
