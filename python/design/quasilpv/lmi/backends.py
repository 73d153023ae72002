"""Which program solves a problem."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

from quasilpv.extras import missing_extra
from quasilpv.lmi import clarabel_backend
from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.expressions import Expression, Variable
from quasilpv.lmi.raw_solution import RawSolution

BackendName: TypeAlias = Literal["clarabel", "cvxpy"]


def solve(
    constraints: Sequence[Constraint],
    objective: Expression | None,
    variables: Sequence[Variable],
    backend: BackendName,
    solver: str | None,
) -> RawSolution:
    """Minimise the objective subject to every expression being positive semidefinite.

    Args:
        constraints, objective, variables: the problem.
        backend: ``"clarabel"`` (assembled directly, fast) or ``"cvxpy"`` (any of its solvers, slow).
        solver: of cvxpy, by its name there; None for its default.

    Raises:
        ValueError: unknown back end, a solver for a back end that has no choice, or one that is not installed.
        InputError: cvxpy itself is not installed: it comes with the extra ``oracles``.
    """
    if backend == "clarabel":
        if solver is not None:
            raise ValueError(f"solver: got {solver!r}, expected none for the back end clarabel")
        return clarabel_backend.solve(constraints, objective, variables)
    if backend == "cvxpy":
        try:
            from quasilpv.lmi import cvxpy_backend  # noqa: PLC0415 -- takes a second to import and is rarely wanted
        except ImportError as error:
            missing = missing_extra(error)
            if missing is None:
                raise
            raise missing from error
        return cvxpy_backend.solve(constraints, objective, variables, solver or cvxpy_backend.DEFAULT_SOLVER)
    raise ValueError(f"backend: got {backend!r}, expected one of {', '.join(get_args(BackendName))}")
