"""One linear matrix inequality with its name: what a problem is made of and what back ends are given."""

from dataclasses import dataclass

from quasilpv.lmi.expressions import Expression


@dataclass(frozen=True)
class Constraint:
    """The inequality ``expression > 0`` (positive definite)."""

    name: str
    expression: Expression
