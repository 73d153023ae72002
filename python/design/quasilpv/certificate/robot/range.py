"""The needed range: which ``M_t / M_n`` occur over operating domain and payload set, proved by branch and bound.

``c1 M_n < M_t < c2 M_n`` for every posture and every payload fraction bounds all eigenvalues of ``M_n^-1 M_t``, and
implies, one subtracted from the other, that M_n is positive definite wherever the robot can be. Both are pencils of
`gate_cells`: a cell that the guide does not accept is cut in two, a cell that it accepts is put to the exact test.

Postures, not premises: cosines of angles that add up are dependent, and at the corners of the premise box there is no
posture and sometimes no definite inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.cells import Cells, Pencil, cosine_enclosure, prove_positive
from quasilpv.certificate.exact.cosine_matrices import CosineMatrix
from quasilpv.certificate.exact.matrices import rational, zero
from quasilpv.certificate.exact.rationals import float_at_least, float_at_most, to_float, to_floats
from quasilpv.certificate.robot.inertia import InertiaData, Pair, design_inertia, true_inertia
from quasilpv.errors import InputError

Side: TypeAlias = Literal["lowest", "highest"]

DEGREE = 3
"""Of M_t in the payload fraction."""

TOLERANCE = 0.002
LOOSEST_TOLERANCE = 0.1
SAMPLES = 3000
SAMPLED_FRACTIONS = 9
CLIMB_STEPS = 60
BOUND_BITS = 30
BOX_BITS = 100


@dataclass(frozen=True)
class Place:
    """Where an inertia ratio occurs: joint angles and payload fraction."""

    angle_rad: tuple[float, ...]
    payload_fraction: float
    inertia_ratio: float


@dataclass(frozen=True)
class NeededRange:
    """Proved bounds of ``M_t / M_n``, and sampled places that come close to them.

    Attributes:
        lowest: c1, with M_t > c1 M_n.
        highest: c2, with M_t < c2 M_n.
        where_lowest: a place whose smallest ratio is the smallest found.
        where_highest: a place whose largest ratio is the largest found.
        cells: how many cells the two proofs took.
    """

    lowest: fmpq
    highest: fmpq
    where_lowest: Place
    where_highest: Place
    cells: int

    def to_floats(self) -> tuple[float, float]:
        """The bounds as doubles, rounded outwards."""
        return float_at_most(self.lowest), float_at_least(self.highest)


class InertiaPair:
    """The true and the design inertia of one robot: exact pencils, and sampled ratios.

    Attributes:
        data: as shipped.
        true: M_t(delta, f) in absolute angles.
        design: M_n(delta) in absolute angles.

    Raises:
        InputError: on the operating domain a premise leaves the box the run-time clamps it to.
    """

    def __init__(self, data: InertiaData) -> None:
        """Build both inertias from the shipped data."""
        _require_premises_inside_box(data)
        self.data = data
        self.true, self.design = _true_matrix(data), _design_matrix(data)
        true, design = true_inertia(data), design_inertia(data)
        self._true_floats = np.array([[[to_float(x[p]) for p in range(DEGREE + 1)] for x in row] for row in true])
        self._design_floats = to_floats(design.constant)
        self._slope_floats = {pair: to_floats(slope) for pair, slope in design.slopes.items()}

    def domain(self) -> Cells:
        """All postures (differences of neighbouring absolute angles) and payload fractions as one cell."""
        lower, upper = ([interval[side] for interval in self.data.relative_rad] for side in (0, 1))
        return Cells.whole([*lower, fmpq(0)], [*upper, fmpq(1)])

    def pencil(self, side: Side, bound: fmpq) -> Pencil:
        """``M_t - bound M_n`` for a lowest ratio, ``bound M_n - M_t`` for a highest."""
        sign = fmpq(1 if side == "lowest" else -1)
        return (self.true * sign + self.design * (-sign * bound)).to_pencil()

    def ratios(self, points: FloatArray) -> FloatArray:
        """Eigenvalues of ``M_n^-1 M_t`` in doubles, ascending, (N, n), at points (posture, f), (N, n).

        Raises:
            numpy.linalg.LinAlgError: M_n is not positive definite at one of the points.
        """
        relative = np.column_stack([np.zeros(len(points)), points[:, :-1]])
        cosines = _cosines(np.cumsum(relative, axis=1))
        powers = points[:, -1, None] ** np.arange(DEGREE + 1)
        true = np.einsum("ijp,np->nij", self._true_floats, powers) * cosines
        factor = np.linalg.cholesky(self._absolute_design_inertia(cosines))
        half = np.linalg.solve(factor, true)
        return np.asarray(np.linalg.eigvalsh(np.linalg.solve(factor, half.transpose(0, 2, 1))))

    def true_inertia_at(self, angles: FloatArray, payload_fraction: float) -> FloatArray:
        """M_t in doubles and joint coordinates, (N, n, n), at configurations (N, n) with one payload."""
        D = self._true_floats @ payload_fraction ** np.arange(DEGREE + 1)
        return self._in_joint_angles(D * _cosines(self.data.absolute(angles)))

    def design_inertia_at(self, angles: FloatArray) -> FloatArray:
        """M_n in doubles and joint coordinates, (N, n, n), at configurations (N, n)."""
        return self._in_joint_angles(self._absolute_design_inertia(_cosines(self.data.absolute(angles))))

    def _in_joint_angles(self, absolute: FloatArray) -> FloatArray:
        """``S' X S`` of (N, n, n)."""
        S = to_floats(self.data.mechanism.absolute_map)
        return np.asarray(S.T @ absolute @ S)

    def _absolute_design_inertia(self, cosines: FloatArray) -> FloatArray:
        """M_n in absolute angles, (N, n, n)."""
        design = np.tile(self._design_floats, (len(cosines), 1, 1))
        for (i, j), slope in self._slope_floats.items():
            design += cosines[:, i, j, None, None] * slope
        return design

    def samples(self) -> FloatArray:
        """About `SAMPLES` points (posture, f) of the domain, its bounds included."""
        intervals = [(to_float(low), to_float(high)) for low, high in self.data.relative_rad]
        per_joint = max(3, round((SAMPLES / SAMPLED_FRACTIONS) ** (1 / max(1, len(intervals)))))
        axes = [np.linspace(low, high, per_joint) for low, high in intervals]
        axes.append(np.linspace(0.0, 1.0, SAMPLED_FRACTIONS))
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    def nearest_place(self, ratio: float) -> Place:
        """The sampled place one of whose ratios is nearest to a given one."""
        points = self.samples()
        ratios = self.ratios(points)
        row, column = np.unravel_index(int(np.abs(ratios - ratio).argmin()), ratios.shape)
        return self.place(points[row], float(ratios[row, column]))

    def place(self, point: FloatArray, ratio: float) -> Place:
        """A point (posture, f) as joint angles."""
        return Place(self.data.configuration(point[:-1]), float(point[-1]), ratio)


def needed_range(inertia: InertiaPair, tolerance: float = TOLERANCE) -> NeededRange | None:
    """Prove bounds of ``M_t / M_n`` over the operating domain and all payload fractions in [0, 1].

    Args:
        inertia: true and design inertia.
        tolerance: wanted relative distance of the bounds from ratios that occur; coarser if the proof gets too long.

    Returns:
        The bounds; None if the design inertia is not positive definite in some posture, or nothing can be proved.
    """
    try:
        lowest = _Side(inertia, "lowest").prove(tolerance)
        highest = _Side(inertia, "highest").prove(tolerance)
    except np.linalg.LinAlgError:
        return None
    if lowest is None or highest is None:
        return None
    return NeededRange(lowest[0], highest[0], lowest[1], highest[1], lowest[2] + highest[2])


def extreme_place(inertia: InertiaPair, side: Side) -> Place:
    """The place with the smallest or the largest ratio that samples and climbing find."""
    return _Side(inertia, side).place


class _Side:
    """One bound: the most extreme ratio found so far, and the proof that little lies beyond it."""

    def __init__(self, inertia: InertiaPair, side: Side) -> None:
        self._inertia = inertia
        self._side = side
        self._sign = 1.0 if side == "highest" else -1.0
        self._low, self._high = (bounds[0] for bounds in inertia.domain().bounds())
        points = inertia.samples()
        self._climb(points[self._extremes(points).argmax()])

    @property
    def place(self) -> Place:
        """The most extreme ratio found so far."""
        return self._inertia.place(self._point, self._sign * self._value)

    def prove(self, tolerance: float) -> tuple[fmpq, Place, int] | None:
        """Bound, place and cells; the tolerance is doubled when a proof takes too many cells."""
        while tolerance < LOOSEST_TOLERANCE:
            bound = self._bound(tolerance)
            outcome = self._prove(bound)
            if isinstance(outcome, int):
                return bound, self.place, outcome
            if outcome is None:
                tolerance *= 2
            else:  # a more extreme ratio than the samples showed
                self._climb(outcome)
        return None

    def _prove(self, bound: fmpq) -> int | FloatArray | None:
        """Cells of a complete proof; or a point that refutes the bound; or None: too many cells."""
        limit = self._sign * to_float(bound)
        pencil = self._inertia.pencil(self._side, bound)
        return prove_positive(pencil, self._inertia.domain(), lambda points: self._extremes(points) > limit)

    def _extremes(self, points: FloatArray) -> FloatArray:
        """Largest ratio at each point, or smallest ratio with the opposite sign: larger is more extreme."""
        return self._sign * self._inertia.ratios(points)[:, -1 if self._side == "highest" else 0]

    def _climb(self, start: FloatArray) -> None:
        """Pattern search from a point: the best neighbour at the current step, or half the step."""
        self._point, self._value = start, float(self._extremes(start[None])[0])
        step = (self._high - self._low) / 16
        for _ in range(CLIMB_STEPS):
            moves = np.vstack([np.diag(step), -np.diag(step)])
            neighbours = np.clip(self._point + moves, self._low, self._high)
            values = self._extremes(neighbours)
            best = int(values.argmax())
            if values[best] > self._value:
                self._point, self._value = neighbours[best], float(values[best])
            else:
                step = step / 2

    def _bound(self, tolerance: float) -> fmpq:
        """The extreme ratio widened by the tolerance, rounded outwards to a short rational."""
        wide = self._value + tolerance * abs(self._value)
        return int(self._sign) * fmpq(int(np.ceil(wide * 2**BOUND_BITS)), 1 << BOUND_BITS)


def premise_ranges(data: InertiaData) -> tuple[tuple[fmpq, fmpq], ...]:
    """Proved bounds of every premise over the operating domain, tight to `BOX_BITS` bits."""
    return tuple(cosine_range(data, pair) for pair in data.premise_pairs)


def cosine_range(data: InertiaData, pair: Pair) -> tuple[fmpq, fmpq]:
    """Proved bounds of ``cos(alpha_j - alpha_i)`` over the operating domain, tight to `BOX_BITS` bits."""
    i, j = pair
    low, high = (sum((x[side] for x in data.relative_rad[i:j]), fmpq(0)) for side in (0, 1))
    below, above = cosine_enclosure(low, high, BOX_BITS)
    unit = 1 << BOX_BITS
    return fmpq(below, unit), fmpq(above, unit)


def _require_premises_inside_box(data: InertiaData) -> None:
    for p, (below, above) in enumerate(premise_ranges(data)):
        lower, upper = data.premise_lower[p], data.premise_upper[p]
        if below < rational(lower) or above > rational(upper):
            raise InputError("law", f"inertia: box of premise {p}", f"[{lower}, {upper}]", "its range on the domain")


def _true_matrix(data: InertiaData) -> CosineMatrix:
    """``D_kl(f) cos(alpha_k - alpha_l)``, exactly."""
    n, D = data.joints, true_inertia(data)
    terms = {(0,) * (n - 1): _powers(n, [(D[i][i], i, i) for i in range(n)])}
    for i, j in data.pairs:
        terms[_difference(n, (i, j))] = _powers(n, [(D[i][j], i, j), (D[j][i], j, i)])
    return CosineMatrix(terms, zero(n, n))


def _design_matrix(data: InertiaData) -> CosineMatrix:
    """M_n with what its vertices' rounding adds."""
    n, design = data.joints, design_inertia(data)
    slopes = {_difference(n, pair): (slope,) for pair, slope in design.slopes.items()}
    return CosineMatrix({(0,) * (n - 1): (design.constant,), **slopes}, design.rest)


def _powers(n: int, entries: Sequence[tuple[fmpq_poly, int, int]]) -> tuple[fmpq_mat, ...]:
    """Entries that are polynomials in f, each at its row and column, as matrices by power."""
    matrices = [zero(n, n) for _ in range(DEGREE + 1)]
    for polynomial, i, j in entries:
        for power, matrix in enumerate(matrices):
            matrix[i, j] = polynomial[power]
    return tuple(matrices)


def _difference(n: int, pair: Pair) -> tuple[int, ...]:
    """``alpha_j - alpha_i = delta_{i+1} + ... + delta_j`` as a combination of the n - 1 angles delta."""
    i, j = pair
    return tuple(int(i <= a < j) for a in range(n - 1))


def _cosines(absolute: FloatArray) -> FloatArray:
    """``cos(alpha_k - alpha_l)`` at absolute angles (N, n), (N, n, n)."""
    return np.asarray(np.cos(absolute[:, :, None] - absolute[:, None, :]))
