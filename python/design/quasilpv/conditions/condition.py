"""What a published condition is to the rest of the project."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.conditions.choices import Form as Form  # noqa: PLC0414 -- also from here
from quasilpv.conditions.choices import Slack
from quasilpv.conditions.forms.blocks import double_sum, single_sum
from quasilpv.conditions.gains import DelayedFeedback, DescriptorGain, Gain, ObserverGain, PolytopicGain
from quasilpv.conditions.reliance import Reliance, Relied, refuse_refuted, reliances
from quasilpv.defaults import SAMPLE_PERIOD_S
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.units import Units

Values: TypeAlias = Mapping[Variable, FloatArray]


@dataclass(frozen=True)
class Options:
    """Choices that all conditions share.

    Attributes:
        slack: which slack matrices.
        decay_rate: alpha >= 0 with ``V' <= -2 alpha V``, 1/s; conditions without one refuse a positive value.
        form: see `Form`.
        window_s: length tau of the moving window of delayed laws, s; None is the limit tau -> 0.
        common: multipliers and the rest of the Lyapunov matrix without index (L, R, W, Z), as in Dehak 2022, Example
            II.8: fewer unknowns, more conservative. Conditions without multipliers are not affected.
        sample_period_s: h of conditions on a sampled model, s; a decay rate alpha is then a contraction by
            exp(-alpha h) per sample.

    Raises:
        InputError: a number is out of range.
    """

    slack: Slack = Slack.THESIS
    decay_rate: float = 0.0
    form: Form = Form.REDUCED
    window_s: float | None = None
    common: bool = False
    sample_period_s: float = SAMPLE_PERIOD_S

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning."""
        if not (isfinite(self.decay_rate) and self.decay_rate >= 0.0):
            raise InputError("condition", "decay rate", self.decay_rate, "a finite number >= 0")
        if self.window_s is not None and not (isfinite(self.window_s) and self.window_s > 0.0):
            raise InputError("condition", "window", self.window_s, "a finite time > 0, or none for the limit")
        if not (isfinite(self.sample_period_s) and self.sample_period_s > 0.0):
            raise InputError("condition", "sample period", self.sample_period_s, "a finite time > 0")

    def in_units(self, units: Units) -> Options:
        """The same options for the system in other units: rates and times in its unit of time, exactly."""
        return replace(
            self,
            decay_rate=self.decay_rate * units.c,
            window_s=None if self.window_s is None else self.window_s / units.c,
            sample_period_s=self.sample_period_s / units.c,
        )


@dataclass(frozen=True, eq=False)
class Feedback:
    """What a solution gives: a Lyapunov function and, for a design condition, a control law, as data (`gains`).

    Attributes:
        lyapunov: P with ``V = x_d' P^-1 x_d`` on the differential states, (q, q).
        gain: K(z), (m, n) for ``u = K(z) x``, or (m, n + q) for ``u = K(z) (x_d, x_d', x_a)``; None for an analysis
            condition.
        observer: L(z), (n, outputs), of an observer condition, whose V is one of the estimation error.
        delayed: the law with memory that was designed, if it has one; `gain` is then the law without that follows.
    """

    lyapunov: FloatArray
    gain: Gain | None
    delayed: DelayedFeedback | None = None
    observer: ObserverGain | None = None

    def in_old_units(self, units: Units) -> Feedback:
        """The same for the system whose description in other units this one is for, exactly: ``P = T P^ T``."""
        T = units.T_differential
        return Feedback(
            T[:, None] * self.lyapunov * T,
            self.gain and self.gain.in_old_units(units),
            self.delayed and self.delayed.in_old_units(units),
            self.observer and self.observer.in_old_units(units),
        )


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
        inequalities: writes them for a model that has what the condition relies on; ask `build`.
        relies_on: what a solution of them is worth nothing without, see `quasilpv.conditions.reliance`.
        has_multipliers: whether `Options.common` makes a difference.
    """

    id: str
    summary: str
    reference: str
    representation: str
    inequalities: Callable[[PolytopicModel, Options], Statement]
    relies_on: tuple[Reliance, ...]
    has_multipliers: bool = False

    def build(self, model: PolytopicModel, options: Options) -> Statement:
        """State it for a model.

        Raises:
            RefusedError: something the condition relies on is refuted (named).
            InputError: the condition does not apply for another reason.
        """
        refuse_refuted(self.id, self.relies_on, model)
        return self.inequalities(model, options)

    def relied(self, model: PolytopicModel) -> tuple[Relied, ...]:
        """What of the things it relies on is proved, refuted or assumed for a model: (name, status, detail) each."""
        return reliances(self.relies_on, model)


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


def polytopic_gain(
    model: PolytopicModel, F: Sequence[Variable], values: Values, right: FloatArray
) -> PolytopicGain | None:
    """``K(z) = sum_i w_i(z) F_i right``, or None for a system without inputs.

    Args:
        model: the system.
        F: gain unknown of every vertex.
        values: of the unknowns.
        right: constant factor.
    """
    if model.inputs == 0:
        return None
    return PolytopicGain(model.polytope, np.stack([values[Fi] for Fi in F]) @ right)


def is_single_sum(model: PolytopicModel, slack: Slack) -> bool:
    """Whether a double sum over ``X_ij = Y_i + Z_j`` is a single one: ``X_ij + X_ji = X_ii + X_jj``.

    The entries have that form when B is constant, and slack matrices do unless they carry both indices. This is how the
    published tables count.
    """
    return model.constant_input and (len(model.polytope.blocks) == 1 or slack in {Slack.NONE, Slack.THESIS})


def single_sum_blocks(model: PolytopicModel, slack: Slack) -> npt.NDArray[np.intp] | None:
    """Blocks of the vertices for the slack of a single sum, in which all families are the same; None for none."""
    return None if slack is Slack.NONE else model.polytope.block_index


def vertex_sum(
    problem: Problem,
    name: str,
    entry: Callable[[int, int], Expression],
    model: PolytopicModel,
    slack: Slack,
    *,
    single: bool = False,
) -> tuple[Variable, ...]:
    """Require ``sum_ij w_i w_j X_ij < 0`` over the vertices of a model; see `double_sum` and `single_sum`.

    Args:
        problem, name, entry: as in `double_sum`.
        model: the system.
        slack: which family.
        single: write it as a single sum over X_ii; only if it is one, see `is_single_sum`.

    Returns:
        The slack matrices.
    """
    if single:
        blocks = single_sum_blocks(model, slack)
        return single_sum(problem, name, lambda i: entry(i, i), model.vertex_count, blocks)
    return double_sum(problem, name, entry, model.vertex_count, model.polytope.block_index, slack=slack)


def descriptor_statement(
    model: PolytopicModel,
    options: Options,
    entry: Callable[[Variable, Sequence[Variable]], Callable[[int, int], Expression]],
    *,
    single: bool = False,
) -> Statement:
    """A double sum in ``P = P' > 0`` (n, n) and F_j (m, n) per vertex, solved by the law ``F(z) E(z)^-T P^-1 x``.

    Args:
        model: a regular system.
        options: of the statement.
        entry: from P and the F_j to X_ij, which may have further unknowns.
        single: as in `vertex_sum`.
    """
    P = Variable("P", model.order, symmetric=True)
    F = shared_gains(model, model.order)
    problem = Problem()
    problem.positive("P", P)
    slacks = vertex_sum(problem, "Xi", entry(P, F), model, options.slack, single=single)
    return Statement(problem, descriptor_feedback(model, P, F), slacks)


def descriptor_feedback(model: PolytopicModel, P: Variable, F: Sequence[Variable]) -> Callable[[Values], Feedback]:
    """From a solution to the law ``u = F(z) E(z)^-T P^-1 x`` with vertex unknowns F_j (m, n)."""

    def feedback(values: Values) -> Feedback:
        return descriptor_law(model, values[P], np.stack([values[Fj] for Fj in F]))

    return feedback


def descriptor_law(model: PolytopicModel, lyapunov: FloatArray, gains: FloatArray) -> Feedback:
    """The law ``u = F(z) E(z)^-T P^-1 x``, P (n, n) and vertices of F (count, m, n)."""
    return Feedback(lyapunov, DescriptorGain(model.polytope, gains, model.system.E, lyapunov) if model.inputs else None)
