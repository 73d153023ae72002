"""The SDPA sparse format: written, read back, solved by strangers, and their answers decided in exact arithmetic."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.cli import run
from quasilpv.conditions.tracking.iv11_reduced import feedback_condition, observer_condition
from quasilpv.conditions.tracking.sampled_chains import feedback_gains, observer_gains
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.lmi import Problem, SdpaProgram, Solution, Variable, block, he
from quasilpv.lmi.assembly import unpack
from quasilpv.lmi.backends import BackendName
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.synthesis.shipped_problem import shipped_problem
from reference.shipped_laws import (
    DECAY,
    DISK,
    FEEDBACK_BANDWIDTH,
    INERTIA,
    INERTIA_UNIT,
    NOISE,
    OBSERVER_BANDWIDTH,
    PERIOD_S,
    chain_document,
    torque_document,
)

# SCS, a first-order method, is asked for a feasible point only: near the optimum it runs out of iterations.
PEERS: tuple[tuple[BackendName, str | None, bool], ...] = (
    ("clarabel", None, True),
    ("cvxpy", "CVXOPT", True),
    ("cvxpy", "SCS", False),
)


def random_problem(rng: np.random.Generator) -> Problem:
    X, Y, t = Variable("X", 2, symmetric=True), Variable("Y", 2, 3), Variable("t", 1)
    A, B = rng.normal(size=(2, 2)), rng.normal(size=(3, 3))
    problem = Problem()
    problem.positive("square", block([[he(A @ X), Y], [None, t * (B @ B.T) - rng.normal(size=(3, 3))]]))
    problem.positive("scalar", np.array([[1.0, 2.0]]) @ X @ np.array([[1.0], [3.0]]) + t)
    problem.minimise(t + rng.normal(size=(1, 2)) @ Y @ rng.normal(size=(3, 1)))
    return problem


@given(st.integers(0, 2**32 - 1))
def test_when_a_problem_is_written_and_read_expect_the_same_program_and_the_same_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    program = SdpaProgram.of(problem, ("made up",))
    again = SdpaProgram.parse(program.to_text(), "text")
    assert again == program
    read, unknowns = again.problem()
    point = rng.normal(size=len(unknowns))
    values = unpack(point, problem.variables)
    numbers = {x: np.array([[value]]) for x, value in zip(unknowns, point, strict=True)}
    for ours, theirs in zip(problem.constraints, read.constraints, strict=True):
        expected = ours.expression.at(values).astype(float)
        np.testing.assert_allclose(theirs.expression.at(numbers), (expected + expected.T) / 2, atol=1e-12)
    assert problem.objective is not None
    assert read.objective is not None
    assert read.objective.at(numbers)[0, 0] == pytest.approx(problem.objective.at(values)[0, 0])


# The example of the SDPA manual: its optimum is -41.9 at x = (-1.1, -2.7375, -0.55).
MANUAL = """"Example 1: mDim = 3, nBLOCK = 1, {2}"
   3  =  mDIM
   1  =  nBLOCK
   2  =  bLOCKsTRUCT
{48, -8, 20}
0 1 1 1 -11
0 1 2 2 23
1 1 1 1 10
1 1 1 2 4
2 1 2 2 -8
3 1 1 2 -8
3 1 2 2 -2
"""


def test_when_the_example_of_the_manual_is_read_expect_its_published_optimum() -> None:
    problem, unknowns = SdpaProgram.parse(MANUAL, "manual").problem()
    solution = problem.solve()
    assert solution.objective == pytest.approx(-41.9, abs=1e-5)
    point = [float(solution.values[x][0, 0]) for x in unknowns]
    assert point == pytest.approx([-1.1, -2.7375, -0.55], abs=1e-3)


@pytest.mark.parametrize(
    ("right", "wrong", "complaint"),
    [
        ("0 1 2 2 23", "0 1 2 2", "multiple of five"),
        ("0 1 2 2 23", "0 1 3 3 23", "entry"),
        ("0 1 2 2 23", "4 1 2 2 23", "entry"),
        ("0 1 2 2 23", "0 1 0 2 23", "count from 1"),
        ("0 1 2 2 23", "0 1 2 2 many", "many"),
        ("   3  =  mDIM", "three", "three"),
        ("   3  =  mDIM", "60", "head"),
    ],
)
def test_when_a_file_is_damaged_expect_one_line_that_says_where(right: str, wrong: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as caught:
        SdpaProgram.parse(MANUAL.replace(right, wrong), "damaged.dat-s")
    assert "damaged.dat-s" in str(caught.value)


# ---- the problems behind the laws ------------------------------------------------------------------------------------


@cache
def chains() -> dict[str, Any]:
    return chain_document(feedback_gains(FEEDBACK_BANDWIDTH, PERIOD_S), observer_gains(OBSERVER_BANDWIDTH, PERIOD_S))


@cache
def torque_level() -> dict[str, Any]:
    feedback = feedback_condition(INERTIA / INERTIA_UNIT, DECAY, DISK)
    observer = observer_condition(INERTIA / INERTIA_UNIT, DECAY, DISK, NOISE)
    return torque_document(
        feedback.point(feedback.problem.solve_inside()), observer.point(observer.problem.solve_inside())
    )


def solved_by_a_stranger(problem: Problem, backend: BackendName, solver: str | None, optimal: bool) -> Solution:
    """The solution another solver finds for the problem as the file states it, in the problem's own variables."""
    program = SdpaProgram.parse(SdpaProgram.of(problem).to_text(), "file")
    if not optimal:
        program = replace(program, objective=(0.0,) * len(program.objective))
    read, unknowns = program.problem()
    solution = read.solve_inside(backend=backend, solver=solver)
    point = np.array([solution.values[x][0, 0] for x in unknowns]) if solution.values else np.zeros(0)
    return replace(solution, values=unpack(point, problem.variables) if solution.values else {})


@pytest.mark.parametrize(
    ("law", "backend", "solver", "optimal"),
    [
        *((chains, *peer) for peer in PEERS),
        *((torque_level, *peer) for peer in PEERS[:2]),
        pytest.param(torque_level, *PEERS[2], marks=pytest.mark.full),
    ],
)
def test_when_a_stranger_solves_the_exported_problem_expect_the_same_verdict_and_a_point_that_certifies(
    law: Callable[[], dict[str, Any]], backend: BackendName, solver: str | None, optimal: bool
) -> None:
    problem = shipped_problem(law())
    solution = solved_by_a_stranger(problem, backend, solver, optimal)
    assert solution.verified
    assert problem.holds_exactly(solution.values)
    if optimal:  # the back-off allows 5 % of it
        assert 1.0 - 1e-4 < solution.objective / problem.solve().objective < 1.05 * (1.0 + 1e-4)


@pytest.mark.parametrize(("backend", "solver", "optimal"), PEERS)
def test_when_more_is_asked_than_the_optimum_gives_expect_every_solver_to_refuse_the_exported_problem(
    backend: BackendName, solver: str | None, optimal: bool
) -> None:
    problem = shipped_problem(chains())
    assert problem.objective is not None
    problem.positive("too much", np.array([[0.5 * problem.solve().objective]]) - problem.objective)
    assert not solved_by_a_stranger(problem, backend, solver, optimal).verified


def test_when_an_artifact_is_exported_expect_the_problem_its_gains_came_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = release(DesignRequest.of("arm2"))
    artifact, out = tmp_path / "artifact.json", tmp_path / "problem.dat-s"
    artifact.write_bytes(canonical_json(made.artifact.to_document()))
    assert run(["export-sdp", str(artifact), "-o", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    program = SdpaProgram.parse(out.read_text(), str(out))
    assert (answer["unknowns"], answer["blocks"]) == (len(program.objective), list(program.blocks))
    assert made.artifact.hash in program.comments[0]
    # The gains as shipped came from a point 5 % above the optimum of this very problem.
    witness = made.artifact.content()["witness"]
    shipped = sum(witness[name]["objective"] for name in ("feedback", "observer"))
    optimum = program.problem()[0].solve().objective
    assert optimum * (1.0 + 1e-6) < shipped < 1.05 * optimum * (1.0 + 1e-3)


@pytest.mark.parametrize("damage", ["law", "witness"])
def test_when_an_artifact_has_no_problem_behind_it_expect_a_clear_refusal(damage: str) -> None:
    if damage == "law":
        document = release(DesignRequest.of("arm2", "pid", Specification())).artifact.content()
        with pytest.raises(InputError, match=r"law\.kind.*pid.*dob-acceleration"):
            shipped_problem(document)
    else:
        with pytest.raises(InputError, match="witness"):
            shipped_problem({**chains(), "witness": None})
