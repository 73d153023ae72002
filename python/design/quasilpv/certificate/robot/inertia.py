"""The true and the design inertia of a robot as exact data: affine in cosines, cubic in the payload.

The true inertia is that of `robot.mechanism`, ``M_t = S' [D_kl(f) cos(alpha_k - alpha_l)] S`` in absolute angles
``alpha = S theta``, D cubic in the payload fraction f. The design inertia M_n is collapsed from the artifact's
vertices, not from what they were made of. Definiteness does not change under the congruence with S, and everything here
is in absolute angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import TypeAlias

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import is_symmetric, magnitude, matrix, rational, zero
from quasilpv.certificate.exact.rationals import to_floats
from quasilpv.certificate.robot.mechanism import MechanismData
from quasilpv.errors import InputError

Pair: TypeAlias = tuple[int, int]
Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class InertiaBlock:
    """One box block of the design inertia: 2^g vertices over g premises, the first premise the most significant bit."""

    premises: tuple[int, ...]
    vertices: tuple[tuple[tuple[float, ...], ...], ...]


@dataclass(frozen=True)
class InertiaData:
    """What the needed range of inertia ratios depends on, as shipped.

    Attributes:
        mechanism: the nominal robot.
        mass_scale: n factors of masses at payload fraction 1.
        com_scale: n factors of distances to the centres of mass at payload fraction 1.
        angle_rad: n intervals of the joint angles, the operating domain.
        premise_lower: lower bounds the run-time clamps the premises to.
        premise_upper: upper bounds.
        premise_pairs: premise p is ``cos(alpha_l - alpha_k)`` for its pair (k, l), k < l, joints counted from 0.
        blocks: the vertices of the design inertia.

    Raises:
        InputError: sizes that do not fit, or a vertex that is not exactly symmetric: then the joints do not decouple.
    """

    mechanism: MechanismData
    mass_scale: tuple[float, ...]
    com_scale: tuple[float, ...]
    angle_rad: tuple[Interval, ...]
    premise_lower: tuple[float, ...]
    premise_upper: tuple[float, ...]
    premise_pairs: tuple[Pair, ...]
    blocks: tuple[InertiaBlock, ...]

    def __post_init__(self) -> None:
        """Refuse data that describe no robot with a design inertia."""
        n, premises = self.joints, len(self.premise_pairs)
        for field, size in (
            ("mass_scale", n),
            ("com_scale", n),
            ("angle_rad", n),
            ("premise_lower", premises),
            ("premise_upper", premises),
        ):
            if len(getattr(self, field)) != size:
                raise InputError("robot", field, len(getattr(self, field)), f"{size} entries")
        for index, block in enumerate(self.blocks):
            for vertex in block.vertices:
                if len(vertex) != n or not is_symmetric(matrix(vertex)):
                    raise InputError("law", f"inertia.blocks[{index}]", "another vertex", f"symmetric, {n} x {n}")

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.mechanism.joints

    @property
    def turns_as_one(self) -> bool:
        """Whether the first joint turns all links alike, so that the inertia does not depend on it."""
        return all(row[0] == 1 for row in self.mechanism.absolute_map.table())

    @property
    def relative_rad(self) -> tuple[tuple[fmpq, fmpq], ...]:
        """n - 1 intervals of ``alpha_{k+1} - alpha_k`` over the operating domain: all that inertias depend on."""
        S = self.mechanism.absolute_map.table()
        bounds = [tuple(map(rational, interval)) for interval in self.angle_rad]
        intervals = []
        for before, after in pairwise(S):
            ends = [
                (factor * low, factor * high) if factor >= 0 else (factor * high, factor * low)
                for factor, (low, high) in zip((b - a for a, b in zip(before, after, strict=True)), bounds, strict=True)
            ]
            intervals.append((sum((low for low, _ in ends), fmpq(0)), sum((high for _, high in ends), fmpq(0))))
        return tuple(intervals)

    def absolute(self, angles: FloatArray) -> FloatArray:
        """Absolute angles in doubles, (N, n), at joint angles (N, n)."""
        return np.asarray(angles @ to_floats(self.mechanism.absolute_map).T)

    def configuration(self, relative: FloatArray) -> tuple[float, ...]:
        """Joint angles of the operating domain at which ``alpha_{k+1} - alpha_k`` take these n - 1 values.

        They are known up to a common shift of the absolute angles, which stays in the middle of what the domain allows.
        """
        inverse = to_floats(self.mechanism.absolute_map.inv())
        angle, shift = inverse @ np.concatenate([[0.0], np.cumsum(relative)]), inverse.sum(axis=1)
        moved = shift != 0.0
        ends = (np.array(self.angle_rad)[moved] - angle[moved, None]) / shift[moved, None]
        middle = (ends.min(axis=1).max() + ends.max(axis=1).min()) / 2.0
        return tuple(map(float, angle + middle * shift))

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


def true_inertia(data: InertiaData) -> list[list[fmpq_poly]]:
    """The n x n matrix D of the module's formula, polynomials of degree at most 3 in the payload fraction."""
    return data.mechanism.inertia(data.mass_scale, data.com_scale)


def design_inertia(data: InertiaData) -> DesignInertia:
    """Collapse the vertices: every block's weights are products over its premises, divided by the number of blocks."""
    n = data.joints
    to_joints = data.mechanism.absolute_map.inv()
    constant, rest = zero(n, n), zero(n, n)
    slopes = {pair: zero(n, n) for pair in data.premise_pairs}
    for block in data.blocks:
        for premises, coefficient in _monomials(data, block).items():
            absolute = to_joints.transpose() * coefficient * to_joints / len(data.blocks)
            if not premises:
                constant += absolute
            elif len(premises) == 1:
                slopes[data.premise_pairs[premises[0]]] += absolute
            else:  # every premise is a cosine, so their product is at most 1
                rest += magnitude(absolute)
    return DesignInertia(constant, slopes, rest)


def _monomials(data: InertiaData, block: InertiaBlock) -> dict[tuple[int, ...], fmpq_mat]:
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
