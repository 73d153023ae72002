"""Errors planted in the builders of the inequalities, one block at a time: no gain they lead to passes the checker.

The checker shares no code with the builders. Here every builder gets a sign flipped or a term dropped in its source,
the problem is solved, the gains and the witness are shipped, and the checker must refuse them.
"""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

import pytest

from quasilpv.certificate import Verification
from reference.checked import inequalities
from reference.mutants import BLOCKS, Mutant
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

CHAINS = "quasilpv.conditions.tracking.sampled_chains"
REDUCED = "quasilpv.conditions.tracking.iv11_reduced"
BACK_OFF = 0.02


def chain(module: Any, side: str) -> Any:
    """Gains of one chain, from a builder that may be wrong."""
    if side == "feedback":
        return module.feedback_gains(FEEDBACK_BANDWIDTH, PERIOD_S)
    return module.observer_gains(OBSERVER_BANDWIDTH, PERIOD_S)


def reduced(module: Any, side: str) -> Any:
    """A point of one half of the reduced theorem, from a builder that may be wrong; None if there is none."""
    if side == "feedback":
        condition = module.feedback_condition(INERTIA / INERTIA_UNIT, DECAY, DISK)
    else:
        condition = module.observer_condition(INERTIA / INERTIA_UNIT, DECAY, DISK, NOISE)
    solution = condition.problem.solve_inside(BACK_OFF)
    return condition.point(solution) if solution.values else None


@cache
def sound(builder: str, side: str) -> Any:
    """What the builder as it is leads to."""
    module = importlib.import_module(builder)
    return chain(module, side) if builder == CHAINS else reduced(module, side)


def shipped(builder: str, side: str, point: Any) -> Verification:
    """The checker's verdict on a law with this point on one side and a sound one on the other."""
    points = {name: point if name == side else sound(builder, name) for name in ("feedback", "observer")}
    document = chain_document if builder == CHAINS else torque_document
    # The design model is of no robot here.
    return Verification(inequalities(document(points["feedback"], points["observer"])), seconds=0.0)


@pytest.mark.parametrize("builder", [CHAINS, REDUCED])
def test_when_the_builders_are_right_expect_the_checker_to_agree(builder: str) -> None:
    verdict = shipped(builder, "feedback", sound(builder, "feedback"))
    assert verdict.verified, verdict.failed


def verdict_on(monkeypatch: pytest.MonkeyPatch, builder: str, side: str, mutant: Mutant) -> Verification:
    """The verdict on what a builder with this error leads to."""
    module = mutant.loaded(monkeypatch, builder)
    point = chain(module, side) if builder == CHAINS else reduced(module, side)
    assert point is not None, "this error leaves nothing to ship: plant another"
    return shipped(builder, side, point)


DISK_OF_A_CHAIN = (
    Mutant("disk 11", "[matrix * radius, None]", "[matrix, None]", BLOCKS),
    Mutant("disk 11 sign", "[matrix * radius, None]", "[-matrix * radius, None]", BLOCKS),
    Mutant("disk 12 product", "as_expression(product) - matrix", "-matrix", BLOCKS),
    Mutant("disk 12 sign", "as_expression(product) - matrix", "-as_expression(product) - matrix", BLOCKS),
    Mutant("disk 12 centre", " - matrix * centre", "", BLOCKS),
    Mutant("disk 12 centre sign", "- matrix * centre", "+ matrix * centre", BLOCKS),
    Mutant("disk 22", "[shifted, matrix * radius]", "[shifted, matrix]", BLOCKS),
)

SAMPLED_FEEDBACK = (
    *DISK_OF_A_CHAIN,
    Mutant("closed loop sign", "transition @ P + drive @ Y", "transition @ P - drive @ Y"),
    Mutant("covariance 11", "[[P, closed, drive]", "[[P * 2, closed, drive]"),
    Mutant("covariance 12", "[[P, closed, drive]", "[[P, zeros(3, 3), drive]"),
    Mutant("covariance 13", "[[P, closed, drive]", "[[P, closed, zeros(3, 1)]"),
    Mutant("covariance 22", "[None, P, zeros(size, 1)]", "[None, P * 2, zeros(size, 1)]"),
    Mutant("covariance 23", "[None, P, zeros(size, 1)]", "[None, P, drive]"),
    Mutant("covariance 33", "np.array([[1]])", "np.array([[2]])"),
)

SAMPLED_OBSERVER = (
    *DISK_OF_A_CHAIN,
    Mutant("error sign", "Q @ transition - W @ output", "Q @ transition + W @ output"),
    Mutant("error gain", "Q @ transition - W @ output", "Q @ transition"),
    Mutant("Gramian 11", '"Gramian", block([[Q, error]', '"Gramian", block([[Q * 2, error]'),
    Mutant("Gramian 12", '"Gramian", block([[Q, error]', '"Gramian", block([[Q, zeros(4, 4)]'),
    Mutant("Gramian 22", "Q - estimate.T @ estimate", "Q"),
    Mutant("Gramian 22 sign", "Q - estimate.T @ estimate", "Q + estimate.T @ estimate"),
    Mutant("variance 11", '"variance", block([[Q, inputs]', '"variance", block([[Q * 2, inputs]'),
    Mutant("variance 12", '"variance", block([[Q, inputs]', '"variance", block([[Q, zeros(4, 2)]'),
    Mutant("variance 12 noise", "W @ to_rational([[1, 0]]) + Q", "Q"),
    Mutant("variance 12 drive", " + Q @ (drive @ to_rational([[0, 1]]))", ""),
    Mutant("variance 22", "[None, N]]", "[None, N * 2]]"),
)


@pytest.mark.parametrize("mutant", SAMPLED_FEEDBACK, ids=lambda mutant: mutant.block)
def test_when_the_sampled_feedback_builder_errs_expect_the_checker_to_refuse(
    monkeypatch: pytest.MonkeyPatch, mutant: Mutant
) -> None:
    assert not verdict_on(monkeypatch, CHAINS, "feedback", mutant).verified


@pytest.mark.parametrize("mutant", SAMPLED_OBSERVER, ids=lambda mutant: mutant.block)
def test_when_the_sampled_observer_builder_errs_expect_the_checker_to_refuse(
    monkeypatch: pytest.MonkeyPatch, mutant: Mutant
) -> None:
    assert not verdict_on(monkeypatch, CHAINS, "observer", mutant).verified


DECAY_OF_THE_ERROR = "he(closed[i] @ E[j].T) + (E[i] @ P @ E[j].T) * (2 * decay)"
BOUNDED_REAL_ROW = "[decreasing, constant(B), E[i] @ P @ C.T]"
DISK_ROW = "(E[i] @ P @ E[j].T) * -disk, closed[i]]"
EQUAL = 'problem.negative(f"{name} {i} {i} {label}".rstrip(), grid[i][i] + shift.at((i, i, *rest)))'
OFF_DIAGONAL = "tuan = diagonal + grid[i][j] + grid[j][i]"

REDUCED_FEEDBACK = (
    Mutant("closed loop sign", "[A @ P + B @ Yi for", "[A @ P - B @ Yi for"),
    Mutant("bounded real 11 decay", DECAY_OF_THE_ERROR, "he(closed[i] @ E[j].T)"),
    Mutant(
        "bounded real 11 decay sign",
        DECAY_OF_THE_ERROR,
        "he(closed[i] @ E[j].T) - (E[i] @ P @ E[j].T) * (2 * decay)",
    ),
    Mutant("bounded real 11 inertia", "he(closed[i] @ E[j].T)", "he(closed[i])"),
    Mutant("bounded real 11 sign", "he(closed[i] @ E[j].T)", "-he(closed[i] @ E[j].T)"),
    Mutant("bounded real 12", BOUNDED_REAL_ROW, "[decreasing, zeros(3 * n, n), E[i] @ P @ C.T]"),
    Mutant("bounded real 13", BOUNDED_REAL_ROW, "[decreasing, constant(B), zeros(3 * n, n)]"),
    Mutant("bounded real 13 inertia", BOUNDED_REAL_ROW, "[decreasing, constant(B), P @ C.T]"),
    Mutant("bounded real 22", "[None, -(gamma * one), zeros(n, n)]", "[None, -(gamma * one) - one, zeros(n, n)]"),
    Mutant("bounded real 22 sign", "[None, -(gamma * one), zeros(n, n)]", "[None, gamma * one, zeros(n, n)]"),
    Mutant("bounded real 33", "constant(-one)", "constant(-2 * one)", place=(0, 2)),
    Mutant("disk 11", DISK_ROW, "(E[i] @ P @ E[j].T) * (-2 * disk), closed[i]]"),
    Mutant("disk 11 inertia", DISK_ROW, "P * -disk, closed[i]]"),
    Mutant("disk 12", DISK_ROW, "(E[i] @ P @ E[j].T) * -disk, zeros(3 * n, 3 * n)]"),
    Mutant("disk 22", "[None, P * -disk]]", "[None, P * (-2 * disk)]]"),
    Mutant("sum, equal indices", EQUAL, "pass", BLOCKS),
    Mutant("sum, unequal indices", OFF_DIAGONAL, "tuan = diagonal", BLOCKS),
    Mutant("sum, sign", OFF_DIAGONAL, "tuan = diagonal - grid[i][j] - grid[j][i]", BLOCKS),
)

REDUCED_OBSERVER = (
    Mutant("error sign", "Q @ A - Wi @ C", "Q @ A + Wi @ C"),
    Mutant("error gain", "Q @ A - Wi @ C", "Q @ A"),
    Mutant("bounded real 11 decay", "he(error[i]) + Q * (2 * decay)", "he(error[i])"),
    Mutant("bounded real 11 decay sign", "he(error[i]) + Q * (2 * decay)", "he(error[i]) - Q * (2 * decay)"),
    Mutant("bounded real 11 transpose", "he(error[i]) + Q * (2 * decay)", "error[i] + Q * (2 * decay)"),
    Mutant("bounded real 12 sign", "Q * (2 * decay), Q @ G]", "Q * (2 * decay), -Q @ G]"),
    Mutant("bounded real 13", "[[Q @ H, W[i] * -noise]", "[[zeros(4 * n, n), W[i] * -noise]"),
    Mutant("bounded real 14", "[[Q @ H, W[i] * -noise]", "[[Q @ H, zeros(4 * n, n)]"),
    Mutant("bounded real 15", "constant(np.vstack([D.T, none]))", "zeros(5 * n, n)"),
    Mutant("bounded real 33", "[None, -(gamma * np.kron", "[None, -((gamma + [[1]]) * np.kron"),
    Mutant("bounded real 55", "constant(-one)", "constant(-2 * one)", place=(1, 2)),
    Mutant("constraint sign", "top + he(F @ motion[i])", "top - he(F @ motion[i])"),
    Mutant("constraint, sign of the inertia", "[none, none, one, none, -M]", "[none, none, one, none, M]"),
    Mutant("constraint, inertia", "[none, none, one, none, -M]", "[none, none, one, none, -one]"),
    Mutant("disk 11", "block([[Q * -disk, zeros(4 * n, n)]", "block([[Q * (-2 * disk), zeros(4 * n, n)]"),
    Mutant("disk 13", "block([[error[i], Q @ G]]).T", "block([[zeros(4 * n, 4 * n), Q @ G]]).T"),
    Mutant("disk 23", "block([[error[i], Q @ G]]).T", "block([[error[i], zeros(4 * n, n)]]).T"),
    Mutant("disk 33", "[None, Q * -disk]]", "[None, Q * (-2 * disk)]]"),
    Mutant("sum", 'problem.negative(f"{name} {i}"', '(i and "real" in name) or problem.negative(f"{name} {i}"', BLOCKS),
)


@pytest.mark.parametrize("mutant", REDUCED_FEEDBACK, ids=lambda mutant: mutant.block)
def test_when_the_reduced_feedback_builder_errs_expect_the_checker_to_refuse(
    monkeypatch: pytest.MonkeyPatch, mutant: Mutant
) -> None:
    assert not verdict_on(monkeypatch, REDUCED, "feedback", mutant).verified


@pytest.mark.parametrize("mutant", REDUCED_OBSERVER, ids=lambda mutant: mutant.block)
def test_when_the_reduced_observer_builder_errs_expect_the_checker_to_refuse(
    monkeypatch: pytest.MonkeyPatch, mutant: Mutant
) -> None:
    assert not verdict_on(monkeypatch, REDUCED, "observer", mutant).verified
