"""Whether an affine matrix is invertible at every state of the domain, cell by cell.

The box of the premises holds points that no state reaches, and a matrix may be singular there alone: of an arm with
wide angles the inertia is positive definite in every posture, and indefinite where three cosines take values that no
two angles give. Over a small cell of the domain the premises stay in a small box of their own. There
``He(E(z) G) > 0`` with G the inverse at the middle, affine in z, proves E(z) invertible once it holds at the corners;
else the cell is halved. Where the matrix at the middle is symmetric and positive definite, as inertias are, G = 1 asks
for less.
"""

from __future__ import annotations

from itertools import product
from math import isfinite

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.enclosure import halves
from quasilpv.systems.intervals.interval_function import IntervalFunction

Box = tuple[tuple[float, float], ...]

MOST_CELLS = 3000
MOST_PREMISES = 6
"""In the matrix: every corner of their box is looked at."""

CLEARANCE = 1e-10
"""Least eigenvalue over the size of what was multiplied; rounding is below n^2 2^-48 of that."""


def cells_with_inverse(system: DescriptorSystem, matrix: AffineMatrix, block: slice) -> int | None:
    """In how many cells of the domain a diagonal block was proved invertible, all of it; None if it was not.

    Args:
        system: whose premises and domain they are.
        matrix: one of its matrices.
        block: rows and columns.
    """
    constant, slopes = matrix.constant[block, block], matrix.coefficients[:, block, block]
    used = [p for p in range(len(system.premises)) if slopes[p].any()]
    premises = [system.premises[p] for p in used]
    symbols = sorted({s for premise in premises for s in premise.expression.free_symbols}, key=str)
    domain = tuple(system.domain.get(symbol, (-np.inf, np.inf)) for symbol in symbols)
    if not 0 < len(used) <= MOST_PREMISES or not all(isfinite(end) for interval in domain for end in interval):
        return None
    try:
        functions = [IntervalFunction(premise.expression, symbols) for premise in premises]
        bounds = [premise.bounds for premise in premises]
        widths = [high - low for low, high in domain]
        cells, done = [domain], 0
        while cells and done + len(cells) <= MOST_CELLS:
            cell = cells.pop()
            box = [_within(function, cell, own) for function, own in zip(functions, bounds, strict=True)]
            if _has_inverse(constant, slopes[used], box):
                done += 1
            elif not _split(cell, widths, cells):
                return None
    except InputError:  # a function that has no range there
        return None
    return None if cells else done


def _within(function: IntervalFunction, cell: Box, bounds: tuple[float, float]) -> tuple[float, float]:
    """The range of a premise over a cell, no wider than it is over the domain."""
    low, high = function.bounds(cell)
    return max(low, bounds[0]), min(high, bounds[1])


def _has_inverse(constant: FloatArray, slopes: FloatArray, box: list[tuple[float, float]]) -> bool:
    """He(E) > 0 at the corners, in the coordinates in which the matrix at the middle is 1, or He(E G) > 0."""
    corners = np.array(list(product(*box))).reshape(-1, len(box))
    E = constant + np.einsum("cp,pij->cij", corners, slopes)
    middle = E.mean(axis=0)
    try:
        if np.array_equal(middle, middle.T) and np.linalg.eigvalsh(middle)[0] > 0.0:
            W = np.linalg.inv(np.linalg.cholesky(middle))
            return _is_positive(W @ E @ W.T, _size(W) ** 2 * _size(E))
        G = np.linalg.inv(middle)
    except np.linalg.LinAlgError:
        return False
    return _is_positive(E @ G, _size(G) * _size(E))


def _size(matrices: FloatArray) -> float:
    return float(np.linalg.norm(matrices, axis=(-2, -1)).max())


def _is_positive(matrices: FloatArray, size: float) -> bool:
    """Whether the symmetric parts are positive definite by more than what rounding can do to products of that size."""
    if not (isfinite(size) and np.isfinite(matrices).all()):
        return False
    least = np.linalg.eigvalsh((matrices + matrices.transpose(0, 2, 1)) / 2.0)[:, 0].min()
    return bool(least > CLEARANCE * size)


def _split(cell: Box, widths: list[float], cells: list[Box]) -> bool:
    """Halve a cell along what is widest of the domain; False if nothing is left to halve."""
    shares = [(high - low) / width if width > 0.0 else 0.0 for (low, high), width in zip(cell, widths, strict=True)]
    if not shares or max(shares) < 1e-6:
        return False
    cells.extend(halves(cell, int(np.argmax(shares))))
    return True
