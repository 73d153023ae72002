"""The vocabulary in which every linear matrix inequality of the project is written once.

Matrix variables, affine matrix expressions over them (generic over the scalar: double or exact rational), named
constraints, and a solver back end. Nothing in here knows what a controller is.
"""

from quasilpv.lmi.exact import is_positive_definite, to_rational
from quasilpv.lmi.expressions import Expression, Variable, block, constant, he, identity, zeros
from quasilpv.lmi.problem import Constraint, Outcome, Problem, Solution

__all__ = [
    "Constraint",
    "Expression",
    "Outcome",
    "Problem",
    "Solution",
    "Variable",
    "block",
    "constant",
    "he",
    "identity",
    "is_positive_definite",
    "to_rational",
    "zeros",
]
