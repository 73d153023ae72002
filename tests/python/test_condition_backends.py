"""Conditions on random systems: direct assembly, cvxpy and CVXOPT give one verdict, and feasible ones are proved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from bench_solvers import Cvxopt, decide_with

from closed_loops import decided
from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import CONDITIONS, condition
from quasilpv.lmi import Outcome, Problem, identity
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import Decision
from quasilpv.polytopes import polytopic_model
from quasilpv.studies import Verdict
from random_systems import random_system

BAND = 0.01
"""Relative: a verdict that changes when the influence of the premises does by as much may go either way."""

SIZES: Mapping[str, Mapping[str, Any]] = {
    "I.1": {"inputs": 0, "instability": -1.5},
    "I.3": {"unknown": 1, "differential": 1},
    "II.5": {"order": 1, "differential": 1},
    "II.5-cor1": {"order": 1, "differential": 1},
    "III.9": {"unknown": 1, "order": 1, "differential": 1},
    "guerra-2007": {"premises": 1},
}
"""Kinds of random system for a condition, where not of two states, one of them algebraic."""

TOO_LARGE = {"II.7", "II.8"}
"""Triple sums: minutes a problem in cvxpy."""

OF_THE_STATE = {"estimated-observer"}
"""Asks for premises that are functions of the state, which those of a random system are not."""

OTHERS = tuple(name for name in CONDITIONS if name not in TOO_LARGE | OF_THE_STATE | {"II.6"})
REGULAR = {"II.6", "II.6-direct", "guerra-2007", "sampled-feedback", "sampled-observer"}


@dataclass(frozen=True)
class Case:
    """A condition and a random system, both drawn by the seed."""

    seed: int

    @property
    def name(self) -> str:
        """Theorem II.6 for every second seed, the others in turn."""
        return "II.6" if self.seed % 2 == 0 else OTHERS[self.seed // 2 % len(OTHERS)]

    def problem(self, factor: float = 1.0) -> Problem:
        """The inequalities, the spread times a factor."""
        rng = np.random.default_rng(self.seed)
        order = int(rng.integers(2, 4)) if self.name == "II.6" else 2
        kind: dict[str, Any] = {
            "order": order,
            "differential": order if self.name in REGULAR else 1,
            "premises": int(rng.integers(1, 4 if order == 2 and self.name != "TS-Pj" else 3)),
            "instability": 0.3,
        }
        kind |= SIZES.get(self.name, {})
        spread = factor * float(rng.uniform(0.05, 0.9))
        system = random_system(self.seed, spread=spread, constant_input=bool(rng.integers(2)), **kind)
        entry = condition(self.name)
        return entry.inequalities(polytopic_model(system, entry.representation), Options()).problem


def directly(decision: Decision) -> Verdict:
    """What the direct assembly and Clarabel say."""
    if decision.feasible:
        return Verdict.FEASIBLE
    return Verdict.INFEASIBLE if decision.outcome is Outcome.INFEASIBLE_NUMERICALLY else Verdict.UNKNOWN


def with_cvxpy(problem: Problem) -> Verdict:
    """The inequalities, required to be at least I, as cvxpy multiplies them out; its candidate is checked exactly."""
    program = Problem()
    for constraint in problem.constraints:
        program.positive(constraint.name, constraint.expression - identity(constraint.expression.shape[0]))
    solution = program.solve(backend="cvxpy", solver="CLARABEL")
    if solution.values and problem.holds_exactly(solution.values):
        return Verdict.FEASIBLE
    return Verdict.INFEASIBLE if solution.outcome is Outcome.INFEASIBLE_NUMERICALLY else Verdict.UNKNOWN


def assert_one_verdict(seed: int) -> None:
    case = Case(seed)
    problem = case.problem()
    decision, compiled = decided(problem), CompiledProblem.of(problem)
    if decision.feasible:
        assert problem.holds_exactly(decision.values)
    assert decision.outcome is not Outcome.SOLVER_ONLY, case
    others = {"cvxpy": with_cvxpy(problem), "CVXOPT": decide_with(Cvxopt(compiled.layout), compiled)}
    if set(others.values()) != {directly(decision)} or directly(decision) is Verdict.UNKNOWN:
        around = {directly(decided(case.problem(1.0 + side))) for side in (-BAND, BAND)}
        assert {Verdict.FEASIBLE, Verdict.INFEASIBLE} <= around, (case.name, case, decision.outcome, others)


@pytest.mark.parametrize("seed", range(15))
def test_when_a_condition_meets_a_random_system_expect_one_verdict_of_all_back_ends(seed: int) -> None:
    assert_one_verdict(seed)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(15, 215))
def test_when_conditions_meet_many_random_systems_expect_one_verdict_of_all_back_ends(seed: int) -> None:
    assert_one_verdict(seed)


def test_the_random_systems_are_feasible_for_some_seeds_and_not_for_others() -> None:
    outcomes = [decided(Case(seed).problem()).outcome for seed in range(0, 40, 2)]
    assert min(outcomes.count(Outcome.VERIFIED), outcomes.count(Outcome.INFEASIBLE_NUMERICALLY)) >= 4
