"""Exact check that a law is scheduled over its whole operating domain, with the inertia of its own robot.

The inequalities of a law are about the box and the inertia of its tables. Two claims tie these to the robot:

* **premise box**: every premise is the cosine of a difference of absolute angles; its range over the operating domain,
  enclosed in ball arithmetic, lies in the box the run-time side clamps it to. If the inertia is constant the premises
  are those of the gains alone and may be any functions of the angles.
* **inertia table**: for every premise vector of the box, the table is s times the inertia of the robot in the artifact,
  s > 0 one number, entry by entry within `ROUNDING` of its diagonal; a cosine that is not scheduled is held at a value
  it takes on the operating domain.

In absolute angles the inertia is ``D_kl cos(alpha_k - alpha_l)`` (`robot.inertia`), so both sides are affine in the
same cosines and are compared coefficient by coefficient, in rational arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.claims import Claim, all_positive
from quasilpv.certificate.exact.matrices import magnitude, rational, zero
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.data import PREMISES, inertia_data, inertia_table
from quasilpv.certificate.robot.inertia import InertiaData, Pair, design_inertia, true_inertia
from quasilpv.certificate.robot.range import cosine_range
from quasilpv.certificate.robot.registry import is_in_space
from quasilpv.certificate.robot.stabilised_model import premise_box_claims
from quasilpv.certificate.robot.tree_model import check_tree_model

ROUNDING = fmpq(1, 1 << 40)
"""Largest deviation of an entry, relative to the geometric mean of its diagonal entries: about 9e-13."""


def check_design_model(shipped: Shipped[Any]) -> tuple[Claim, ...]:
    """Claims of an artifact.

    Raises:
        InputError: the robot is not known, or a premise is not the cosine of a difference of absolute angles.
        ValueError: program and table have different premises.
    """
    if is_in_space(shipped.mechanism, shipped.source):
        return check_tree_model(shipped)
    data = inertia_data(shipped)
    if data.premise_pairs:
        coverage = [*_coverage_claims(data)]
    else:
        coverage = premise_box_claims(shipped, VertexTable.of(inertia_table(shipped)), PREMISES)
    return (*coverage, *_inertia_claims(data))


def _coverage_claims(data: InertiaData) -> Iterator[Claim]:
    for p, pair in enumerate(data.premise_pairs):
        below, above = cosine_range(data, pair)
        lower, upper = rational(data.premise_lower[p]), rational(data.premise_upper[p])
        beyond = max(lower - below, above - upper)
        margin = 1.0 if beyond <= 0 else -to_float(beyond / (upper - lower))
        yield Claim.enclosed(f"premise box: {_cosine(data, pair)} on the operating domain", beyond <= 0, margin)


def _inertia_claims(data: InertiaData) -> Iterator[Claim]:
    """The value of each cosine that is not scheduled, and proportionality of everything else."""
    n, table, nominal = data.joints, design_inertia(data), true_inertia(data)
    robot = fmpq_mat(n, n, [nominal[i][j](fmpq(0)) for i, j in product(range(n), repeat=2)])
    scale = table.constant[n - 1, n - 1] / robot[n - 1, n - 1]
    if scale <= 0:
        yield all_positive("inertia table: a positive multiple of the robot's own", [scale])
        return
    constant = table.constant - scale * sum((_only(robot, (k, k)) for k in range(n)), zero(n, n))
    for pair in (pair for pair in data.pairs if pair not in table.slopes):
        below, above = cosine_range(data, pair)
        held = table.constant[pair] / (scale * robot[pair])
        inside = min(held - below, above - held) / (above - below)
        title = f"inertia table: {_cosine(data, pair)} held at {to_float(held):.4g}, a value it takes"
        yield Claim.enclosed(title, inside >= 0, to_float(inside))
        constant -= _only(table.constant, pair)
    error = table.rest + magnitude(constant)
    for pair, slope in table.slopes.items():
        error += magnitude(slope - scale * _only(robot, pair))
    yield _proportional(scale, error, robot)


def _proportional(scale: fmpq, error: fmpq_mat, robot: fmpq_mat) -> Claim:
    """The claim that every entry of the error is small against ``scale * sqrt(D_ii D_jj)``."""
    entries = product(range(robot.nrows()), repeat=2)
    squares = [error[i, j] ** 2 / (robot[i, i] * robot[j, j]) for i, j in entries]
    worst = max(squares) / (scale * ROUNDING) ** 2
    margin = 1.0 - to_float(min(worst, fmpq(4))) ** 0.5
    return Claim.at_most(f"inertia table: {to_float(scale):.6g} times the robot's own", worst, fmpq(1), margin)


def _only(square: fmpq_mat, pair: Pair) -> fmpq_mat:
    """The two entries of a pair, the rest zero."""
    i, j = pair
    chosen = zero(square.nrows(), square.nrows())
    chosen[i, j], chosen[j, i] = square[i, j], square[j, i]
    return chosen


def _cosine(data: InertiaData, pair: Pair) -> str:
    """``cos(alpha_j - alpha_i)`` in joint angles, e.g. ``cos(theta_2 + theta_3)``."""
    S = data.mechanism.absolute_map.table()
    i, j = pair
    factors = [(joint, after - before) for joint, (before, after) in enumerate(zip(S[i], S[j], strict=True), start=1)]
    added = " + ".join(f"theta_{joint}" for joint, factor in factors if factor > 0)
    subtracted = "".join(f" - theta_{joint}" for joint, factor in factors if factor < 0)
    return f"cos({added}{subtracted})"
