"""Positive definiteness of an inertia-like matrix over a box of postures and payloads: one cell at a time.

A posture is n - 1 angles delta, the differences of neighbouring absolute angles (of a serial arm theta_2 ... theta_n).
A `Pencil` is ``X(delta, f) = sum_p f^p (K_p0 + sum_k cos(s_k) K_pk)``, symmetric, of degree d in the payload fraction
f, with integer combinations ``s_k = sum_a N_ak delta_a``, up to a symmetric error no entry of which exceeds ``rest``. A
cell is ``delta_a = middle_a +- h_a`` and f in [u, v]. With X_0 ... X_d the Bernstein coefficients of X in f on [u, v],
X > 0 on the whole cell if for each of them and for every corner sigma (a sign per angle)

    X_j(middle) + sum_a sigma_a h_a dX_j/ddelta_a (middle) - diag(r_j) > 0,

    r_j = row sums of  rest + sum_k H_k^2 / 2 |K_jk|   (entrywise),   H_k = sum_a |N_ak| h_a:

X(f) is a convex combination of the X_j; by Taylor's theorem ``cos(s_k)`` differs from its tangent by at most H_k^2 / 2;
a symmetric matrix whose entries are at most R_ab in absolute value is at most the diagonal matrix of the row sums of R;
and what is affine in the deviations is positive definite on a box if it is at its corners. The overestimate is
quadratic in the size of the cell.

The same test is written twice: in doubles, fast, to decide where to cut; and in integers, exactly, to decide what is
true. Only the second one counts.

Reference: Neumaier (1990), Interval Methods for Systems of Equations, chapter 2 (mean value forms); Farouki (2012),
Computer Aided Geometric Design 29, 379 (the Bernstein hull).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import comb, lcm
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from flint import arb, ctx, fmpq

from quasilpv.arrays import FloatArray

IntegerArray: TypeAlias = npt.NDArray[Any]
"""Array of Python integers of any size."""

ANGLE_BITS = 40
MAX_SCALE_BITS = 20
COEFFICIENT_BITS = 64
MAX_CELLS = 100_000
GUIDE_SLACK = 1e-10


@dataclass(frozen=True, eq=False)
class Pencil:
    """See the module; integer coefficients in a unit of its own, which definiteness does not see.

    Attributes:
        coefficients: shape (d + 1, 1 + m, n, n): power of f, then constant and m cosines.
        rest: shape (n, n).
        angles: N, shape (n - 1, m), integers: cosine k is that of ``sum_a N_ak delta_a``.
    """

    coefficients: IntegerArray
    rest: IntegerArray
    angles: IntegerArray

    @classmethod
    def enclosing(cls, coefficients: IntegerArray, rest: IntegerArray, angles: IntegerArray) -> Pencil:
        """From arrays of these shapes, two of them rational: scaled, and rounded down with the error added to the rest.

        Rows and columns are scaled alike by powers of two so that no link is small: that congruence leaves definiteness
        alone and makes the row sums of the test less pessimistic. f and cosines are at most 1 in absolute value, so the
        errors of all terms of an entry add up to less than the number of terms.
        """
        diagonal = [abs(int(x.p) / int(x.q)) for x in coefficients[0, 0].diagonal()]
        power = [round(math.log2(max(diagonal) / x) / 2) if x > 0 else 0 for x in diagonal]
        scale = np.array([fmpq(1 << min(exponent, MAX_SCALE_BITS)) for exponent in power], dtype=object)
        coefficients = coefficients * scale[:, None] * scale
        unit = max(map(abs, coefficients.ravel())) / (1 << COEFFICIENT_BITS)
        terms = coefficients.shape[0] * coefficients.shape[1]
        rounded = np.array([int((x / unit).floor()) for x in coefficients.ravel()], dtype=object)
        bounds = [int((x / unit).ceil()) + terms for x in (rest * scale[:, None] * scale).ravel()]
        return cls(rounded.reshape(coefficients.shape), np.array(bounds, dtype=object).reshape(rest.shape), angles)

    @property
    def degree(self) -> int:
        """d, the degree in the payload fraction."""
        return len(self.coefficients) - 1

    def to_floats(self) -> tuple[FloatArray, FloatArray]:
        """Coefficients and rest as doubles, scaled so that the largest coefficient is 1."""
        largest = max(map(abs, self.coefficients.ravel()))
        return (self.coefficients / largest).astype(float), (self.rest / largest).astype(float)


@dataclass(frozen=True, eq=False)
class Cells:
    """N boxes of a bisected domain: on axis a, box i is the part ``index[i, a]`` of ``2^level[i, a]`` equal ones.

    Attributes:
        lower: rational lower bounds of the domain, one per axis: the angles of the posture, then f.
        upper: upper bounds.
        level: (N, axes) integers.
        index: (N, axes) integers.
    """

    lower: tuple[fmpq, ...]
    upper: tuple[fmpq, ...]
    level: npt.NDArray[np.int64]
    index: npt.NDArray[np.int64]

    @classmethod
    def whole(cls, lower: Sequence[fmpq], upper: Sequence[fmpq]) -> Cells:
        """The domain as one cell."""
        none = np.zeros((1, len(lower)), dtype=np.int64)
        return cls(tuple(lower), tuple(upper), none, none)

    def __len__(self) -> int:
        """Number of cells N."""
        return len(self.level)

    def only(self, chosen: npt.NDArray[Any]) -> Cells:
        """The cells of a mask or of a list of indices."""
        return Cells(self.lower, self.upper, self.level[chosen], self.index[chosen])

    def halved(self, axis: npt.NDArray[np.intp]) -> Cells:
        """Every cell cut into two along its own axis, 2N cells."""
        cut = np.zeros_like(self.level)
        cut[np.arange(len(self)), axis] = 1
        level, index = self.level + cut, self.index * (1 + cut)
        return Cells(self.lower, self.upper, np.vstack([level, level]), np.vstack([index, index + cut]))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corners in doubles, (N, axes), for the guide."""
        low, high = (np.array([int(x.p) / int(x.q) for x in side]) for side in (self.lower, self.upper))
        width = (high - low) * 0.5**self.level
        start = low + width * self.index
        return start, start + width

    def exact_interval(self, cell: int, axis: int) -> tuple[fmpq, fmpq]:
        """Bounds of one cell on one axis."""
        step = (self.upper[axis] - self.lower[axis]) / (1 << int(self.level[cell, axis]))
        start = self.lower[axis] + step * int(self.index[cell, axis])
        return start, start + step


def smallest_eigenvalues(pencil: Pencil, cells: Cells) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """The guide: per cell, the smallest eigenvalue of all matrices to be tested, and the axis best cut next.

    Args:
        pencil: used in doubles, its largest coefficient scaled to 1.
        cells: N cells.
    """
    K, rest = pencil.to_floats()
    low, high = cells.bounds()
    middle, half = (low + high)[:, :-1] / 2, (high - low)[:, :-1] / 2
    sums = pencil.angles.astype(float)
    reach = half @ np.abs(sums)
    blossom = _blossom(pencil.degree, low[:, -1], high[:, -1]) / _binomials(pencil.degree)
    matrices = np.einsum("njp,pkab->njkab", blossom, K)
    slopes = matrices[:, :, 1:]
    centre = matrices[:, :, 0] + np.einsum("nk,njkab->njab", np.cos(middle @ sums), slopes)
    gradient = -np.einsum("nd,dk,nk,njkab->ndjab", half, sums, np.sin(middle @ sums), slopes)
    bends = (reach**2 / 2)[:, None, :, None] * np.abs(slopes).sum(axis=-1)
    margin = bends.sum(axis=2) + rest.sum(axis=-1)
    corners = np.einsum("sd,ndjab->nsjab", _signs(half.shape[1]), gradient)
    tested = centre[:, None] + corners - (margin[..., None] * np.eye(K.shape[-1]))[:, None]
    smallest = np.linalg.eigvalsh(tested)[..., 0].min(axis=(1, 2))

    share = half[:, :, None] * np.abs(sums) / np.maximum(reach, np.finfo(float).tiny)[:, None]
    bent = np.einsum("ndk,nk->nd", share, bends.max(axis=(1, 3)))
    curved = np.abs(np.diff(centre, n=2, axis=1)).max(axis=(1, 2, 3))
    return smallest, np.column_stack([bent, curved]).argmax(axis=1)


def are_positive_definite(pencil: Pencil, cells: Cells) -> npt.NDArray[np.bool_]:
    """The verdict: per cell, whether the pencil is positive definite on it, proved in integer arithmetic.

    Args:
        pencil: integer coefficients.
        cells: N cells.
    """
    K, unit, sums = pencil.coefficients, 1 << ANGLE_BITS, pencil.angles
    depth = int(cells.level[:, -1].max(initial=0))
    width = np.array([1 << (depth - level) for level in cells.level[:, -1].tolist()], dtype=object)
    start = width * cells.index[:, -1].astype(object)
    # The weights of Bernstein's form, times _binomials * 2^(degree * depth).
    blossom = _blossom(pencil.degree, start, start + width, 1 << depth)
    matrices = (blossom[..., None, None, None] * K).sum(axis=2)
    constant, slopes = matrices[:, :, 0], matrices[:, :, 1:]
    half, cosine, sine = _exact_postures(sums, cells)
    reach = half.dot(abs(sums))  # H_k in units
    # In units of 1 / (2 unit^2). Cosine and sine are short of the truth by at most 2 units each.
    bend = reach**2 + 4 * unit + 4 * reach
    centre = 2 * unit**2 * constant + 2 * unit * _weighted(cosine, slopes)
    rest = pencil.rest.sum(axis=-1) * (2 * unit**2 * _binomials(pencil.degree) << (pencil.degree * depth))
    margin = _weighted(bend, np.abs(slopes)).sum(axis=-1) + rest
    centre = centre - margin[..., None] * np.eye(K.shape[-1], dtype=int).astype(object)
    definite = np.ones(len(cells), dtype=bool)
    for signs in _signs(len(sums)).astype(int).astype(object):
        deviation = (half * signs).dot(sums) * sine
        definite &= _are_minors_positive(centre - 2 * _weighted(deviation, slopes)).all(axis=1)
    return definite


def prove_positive(
    pencil: Pencil, domain: Cells, refutes: Callable[[FloatArray], npt.NDArray[np.bool_]]
) -> int | FloatArray | None:
    """Cut a domain until the pencil is proved positive definite on every cell.

    Args:
        pencil: what has to be positive definite.
        domain: cells that cover where.
        refutes: which of the points (N, axes) in the middle of cells, in doubles, show that it is not.

    Returns:
        The number of cells of a complete proof; or the first point that refutes; or None: more than `MAX_CELLS` cells.
    """
    cells, proved = domain, 0
    while len(cells):
        if proved + len(cells) > MAX_CELLS:
            return None
        low, high = cells.bounds()
        middle = (low + high) / 2
        beyond = refutes(middle)
        if beyond.any():
            return np.asarray(middle[int(beyond.argmax())])
        smallest, axis = smallest_eigenvalues(pencil, cells)
        done = smallest > GUIDE_SLACK
        done[done] = are_positive_definite(pencil, cells.only(done))
        proved += int(done.sum())
        cells = cells.only(~done).halved(axis[~done])
    return proved


def cosine_enclosure(low: fmpq, high: fmpq, bits: int) -> tuple[int, int]:
    """Integers a, b with ``a <= 2^bits cos(x) <= b`` for every x in [low, high], tight to one unit.

    A cosine is monotone between neighbouring multiples of pi: its range is spanned by its ends and the multiples in it.
    """
    unit = 1 << bits
    with ctx.workprec(2 * bits):
        ends = [arb(x).cos() * unit for x in (low, high)]
        first = int((arb(low) / arb.pi()).lower().fmpq().ceil())
        last = int((arb(high) / arb.pi()).upper().fmpq().floor())
        below = min(int(end.lower().fmpq().floor()) for end in ends)
        above = max(int(end.upper().fmpq().ceil()) for end in ends)
    for multiple in range(first, min(last, first + 1) + 1):
        below, above = (min(below, -unit), above) if multiple % 2 else (below, max(above, unit))
    return max(below, -unit), min(above, unit)


def _exact_postures(sums: IntegerArray, cells: Cells) -> tuple[IntegerArray, IntegerArray, IntegerArray]:
    """Half widths h_a rounded up, and cosine and sine of the middle of every combination rounded down, in units.

    Shapes (N, n - 1), (N, m) and (N, m).
    """
    count, angles = cells.level.shape[0], cells.level.shape[1] - 1
    half = np.empty((count, angles), dtype=object)
    cosine, sine = (np.empty((count, sums.shape[1]), dtype=object) for _ in range(2))
    unit = 1 << ANGLE_BITS
    with ctx.workprec(2 * ANGLE_BITS):
        for cell in range(count):
            middles = []
            for axis in range(angles):
                low, high = cells.exact_interval(cell, axis)
                middles.append((low + high) / 2)
                half[cell, axis] = int(((high - low) / 2 * unit).ceil())
            for k, factors in enumerate(sums.T):
                angle = sum((m * factor for m, factor in zip(middles, factors, strict=True)), fmpq(0))
                sine_ball, cosine_ball = arb(angle).sin_cos()
                sine[cell, k] = _rounded_down(sine_ball * unit)
                cosine[cell, k] = _rounded_down(cosine_ball * unit)
    return half, cosine, sine


def _rounded_down(ball: arb) -> int:
    """An integer at most 2 below every number of a ball narrower than 1."""
    return int(ball.lower().fmpq().floor())


def _binomials(degree: int) -> int:
    """The least common multiple of all binomial(degree, p): it makes Bernstein coefficients of integers integers."""
    return lcm(*(comb(degree, p) for p in range(degree + 1)))


def _blossom(degree: int, u: Any, v: Any, unit: int = 1) -> npt.NDArray[Any]:
    """Bernstein coefficient j of ``f^p`` on [u, v] times `_binomials` and ``unit^degree``, shape (N, d + 1, d + 1).

    The coefficient is the elementary symmetric polynomial of degree p of (v repeated j times, u repeated d - j times)
    over binomial(d, p).

    Args:
        degree: d.
        u, v: N ends each, in units of 1 / unit.
        unit: see above.
    """
    table = [
        [
            sum(comb(j, k) * comb(degree - j, p - k) * v**k * u ** (p - k) for k in range(p + 1))
            * (_binomials(degree) // comb(degree, p) * unit ** (degree - p))
            for p in range(degree + 1)
        ]
        for j in range(degree + 1)
    ]
    return np.moveaxis(np.array(table), -1, 0)


@cache
def _signs(size: int) -> FloatArray:
    """All sign vectors of a size, one per row."""
    return np.array(list(product((1.0, -1.0), repeat=size))).reshape(2**size, size)


def _weighted(weights: IntegerArray, matrices: IntegerArray) -> IntegerArray:
    """``sum_k weights[n, k] matrices[n, j, k]``, shape (N, d + 1, n, n)."""
    return np.asarray((weights[:, None, :, None, None] * matrices).sum(axis=2))


def _are_minors_positive(matrices: IntegerArray) -> npt.NDArray[np.bool_]:
    """Whether symmetric integer matrices (..., n, n) are positive definite: all leading principal minors are positive.

    Bareiss elimination, whose pivots are those minors and whose divisions leave no remainder. After a pivot that is not
    positive the rest does not matter; 1 takes its place as divisor.
    """
    work, previous = matrices, np.array(1, dtype=object)
    positive = np.ones(matrices.shape[:-2], dtype=bool)
    for _ in range(matrices.shape[-1]):
        pivot = work[..., 0, 0]
        positive &= pivot > 0
        column, row = work[..., 1:, :1], work[..., :1, 1:]
        work = (pivot[..., None, None] * work[..., 1:, 1:] - column * row) // previous[..., None, None]
        previous = np.where(positive, pivot, 1)
    return positive
