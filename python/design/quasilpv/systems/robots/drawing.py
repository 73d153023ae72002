"""What a picture of a planar mechanism shows."""

from __future__ import annotations

from abc import ABC, abstractmethod

from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix


class Drawing(ABC):
    """A mechanism that can be drawn."""

    @abstractmethod
    def skeleton(self, theta: ArrayLike) -> Matrix:
        """The links as one line from the base through the joints, points x 2, m: what a drawing of the robot shows."""
