"""The robots a gate knows, as exact data: inertia and first moments with a payload, and what their joint angles mean.

The n joint angles theta determine n absolute angles ``alpha = S theta`` (S of zeros and ones), in which the inertia is
``M = S' [D_kl cos(alpha_k - alpha_l)] S`` and the gravity torque ``S' [g h_k sin(alpha_k)]``, g gravity. At payload
fraction f a link has mass ``m (1 + f (mass_scale - 1))``, centre of mass ``r (1 + f (com_scale - 1))`` and its nominal
moment of inertia about the centre of mass, so that D is a cubic polynomial of f.

* **Serial arm**: S the lower triangle of ones; with I_k about the joint axis

      D_kk = I_k + L_k^2 sum_{l>k} m_l,    D_kl = L_k (m_l r_l + L_l sum_{p>l} m_p)  for k < l
      h_k = m_k r_k + L_k sum_{l>k} m_l

* **Rolling disc** of mass M and radius r, its angle the one joint, its moment of inertia J scaled by ``mass_scale``:

      D = J (1 + f (mass_scale - 1)) + M r^2,    h = 0

* **Five-bar linkage with equal links** (length a; active and passive link of masses m_a, m_b), a rhombus whose passive
  links are parallel to the opposite active ones: S the identity;

      D_kk = I_a + m_b a^2 + I_b,    D_12 = 2 m_b r_b a,    h_k = m_a r_a + m_b a + m_b r_b
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.certificate.exact_matrices import identity, rational
from quasilpv.errors import InputError

Polynomials = list[list[fmpq_poly]]


@dataclass(frozen=True)
class LinkData:
    """One link: length, mass, centre of mass and moment of inertia about the joint axis, SI units."""

    length_m: float
    mass_kg: float
    com_m: float
    inertia_kg_m2: float


@dataclass(frozen=True)
class LoadedLink:
    """A link with its payload: polynomials in the payload fraction."""

    length: fmpq
    mass: fmpq_poly
    first_moment: fmpq_poly
    inertia: fmpq_poly

    @classmethod
    def of(cls, link: LinkData, mass_scale: float, com_scale: float) -> LoadedLink:
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


@dataclass(frozen=True)
class SerialArmData:
    """A planar serial arm.

    Attributes:
        links: nominal links, base to tool; a payload has one factor per link.
    """

    links: tuple[LinkData, ...]

    @property
    def joints(self) -> int:
        """One per link."""
        return len(self.links)

    @property
    def absolute_map(self) -> fmpq_mat:
        """The lower triangle of ones."""
        n = self.joints
        return fmpq_mat(n, n, [int(j <= i) for i in range(n) for j in range(n)])

    def inertia(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Polynomials:
        """D of the module's formula."""
        links, outer = self._loaded(mass_scale, com_scale)
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
        links, outer = self._loaded(mass_scale, com_scale)
        return [link.first_moment + link.length * mass for link, mass in zip(links, outer, strict=True)]

    def _loaded(
        self, mass_scale: Sequence[float], com_scale: Sequence[float]
    ) -> tuple[list[LoadedLink], list[fmpq_poly]]:
        """Links with their payload, and the mass beyond each of them."""
        links = [LoadedLink.of(*factors) for factors in zip(self.links, mass_scale, com_scale, strict=True)]
        return links, [sum((link.mass for link in links[k + 1 :]), fmpq_poly([0])) for k in range(self.joints)]


@dataclass(frozen=True)
class FiveBarData:
    """A five-bar linkage with equal links.

    Attributes:
        active: each link on the motor axis.
        passive: each link from an elbow to the tool. A payload has one factor for either kind.

    Raises:
        InputError: links of different lengths, whose reduced inertia is not affine in a cosine.
    """

    active: LinkData
    passive: LinkData

    def __post_init__(self) -> None:
        """Refuse other linkages."""
        lengths = self.active.length_m, self.passive.length_m
        if lengths[0] != lengths[1]:
            raise InputError("five-bar", "length_m", f"{lengths[0]} and {lengths[1]}", "links of one length")

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
        links = zip((self.active, self.passive), mass_scale, com_scale, strict=True)
        active, passive = (LoadedLink.of(*factors) for factors in links)
        return active, passive


@dataclass(frozen=True)
class DiscData:
    """A disc that rolls on a line.

    Attributes:
        mass_kg, radius_m, inertia_kg_m2: M, r and J about its centre; what a payload scales is J.
    """

    mass_kg: float
    radius_m: float
    inertia_kg_m2: float

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
        J = rational(self.inertia_kg_m2) * fmpq_poly([1, rational(mass_scale[0]) - 1])
        return [[J + rational(self.mass_kg) * rational(self.radius_m) ** 2]]

    def first_moments(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[fmpq_poly]:
        """Zero: it rolls on the level."""
        return [fmpq_poly([0])]


def mechanism_data(parameters: Mapping[str, Any], source: str = "artifact") -> MechanismData:
    """The robot of an artifact, from its ``robot.parameters``.

    Raises:
        InputError: no robot known here, or a five-bar linkage with links of different lengths.
    """
    if {"active", "passive"} <= parameters.keys():
        return FiveBarData(_link(parameters["active"]), _link(parameters["passive"]))
    if "radius_m" in parameters:
        return DiscData(*(float(parameters[field]) for field in DiscData.__annotations__))
    links = parameters.get("links")
    if not links:
        expected = "the links of a planar serial arm, active and passive link of a five-bar linkage, or a disc"
        raise InputError(source, "robot.parameters.links", links, expected)
    return SerialArmData(tuple(map(_link, links)))


def _link(parameters: Mapping[str, Any]) -> LinkData:
    return LinkData(*(float(parameters[field]) for field in LinkData.__annotations__))
