"""Which columns of a tall sparse matrix to keep so that they span what all of them span."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import sparse

TOLERANCE = 1e-9
"""A column of length one counts as dependent if what is left of it is shorter."""

ROWS_MIXED = 8
"""Combinations in which a row takes part: enough that no small set of sparse columns loses its rank."""

COLUMNS_AT_ONCE = 64
"""Columns that are made orthogonal to the kept ones by one matrix product."""


def independent_columns(matrix: sparse.csr_matrix) -> npt.NDArray[np.intp]:
    """A basis among the columns, the sparsest there is, in ascending order.

    Columns are taken by their number of entries; one that depends on those taken before is left out. No other basis has
    fewer entries (the greedy algorithm on a matroid), and few entries are what a sparse factorisation is fast with.

    There are usually many more rows than columns. Twice as many random combinations of the rows as there are columns
    have the same dependent columns, up to chances of no account (Clarkson and Woodruff 2013, sparse embeddings). They
    are made orthogonal instead (Gram and Schmidt, twice), and are the same in every run.

    Args:
        matrix: (rows, columns).
    """
    entries = np.diff(matrix.tocsc().indptr)
    filled = matrix[np.flatnonzero(np.diff(matrix.indptr))]
    dense = (_combinations(2 * filled.shape[1], filled.shape[0]) @ filled).toarray()
    norms = np.linalg.norm(dense, axis=0)
    dense /= np.where(norms > 0.0, norms, 1.0)
    order = np.argsort(entries, kind="stable")
    basis = np.empty((dense.shape[0], min(dense.shape)), order="F")
    kept: list[int] = []
    for start in range(0, len(order), COLUMNS_AT_ONCE):
        chunk, before = order[start : start + COLUMNS_AT_ONCE], len(kept)
        remainders = _without(dense[:, chunk], basis[:, :before])
        for column, remainder in zip(chunk.tolist(), remainders.T, strict=True):
            rest = _without(remainder, basis[:, before : len(kept)])
            length = float(np.linalg.norm(rest))
            if length > TOLERANCE:
                basis[:, len(kept)] = rest / length
                kept.append(column)
    return np.sort(np.array(kept, dtype=np.intp))


def _without(vectors: npt.NDArray[np.float64], basis: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """What is left of vectors orthogonal to an orthonormal basis; the second pass removes what rounding left."""
    for _ in range(2):
        vectors = vectors - basis @ (basis.T @ vectors)
    return vectors


def _combinations(count: int, rows: int) -> sparse.csr_matrix:
    """Matrix (count, rows) that takes every row into `ROWS_MIXED` combinations; the identity if there are few rows."""
    if rows <= count:
        return sparse.identity(rows, format="csr")
    random = np.random.default_rng(0)
    places = random.integers(0, count, rows * ROWS_MIXED), np.repeat(np.arange(rows), ROWS_MIXED)
    return sparse.csr_matrix((random.standard_normal(rows * ROWS_MIXED), places), shape=(count, rows))
