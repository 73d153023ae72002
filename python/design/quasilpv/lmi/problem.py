"""A semidefinite program over named linear matrix inequalities, its outcome, and its margins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import symmetric
from quasilpv.lmi import backends, budget
from quasilpv.lmi.backends import BackendName
from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.exact import Matrix, is_positive_definite, symmetric_part, to_rational
from quasilpv.lmi.expressions import Expression, Operand, Variable, as_expression, identity
from quasilpv.lmi.raw_solution import RawSolution


class Outcome(Enum):
    """What is known about a problem. A solver status alone never gives more than `SOLVER_ONLY`."""

    NOT_RUN = "not_run"
    VERIFIED = "verified"  # every inequality holds strictly at the returned point, in exact arithmetic
    SOLVER_ONLY = "solver_only"  # the solver says solved, the exact check says no
    INFEASIBLE_NUMERICALLY = "infeasible_numerically"  # the solver found a dual certificate, not checked exactly
    UNKNOWN = "unknown"  # the solver gave up


@dataclass(frozen=True)
class Solution:
    """Values of the variables, and what they are worth.

    Attributes:
        outcome: see `Outcome`.
        values: one matrix per variable (empty when there is no candidate).
        objective: value of the objective at the candidate (0 for pure feasibility, NaN without a candidate).
        margins: smallest eigenvalue of each inequality at the candidate, by name, in double arithmetic.
        iterations: of the solver.
    """

    outcome: Outcome
    values: Mapping[Variable, npt.NDArray[np.float64]] = field(default_factory=dict)
    objective: float = float("nan")
    margins: Mapping[str, float] = field(default_factory=dict)
    iterations: int = 0

    @property
    def verified(self) -> bool:
        """Whether the candidate was proved to satisfy every inequality."""
        return self.outcome is Outcome.VERIFIED


class Problem:
    """Minimise a scalar affine expression subject to linear matrix inequalities.

    Example:
        >>> P = Variable("P", 2, symmetric=True)
        >>> problem = Problem()
        >>> problem.positive("P", P - np.eye(2))
        >>> problem.minimise(np.ones((1, 2)) @ P @ np.ones((2, 1)))
        >>> problem.solve().verified
        True
    """

    def __init__(self) -> None:
        """Start with no inequality and the zero objective."""
        self._constraints: list[Constraint] = []
        self._names: set[str] = set()
        self._objective: Expression | None = None

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The inequalities, in the order in which they were added."""
        return tuple(self._constraints)

    @property
    def objective(self) -> Expression | None:
        """The 1 x 1 expression that is minimised, if any."""
        return self._objective

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables, each once."""
        expressions = [c.expression for c in self._constraints] + ([self._objective] if self._objective else [])
        return tuple(dict.fromkeys(v for e in expressions for v in e.variables))

    def positive(self, name: str, expression: Operand) -> None:
        """Require ``expression > 0``; of an expression without rows that is nothing.

        Raises:
            ValueError: the expression is not square, or the name is taken.
            TimeUpError: the time limit was reached (`quasilpv.lmi.budget`).
        """
        square = as_expression(expression)
        if square.shape[0] != square.shape[1]:
            raise ValueError(f"{name}: an inequality is square, got {square.shape}")
        if name in self._names:
            raise ValueError(f"{name}: there is already an inequality of that name")
        if square.shape[0] == 0:
            return
        budget.time_left_s()  # writing a large problem down takes seconds
        self._names.add(name)
        self._constraints.append(Constraint(name, square))

    def negative(self, name: str, expression: Operand) -> None:
        """Require ``expression < 0``. Errors as `positive`."""
        self.positive(name, -as_expression(expression))

    def minimise(self, objective: Operand) -> None:
        """Set the objective, a 1 x 1 expression. ValueError otherwise."""
        scalar = as_expression(objective)
        if scalar.shape != (1, 1):
            raise ValueError(f"the objective is 1 x 1, got {scalar.shape}")
        self._objective = scalar

    def solve(self, *, backend: BackendName = "clarabel", solver: str | None = None) -> Solution:
        """Solve as stated. An optimum lies on the boundary of the feasible set: use `solve_inside` for gains.

        Args:
            backend, solver: what solves it, see `backends.solve`.

        Raises:
            ValueError: there is no such back end or solver.
        """
        return self._judge(backends.solve(self._constraints, self._objective, self.variables, backend, solver))

    def solve_inside(
        self, back_off: float = 0.05, *, backend: BackendName = "clarabel", solver: str | None = None
    ) -> Solution:
        """Near-optimal point strictly inside the feasible set, so that exact arithmetic can confirm it.

        Two stages: the optimum ``v``; then, with the objective allowed up to ``v + back_off |v|``, the largest
        ``t <= 1`` such that every inequality is at least ``t I``.

        Args:
            back_off: how much of the optimum is given up, relative.
            backend, solver: what solves it, see `backends.solve`.

        Raises:
            ValueError: there is no such back end or solver.
        """
        first = self.solve(backend=backend, solver=solver)
        if not first.values:
            return first
        margin = Variable("margin", 1)
        inner = Problem()
        for constraint in self._constraints:
            size = constraint.expression.shape[0]
            shift = margin.expression * np.eye(size, dtype=int).astype(object)
            inner.positive(constraint.name, constraint.expression - shift)
        inner.positive("margin <= 1", identity(1) - margin)
        if self._objective is not None:
            budget = first.objective + back_off * abs(first.objective)
            inner.positive("objective", np.array([[budget]]) - self._objective)
        inner.minimise(-margin)
        second = backends.solve(inner.constraints, inner.objective, inner.variables, backend, solver)
        if not second.values:
            return first
        return self._judge(second)

    def _judge(self, raw: RawSolution) -> Solution:
        if not raw.values:
            outcome = Outcome.INFEASIBLE_NUMERICALLY if raw.infeasible else Outcome.UNKNOWN
            return Solution(outcome, iterations=raw.iterations)
        margins = {
            c.name: float(np.linalg.eigvalsh(symmetric(c.expression.at(raw.values).astype(float)))[0])
            for c in self._constraints
        }
        holds = all(m > 0 for m in margins.values()) and self.holds_exactly(raw.values)
        objective = 0.0 if self._objective is None else float(self._objective.at(raw.values)[0, 0])
        outcome = Outcome.VERIFIED if holds else Outcome.SOLVER_ONLY
        return Solution(outcome, raw.values, objective, margins, raw.iterations)

    def holds_exactly(self, values: Mapping[Variable, Matrix]) -> bool:
        """Whether every inequality holds strictly at the given point, with doubles taken as the rationals they are."""
        exact = {variable: to_rational(value) for variable, value in values.items()}
        return all(is_positive_definite(symmetric_part(c.expression.at_exactly(exact))) for c in self._constraints)
