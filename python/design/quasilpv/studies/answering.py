"""One question answered: solved, proved or examined, with the law that a yes comes with."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

from quasilpv.conditions.registry import condition
from quasilpv.conditions.reliance import refuse_refuted
from quasilpv.lmi import largest_margin
from quasilpv.lmi.budget import TimeUpError, TooLargeError, limited
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.polytopes.scaling import ladder
from quasilpv.studies.affordable import require_affordable, within_limits
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.examination import Case, Finding, examine, is_small, solution, stated
from quasilpv.studies.law import Law
from quasilpv.studies.other_factorings import with_other_factorings
from quasilpv.studies.question import Question
from quasilpv.systems.descriptor.system import DescriptorSystem

LEAST_S = 1e-3
"""A time limit has to be positive."""


def answered(question: Question) -> Answer:
    """Everything there is to say about one question, its law included.

    Of a system from equations other factorings of A(x) x are tried where the first one is not feasible; the reason says
    so, and the law has the premises of the one it was found with.

    Raises:
        InputError: the condition does not apply to the system, or the representation does not.
        TooLargeError: a solver would need more memory than it may have; names cheaper ways.
    """
    first = within_limits(question, lambda: _answered(question, question.model()), alternatives=True)

    def ask(other: DescriptorSystem) -> Answer:
        return _answered(question, polytopic_model(other, question.representation))

    return with_other_factorings(question.model().system, first, question.limits, ask)


def _answered(question: Question, model: PolytopicModel) -> Answer:
    start = time.perf_counter()
    known = condition(question.condition)
    refuse_refuted(known.id, known.relies_on, model)
    statement = stated(known, model, question.options)
    compiled = CompiledProblem.of(statement.problem)
    require_affordable(question, compiled.layout)
    decision = decide(compiled)
    finding = solution(decision, 1)
    if not decision.feasible:
        finding = examine(case_of(question, compiled, lambda: model), decision)
    answer = replace(answer_of(compiled, finding, start), relies_on=known.relied(model))
    if answer.verdict is not Verdict.FEASIBLE:
        return answer
    return replace(answer, law=Law.of(model.system, known.id, finding.feedback(statement)))


def largest_or_reached_margin(question: Question, answer: Answer) -> float | None:
    """How far a question is from the edge between feasible and infeasible; see `quasilpv.lmi.margin`.

    In the units of the answer, or those fitted first if it is not feasible: the margin depends on them. Of a problem
    too large for the margin program, with another factoring, or larger than the time left allows, what the answer
    reached; None if it is not feasible.
    """
    if not answer.unknowns or answer.factoring or not is_small(answer.rows, answer.unknowns):
        return answer.margin
    feasible, allowed = answer.verdict is Verdict.FEASIBLE, question.limits.time_s
    left = None if allowed is None else max(allowed - answer.seconds, LEAST_S)
    try:
        with limited(replace(question.limits, time_s=left)):
            units = answer.units if feasible else next(ladder(question.model().system))
            margin = largest_margin(question.statement(units).problem)
    except (TimeUpError, TooLargeError):
        return answer.margin
    return _finite(margin.margin)


def case_of(
    question: Question,
    compiled: CompiledProblem,
    exact: Callable[[], PolytopicModel],
) -> Case:
    """What is examined of a question whose problem is compiled; ``exact`` makes the system at its point."""
    small = is_small(sum(compiled.layout.sizes), compiled.layout.unknowns)
    return Case(condition(question.condition), question.options, small, exact)


def answer_of(compiled: CompiledProblem, finding: Finding, start: float) -> Answer:
    """A finding as an answer, with the size of its problem and the seconds since ``start`` (`time.perf_counter`)."""
    return Answer(
        verdict=finding.verdict,
        evidence=finding.evidence,
        reason=finding.reason,
        margin=_finite(finding.decision.margin),
        unknowns=compiled.layout.unknowns,
        rows=sum(compiled.layout.sizes),
        seconds=time.perf_counter() - start,
        witness=tuple(finding.decision.point.tolist()) if finding.decision.feasible else (),
        refutation=finding.refutation,
        units=finding.units,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
