"""Proofs that no solution exists: one rational point of the polytope at which no law of a condition could do its work.

A solution of a condition makes the system frozen at any z0 of its polytope exponentially stable, with the decay rate
asked for. If a mode of the frozen system that no input reaches (an observer: no output shows) does not decay so fast,
there is no solution, whatever a solver would say (`frozen_modes`; exact). At points with E(z0) or A_22(z0) singular
nothing is claimed. It says nothing about the nonlinear system, another way to write its equations, or a smaller box.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from fractions import Fraction
from functools import lru_cache
from itertools import islice, product
from math import exp
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Options
from quasilpv.lmi import budget
from quasilpv.lmi.exact import Matrix, to_rational
from quasilpv.polytopes import PolytopicModel
from quasilpv.studies.frozen_modes import Disk, HalfPlane, Mode, Stable, eliminated, unreachable_mode
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.descriptor.system import DescriptorSystem

BoolArray = npt.NDArray[np.bool_]

MOST_POINTS = 48
"""At most so many points of a polytope are looked at."""

MOST_CORNERS = 16

DOUBT = 1e-3
"""Relative distance from which on doubles are believed: far more than they can be wrong."""

ORDER_LIMIT = 24
"""Larger systems are not looked at: exact elimination would take longer than the solver did."""


class Loop(Enum):
    """What a solution of a condition makes stable at every frozen z."""

    OPEN = "the system without inputs"
    CLOSED = "the system with a law, in continuous time"
    SAMPLED = "Euler's model of the system with a law"
    OBSERVER = "Euler's model of the error of an observer"


IMPLIED: dict[str, Loop] = {
    "I.1": Loop.OPEN,
    **dict.fromkeys(("I.2", "I.53", "I.3", "II.5", "II.5-cor1", "II.6", "II.6-direct", "II.7", "II.8"), Loop.CLOSED),
    **dict.fromkeys(("III.9", "TS-Pj", "guerra-2007", "tanaka-wang"), Loop.CLOSED),
    "sampled-feedback": Loop.SAMPLED,
    "sampled-observer": Loop.OBSERVER,
}
"""By id of the condition; of others nothing is claimed (the error of `estimated-observer` has a nonlinear part)."""


@dataclass(frozen=True)
class Refutation:
    """Why there is no solution.

    Attributes:
        point: value of every premise, by name; what was decided was decided at exactly these rationals.
        eigenvalue: of the mode, (real part, imaginary part), rounded.
        states: names of the states it consists of.
    """

    point: tuple[tuple[str, float], ...]
    eigenvalue: tuple[float, float]
    states: tuple[str, ...]

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {**asdict(self), "point": dict(self.point)}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Refutation:
        """What `to_document` wrote."""
        real, imaginary = document["eigenvalue"]
        return cls(tuple(document["point"].items()), (real, imaginary), tuple(document["states"]))

    def sentence(self, loop: Loop) -> str:
        """One clause for people."""
        where = ", ".join(f"{name} = {value:.6g}" for name, value in self.point) or "every point"
        what = {
            Loop.OPEN: "is not stable enough",
            Loop.CLOSED: "is reached by no input and not stable enough",
            Loop.SAMPLED: "is reached by no input and does not contract enough per sample",
            Loop.OBSERVER: "is shown by no output and does not contract enough per sample",
        }[loop]
        return f"at {where} the mode {_complex(self.eigenvalue)} of {', '.join(self.states)} {what}"


def refutation(condition: str, model: PolytopicModel, options: Options) -> Refutation | None:
    """A proof that a condition has no solution for a model, or None if none was found.

    Args:
        condition: its id.
        model: the system in its representation.
        options: of the condition.

    Raises:
        TimeUpError: the time limit was reached (`quasilpv.lmi.budget`).
    """
    if condition not in IMPLIED or model.order > ORDER_LIMIT:
        return None
    loop, own = IMPLIED[condition], _stated(condition, model)
    stable = _stable(loop, options)
    system, points = own.system, list(_points(own))
    constants = [_Affine.of(matrix) for matrix in (system.E, system.A, system.B, system.C)]
    for number in np.flatnonzero(_suspects(loop, own, points, stable)):
        budget.time_left_s()
        z = points[number]
        mode = _mode(loop, [matrix.at(z) for matrix in constants], system.differential, stable)
        if mode is not None:
            return Refutation(
                tuple((p.name, float(value)) for p, value in zip(system.premises, z, strict=True)),
                (mode.eigenvalue.real, mode.eigenvalue.imag),
                tuple(system.state[k].name for k in mode.states),
            )
    return None


def is_suspect(condition: str, model: PolytopicModel, options: Options) -> bool:
    """Whether `refutation` might find something, in double arithmetic; errs on that side. Arguments as there."""
    if condition not in IMPLIED or model.order > ORDER_LIMIT:
        return False
    loop, own = IMPLIED[condition], _stated(condition, model)
    return bool(_suspects(loop, own, list(_points(own)), _stable(loop, options)).any())


def _stated(condition: str, model: PolytopicModel) -> PolytopicModel:
    """What a condition states its inequalities on: I.3 on the nominal system."""
    if condition != "I.3" or model.system.uncertainty is None:
        return model
    known = [p for p in range(model.polytope.premises) if p not in model.polytope.unknown]
    return PolytopicModel(model.system.uncertainty.nominal, model.polytope.restricted(known))


def _suspects(loop: Loop, model: PolytopicModel, points: Sequence[Sequence[Fraction]], stable: Stable) -> BoolArray:
    """Points at which a mode may be out of place and out of reach, as far as doubles can tell, (points,)."""
    system, q = model.system, model.differential
    z = np.array([[float(value) for value in point] for point in points]).reshape(len(points), -1)
    E, A, B, C = (
        matrix.constant + np.tensordot(z, matrix.coefficients, axes=1)
        for matrix in (system.E, system.A, system.B, system.C)
    )
    if loop is Loop.OPEN:
        B = B[..., :0]
    found = np.zeros(len(points), dtype=bool)
    with np.errstate(all="ignore"):
        sound = (np.linalg.det(E[:, :q, :q]) != 0.0) & (np.linalg.det(A[:, q:, q:]) != 0.0)
        E, A, B, C = (matrix[sound] for matrix in (E, A, B, C))
        state, inputs = np.concatenate([A[..., :q], B], axis=2), A[..., q:]
        rest = state[:, :q] - inputs[:, :q] @ np.linalg.solve(A[:, q:, q:], state[:, q:])
        reduced = np.linalg.solve(E[:, :q, :q], rest)
    drift, reach = reduced[..., :q], reduced[..., q:]
    if loop is Loop.OBSERVER:
        drift, reach = drift.transpose(0, 2, 1), C[..., :q].transpose(0, 2, 1)
    finite = np.isfinite(reduced).all(axis=(1, 2))
    places = np.flatnonzero(sound)
    found[places[~finite]] = True
    for place, own, onto in zip(places[finite], drift[finite], reach[finite], strict=True):
        found[place] = _may_be_out_of_place(own, onto, stable)
    return found


def _may_be_out_of_place(drift: FloatArray, reach: FloatArray, stable: Stable) -> bool:
    eigenvalues = np.linalg.eigvals(drift)
    size = float(np.abs(drift).max(initial=0.0))
    late = [s for s in eigenvalues.tolist() if stable.excess(s) >= -DOUBT * max(size, 1e-300)]
    if not late or reach.shape[1] == 0:
        return bool(late)
    pencils = np.array([np.hstack([drift - s * np.eye(len(drift)), reach]) for s in late])
    smallest = np.linalg.svd(pencils, compute_uv=False)[:, -1]
    return bool((smallest <= DOUBT * np.abs(pencils).max(axis=(1, 2))).any())


def _stable(loop: Loop, options: Options) -> Stable:
    if loop in (Loop.OPEN, Loop.CLOSED):
        return HalfPlane(Fraction(options.decay_rate))
    contraction = Fraction(exp(-2.0 * options.decay_rate * options.sample_period_s))  # as the inequalities have it
    return Disk(Fraction(options.sample_period_s), contraction)


def _mode(loop: Loop, matrices: Sequence[Matrix], q: int, stable: Stable) -> Mode | None:
    E, A, B, C = matrices
    if loop is Loop.OPEN:
        B = B[:, :0]
    reduced = eliminated(E, A, B, q)
    if reduced is None:
        return None
    if loop is Loop.OBSERVER:
        return unreachable_mode(reduced[0].T, C.T, stable)
    return unreachable_mode(*reduced, stable)


@dataclass(frozen=True, eq=False)
class _Affine:
    """An affine matrix in rationals."""

    constant: Matrix
    slopes: dict[int, Matrix]

    @classmethod
    def of(cls, matrix: AffineMatrix) -> _Affine:
        slopes = {p: to_rational(slope) for p, slope in enumerate(matrix.coefficients) if slope.any()}
        return cls(to_rational(matrix.constant), slopes)

    def at(self, z: Sequence[Fraction]) -> Matrix:
        return sum((z[p] * slope for p, slope in self.slopes.items()), self.constant)


# ---- points ----------------------------------------------------------------------------------------------------------


def _points(model: PolytopicModel) -> Iterator[tuple[Fraction, ...]]:
    """Rational points at which the inequalities speak: of the box, and the vertices of a simplex around it.

    The equilibrium, 0 and the centre first; then points at which an entry of A or B vanishes, where a chain of inputs
    and states may break; then corners. `MOST_POINTS` at most.
    """
    return islice(filter(model.polytope.holds, dict.fromkeys(_candidates(model))), MOST_POINTS)


def _candidates(model: PolytopicModel) -> Iterator[tuple[Fraction, ...]]:
    system, polytope = model.system, model.polytope
    bounds = [(Fraction(low), Fraction(high)) for low, high in zip(polytope.lower, polytope.upper, strict=True)]
    centre = tuple((low + high) / 2 for low, high in bounds)
    zero = tuple(min(max(Fraction(0), low), high) for low, high in bounds)
    rest = _at_rest(system.premises, system.state, tuple(system.domain.items()))
    start = centre if rest is None else tuple(min(max(z, b[0]), b[1]) for z, b in zip(rest, bounds, strict=True))
    yield from (start, zero, centre)
    for p, root in _roots(system):
        if bounds[p][0] <= root <= bounds[p][1]:
            yield from (tuple(root if k == p else z for k, z in enumerate(base)) for base in (start, centre))
    if len(polytope.blocks) == 1 and polytope.blocks[0].kind != "box":
        yield from (tuple(z) for z in polytope.exact_offsets(range(polytope.vertex_count)))
    yield from islice(product(*bounds), MOST_CORNERS)
    yield tuple(high for _, high in bounds)
    for p, own in enumerate(bounds):
        yield from (tuple(end if k == p else z for k, z in enumerate(start)) for end in own)


@lru_cache(maxsize=64)
def _at_rest(
    premises: tuple[Premise, ...],
    state: tuple[sp.Symbol, ...],
    domain: tuple[tuple[sp.Symbol, tuple[float, float]], ...],
) -> tuple[Fraction, ...] | None:
    """The premises at x = 0 and in the middle of the parameters' domain, to the accuracy of doubles; None if undefined.

    Any point of the box serves, so that rounding does no harm.
    """
    place = {symbol: 0.5 * (float(low) + float(high)) for symbol, (low, high) in domain}
    place |= dict.fromkeys(state, 0.0)
    symbols = sorted({s for p in premises for s in p.expression.free_symbols}, key=lambda symbol: symbol.name)
    if not set(symbols) <= set(place):
        return None
    evaluate = sp.lambdify(symbols, [p.expression for p in premises], "numpy")
    try:
        with np.errstate(all="ignore"):
            values = np.array(evaluate(*(place[symbol] for symbol in symbols)), dtype=float)
    except (ArithmeticError, TypeError, ValueError):
        return None
    return tuple(Fraction(value) for value in values.tolist()) if np.isfinite(values).all() else None


def _roots(system: DescriptorSystem) -> Iterator[tuple[int, Fraction]]:
    """Premises and their values at which an entry of B or A that depends on one premise only is 0."""
    for matrix in (system.B, system.A):
        moving = matrix.coefficients != 0.0
        for i, j in np.argwhere(moving.sum(axis=0) == 1).tolist():
            p = int(np.flatnonzero(moving[:, i, j])[0])
            yield p, -Fraction(matrix.constant[i, j]) / Fraction(matrix.coefficients[p, i, j])


def _complex(value: tuple[float, float]) -> str:
    real, imaginary = value
    return f"{real:.4g}" if imaginary == 0.0 else f"{real:.4g} {'+' if imaginary > 0 else '-'} {abs(imaginary):.4g}i"
