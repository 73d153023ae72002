"""How the tool of a planar mechanism moves with its joints."""

from __future__ import annotations

from abc import ABC, abstractmethod

from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix, Vector


class ToolKinematics(ABC):
    """Pose, Jacobian and their inverses.

    Frames: X to the right, Y up; angles are positive counter-clockwise.
    """

    @abstractmethod
    def forward_kinematics(self, theta: ArrayLike) -> Vector:
        """Tool pose: (X, Y) in metres, the orientation Phi in rad if the tool has one of its own, then the posture."""

    @property
    def posture(self) -> tuple[float, ...]:
        """Values at which this mechanism keeps the pose coordinates that no path states.

        A mechanism with more joints than its tool has coordinates adds functions of its angles to the pose, as many as
        it has joints to spare, and uses the spare joints to keep them constant (Baillieul 1985).
        """
        return ()

    @abstractmethod
    def inverse_kinematics(self, pose: ArrayLike) -> Vector:
        """Joint angles that put the tool at a pose. InputError: out of reach, or singular."""

    @abstractmethod
    def jacobian(self, theta: ArrayLike) -> Matrix:
        """Tool Jacobian J, one row per pose coordinate."""

    @abstractmethod
    def jacobian_rate_times_speed(self, theta: ArrayLike, omega: ArrayLike) -> Vector:
        """The velocity part of the tool acceleration, (dJ/dt) omega."""

    @abstractmethod
    def singularity(self, theta: ArrayLike) -> tuple[str, float]:
        """A quantity in [0, 1] that vanishes at singular configurations, with its name."""
