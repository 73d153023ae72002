"""How large a condition is: counted from the problem as built, never from a formula."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from quasilpv.conditions.condition import Form, Statement
from quasilpv.lmi.constraint import Constraint
from quasilpv.studies.question import Question


@dataclass(frozen=True)
class Complexity:
    """Sizes of a problem.

    Attributes:
        vertices: of the representation.
        unknowns: scalar unknowns without those of slack matrices.
        slack_unknowns: scalar unknowns of slack matrices.
        inequalities: how many matrix inequalities.
        rows: their orders, summed.
        entries: their orders squared, summed: what some tables of the literature call the number of inequalities.
    """

    vertices: int
    unknowns: int
    slack_unknowns: int
    inequalities: int
    rows: int
    entries: int

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return asdict(self)


def count(question: Question) -> Complexity:
    """Sizes of a condition as published (nothing eliminated) for a system in a representation.

    Raises:
        InputError: the condition or the representation does not apply to the system.
    """
    published = replace(question, options=replace(question.options, form=Form.PUBLISHED))
    return measured(published.statement(), published.model().vertex_count)


def measured(statement: Statement, vertices: int, constraints: Sequence[Constraint] | None = None) -> Complexity:
    """Sizes of a statement.

    Args:
        statement: as built.
        vertices: of the representation.
        constraints: those of its inequalities that count; all of them by default.
    """
    slack = sum(variable.size for variable in statement.slacks)
    counted = statement.problem.constraints if constraints is None else constraints
    orders = [constraint.expression.shape[0] for constraint in counted]
    return Complexity(
        vertices=vertices,
        unknowns=sum(variable.size for variable in statement.problem.variables) - slack,
        slack_unknowns=slack,
        inequalities=len(orders),
        rows=sum(orders),
        entries=sum(order**2 for order in orders),
    )
