"""The five-bar linkage with equal links, in exact arithmetic and in doubles.

Links of length a, active and passive ones of masses m_a, m_b: a rhombus whose passive links are parallel to the
opposite active ones. S is the identity;

    D_kk = I_a + m_b a^2 + I_b,    D_12 = 2 m_b r_b a,    h_k = m_a r_a + m_b a + m_b r_b
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import diagonal, identity, rational
from quasilpv.certificate.robot.dynamics import Motion, Planar, planar_stiffness
from quasilpv.certificate.robot.mechanism import LoadedLink, Polynomials
from quasilpv.documents.mechanism import FiveBar
from quasilpv.errors import InputError


@dataclass(frozen=True)
class FiveBarData:
    """A five-bar linkage with equal links; a payload has one factor for either kind of link.

    Raises:
        InputError: links of different lengths, whose reduced inertia is not affine in a cosine, or friction of elbows.
    """

    document: FiveBar

    def __post_init__(self) -> None:
        """Refuse other linkages."""
        lengths = self.document.active.length_m, self.document.passive.length_m
        if lengths[0] != lengths[1]:
            raise InputError("five-bar", "length_m", f"{lengths[0]} and {lengths[1]}", "links of one length")
        if self.document.passive.friction_nm_s != 0.0:
            raise InputError("five-bar", "passive.friction_nm_s", self.document.passive.friction_nm_s, "0")

    @property
    def joints(self) -> int:
        """Two motors."""
        return 2

    @property
    def absolute_map(self) -> fmpq_mat:
        """The identity."""
        return identity(2)

    def inertia(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Polynomials:
        """D of the module's formula."""
        active, passive = self._loaded(mass_scale, com_scale)
        own = active.inertia + passive.mass * active.length**2 + passive.inertia
        shared = 2 * active.length * passive.first_moment
        return [[own, shared], [shared, own]]

    def first_moments(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[fmpq_poly]:
        """h of the module's formula."""
        active, passive = self._loaded(mass_scale, com_scale)
        return [active.first_moment + passive.mass * active.length + passive.first_moment] * 2

    def _loaded(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> tuple[LoadedLink, LoadedLink]:
        links = zip((self.document.active, self.document.passive), mass_scale, com_scale, strict=True)
        active, passive = (LoadedLink.of(*factors) for factors in links)
        return active, passive

    @property
    def gravity(self) -> fmpq:
        """Angles count from the downward vertical."""
        return rational(self.document.gravity_m_s2)

    @property
    def friction(self) -> fmpq_mat:
        """That of the motor axes."""
        return diagonal([rational(self.document.active.friction_nm_s)] * 2)


@dataclass(frozen=True)
class FiveBarDynamics:
    """The same linkage in doubles, written out anew."""

    document: FiveBar

    def motion(self, theta: FloatArray, omega: FloatArray) -> Motion:
        """See `Planar`, at K states (K, 2)."""
        a, b = self.document.active, self.document.passive
        own = a.inertia_kg_m2 + b.mass_kg * a.length_m**2 + b.inertia_kg_m2
        shared = 2.0 * b.mass_kg * b.com_m * a.length_m
        g = self.document.gravity_m_s2 * (a.mass_kg * a.com_m + b.mass_kg * (a.length_m + b.com_m))
        D = np.array([[own, shared], [shared, own]])
        return Planar(np.eye(2), D, np.full(2, g), np.full(2, a.friction_nm_s)).motion(theta, omega, omega)

    def stiffness(self, mass_scale: Sequence[float], com_scale: Sequence[float], theta: FloatArray) -> FloatArray:
        """Gravity torque as ``H(theta) theta`` with these factors, at K configurations (K, 2): H, (K, 2, 2)."""
        a, b = self.document.active, self.document.passive
        moment = a.mass_kg * mass_scale[0] * a.com_m * com_scale[0]
        moment += b.mass_kg * mass_scale[1] * (a.length_m + b.com_m * com_scale[1])
        return planar_stiffness(np.eye(2), np.full(2, self.document.gravity_m_s2 * moment), theta)
