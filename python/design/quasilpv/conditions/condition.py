"""What a published condition is to the rest of the project."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import isfinite
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.slack import Slack
from quasilpv.errors import InputError
from quasilpv.lmi import Problem, Variable
from quasilpv.polytopes import PolytopicModel

FloatArray = npt.NDArray[np.float64]
Values: TypeAlias = Mapping[Variable, FloatArray]


class Form(StrEnum):
    """How a condition is written down."""

    PUBLISHED = "published"
    """Every unknown and inequality of the source: what its complexity tables count."""

    REDUCED = "reduced"
    """Equivalent, smaller: unknowns eliminated and inequalities dropped where a proof allows it."""


@dataclass(frozen=True)
class Options:
    """Choices that all conditions share.

    Attributes:
        slack: which slack matrices.
        decay_rate: alpha >= 0 with ``V' <= -2 alpha V``, 1/s; conditions without one refuse a positive value.
        form: see `Form`.
        window_s: length tau of the moving window of delayed laws, s; None is the limit tau -> 0.

    Raises:
        InputError: a number is out of range.
    """

    slack: Slack = Slack.THESIS
    decay_rate: float = 0.0
    form: Form = Form.REDUCED
    window_s: float | None = None

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning."""
        if not (isfinite(self.decay_rate) and self.decay_rate >= 0.0):
            raise InputError("condition", "decay rate", self.decay_rate, "a finite number >= 0")
        if self.window_s is not None and not (isfinite(self.window_s) and self.window_s > 0.0):
            raise InputError("condition", "window", self.window_s, "a finite time > 0, or none for the limit")


@dataclass(frozen=True, eq=False)
class Feedback:
    """What a solution gives: a Lyapunov function and, for a design condition, a control law.

    Attributes:
        lyapunov: P with ``V = x_d' P^-1 x_d`` on the differential states, (q, q).
        gain: ``z -> K(z)``, (m, n) for ``u = K(z) x``, or (m, n + q) for ``u = K(z) (x_d, x_d', x_a)``; None for an
            analysis condition.
    """

    lyapunov: FloatArray
    gain: Callable[[FloatArray], FloatArray] | None


@dataclass(frozen=True, eq=False)
class Statement:
    """A condition written for one model: homogeneous inequalities, and what their solution means.

    Attributes:
        problem: the inequalities.
        slacks: the slack matrices among its unknowns.
        feedback: from a solution to the control law.
    """

    problem: Problem
    feedback: Callable[[Values], Feedback]
    slacks: tuple[Variable, ...] = field(default=())


@dataclass(frozen=True)
class Condition:
    """A published (or own) condition; one file each.

    Attributes:
        id: as in the source, e.g. ``"II.6"``.
        summary: one line for a listing.
        reference: author, year, theorem.
        representation: with which it was published.
        build: states it for a model.
    """

    id: str
    summary: str
    reference: str
    representation: str
    build: Callable[[PolytopicModel, Options], Statement]


def require_regular(model: PolytopicModel, condition: str) -> None:
    """Refuse a system with algebraic states.

    Args:
        model: the system.
        condition: id of the condition that cannot take one.

    Raises:
        InputError: there are algebraic states.
    """
    if model.differential != model.order:
        got = f"{model.order - model.differential} algebraic states"
        raise InputError(f"condition {condition}", model.system.name, got, "a regular system (E(z) invertible)")


def shared_gains(model: PolytopicModel, columns: int, name: str = "F") -> tuple[Variable, ...]:
    """One gain matrix (m, columns) per vertex; vertices that differ in unknown premises only share theirs.

    Args:
        model: the system.
        columns: of the gain.
        name: of the unknowns.
    """
    representative = model.polytope.shared_gain
    own = {vertex: Variable(f"{name}{vertex}", model.inputs, columns) for vertex in sorted(set(representative))}
    return tuple(own[vertex] for vertex in representative)
