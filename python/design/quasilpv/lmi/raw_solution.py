"""What every back end returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from quasilpv.lmi.expressions import Variable


@dataclass(frozen=True)
class RawSolution:
    """What the solver returned; a candidate point at best.

    Attributes:
        values: one matrix per variable; empty when there is no finite point.
        infeasible: the solver claims that there is no feasible point.
        iterations: of the solver; 0 when it does not say.
        status: the solver's own word.
    """

    values: Mapping[Variable, npt.NDArray[np.float64]] = field(default_factory=dict)
    infeasible: bool = False
    iterations: int = 0
    status: str = ""
