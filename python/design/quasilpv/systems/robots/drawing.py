"""What a picture of a mechanism shows."""

from __future__ import annotations

from abc import ABC, abstractmethod

from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray


class Drawing(ABC):
    """A mechanism that can be drawn: in its plane, X to the right and Y up, or in space, Z up."""

    @abstractmethod
    def skeleton(self, theta: ArrayLike) -> FloatArray:
        """The links as one line from the base through the joints, points x 2 or points x 3, m."""

    @abstractmethod
    def tool_path(self, angles: FloatArray) -> FloatArray:
        """Where the tool is at joint angles (N, n): N x 2 or N x 3, m."""
