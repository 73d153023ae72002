"""The disc that rolls on a spring, in exact arithmetic and in doubles.

Mass M, radius r, its angle the one joint, its moment of inertia J scaled by ``mass_scale``:

    D = J (1 + f (mass_scale - 1)) + M r^2,    h = 0
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import diagonal, identity, rational
from quasilpv.certificate.robot.dynamics import Motion
from quasilpv.certificate.robot.mechanism import Polynomials
from quasilpv.documents.mechanism import SpringDisc


@dataclass(frozen=True)
class SpringDiscData:
    """A disc that rolls on a line; what a payload scales is its moment of inertia."""

    document: SpringDisc

    @property
    def joints(self) -> int:
        """The disc."""
        return 1

    @property
    def absolute_map(self) -> fmpq_mat:
        """The identity."""
        return identity(1)

    def inertia(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Polynomials:
        """D of the module's formula."""
        J = rational(self.document.inertia_kg_m2) * fmpq_poly([1, rational(mass_scale[0]) - 1])
        return [[J + rational(self.document.mass_kg) * rational(self.document.radius_m) ** 2]]

    def first_moments(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[fmpq_poly]:
        """Zero: it rolls on the level."""
        return [fmpq_poly([0])]

    @property
    def gravity(self) -> None:
        """Its torque at rest is that of its spring."""
        return None

    @property
    def friction(self) -> fmpq_mat:
        """b r^2."""
        return diagonal([rational(self.document.damping_n_s_m) * rational(self.document.radius_m) ** 2])


@dataclass(frozen=True)
class SpringDiscDynamics:
    """The same disc in doubles: ``(J + M r^2) theta'' + b r^2 theta' + r F(r theta) = u``, F = k_1 x + k_2 x^3."""

    document: SpringDisc

    def motion(self, theta: FloatArray, omega: FloatArray) -> Motion:
        """Inertia, torque and the size of its terms at K states (K, 1)."""
        r, b = self.document.radius_m, self.document.damping_n_s_m
        inertia = self.document.inertia_kg_m2 + self.document.mass_kg * r**2
        spring = self._spring(theta) * theta
        damping = b * r**2 * omega
        scale = float(np.abs(spring).max() + np.abs(damping).max() + inertia)
        return Motion(np.full((len(theta), 1, 1), inertia), spring + damping, scale)

    def stiffness(self, mass_scale: Sequence[float], com_scale: Sequence[float], theta: FloatArray) -> FloatArray:
        """Torque of the spring as ``H(theta) theta``, which no payload changes, at K configurations (K, 1)."""
        return self._spring(theta)[:, :, None]

    def _spring(self, theta: FloatArray) -> FloatArray:
        """``r^2 (k_1 + k_2 (r theta)^2)``, N m/rad."""
        r = self.document.radius_m
        cubic = self.document.cubic_stiffness_n_m3 * (r * theta) ** 2
        return np.asarray(r**2 * (self.document.stiffness_n_m + cubic))
