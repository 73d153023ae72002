"""What the semidefinite programs of the chain certificates share: samples, scales, and the solver itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import pi
from typing import TypeAlias

import clarabel
import numpy as np
from scipy import sparse

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.tree import TreeJoint

Block: TypeAlias = tuple[FloatArray, FloatArray]
"""N inequalities affine in u unknowns: their part without unknowns, (N, s, s), and their slopes, (N, u, s, s)."""

FEWEST_ANGLES = 9
STORAGE_BITS = 24
USABLE_RESIDUAL = 1e-6
"""A solver that gave up this near to a solution has an answer: whoever asks checks it."""


def coordinates_of(lower: float, upper: float, per_turn: int) -> FloatArray:
    """Evenly spaced coordinates, ends included: so many a turn, and no fewer than a few."""
    if not np.isfinite(upper - lower) or upper - lower >= 2.0 * pi:
        return np.linspace(-pi, pi, per_turn, endpoint=False)
    return np.linspace(lower, upper, max(FEWEST_ANGLES, round(per_turn * (upper - lower) / (2.0 * pi)) + 1))


def symmetric_basis(size: int) -> FloatArray:
    """Symmetric matrices with a one at (i, j) and (j, i), i <= j, (count, size, size)."""
    i, j = np.triu_indices(size)
    basis = np.zeros((len(i), size, size))
    basis[np.arange(len(i)), i, j] = 1.0
    basis[np.arange(len(i)), j, i] = 1.0
    return basis


def twist_scales(joints: Sequence[TreeJoint], bodies: Iterable[FloatArray]) -> list[FloatArray]:
    """For every body, one over the square roots of the diagonal of the inertia it carries at coordinates 0, (6,).

    Args:
        joints: of the chain.
        bodies: 6 x 6, one per joint.
    """
    carried = np.zeros((6, 6))
    scales = []
    for joint, body in zip(reversed(joints), reversed(list(bodies)), strict=True):
        carried = carried + body
        scales.append(1.0 / np.sqrt(np.maximum(carried.diagonal(), 1e-9 * carried.diagonal().max())))
        X = joint.motion_matrices(np.array(0.0))
        carried = X.T @ carried @ X
    return scales[::-1]


def rounded(scaled: FloatArray, unit: FloatArray) -> FloatArray:
    """A storage in short binary numbers: multiples of 2^-24 of the unit that each entry is scaled by.

    Not of its own largest entry: where a joint's twists leave a direction free, a storage may be 10^4 times as large as
    the inequality's margin.

    Args:
        scaled: the storage, scaled.
        unit: by which an entry is larger, positive; of the same shape, or one number.
    """
    step = 2.0 ** (np.floor(np.log2(unit)) - STORAGE_BITS)
    return np.asarray(np.round(scaled * unit / step) * step)


def minimise(cost: FloatArray, blocks: Sequence[Block]) -> FloatArray | None:
    """Minimise ``cost . x`` subject to ``F + sum x_u G_u >= 0`` for all blocks (N, s, s) and (N, u, s, s).

    Returns:
        None if the solver has no answer. One that it calls inaccurate is one: whoever asks checks it.
    """
    rows, offsets, cones = [], [], []
    for F, G in blocks:
        size = F.shape[-1]
        j, i = np.tril_indices(size)  # upper triangle, column by column
        weight = np.where(i == j, 1.0, np.sqrt(2.0))
        offsets.append((F[:, i, j] * weight).ravel())
        rows.append(-(G[:, :, i, j] * weight).transpose(0, 2, 1).reshape(-1, len(cost)))
        cones += [clarabel.PSDTriangleConeT(size)] * len(F)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    A = sparse.csc_matrix(np.vstack(rows))
    quadratic = sparse.csc_matrix((len(cost), len(cost)))
    solution = clarabel.DefaultSolver(quadratic, cost, A, np.concatenate(offsets), cones, settings).solve()
    x = np.asarray(solution.x)
    near = max(solution.r_prim, solution.r_dual) < USABLE_RESIDUAL
    usable = str(solution.status) in {"Solved", "AlmostSolved", "InsufficientProgress"} or near
    return x if usable and np.all(np.isfinite(x)) else None
