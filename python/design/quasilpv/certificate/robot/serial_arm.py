"""The planar serial arm, in exact arithmetic and in doubles.

S is the lower triangle of ones; with I_k about the joint axis

    D_kk = I_k + L_k^2 sum_{l>k} m_l,    D_kl = L_k (m_l r_l + L_l sum_{p>l} m_p)  for k < l
    h_k = m_k r_k + L_k sum_{l>k} m_l
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import diagonal, rational
from quasilpv.certificate.robot.dynamics import Motion, Planar, planar_stiffness
from quasilpv.certificate.robot.mechanism import LoadedLink, Polynomials
from quasilpv.documents.mechanism import SerialArm


@dataclass(frozen=True)
class SerialArmData:
    """A planar serial arm; a payload has one factor per link."""

    document: SerialArm

    @property
    def joints(self) -> int:
        """One per link."""
        return len(self.document.links)

    @property
    def absolute_map(self) -> fmpq_mat:
        """The lower triangle of ones."""
        n = self.joints
        return fmpq_mat(n, n, [int(j <= i) for i in range(n) for j in range(n)])

    def inertia(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Polynomials:
        """D of the module's formula."""
        links, outer = self.loaded(mass_scale, com_scale)
        moments = self.first_moments(mass_scale, com_scale)
        n = self.joints
        D = [[fmpq_poly([0])] * n for _ in range(n)]
        for k in range(n):
            D[k][k] = links[k].inertia + links[k].length ** 2 * outer[k]
            for j in range(k):
                D[j][k] = D[k][j] = links[j].length * moments[k]
        return D

    def first_moments(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[fmpq_poly]:
        """h of the module's formula."""
        links, outer = self.loaded(mass_scale, com_scale)
        return [link.first_moment + link.length * mass for link, mass in zip(links, outer, strict=True)]

    def loaded(
        self, mass_scale: Sequence[float], com_scale: Sequence[float]
    ) -> tuple[list[LoadedLink], list[fmpq_poly]]:
        """Links with their payload, and the mass beyond each of them; in the order of the links."""
        links = [LoadedLink.of(*factors) for factors in zip(self.document.links, mass_scale, com_scale, strict=True)]
        return links, [sum((link.mass for link in links[k + 1 :]), fmpq_poly([0])) for k in range(self.joints)]

    @property
    def gravity(self) -> fmpq:
        """Positive where theta = 0 hangs."""
        sign = 1 if self.document.equilibrium == "hanging" else -1
        return sign * rational(self.document.gravity_m_s2)

    @property
    def friction(self) -> fmpq_mat:
        """That of the joints."""
        return diagonal([rational(link.friction_nm_s) for link in self.document.links])


@dataclass(frozen=True)
class SerialArmDynamics:
    """The same arm in doubles, written out anew."""

    document: SerialArm

    @property
    def _sign(self) -> float:
        return 1.0 if self.document.equilibrium == "hanging" else -1.0

    def motion(self, theta: FloatArray, omega: FloatArray) -> Motion:
        """See `Planar`, at K states (K, n)."""
        links = self.document.links
        n = len(links)
        L, m, r, I, friction = (  # noqa: E741
            np.array([getattr(link, field) for link in links])
            for field in ("length_m", "mass_kg", "com_m", "inertia_kg_m2", "friction_nm_s")
        )
        outer = np.array([m[k + 1 :].sum() for k in range(n)])
        D = np.diag(I + L**2 * outer)
        for k in range(n):
            for j in range(k):
                D[j, k] = D[k, j] = L[j] * (m[k] * r[k] + L[k] * outer[k])
        g = self._sign * self.document.gravity_m_s2 * (m * r + L * outer)
        alpha, W = np.cumsum(theta, axis=1), np.cumsum(omega, axis=1)
        return Planar(np.tril(np.ones((n, n))), D, g, friction).motion(alpha, W, omega)

    def stiffness(self, mass_scale: Sequence[float], com_scale: Sequence[float], theta: FloatArray) -> FloatArray:
        """Gravity torque as ``H(theta) theta`` with these factors, at K configurations (K, n): H, (K, n, n)."""
        links = self.document.links
        masses = [link.mass_kg * scale for link, scale in zip(links, mass_scale, strict=True)]
        moments = [m * link.com_m * scale for m, link, scale in zip(masses, links, com_scale, strict=True)]
        outer = [sum(masses[k + 1 :]) for k in range(len(links))]
        g = self._sign * self.document.gravity_m_s2
        constants = [g * (h + link.length_m * m) for h, link, m in zip(moments, links, outer, strict=True)]
        S = np.tril(np.ones((len(links), len(links))))
        return planar_stiffness(S, np.array(constants), np.cumsum(theta, axis=1))
