"""One question: does this condition hold for this system, in this representation, at these parameters?"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from quasilpv.conditions.condition import Options, Statement
from quasilpv.conditions.registry import condition
from quasilpv.lmi import Outcome, largest_margin
from quasilpv.lmi.common import common_problem
from quasilpv.lmi.compiled import CompiledFamily, CompiledProblem, compile_family
from quasilpv.lmi.feasibility import Decision, decide
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.systems.catalogue import system_kind

MARGIN_PROGRAM_SIZE = 300_000
"""Rows times unknowns; larger problems are not put to the margin program: it would take minutes."""


class Verdict(StrEnum):
    """What is known. `FEASIBLE` is a theorem, `INFEASIBLE` is what a solver found."""

    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Question:
    """A condition for a system that has a name.

    Attributes:
        system: its id, see `quasilpv.systems.catalogue.system_kind`; a relative path becomes an absolute one.
        condition: its id.
        representation: its name, see `quasilpv.polytopes.polytopic_model`; empty for the one the condition was
            published with.
        parameters: of the system, by name, in order of name; defaults for the others.
        options: of the condition.

    Raises:
        InputError: there is no such system, parameter or condition.
    """

    system: str
    condition: str
    representation: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    options: Options = field(default_factory=Options)

    def __post_init__(self) -> None:
        """Fill in the representation; refuse what does not exist."""
        if not self.representation:
            object.__setattr__(self, "representation", condition(self.condition).representation)
        object.__setattr__(self, "parameters", tuple(sorted(dict(self.parameters).items())))
        condition(self.condition)
        kind = system_kind(self.system)
        object.__setattr__(self, "system", kind.id)
        kind.system(**dict(self.parameters))

    def at(self, point: Mapping[str, float]) -> Question:
        """The same question with some parameters set."""
        return replace(self, parameters=tuple({**dict(self.parameters), **point}.items()))

    def statement(self) -> Statement:
        """The inequalities.

        Raises:
            InputError: the condition does not apply to the system, or the representation does not.
        """
        return condition(self.condition).build(self.model(), self.options)

    def model(self) -> PolytopicModel:
        """The system in its representation. Errors as `statement`."""
        return polytopic_model(system_kind(self.system).system(**dict(self.parameters)), self.representation)

    def to_document(self) -> dict[str, Any]:
        """JSON-able; a fingerprint tells two contents of one file of a user apart."""
        fingerprint = system_kind(self.system).fingerprint
        return {
            "system": self.system,
            **({"system_fingerprint": fingerprint} if fingerprint else {}),
            "condition": self.condition,
            "representation": self.representation,
            "parameters": dict(self.parameters),
            "options": asdict(self.options),
        }


@dataclass(frozen=True)
class Answer:
    """What is known about a question.

    Attributes:
        verdict: see `Verdict`.
        certified: the verdict is feasible and proved in exact arithmetic.
        margin: of a feasible problem, see `quasilpv.lmi.feasibility.Decision`; None otherwise.
        excluded_norm: of an infeasible problem, how sure: no solution of smaller norm exists with all inequalities
            at least I, as far as the solver's certificate was computed correctly. None otherwise.
        unknowns, rows: scalar unknowns and rows (summed sizes) of the inequalities as solved.
        seconds: wall time, building included.
        witness: the kept unknowns at which every inequality was proved, for `Sweep.proves`; empty if there is no such
            proof.
    """

    verdict: Verdict
    certified: bool
    margin: float | None
    excluded_norm: float | None
    unknowns: int
    rows: int
    seconds: float
    witness: tuple[float, ...] = ()


class Sweep:
    """A question at many parameter points: built once where its data are affine in the swept parameters.

    Args:
        question: at any point.
        swept: names of the parameters that change.
    """

    def __init__(self, question: Question, swept: Sequence[str]) -> None:
        """Compile the family, if it is one."""
        self.question = question
        self.swept = tuple(swept)
        self._family = self._compile()

    @property
    def updates(self) -> bool:
        """Whether points update numbers (True) or rebuild the problem (False)."""
        return self._family is not None

    def at(self, point: Mapping[str, float]) -> Answer:
        """Answer at a point.

        Args:
            point: a value for every swept parameter.
        """
        start = time.perf_counter()
        compiled = self._problem([point])
        decision = decide(compiled)
        outcome = decision.outcome
        unclear = outcome in {Outcome.UNKNOWN, Outcome.SOLVER_ONLY}
        if unclear and _is_small(sum(compiled.layout.sizes), compiled.layout.unknowns):
            outcome = largest_margin(self.question.at(point).statement().problem).outcome
        return _answer(compiled, decision, outcome, start)

    def common(self, points: Sequence[Mapping[str, float]]) -> Answer:
        """One solution for several points: it holds in their whole convex hull (`quasilpv.lmi.common`).

        A verdict other than feasible says nothing about any point.

        Args:
            points: values for every swept parameter.

        Raises:
            ValueError: the data are not affine in the swept parameters.
        """
        start = time.perf_counter()
        compiled = self._problem(points)
        decision = decide(compiled)
        return _answer(compiled, decision, decision.outcome, start)

    def proves(self, points: Sequence[Mapping[str, float]], witness: Sequence[float]) -> bool:
        """Whether the witness of an answer proves it, in exact arithmetic.

        Args:
            points: that the answer was about.
            witness: of the answer.
        """
        compiled = self._problem(points)
        return len(witness) == len(compiled.layout.kept) and compiled.holds_exactly(np.array(witness))

    def _problem(self, points: Sequence[Mapping[str, float]]) -> CompiledProblem:
        if self._family is not None:
            return common_problem(self._family, [{name: point[name] for name in self.swept} for point in points])
        if len(points) > 1:
            raise ValueError(f"the data are not affine in {', '.join(self.swept)}: points have nothing in common")
        return CompiledProblem.of(self.question.at(points[0]).statement().problem)

    def _compile(self) -> CompiledFamily | None:
        parameters = system_kind(self.question.system).parameters
        if not self.swept or not all(parameters[name].affine for name in self.swept):
            return None
        base = {name: dict(self.question.parameters).get(name, parameters[name].default) for name in self.swept}
        return compile_family(lambda point: self.question.at(point).statement().problem, base)


def _answer(compiled: CompiledProblem, decision: Decision, outcome: Outcome, start: float) -> Answer:
    return Answer(
        verdict=_VERDICTS.get(outcome, Verdict.UNKNOWN),
        certified=outcome is Outcome.VERIFIED,
        margin=_finite(decision.margin),
        excluded_norm=_finite(decision.excluded_norm),
        unknowns=compiled.layout.unknowns,
        rows=sum(compiled.layout.sizes),
        seconds=time.perf_counter() - start,
        witness=tuple(decision.point.tolist()),
    )


def largest_or_reached_margin(question: Question, answer: Answer) -> float | None:
    """How far a question is from the edge between feasible and infeasible; see `quasilpv.lmi.margin`.

    Of a problem too large for the margin program, what the answer reached; None if it is not feasible.
    """
    if not _is_small(answer.rows, answer.unknowns):
        return answer.margin
    return _finite(largest_margin(question.statement().problem).margin)


def _is_small(rows: int, unknowns: int) -> bool:
    return rows * unknowns <= MARGIN_PROGRAM_SIZE


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


_VERDICTS = {Outcome.VERIFIED: Verdict.FEASIBLE, Outcome.INFEASIBLE_NUMERICALLY: Verdict.INFEASIBLE}
