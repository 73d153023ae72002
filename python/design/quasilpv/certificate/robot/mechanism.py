"""The robots a gate knows, as exact data: inertia and first moments with a payload, and what their joint angles mean.

The n joint angles theta determine n absolute angles ``alpha = S theta`` (S of zeros and ones), in which the inertia is
``M = S' [D_kl cos(alpha_k - alpha_l)] S`` and the gravity torque ``S' [g h_k sin(alpha_k)]``, g gravity. At payload
fraction f a link has mass ``m (1 + f (mass_scale - 1))``, centre of mass ``r (1 + f (com_scale - 1))`` and its nominal
moment of inertia about the centre of mass, so that D is a cubic polynomial of f. Each kind has a file of this folder
with its formulas, exact and in doubles, and a line in `registry`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.certificate.exact.matrices import rational
from quasilpv.documents.mechanism import LinkParameters

Polynomials = list[list[fmpq_poly]]


@dataclass(frozen=True)
class LoadedLink:
    """A link with its payload: polynomials in the payload fraction."""

    length: fmpq
    mass: fmpq_poly
    first_moment: fmpq_poly
    inertia: fmpq_poly

    @classmethod
    def of(cls, link: LinkParameters, mass_scale: float, com_scale: float) -> LoadedLink:
        """A link whose mass and centre of mass reach these factors at payload fraction 1."""
        m, r = rational(link.mass_kg), rational(link.com_m)
        mass = m * fmpq_poly([1, rational(mass_scale) - 1])
        com = r * fmpq_poly([1, rational(com_scale) - 1])
        inertia = rational(link.inertia_kg_m2) - m * r**2 + mass * com**2
        return cls(rational(link.length_m), mass, mass * com, inertia)


class MechanismData(Protocol):
    """What the gates need of a robot."""

    @property
    def joints(self) -> int:
        """Number of joints n."""

    @property
    def absolute_map(self) -> fmpq_mat:
        """S, n x n, invertible: ``alpha = S theta``."""

    def inertia(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Polynomials:
        """D, n x n."""

    def first_moments(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[fmpq_poly]:
        """h, n, kg m."""

    @property
    def gravity(self) -> fmpq | None:
        """g, negative where theta = 0 stands upright; None for a robot whose torque at rest is not gravity's."""

    @property
    def friction(self) -> fmpq_mat:
        """Derivative of the torque in the joint speeds at rest, n x n."""
