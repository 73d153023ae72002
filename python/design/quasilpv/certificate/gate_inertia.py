"""The true and the design inertia of a planar serial arm as exact data: affine in cosines, cubic in the payload.

In absolute angles ``alpha_k = theta_1 + ... + theta_k`` (``alpha = S theta``, S the lower triangle of ones) the inertia
of the arm is ``M_t = S' [D_kl(f) cos(alpha_k - alpha_l)] S`` with

    D_kk = I_k + L_k^2 sum_{l>k} m_l,    D_kl = L_k (m_l r_l + L_l sum_{p>l} m_p)  for k < l

(I_k about the joint axis), where at payload fraction f link i has mass ``m_i (1 + f (mass_scale_i - 1))``, centre of
mass ``r_i (1 + f (com_scale_i - 1))`` and the nominal moment of inertia about its centre of mass, so that D is a cubic
in f. The design inertia M_n is collapsed from the artifact's vertices, not from what they were made of. Definiteness
does not change under the congruence with S, and everything here is in absolute angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

from flint import fmpq_mat, fmpq_poly

from quasilpv.certificate.exact_matrices import is_symmetric, magnitude, matrix, rational, zero
from quasilpv.errors import InputError

Pair: TypeAlias = tuple[int, int]
Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class LinkData:
    """One link: length, mass, centre of mass and moment of inertia about the joint axis, SI units."""

    length_m: float
    mass_kg: float
    com_m: float
    inertia_kg_m2: float


@dataclass(frozen=True)
class InertiaBlock:
    """One box block of the design inertia: 2^g vertices over g premises, the first premise the most significant bit."""

    premises: tuple[int, ...]
    vertices: tuple[tuple[tuple[float, ...], ...], ...]


@dataclass(frozen=True)
class ArmInertiaData:
    """What the needed range of inertia ratios depends on, as shipped.

    Attributes:
        links: nominal links, base to tool.
        mass_scale: n factors of the masses at payload fraction 1.
        com_scale: n factors of the distances to the centres of mass at payload fraction 1.
        angle_rad: n intervals of the joint angles, the operating domain.
        premise_lower: lower bounds the run-time clamps the premises to.
        premise_upper: upper bounds.
        premise_pairs: premise p is ``cos(alpha_l - alpha_k)`` for its pair (k, l), k < l, joints counted from 0.
        blocks: the vertices of the design inertia.

    Raises:
        InputError: sizes that do not fit, or a vertex that is not exactly symmetric: then the joints do not decouple.
    """

    links: tuple[LinkData, ...]
    mass_scale: tuple[float, ...]
    com_scale: tuple[float, ...]
    angle_rad: tuple[Interval, ...]
    premise_lower: tuple[float, ...]
    premise_upper: tuple[float, ...]
    premise_pairs: tuple[Pair, ...]
    blocks: tuple[InertiaBlock, ...]

    def __post_init__(self) -> None:
        """Refuse data that describe no arm with a design inertia."""
        n, premises = len(self.links), len(self.premise_pairs)
        for field, size in (
            ("mass_scale", n),
            ("com_scale", n),
            ("angle_rad", n),
            ("premise_lower", premises),
            ("premise_upper", premises),
        ):
            if len(getattr(self, field)) != size:
                raise InputError("arm", field, len(getattr(self, field)), f"{size} entries")
        for index, block in enumerate(self.blocks):
            for vertex in block.vertices:
                if len(vertex) != n or not is_symmetric(matrix(vertex)):
                    raise InputError("law", f"inertia.blocks[{index}]", "another vertex", f"symmetric, {n} x {n}")

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.links)

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs (k, l), k < l: one cosine each."""
        return tuple(combinations(range(self.joints), 2))


@dataclass(frozen=True)
class DesignInertia:
    """``M_n = constant + sum_(k,l) cos(alpha_l - alpha_k) slope[k,l] + rest`` in absolute angles, exactly.

    Attributes:
        constant: n x n.
        slopes: n x n per pair that is a premise.
        rest: n x n bound on the absolute value of every entry of what is not affine: products of premises, zero up to
            the rounding of the vertices because M_n is affine in its premises by design.
    """

    constant: fmpq_mat
    slopes: Mapping[Pair, fmpq_mat]
    rest: fmpq_mat


def true_inertia(data: ArmInertiaData) -> list[list[fmpq_poly]]:
    """The n x n matrix D of the module's formula, polynomials of degree at most 3 in the payload fraction."""
    n = data.joints
    mass, first_moment, inertia = [], [], []
    for link, mass_scale, com_scale in zip(data.links, data.mass_scale, data.com_scale, strict=True):
        m, r = rational(link.mass_kg), rational(link.com_m)
        loaded_mass = m * fmpq_poly([1, rational(mass_scale) - 1])
        loaded_com = r * fmpq_poly([1, rational(com_scale) - 1])
        mass.append(loaded_mass)
        first_moment.append(loaded_mass * loaded_com)
        inertia.append(rational(link.inertia_kg_m2) - m * r**2 + loaded_mass * loaded_com**2)
    length = [rational(link.length_m) for link in data.links]
    outer = [sum(mass[k + 1 :], fmpq_poly([0])) for k in range(n)]
    D = [[fmpq_poly([0])] * n for _ in range(n)]
    for k in range(n):
        D[k][k] = inertia[k] + length[k] ** 2 * outer[k]
        for j in range(k):
            D[j][k] = D[k][j] = length[j] * (first_moment[k] + length[k] * outer[k])
    return D


def design_inertia(data: ArmInertiaData) -> DesignInertia:
    """Collapse the vertices: every block's weights are products over its premises, divided by the number of blocks."""
    n = data.joints
    to_relative = fmpq_mat(n, n, [int(j <= i) for i in range(n) for j in range(n)]).inv()
    constant, rest = zero(n, n), zero(n, n)
    slopes = {pair: zero(n, n) for pair in data.premise_pairs}
    for block in data.blocks:
        for premises, coefficient in _monomials(data, block).items():
            absolute = to_relative.transpose() * coefficient * to_relative / len(data.blocks)
            if not premises:
                constant += absolute
            elif len(premises) == 1:
                slopes[data.premise_pairs[premises[0]]] += absolute
            else:  # every premise is a cosine, so their product is at most 1
                rest += magnitude(absolute)
    return DesignInertia(constant, slopes, rest)


def _monomials(data: ArmInertiaData, block: InertiaBlock) -> dict[tuple[int, ...], fmpq_mat]:
    """Coefficients of the multilinear interpolant of one block's vertices, by the premises each one multiplies."""
    terms: dict[tuple[int, ...], list[fmpq_mat]] = {(): [matrix(vertex) for vertex in block.vertices]}
    for p in block.premises:
        lower, upper = rational(data.premise_lower[p]), rational(data.premise_upper[p])
        split: dict[tuple[int, ...], list[fmpq_mat]] = {}
        for premises, corners in terms.items():
            half = len(corners) // 2
            pairs = list(zip(corners[:half], corners[half:], strict=True))
            split[premises] = [(low * upper - high * lower) / (upper - lower) for low, high in pairs]
            split[(*premises, p)] = [(high - low) / (upper - lower) for low, high in pairs]
        terms = split
    return {premises: corners[0] for premises, corners in terms.items()}
