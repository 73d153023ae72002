"""Rigid bodies and frames in space: inertias of ten parameters, placements, and how twists change with the frame.

A twist is ``v = (linear; angular)``, the velocity of the frame's origin and the angular velocity, both in the frame's
own axes (Featherstone 2008, with the two halves exchanged, as in Pinocchio).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError

ROTATION_TOLERANCE = 1e-9
"""How far R R' may be from the identity: descriptions print angles with few digits, but not rotation matrices."""


def cross_matrix(vector: ArrayLike) -> FloatArray:
    """``[a]`` with ``[a] b = a x b``, for vectors (..., 3), as (..., 3, 3)."""
    a = np.asarray(vector, dtype=float)
    matrix = np.zeros((*a.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return matrix


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame is in another one: a point with coordinates p has the coordinates ``R p + t`` there.

    Attributes:
        rotation: R, 3 x 3.
        translation_m: t, 3.

    Raises:
        InputError: R is no rotation, or a number is not finite.
    """

    rotation: FloatArray
    translation_m: FloatArray

    def __post_init__(self) -> None:
        """Refuse what is no placement."""
        rotation = np.array(self.rotation, dtype=float).reshape(3, 3)
        translation = np.array(self.translation_m, dtype=float).reshape(3)
        if not (np.all(np.isfinite(rotation)) and np.all(np.isfinite(translation))):
            raise InputError("placement", "entries", "one that is not finite", "finite numbers")
        distance = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if distance > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
            raise InputError("placement", "rotation", f"R R' - I of size {distance:.1e}", "a rotation matrix")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation_m", translation)

    @classmethod
    def identity(cls) -> Placement:
        """The frame itself."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def turned(cls, axis: ArrayLike, angle_rad: float) -> Placement:
        """Turned about an axis through the origin (Rodrigues 1840)."""
        K = cross_matrix(axis)
        return cls(np.eye(3) + np.sin(angle_rad) * K + (1.0 - np.cos(angle_rad)) * K @ K, np.zeros(3))

    def then(self, inner: Placement) -> Placement:
        """The placement of a frame that is placed by `inner` in this one."""
        return Placement(self.rotation @ inner.rotation, self.translation_m + self.rotation @ inner.translation_m)

    @cached_property
    def motion_matrix(self) -> FloatArray:
        """X, 6 x 6: from the twist of a body in the outer frame to its twist in the placed frame.

        ``linear' = R' (linear + angular x t)``, ``angular' = R' angular``.
        """
        Rt = self.rotation.T
        return np.block([[Rt, -Rt @ cross_matrix(self.translation_m)], [np.zeros((3, 3)), Rt]])


@dataclass(frozen=True, eq=False)
class SpatialInertia:
    """A rigid body about a frame, by its ten parameters: what its kinetic energy is linear in.

    Attributes:
        mass_kg: m.
        first_moment_kg_m: h = m c, c the centre of mass.
        rotational_kg_m2: I about the frame's *origin*, 3 x 3 symmetric.

    Raises:
        InputError: a number is not finite, or I is not symmetric. Whether the numbers can belong to a body is asked by
            `least_eigenvalue` and `triangle_excess`.
    """

    mass_kg: float
    first_moment_kg_m: FloatArray
    rotational_kg_m2: FloatArray

    def __post_init__(self) -> None:
        """Refuse numbers that are none, and a moment of inertia that is no symmetric matrix."""
        first = np.array(self.first_moment_kg_m, dtype=float).reshape(3)
        rotational = np.array(self.rotational_kg_m2, dtype=float).reshape(3, 3)
        if not (isfinite(self.mass_kg) and np.all(np.isfinite(first)) and np.all(np.isfinite(rotational))):
            raise InputError("inertia", "entries", "one that is not finite", "finite numbers")
        if np.abs(rotational - rotational.T).max() > 1e-12 * max(np.abs(rotational).max(), 1e-300):
            raise InputError("inertia", "rotational_kg_m2", "a matrix that is not symmetric", "a symmetric matrix")
        object.__setattr__(self, "first_moment_kg_m", first)
        object.__setattr__(self, "rotational_kg_m2", (rotational + rotational.T) / 2.0)

    @classmethod
    def zero(cls) -> SpatialInertia:
        """No body."""
        return cls(0.0, np.zeros(3), np.zeros((3, 3)))

    @classmethod
    def about_com(cls, mass_kg: float, com_m: ArrayLike, rotational_kg_m2: ArrayLike) -> SpatialInertia:
        """From the moment of inertia about the *centre of mass*, in the axes of the frame (Steiner's theorem)."""
        com = np.asarray(com_m, dtype=float)
        C = cross_matrix(com)
        return cls(mass_kg, mass_kg * com, np.asarray(rotational_kg_m2, dtype=float) - mass_kg * C @ C)

    @property
    def com_m(self) -> FloatArray:
        """Centre of mass; the origin for a body without mass."""
        return self.first_moment_kg_m / self.mass_kg if self.mass_kg else np.zeros(3)

    @property
    def about_its_com_kg_m2(self) -> FloatArray:
        """Moment of inertia about the centre of mass, in the axes of the frame."""
        C = cross_matrix(self.com_m)
        return self.rotational_kg_m2 + self.mass_kg * C @ C

    @cached_property
    def matrix(self) -> FloatArray:
        """6 x 6 with kinetic energy ``1/2 v' M v``."""
        H = cross_matrix(self.first_moment_kg_m)
        return np.block([[self.mass_kg * np.eye(3), -H], [H, self.rotational_kg_m2]])

    @property
    def least_eigenvalue(self) -> float:
        """Smallest eigenvalue of the 6 x 6 matrix: negative for numbers that are no body."""
        return float(np.linalg.eigvalsh(self.matrix)[0])

    @property
    def triangle_excess(self) -> float:
        """By how much the largest principal moment about the centre of mass exceeds the sum of the other two, kg m^2.

        Positive for numbers that no distribution of mass has.
        """
        small, middle, large = np.linalg.eigvalsh(self.about_its_com_kg_m2)
        return float(large - small - middle)

    @property
    def radius_of_gyration_m(self) -> float:
        """Largest ``sqrt(I/m)`` about the centre of mass: a body that is no larger than r has at most r."""
        largest = float(np.linalg.eigvalsh(self.about_its_com_kg_m2)[-1])
        return float(np.sqrt(max(largest, 0.0) / self.mass_kg)) if self.mass_kg > 0.0 else 0.0

    def scaled(self, factor: float) -> SpatialInertia:
        """All ten parameters times a factor."""
        return SpatialInertia(self.mass_kg * factor, self.first_moment_kg_m * factor, self.rotational_kg_m2 * factor)

    def plus(self, other: SpatialInertia) -> SpatialInertia:
        """Both bodies as one, about the same frame."""
        return SpatialInertia(
            self.mass_kg + other.mass_kg,
            self.first_moment_kg_m + other.first_moment_kg_m,
            self.rotational_kg_m2 + other.rotational_kg_m2,
        )

    def seen_from(self, placement: Placement) -> SpatialInertia:
        """The same body about the outer frame of a placement."""
        R, t = placement.rotation, placement.translation_m
        com = R @ self.com_m + t
        rotational = R @ self.about_its_com_kg_m2 @ R.T
        if self.mass_kg == 0.0:
            return SpatialInertia(0.0, R @ self.first_moment_kg_m, R @ self.rotational_kg_m2 @ R.T)
        return SpatialInertia.about_com(self.mass_kg, com, (rotational + rotational.T) / 2.0)
