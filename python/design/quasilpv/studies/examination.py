"""From what a solver says to a verdict: proofs looked for on both sides, other units tried, steps compared.

1. A solution that exact arithmetic confirms: *feasible, proved*. The units the system comes in are tried first.
2. A frozen mode that refutes every solution (`refutation`): *infeasible, proved*.
3. The inequalities again in other units (`quasilpv.polytopes.scaling.ladder`), until one step is verified. What holds
   in other units holds: a statement is built for the rescaled system, exactly, and its law and Lyapunov function are
   brought back exactly. They are the same inequalities, with powers of two on rows, columns and unknowns (but for the
   factors that I.3 chooses for its uncertainty).
4. The margin program (`quasilpv.lmi.margin`), in the units fitted first, if a step came to no conclusion, or if the
   system came in units far from all that were fitted.
5. *Infeasible, numerically* if the solver says so in all units, or the margin program does; else *unknown*.

The norm below which a dual certificate excludes solutions tells true from false verdicts as little as a status does,
and is not used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from quasilpv.conditions.condition import Condition, Feedback, Options, Statement
from quasilpv.lmi import Outcome, largest_margin
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import Decision, decide
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.scaling import ladder
from quasilpv.polytopes.units import Units
from quasilpv.studies.answer import Evidence, Verdict
from quasilpv.studies.refutation import IMPLIED, Refutation, is_suspect, refutation

MARGIN_PROGRAM_SIZE = 300_000
"""Rows times unknowns; larger problems are not put to the margin program: it would take minutes."""


@dataclass(frozen=True, eq=False)
class Case:
    """A condition for a model: what is examined.

    Attributes:
        condition: the condition.
        options: of the condition.
        small: whether the margin program is worth its time, see `is_small`.
        exact: makes the system in its representation.
        sketch: the same up to rounding, where that is cheaper: enough to see whether there is anything to do.
        in_units: the inequalities in other units, where that is cheaper than to write them down; None where it is not
            known. A solution of these is looked for again, and proved, in those written down.
    """

    condition: Condition
    options: Options
    small: bool
    exact: Callable[[], PolytopicModel]
    sketch: PolytopicModel | None = None
    in_units: Callable[[Units], CompiledProblem | None] = lambda units: None

    @cached_property
    def model(self) -> PolytopicModel:
        """The system in its representation."""
        return self.exact()

    def refutation(self) -> Refutation | None:
        """A proof that there is no solution, if one is found."""
        known = self.condition.id
        if not is_suspect(known, self.sketch or self.model, self.options):
            return None
        return refutation(known, self.model, self.options)

    def statement(self, units: Units | None) -> Statement:
        """The inequalities, in other units."""
        return stated(self.condition, self.model, self.options, units)

    def decided(self, units: Units) -> tuple[Decision, Statement | None]:
        """The solver's decision in other units, and the statement that a solution belongs to."""
        sketched = self.in_units(units)
        decision = None if sketched is None else decide(sketched)
        if decision is not None and not decision.feasible:
            return decision, None
        statement = self.statement(units)
        return decide(CompiledProblem.of(statement.problem)), statement


@dataclass(frozen=True, eq=False)
class Finding:
    """A verdict, and how it came about.

    Attributes:
        verdict, evidence, reason: see `quasilpv.studies.answer.Answer`.
        decision: that of the verified step; the first one otherwise.
        statement: of that step, if it is not the first one.
        units: of that step.
        refutation: if the verdict is proved by one.
        steps: how many times a solver was asked.
    """

    verdict: Verdict
    evidence: Evidence | None
    reason: str
    decision: Decision
    statement: Statement | None = None
    units: Units | None = None
    refutation: Refutation | None = None
    steps: int = 1

    def feedback(self, first: Statement) -> Feedback:
        """What the solution of a feasible finding gives, in the units of the system.

        Args:
            first: the statement in these units.
        """
        found = (self.statement or first).feedback(self.decision.values)
        return found if self.units is None else found.in_old_units(self.units)


def examine(case: Case, first: Decision) -> Finding:
    """The verdict on a case.

    Args:
        case: what is asked.
        first: the solver's decision in the units the system comes in, not a verified one.
    """
    refuted = case.refutation()
    if refuted is not None:
        reason = refuted.sentence(IMPLIED[case.condition.id])
        return Finding(Verdict.INFEASIBLE, Evidence.PROVED, reason, first, refutation=refuted)
    outcomes, tried = [], list[Units | None]()
    for units in ladder((case.sketch or case.model).system):
        tried.append(units)
        if units is None:
            outcomes.append(first.outcome)
            continue
        decision, statement = case.decided(units)
        if decision.feasible:
            return solution(decision, 1 + len(tried) - tried.count(None), statement, units)
        outcomes.append(decision.outcome)
    asked = 1 + len(tried) - tried.count(None)
    agreed = all(outcome is Outcome.INFEASIBLE_NUMERICALLY for outcome in outcomes)
    if case.small and (not agreed or None not in tried):
        return _by_margin(case, first, tried[0], asked + 1)
    if agreed:
        many = "" if asked == 1 else f", in {asked} systems of units"
        reason = f"the solver found no solution{many}; not a proof"
        return Finding(Verdict.INFEASIBLE, Evidence.NUMERICAL, reason, first, steps=asked)
    return Finding(Verdict.UNKNOWN, None, _undecided(outcomes), first, steps=asked)


def stated(condition: Condition, model: PolytopicModel, options: Options, units: Units | None = None) -> Statement:
    """The inequalities of a condition for a model, or for the same model in other units.

    That the model has what the condition relies on is for the caller to see to. Errors: `Condition.inequalities`.
    """
    if units is None:
        return condition.inequalities(model, options)
    rescaled = PolytopicModel(units.of(model.system), model.polytope)
    return condition.inequalities(rescaled, options.in_units(units))


def no_solution(decision: Decision) -> Finding:
    """What a solver's word alone is worth that there is none: nothing, unless it is compared with others."""
    return Finding(Verdict.UNKNOWN, None, "no solution was found", decision)


def solution(decision: Decision, steps: int, statement: Statement | None = None, units: Units | None = None) -> Finding:
    """The finding of a verified decision.

    Args:
        decision: of the step that was verified.
        steps: how many times a solver was asked.
        statement, units: of that step, if it is not the first one.
    """
    rescaled = "" if units is None else ", in rescaled units"
    reason = f"a solution satisfies every inequality, in exact arithmetic{rescaled}"
    return Finding(Verdict.FEASIBLE, Evidence.PROVED, reason, decision, statement, units, steps=steps)


def _by_margin(case: Case, first: Decision, units: Units | None, asked: int) -> Finding:
    statement = case.statement(units)
    margin = largest_margin(statement.problem)
    if margin.outcome is Outcome.VERIFIED:
        decision = Decision(Outcome.VERIFIED, values=margin.values, margin=margin.margin)
        return solution(decision, asked, statement, units)
    if margin.outcome is Outcome.INFEASIBLE_NUMERICALLY:
        reason = f"no solution comes nearer than a margin of {margin.margin:.3g}, numerically; not a proof"
        return Finding(Verdict.INFEASIBLE, Evidence.NUMERICAL, reason, first, steps=asked)
    reason = "the question is within the solver's accuracy of the edge between feasible and infeasible"
    if margin.outcome is Outcome.SOLVER_ONLY:
        reason = "the solver's point does not satisfy the inequalities in exact arithmetic"
    return Finding(Verdict.UNKNOWN, None, reason, first, steps=asked)


def _undecided(outcomes: list[Outcome]) -> str:
    if Outcome.SOLVER_ONLY in outcomes:
        return "the solver's point does not satisfy the inequalities in exact arithmetic"
    if Outcome.INFEASIBLE_NUMERICALLY in outcomes:
        return "the solver does not say the same in all units"
    return "the solver came to no conclusion"


def is_small(rows: int, unknowns: int) -> bool:
    """Whether a problem of that size is put to the margin program."""
    return rows * unknowns <= MARGIN_PROGRAM_SIZE
