"""The vocabulary in which every linear matrix inequality of the project is written once.

Matrix variables, affine matrix expressions over them (generic over the scalar: double or exact rational), named
constraints, solver back ends, what a solution is worth (exact check, margin, scaling), and a file format. Nothing in
here knows what a controller is.
"""

from quasilpv.lmi.constraint import Constraint
from quasilpv.lmi.exact import is_positive_definite, to_rational
from quasilpv.lmi.expressions import Expression, Variable, block, constant, he, identity, zeros
from quasilpv.lmi.margin import Margin, largest_margin
from quasilpv.lmi.problem import Outcome, Problem, Solution
from quasilpv.lmi.scaling import ScalingReport, scaling_report
from quasilpv.lmi.sdpa_format import SdpaProgram

__all__ = [
    "Constraint",
    "Expression",
    "Margin",
    "Outcome",
    "Problem",
    "ScalingReport",
    "SdpaProgram",
    "Solution",
    "Variable",
    "block",
    "constant",
    "he",
    "identity",
    "is_positive_definite",
    "largest_margin",
    "scaling_report",
    "to_rational",
    "zeros",
]
