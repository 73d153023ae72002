"""The largest eigenvalue of a symmetric matrix function over a box of angles, bounded from both sides.

``X(theta) = X_0 + sum_k (sin(s_k) X_k + cos(s_k) Y_k)`` with sums ``s_k`` of angles. On a cell ``theta_a = middle_a +-
h_a`` a sine or cosine differs from its tangent by at most ``H_k^2 / 2``, ``H_k`` the sum of the h_a in s_k, so that
``X < bound I`` on the whole cell if at each of its corners sigma

    bound I - X(middle) - sum_a sigma_a h_a dX/dtheta_a (middle) - diag(r) > 0,

    r = row sums of sum_k H_k^2 / 2 (|X_k| + |Y_k|).

Doubles decide which cells to cut; what is claimed is decided in rational arithmetic, with sines and cosines enclosed by
interval arithmetic.

Reference: Neumaier (1990), Interval Methods for Systems of Equations, chapter 2 (mean value forms).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from mpmath import libmp

from quasilpv.arrays import FloatArray
from quasilpv.lmi import is_positive_definite
from quasilpv.lmi.exact import Matrix
from quasilpv.systems.intervals.functions import iv

Interval = tuple[float, float]

SAMPLES_PER_AXIS = 25
MAX_CELLS = 100_000
TRIG_BITS = 60


@dataclass(frozen=True)
class Bound:
    """A supremum from both sides.

    Attributes:
        proved: no value is larger.
        attained: a value that was found, in double arithmetic.
        cells: how many cells the proof took.
    """

    proved: float
    attained: float
    cells: int

    @property
    def tightness(self) -> float:
        """Proved over attained, at least 1 and at best 1."""
        return self.proved / self.attained


class ProofError(ArithmeticError):
    """A bound could not be proved with `MAX_CELLS` cells."""


@dataclass(frozen=True, eq=False)
class TrigonometricPencil:
    """``X(theta) = X_0 + sum_k (sin(s_k) X_k + cos(s_k) Y_k)``, ``s = sums theta``.

    Attributes:
        constant: X_0, symmetric, rational, (m, m).
        slopes: the X_k.
        sums: zeros and ones, (k, angles).
        cosines: the Y_k; none for zeros.
    """

    constant: Matrix
    slopes: Sequence[Matrix]
    sums: FloatArray
    cosines: Sequence[Matrix] = ()

    @cached_property
    def _floats(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """X_0, X_k and Y_k in doubles."""
        sines = np.array(self.slopes, dtype=float)
        cosines = np.array(self.cosines, dtype=float) if self.cosines else np.zeros_like(sines)
        return self.constant.astype(float), sines, cosines

    def _at(self, angle: FloatArray) -> FloatArray:
        """X at B values of the sums, (B, k) -> (B, m, m)."""
        constant, sines, cosines = self._floats
        moving = np.tensordot(np.sin(angle), sines, axes=1) + np.tensordot(np.cos(angle), cosines, axes=1)
        return np.asarray(constant + moving)

    def eigenvalues(self, theta: FloatArray) -> FloatArray:
        """Largest eigenvalue at B points, (B, angles) -> (B,), in doubles."""
        values = self._at(theta @ self.sums.T)
        return np.asarray(np.linalg.eigvalsh(values)[..., -1])

    def guide(self, middle: FloatArray, half: FloatArray) -> FloatArray:
        """Largest eigenvalue of all matrices to be tested, per cell, in doubles."""
        _, sines, cosines = self._floats
        angle, reach = middle @ self.sums.T, half @ self.sums.T
        rest = np.tensordot(reach**2 / 2, (np.abs(sines) + np.abs(cosines)).sum(axis=-1), axes=1)
        value = self._at(angle) + rest[..., None] * np.eye(sines.shape[-1])
        largest = np.full(len(middle), -np.inf)
        for signs in product((-1.0, 1.0), repeat=middle.shape[1]):
            deviation = (half * signs) @ self.sums.T
            tested = value + np.tensordot(np.cos(angle) * deviation, sines, axes=1)
            tested -= np.tensordot(np.sin(angle) * deviation, cosines, axes=1)
            largest = np.maximum(largest, np.linalg.eigvalsh(tested)[:, -1])
        return largest

    def is_below(self, bound: Fraction, middle: Sequence[Fraction], half: Sequence[Fraction]) -> bool:
        """The verdict on one cell, exact."""
        identity = np.eye(len(self.constant), dtype=int).astype(object)
        zero = 0 * identity
        places = [[a for a, included in enumerate(row) if included] for row in self.sums]
        trig = [_sine_cosine(sum((middle[a] for a in place), Fraction(0))) for place in places]
        cosines = self.cosines or [zero] * len(places)
        terms = list(zip(trig, self.slopes, cosines, strict=True))
        centre = bound * identity - self.constant - sum((sin * X + cos * Y for (sin, cos), X, Y in terms), zero)
        tangents = [cos * X - sin * Y for (sin, cos), X, Y in terms]
        for place, X, Y in zip(places, self.slopes, cosines, strict=True):
            reach = sum((half[a] for a in place), Fraction(0))
            slack = reach**2 / 2 + (1 + reach) / (1 << TRIG_BITS)
            centre = centre - np.diag(slack * (np.abs(X) + np.abs(Y)).sum(axis=1))
        for signs in product((-1, 1), repeat=len(middle)):
            deviations = [sum((signs[a] * half[a] for a in place), Fraction(0)) for place in places]
            tilted = sum((d * T for d, T in zip(deviations, tangents, strict=True)), zero)
            if not is_positive_definite(centre - tilted):
                return False
        return True


def largest_eigenvalue(pencils: Sequence[TrigonometricPencil], box: Sequence[Interval], tolerance: float) -> Bound:
    """The largest eigenvalue of any of some pencils over a box of angles.

    Args:
        pencils: over the same angles.
        box: their intervals, rad.
        tolerance: excess of the proved bound over the largest value found, relative to it; > 0.

    Raises:
        ProofError: that takes more than `MAX_CELLS` cells.
    """
    moving = np.any([pencil.sums.any(axis=0) for pencil in pencils], axis=0)
    axes = [np.linspace(*interval, SAMPLES_PER_AXIS if used else 1) for interval, used in zip(box, moving, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(box))
    attained = max(float(pencil.eigenvalues(points).max()) for pencil in pencils)
    bound = attained + tolerance * abs(attained)
    return Bound(bound, attained, sum(prove_below(pencil, bound, box) for pencil in pencils))


def prove_below(pencil: TrigonometricPencil, bound: float, box: Sequence[Interval]) -> int:
    """Prove ``X < bound I`` over the box.

    Returns:
        The number of cells it took.

    Raises:
        ProofError: that takes more than `MAX_CELLS` cells, or it is not true.
    """
    moving = pencil.sums.any(axis=0)
    exact = [(Fraction(low), Fraction(high)) for low, high in box]
    open_cells = np.zeros((1, 2, len(box)), dtype=object)  # (cell, level and index, axis)
    proved = 0
    while len(open_cells):
        if proved + len(open_cells) > MAX_CELLS:
            raise ProofError(f"{bound:.6g} is not proved with {MAX_CELLS} cells")
        middle, half = _floats(open_cells, box)
        accepted = pencil.guide(middle, half) < bound - 1e-12 * abs(bound)
        accepted[accepted] = [
            pencil.is_below(Fraction(bound), *_exact_cell(cell, exact)) for cell in open_cells[accepted]
        ]
        proved += int(accepted.sum())
        open_cells = np.array(
            [
                child
                for cell, wide in zip(open_cells[~accepted], half[~accepted], strict=True)
                for child in _halves(cell, int(np.argmax(np.where(moving, wide, -1.0))))
            ]
        ).reshape(-1, 2, len(box))
    return proved


def _floats(cells: npt.NDArray[np.object_], box: Sequence[Interval]) -> tuple[FloatArray, FloatArray]:
    low, high = np.array(box).T
    half = (high - low) / 2 * 0.5 ** cells[:, 0].astype(float)
    return low + half * (2 * cells[:, 1].astype(float) + 1), half


def _exact_cell(
    cell: npt.NDArray[np.object_], box: Sequence[tuple[Fraction, Fraction]]
) -> tuple[list[Fraction], list[Fraction]]:
    half = [(high - low) / 2 / (1 << int(level)) for (low, high), level in zip(box, cell[0], strict=True)]
    middle = [low + h * (2 * int(index) + 1) for (low, _), h, index in zip(box, half, cell[1], strict=True)]
    return middle, half


def _halves(cell: npt.NDArray[np.object_], axis: int) -> Iterator[npt.NDArray[np.object_]]:
    for side in (0, 1):
        child = cell.copy()
        child[0, axis] += 1
        child[1, axis] = 2 * child[1, axis] + side
        yield child


def _sine_cosine(angle: Fraction) -> tuple[Fraction, Fraction]:
    """Rational sine and cosine, each within ``2^-TRIG_BITS`` of the truth."""
    x = iv.mpf(angle.numerator) / iv.mpf(angle.denominator)
    return _rational(iv.sin(x)), _rational(iv.cos(x))


def _rational(value: Any) -> Fraction:
    """The middle of a narrow interval."""
    low, high = (Fraction(*libmp.to_rational(end)) for end in value._mpi_)
    return (low + high) / 2
