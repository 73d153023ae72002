"""The loop of the acceleration-level law on a robot that moves: one quadratic Lyapunov function for all of its motions.

The frozen gate asks about every posture on its own. Here the posture and the payload may be different ones at every
sample. With ``X = M_t^-1 M_n`` and n-vectors as signals, one sample of the loop is ``s+ = (A_0 x I + b c' x X) s``.
Suppose there are a centre c > 0, a radius r < c and a shape ``Y > 0`` with

    (X - c I) Y (X - c I)' <= r^2 Y       for every X that occurs.                                    (disc)

Then ``T X T^-1``, ``T' T = Y^-1``, is within r of c I in the spectral norm. If moreover ``F + c G`` is Schur and

    |F + c G| > r |G|      on the whole unit circle                                                    (circle)

then by the bounded real lemma there is a P > 0 for which ``V(s) = s' (P x Y^-1) s`` decreases at every sample whatever
sequence of X in the disc occurs. For one joint (disc) says that mu stays within [c - r, c + r], and (circle) is also
necessary for any common quadratic V: it is the circle criterion in discrete time.

(disc) is a pencil of `gate_cells`: multiplied with M_t from both sides it is, without inverse,

    (r^2 - c^2) M_t Y M_t + c (M_t Y M_n + M_n Y M_t) - M_n Y M_n >= 0.

(circle) is decided for every constant delay in [0, d], d <= 1 sample: the plant's polynomial is quadratic in the share
``e = 1 - delay`` of the sample in which the new command acts, so ``|F + c G|^2 - r^2 |G|^2`` is a polynomial of degree
4 in e and, on the circle, a polynomial in the cosine of the phase; all of its Bernstein coefficients in e must be
positive on [-1, 1], which the isolation of their roots decides exactly.

The inertia is taken as constant over a sample, and a torque that acts late as meeting the inertia of the posture at
which it was commanded: with a delay the last of the signals is ``X a``, what the torque on its way will do.

References: Tsypkin (1964), Dokl. Akad. Nauk SSSR 155, 1029 (the discrete circle criterion); Willems (1971), IEEE TAC
16, 621; Boyd et al. (1994), Linear Matrix Inequalities in System and Control Theory, section 5.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
import numpy.typing as npt
from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.cells import prove_positive
from quasilpv.certificate.exact.cosine_matrices import CosineMatrix
from quasilpv.certificate.exact.matrices import is_positive_definite, is_symmetric, matrix, rational
from quasilpv.certificate.exact.polynomials import CircleProduct, is_schur, roots_between
from quasilpv.certificate.gate.loop import AccelerationLoopData, CharacteristicPolynomial, Controller
from quasilpv.certificate.reading import Rows, WitnessDocument
from quasilpv.certificate.robot.range import InertiaPair
from quasilpv.errors import InputError

PLANT_DEGREE = 2
"""Of the sampled plant in the share of the sample in which the new command acts."""

MAX_HALVINGS = 6
ONE_CIRCLE = fmpq(1)


class LyapunovDocument(WitnessDocument):
    """A Lyapunov function: P without delay and at the longest one, time in samples, and the multiplier t."""

    no_delay: Rows
    longest_delay: Rows
    multiplier: float


class MotionDocument(WitnessDocument):
    """The member ``motion`` of a witness: centre c, radius r and shape Y of the disc, the delays, and perhaps a P."""

    centre: float
    radius: float
    shape: Rows
    longest_delay_samples: float
    lyapunov: LyapunovDocument | None = None


@dataclass(frozen=True)
class InertiaDisc:
    """``(X - c I) Y (X - c I)' <= r^2 Y`` for ``X = M_t^-1 M_n``, in joint coordinates.

    Attributes:
        centre: c.
        radius: r, with 0 <= r < c.
        shape: Y, n x n, symmetric.
    """

    centre: fmpq
    radius: fmpq
    shape: fmpq_mat

    @classmethod
    def of(cls, member: MotionDocument, joints: int, source: str = "artifact") -> InertiaDisc:
        """The disc that the member ``motion`` of a witness states.

        Raises:
            InputError: a value is not of the documented form.
        """
        centre, radius = rational(member.centre), rational(member.radius)
        if not 0 <= radius < centre:
            raise InputError(source, "witness.motion.radius", member.radius, "at least 0 and less than the centre")
        return cls(centre, radius, symmetric_matrix(member.shape, joints, "witness.motion.shape", source))

    def inequality(self, inertia: InertiaPair) -> CosineMatrix:
        """The left side of (disc) without inverse, in absolute angles."""
        S = inertia.data.mechanism.absolute_map
        Y = S * self.shape * S.transpose()
        true, design, c = inertia.true, inertia.design, self.centre
        mixed = true.times(Y, design) + design.times(Y, true)
        return true.times(Y, true) * (self.radius**2 - c**2) + mixed * c + design.times(Y, design) * fmpq(-1)

    def is_proved(self, inertia: InertiaPair) -> bool:
        """Whether (disc) holds strictly in every posture of the operating domain with every payload."""
        if not is_positive_definite(self.shape):
            return False
        inequality = self.inequality(inertia)

        def refutes(points: FloatArray) -> npt.NDArray[np.bool_]:
            return np.asarray(np.linalg.eigvalsh(inequality.at(points))[:, 0] < 0.0)

        return isinstance(prove_positive(inequality.to_pencil(), inertia.domain(), refutes), int)


def symmetric_matrix(rows: Sequence[Sequence[Any]], size: int, field: str, source: str) -> fmpq_mat:
    """A member of an artifact as an exact matrix.

    Raises:
        InputError: it is not symmetric, or of another size.
    """
    square = matrix(rows)
    if (square.nrows(), square.ncols()) != (size, size) or not is_symmetric(square):
        raise InputError(source, field, "another matrix", f"symmetric, {size} x {size}")
    return square


def is_proved_in_motion(
    claimed: MotionDocument, loop: AccelerationLoopData, inertia: InertiaPair, source: str = "artifact"
) -> bool:
    """Whether what the member ``motion`` of a witness claims is proved.

    Args:
        claimed: that member.
        loop, inertia: as shipped.
        source: what to call the artifact in errors.

    Raises:
        InputError: a value is not of the documented form.
    """
    disc, longest = InertiaDisc.of(claimed, inertia.data.joints, source), rational(claimed.longest_delay_samples)
    return satisfies_circle_criterion(loop, disc.centre, disc.radius, longest) and disc.is_proved(inertia)


def satisfies_circle_criterion(
    data: AccelerationLoopData, centre: fmpq, radius: fmpq, longest_delay_samples: fmpq, contraction: fmpq = ONE_CIRCLE
) -> bool:
    """Whether (circle) is proved for both neighbours of the filter pole and every constant delay up to the longest.

    Args:
        data: the law as shipped.
        centre, radius: c and r of the disc.
        longest_delay_samples: in [0, 1].
        contraction: radius in (0, 1] of the circle, and of the disk of the roots: V falls by its square every sample.

    Raises:
        InputError: the delay is out of range.
    """
    if not 0 <= longest_delay_samples <= 1:
        raise InputError("loop", "delay", longest_delay_samples, "a delay between 0 and 1 sample")
    controllers = [Controller.of(data, pole) for pole in data.filter_poles()]
    earliest = 1 - longest_delay_samples
    return all(
        _is_schur_at(c, centre, contraction)
        and _separated(_gap_by_powers(c, centre, radius, contraction), earliest, fmpq(1))
        for c in controllers
    )


def _is_schur_at(controller: Controller, ratio: fmpq, contraction: fmpq) -> bool:
    polynomial = _contracted(controller, fmpq(0), contraction)
    return is_schur(polynomial.F + ratio * polynomial.G)


def _contracted(controller: Controller, delay: fmpq, contraction: fmpq) -> CharacteristicPolynomial:
    """The characteristic polynomial in z over the contraction."""
    polynomial, scaled = CharacteristicPolynomial.of(controller, delay), fmpq_poly([0, contraction])
    return CharacteristicPolynomial(polynomial.F(scaled), polynomial.G(scaled))


def _separated(gap: Sequence[fmpq_poly], low: fmpq, high: fmpq, halvings: int = MAX_HALVINGS) -> bool:
    """Whether a gap (`_gap_by_powers`) is positive for every e in [low, high], cut in half where it is not seen."""
    if all(_is_positive_on_circle(coefficient) for coefficient in _bernstein(gap, low, high)):
        return True
    if halvings == 0 or low == high:
        return False
    middle = (low + high) / 2
    return all(_separated(gap, *part, halvings - 1) for part in ((low, middle), (middle, high)))


def _gap_by_powers(controller: Controller, centre: fmpq, radius: fmpq, contraction: fmpq) -> list[fmpq_poly]:
    """``|F + c G|^2 - r^2 |G|^2`` on the circle by powers of e: polynomials in the cosine of the phase.

    F does not depend on e. G is quadratic in e; its coefficients follow from its values at e = 1, 3/4 and 1/2.
    """
    now, quarter, half = (_contracted(controller, fmpq(d, 4), contraction) for d in range(3))
    g2 = 8 * (now.G - 2 * quarter.G + half.G)
    g1 = 2 * (now.G - half.G) - fmpq(3, 2) * g2
    g0 = now.G - g1 - g2
    gains = (g0, g1, g2)
    gap = [fmpq_poly([0]) for _ in range(2 * PLANT_DEGREE + 1)]
    gap[0] += CircleProduct.of(now.F, now.F).real
    for i, left in enumerate(gains):
        gap[i] += 2 * centre * CircleProduct.of(now.F, left).real
        for j, right in enumerate(gains):
            gap[i + j] += (centre**2 - radius**2) * CircleProduct.of(left, right).real
    return gap


def _bernstein(powers: Sequence[fmpq_poly], low: fmpq, high: fmpq) -> list[fmpq_poly]:
    """Bernstein coefficients on [low, high] of a polynomial given by its coefficients, themselves polynomials."""
    degree, width = len(powers) - 1, high - low
    shifted = [
        sum((powers[p] * (comb(p, k) * low ** (p - k) * width**k) for p in range(k, degree + 1)), fmpq_poly([0]))
        for k in range(degree + 1)
    ]
    return [
        sum((shifted[k] * fmpq(comb(j, k), comb(degree, k)) for k in range(j + 1)), fmpq_poly([0]))
        for j in range(degree + 1)
    ]


def _is_positive_on_circle(polynomial: fmpq_poly) -> bool:
    """Whether a polynomial in the cosine is positive on [-1, 1]."""
    return bool(polynomial(fmpq(1)) > 0 and polynomial(fmpq(-1)) > 0) and not roots_between(polynomial)
