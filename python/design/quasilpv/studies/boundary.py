"""Where a condition stops being feasible along one parameter, by bisection, proved on the feasible side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from quasilpv.defaults import RELATIVE_TOLERANCE
from quasilpv.errors import InputError
from quasilpv.shown import html_table
from quasilpv.studies.answer import Answer, Evidence, Verdict
from quasilpv.studies.question import Question
from quasilpv.studies.sweep import Sweep
from quasilpv.systems.catalogue import system_kind


@dataclass(frozen=True)
class Interval:
    """The range of a parameter that is searched.

    Attributes:
        name: of the parameter.
        start: an end of the range, any order.
        end: the other one.
    """

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class Boundary:
    """What was found between a feasible and an infeasible end.

    Attributes:
        certified_up_to: the last point at which feasibility is proved; None if neither end is feasible.
        infeasible_from: the nearest point that is infeasible; None if there is none.
        evaluations: points that were solved.
        infeasible_evidence: whether that is proved, or what a solver found; None without such a point.
    """

    certified_up_to: float | None
    infeasible_from: float | None
    evaluations: int
    infeasible_evidence: Evidence | None = None

    @property
    def value(self) -> float | None:
        """The middle of the two; the one that is known if there is one only."""
        if self.certified_up_to is None or self.infeasible_from is None:
            return self.certified_up_to if self.infeasible_from is None else None
        return 0.5 * (self.certified_up_to + self.infeasible_from)

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        evidence = "" if self.infeasible_evidence is None else f", {self.infeasible_evidence.value}"
        rows = {
            "feasible, proved, up to": self.certified_up_to,
            f"infeasible{evidence}, from": self.infeasible_from,
            "points solved": self.evaluations,
        }
        return html_table(f"boundary at {self.value:.6g}" if self.value is not None else "no boundary", rows)

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "value": self.value,
            "certified_up_to": self.certified_up_to,
            "infeasible_from": self.infeasible_from,
            "infeasible_evidence": self.infeasible_evidence and self.infeasible_evidence.value,
            "evaluations": self.evaluations,
        }


def find_boundary(question: Question, over: Interval, tolerance: float = RELATIVE_TOLERANCE) -> Boundary:
    """Bisect between a feasible and an infeasible end of an interval.

    Whatever lies between is assumed to change its verdict once; points at which nothing can be said keep the two
    results apart instead of being counted on either side.

    Args:
        question: with all other parameters set.
        over: the parameter and its range.
        tolerance: width of the final interval, relative to where it is.

    Raises:
        InputError: there is no such parameter, the range is a point, or the tolerance is not in (0, 1).
    """
    if not 0.0 < tolerance < 1.0:
        raise InputError("boundary", "tolerance", tolerance, "a number between 0 and 1")
    parameters = system_kind(question.system).parameters
    if over.name not in parameters or over.start == over.end:
        known = ", ".join(parameters)
        got = f"{over.name}={over.start:g}:{over.end:g}"
        raise InputError("boundary", "over", got, f"a range of one of {known}")
    sweep = Sweep(question, (over.name,))
    answers: dict[float, Answer] = {}

    def verdict(value: float) -> Verdict:
        answers[value] = sweep.at({over.name: value})
        return answers[value].verdict

    ends = {value: verdict(value) for value in (over.start, over.end)}
    feasible = [value for value, found in ends.items() if found is Verdict.FEASIBLE]
    if len(feasible) != 1:
        refused = [value for value, found in ends.items() if found is Verdict.INFEASIBLE]
        return _found(over.end if feasible else None, refused[0] if refused else None, answers)
    good, bad = feasible[0], next(value for value in ends if value != feasible[0])
    smallest = tolerance**2 * abs(over.end - over.start)
    worst = bad if ends[bad] is Verdict.INFEASIBLE else None
    while abs(bad - good) > max(tolerance * max(abs(good), abs(bad)), smallest):
        middle = 0.5 * (good + bad)
        found = verdict(middle)
        if found is Verdict.FEASIBLE:
            good = middle
        else:
            bad = middle
            worst = middle if found is Verdict.INFEASIBLE else worst
    return _found(good, worst, answers)


def _found(good: float | None, worst: float | None, answers: dict[float, Answer]) -> Boundary:
    """A boundary between points that were answered."""
    evidence = answers[worst].evidence if worst is not None else None
    return Boundary(good, worst, len(answers), evidence)
