"""How well the numbers of a problem fit into double arithmetic: orders of magnitude of data and solution."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quasilpv.lmi.assembly import upper_triangle
from quasilpv.lmi.expressions import Variable
from quasilpv.lmi.problem import Problem


@dataclass(frozen=True)
class Magnitudes:
    """Smallest and largest magnitude of some numbers, zeros left out; both zero if there is nothing else."""

    smallest: float
    largest: float

    @classmethod
    def of(cls, arrays: Iterable[npt.NDArray[np.float64]]) -> Magnitudes:
        """The range over all entries."""
        found = np.abs(np.concatenate([array.ravel() for array in arrays]))
        found = found[found > 0.0]
        return cls(float(found.min()), float(found.max())) if found.size else cls(0.0, 0.0)

    @property
    def decades(self) -> float:
        """``log10(largest / smallest)``."""
        return math.log10(self.largest / self.smallest) if self.smallest else 0.0


@dataclass(frozen=True)
class ScalingReport:
    """Ranges of magnitudes; interior-point solvers lose a digit for about every two decades of data.

    Attributes:
        constraints: of the coefficients and constants of each inequality, by name.
        variables: of the entries of each variable at the solution, by name; empty without a solution.
    """

    constraints: Mapping[str, Magnitudes]
    variables: Mapping[str, Magnitudes]

    @property
    def worst_constraint(self) -> str:
        """The inequality whose data span the most decades."""
        return max(self.constraints, key=lambda name: self.constraints[name].decades)


def scaling_report(problem: Problem, values: Mapping[Variable, npt.NDArray[np.float64]] | None = None) -> ScalingReport:
    """Orders of magnitude of a problem as the solver sees it.

    Args:
        problem: its inequalities.
        values: of a solution, if there is one.
    """
    constraints = {}
    for constraint in problem.constraints:
        coefficients, offset = upper_triangle(constraint.expression, problem.variables)
        constraints[constraint.name] = Magnitudes.of([coefficients.data, offset])
    variables = {v.name: Magnitudes.of([np.asarray(x, dtype=float)]) for v, x in (values or {}).items()}
    return ScalingReport(constraints, variables)
