"""Other conic solvers behind the library's direct assembly: ``svec(F_k(x)) = G_k x``, ``F_k(x) >= I``."""

# SCS, CVXOPT and SDPA are not typed.
# mypy: disable-error-code="import-untyped, import-not-found"

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import sparse

from quasilpv.arrays import FloatArray
from quasilpv.lmi.assembly import triangle_places
from quasilpv.lmi.compiled import CompiledProblem, rounded
from quasilpv.lmi.layout import Layout
from quasilpv.studies import Verdict

Found: TypeAlias = tuple[FloatArray | None, bool]
"""A candidate, if there is one, and whether the solver says that the problem is infeasible."""


class Conic(Protocol):
    """A solver set up for one layout."""

    def solve(self, coefficients: sparse.csc_matrix) -> Found:
        """Find x with ``F_k(x) >= I``, G given."""


def decide_with(solver: Conic, problem: CompiledProblem) -> Verdict:
    """What is known with another solver's answer; its candidate counts after the exact check, like any other."""
    candidate, infeasible = solver.solve(problem.matrix()[0])
    if candidate is not None and problem.holds_exactly(rounded(candidate)):
        return Verdict.FEASIBLE
    return Verdict.INFEASIBLE if infeasible else Verdict.UNKNOWN


class Scs:
    """SCS 3, a first-order method (O'Donoghue et al. 2016); its triangles are ordered by rows."""

    def __init__(self, layout: Layout) -> None:
        """Order the rows; ImportError without the package."""
        import scs  # noqa: PLC0415 -- a missing solver is reported, not an error

        self._solver = scs.SCS
        self._cone = {"s": list(layout.sizes)}
        self._order = _by_rows(layout.sizes)
        self._identity = layout.diagonal.astype(float)[self._order]

    def solve(self, coefficients: sparse.csc_matrix) -> Found:
        """See `Conic`."""
        rows = coefficients.tocsr()[self._order].tocsc()
        data = {"A": -rows, "b": -self._identity, "c": np.zeros(rows.shape[1])}
        solution = self._solver(data, self._cone, verbose=False, eps_abs=1e-6, eps_rel=1e-6, max_iters=5000).solve()
        return _finite(solution["x"]), solution["info"]["status"].startswith("infeasible")


class Cvxopt:
    """CVXOPT, a primal-dual method with dense cones (Andersen, Dahl and Vandenberghe).

    It minimises the sum of all traces, with which Z = I is inside the dual: without an objective it often gives up.
    """

    def __init__(self, layout: Layout) -> None:
        """Prepare the expansion to full matrices; ImportError without the package."""
        from cvxopt import matrix, solvers, spmatrix  # noqa: PLC0415

        self._dense, self._sparse, self._solve = matrix, spmatrix, solvers.sdp
        self._full = _full_matrices(layout.sizes)
        self._ends = np.cumsum([size * size for size in layout.sizes])
        self._right = [matrix(-np.eye(size)) for size in layout.sizes]
        self._identity = layout.diagonal.astype(float)

    def solve(self, coefficients: sparse.csc_matrix) -> Found:
        """See `Conic`."""
        full = (self._full @ coefficients).tocsr()
        left = [self._matrix(block) for block in _split(full, self._ends)]
        cost = self._dense(coefficients.T @ self._identity)
        options = {"show_progress": False, "maxiters": 40}  # it takes 20, or never arrives
        try:
            solution = self._solve(cost, Gs=left, hs=self._right, kktsolver="ldl", options=options)
        except (ArithmeticError, ValueError):  # a singular system
            return None, False
        point = None if solution["x"] is None else _finite(np.array(solution["x"]).ravel())
        return point, solution["status"] == "primal infeasible"

    def _matrix(self, block: sparse.csr_matrix) -> Any:
        entries = block.tocoo()
        return self._sparse((-entries.data).tolist(), entries.row.tolist(), entries.col.tolist(), entries.shape)


class Sdpa:
    """SDPA, a primal-dual method (Yamashita, Fujisawa and Kojima 2003), through sdpa-python."""

    def __init__(self, layout: Layout) -> None:
        """Prepare the expansion to full matrices; ImportError without the package."""
        import sdpap  # noqa: PLC0415

        self._sdpap = sdpap
        self._full = _full_matrices(layout.sizes)
        self._sizes = layout.sizes
        self._identity = sparse.csc_matrix(np.concatenate([np.eye(size).ravel() for size in layout.sizes])[:, None])

    def solve(self, coefficients: sparse.csc_matrix) -> Found:
        """See `Conic`."""
        full = (self._full @ coefficients).tocsc()
        unknowns = full.shape[1]
        cost = sparse.csc_matrix((unknowns, 1))
        free, cone = self._sdpap.SymCone(f=unknowns), self._sdpap.SymCone(s=self._sizes)
        option = {"print": "no", "numThreads": 1}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its estimate of a condition number
            point, _, info, _, _ = self._sdpap.solve(full, self._identity, cost, free, cone, option)
        infeasible = any(word in info["phasevalue"] for word in ("INF", "UNBD"))
        return _finite(np.asarray(point.todense()).ravel()), infeasible


SOLVERS: Mapping[str, Callable[[Layout], Conic]] = {"SCS": Scs, "CVXOPT": Cvxopt, "SDPA": Sdpa}


def _finite(point: Any) -> FloatArray | None:
    array = np.asarray(point, dtype=float)
    return array if np.all(np.isfinite(array)) else None


def _split(matrix: sparse.csr_matrix, ends: npt.NDArray[np.intp]) -> list[sparse.csr_matrix]:
    starts = np.concatenate([[0], ends[:-1]])
    return [matrix[start:end] for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


def _by_rows(sizes: tuple[int, ...]) -> npt.NDArray[np.intp]:
    """The rows of all upper triangles, stored column by column, in the order row by row."""
    orders, start = [], 0
    for size in sizes:
        i, j = triangle_places(size)
        orders.append(start + np.lexsort((j, i)))
        start += len(i)
    return np.concatenate(orders)


def _full_matrices(sizes: tuple[int, ...]) -> sparse.csr_matrix:
    """From the scaled upper triangles to the full matrices, all entries of each one after the other."""
    blocks = []
    for size in sizes:
        i, j = triangle_places(size)
        weight, entry = np.where(i == j, 0.5, np.sqrt(0.5)), np.arange(len(i))
        places = np.concatenate([i * size + j, j * size + i]), np.tile(entry, 2)
        blocks.append(sparse.csr_matrix((np.tile(weight, 2), places), shape=(size * size, len(i))))
    return sparse.block_diag(blocks, format="csr")
