"""From exact rationals to the doubles that are printed, rounded to the safe side where a claim is made."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.matrices import rational


def to_float(value: fmpq) -> float:
    """The double nearest to a rational."""
    return int(value.p) / int(value.q)


def float_at_most(value: fmpq) -> float:
    """The largest double that does not exceed a rational."""
    nearest = to_float(value)
    return nearest if rational(nearest) <= value else math.nextafter(nearest, -math.inf)


def float_at_least(value: fmpq) -> float:
    """The smallest double that is not below a rational."""
    return -float_at_most(-value)


def to_floats(exact: fmpq_mat) -> npt.NDArray[np.float64]:
    """A rational matrix in doubles."""
    return np.array([[to_float(entry) for entry in row] for row in exact.table()])
