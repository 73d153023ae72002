"""Numbers of unknowns and inequalities: counted from problems as built, beside the printed ones."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from quasilpv.conditions.condition import Form
from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.problem import Problem
from quasilpv.reproduction import rules
from quasilpv.reproduction.item import Finding
from quasilpv.studies.complexity import Complexity, measured
from quasilpv.studies.question import Question

_DOUBLE_INDEX = re.compile(r" (\d+) (\d+)$")


def symmetric(size: int) -> int:
    """Scalar unknowns of a symmetric matrix."""
    return size * (size + 1) // 2


def single_sum(question: Question) -> Complexity:
    """Sizes of a condition whose double sum over ``i, j`` is reduced to its inequalities with i = j.

    That is what the thesis counts wherever B is constant: the others then follow.
    """
    published = replace(question, options=replace(question.options, form=Form.PUBLISHED))
    statement = published.statement()
    return measured(statement, published.model().vertex_count, equal_indices(statement.problem))


def equal_indices(problem: Problem) -> list[Constraint]:
    """The inequalities of a problem without those that stand for different indices i and j."""
    found = [(constraint, _DOUBLE_INDEX.search(constraint.name)) for constraint in problem.constraints]
    return [constraint for constraint, indices in found if indices is None or indices[1] == indices[2]]


@dataclass(frozen=True)
class Row:
    """One line of a printed table.

    Attributes:
        label: of the line.
        printed: number by quantity.
        built: the same, counted from the problem.
        beyond: what the source counts on top of that (or, negative, leaves out), by quantity.
        because: what the difference consists of; empty if there is none.
    """

    label: str
    printed: Mapping[str, int]
    built: Mapping[str, int]
    beyond: Mapping[str, int] = field(default_factory=dict)
    because: str = ""

    @property
    def explained(self) -> dict[str, int]:
        """What the source should have printed if it counted as said."""
        return {quantity: self.built[quantity] + self.beyond.get(quantity, 0) for quantity in self.printed}

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "printed": dict(self.printed),
            "as built": dict(self.built),
            "counted by the source beyond that": dict(self.beyond),
            "difference": self.because,
        }


def table_finding(rows: Sequence[Row], instead: str = "") -> Finding:
    """Compare the lines of a table, each with its explanation applied."""
    checks = [
        rules.exact(f"{row.label}, {quantity}", number, row.explained[quantity])
        for row in rows
        for quantity, number in row.printed.items()
    ]
    differences = [f"{row.label}: as built {_numbers(row.built)}; {row.because}" for row in rows if row.because]
    reasons = ". ".join([*differences, instead] if instead else differences)
    return Finding(checks, {row.label: row.to_document() for row in rows}, instead=reasons)


def _numbers(values: Mapping[str, int]) -> str:
    return ", ".join(f"{quantity} {number}" for quantity, number in values.items())


def printed_labels(sizes: Complexity) -> dict[str, int]:
    """Sizes under the names of the thesis: N_var counts slack matrices, N_lmi is the sum of squared orders."""
    return {
        "vertices": sizes.vertices,
        "N_var": sizes.unknowns + sizes.slack_unknowns,
        "N_row": sizes.rows,
        "N_slack": sizes.slack_unknowns,
        "N_lmi": sizes.entries,
    }
