"""Equations of motion in double arithmetic, written out apart from the exact ones and from the models of designs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from quasilpv.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """A robot at K states.

    Attributes:
        inertia: M, (K, n, n).
        torque: ``N omega + G``, (K, n).
        scale: size of its terms, to compare errors with.
    """

    inertia: FloatArray
    torque: FloatArray
    scale: float


class RobotDynamics(Protocol):
    """What a sampled check and a grid gate need of a robot."""

    def motion(self, theta: FloatArray, omega: FloatArray) -> Motion:
        """The robot at K states, (K, n) each."""

    def stiffness(self, mass_scale: Sequence[float], com_scale: Sequence[float], theta: FloatArray) -> FloatArray:
        """Its torque at rest as ``H(theta) theta`` with these factors of a payload: H, (K, n, n)."""


@dataclass(frozen=True, eq=False)
class Planar:
    """A mechanism in a plane.

    In absolute angles ``alpha = S theta``, W = S omega: ``M = S' [D_kl cos(alpha_k - alpha_l)] S`` and the torque is
    ``S' (sum_l D_kl sin(alpha_k - alpha_l) W_l^2 + g_k sin(alpha_k)) + friction``.
    """

    S: FloatArray
    D: FloatArray
    g: FloatArray
    friction: FloatArray

    def motion(self, alpha: FloatArray, W: FloatArray, omega: FloatArray) -> Motion:
        """At K states, (K, n): absolute angles, their speeds and the speeds of the joints."""
        S, D = self.S, self.D
        difference = alpha[:, :, None] - alpha[:, None, :]
        inertia = S.T @ (D * np.cos(difference)) @ S
        link_torque = np.einsum("kij,kj->ki", D * np.sin(difference), W**2) + self.g * np.sin(alpha)
        rubbing = self.friction * omega
        scale = float(np.abs(self.g).sum() + np.abs(D).sum() * (1.0 + (W**2).max()) + np.abs(rubbing).max())
        return Motion(inertia, link_torque @ S + rubbing, scale)


def planar_stiffness(S: FloatArray, g: FloatArray, alpha: FloatArray) -> FloatArray:
    """``S' [g_k sin(alpha_k)]`` as ``H theta`` at K configurations, given by absolute angles, (K, n): H, (K, n, n)."""
    sinc = np.sinc(alpha / np.pi)
    return np.asarray(np.einsum("ki,zk,kj->zij", S, g * sinc, S))
