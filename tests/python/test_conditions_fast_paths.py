"""Reduced forms say what published forms say: verdicts compared on random problems, laws judged by the closed loop."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from closed_loops import decided, worst_rate
from quasilpv.conditions.condition import Form, Options
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.registry import condition
from quasilpv.conditions.theorems import i2
from quasilpv.lmi import Outcome
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.systems.descriptor.system import DescriptorSystem
from random_systems import random_system

DECIDED = {Outcome.VERIFIED, Outcome.INFEASIBLE_NUMERICALLY}


def regular(seed: int) -> DescriptorSystem:
    return random_system(seed, spread=0.15 * (1 + seed % 6), instability=0.3)


def scalar(seed: int) -> DescriptorSystem:
    return random_system(seed, order=1, differential=1, spread=0.2 * (1 + seed % 6), instability=1.0)


def scalar_singular(seed: int) -> DescriptorSystem:
    return random_system(seed, order=2, differential=1, spread=0.1 * (1 + seed % 6))


def singular(seed: int) -> DescriptorSystem:
    return random_system(seed, order=3, spread=0.1 * (1 + seed % 6))


def unforced(seed: int) -> DescriptorSystem:
    return random_system(seed, inputs=0, spread=0.1 * (1 + seed % 6), instability=-1.5)


def uncertain(seed: int) -> DescriptorSystem:
    return random_system(seed, order=2, differential=1, spread=0.15 * (1 + seed % 6), unknown=1)


def uncertain_input(seed: int) -> DescriptorSystem:
    spread = 0.2 * (1 + seed % 6)
    return random_system(seed, order=1, differential=1, spread=spread, constant_input=False, unknown=1)


def mechanical(seed: int) -> DescriptorSystem:
    """Premises in the lower rows only, with a lower or upper row that no input and no premise reaches."""
    system = random_system(seed, spread=0.8, instability=1.0)
    for matrix in (system.E, system.A):
        matrix.coefficients.setflags(write=True)
        matrix.coefficients[:, 0, :] = 0.0
    system.B.constant.setflags(write=True)
    system.B.constant[:] = [[0.0], [1.0]]
    system.A.constant.setflags(write=True)
    system.A.constant[0] = [float(seed % 3 - 1), 0.0 if seed % 2 else 1.0]
    return system


CASES: list[tuple[str, str, Options, Callable[[int], DescriptorSystem]]] = [
    ("I.1", "per-premise", Options(), unforced),
    ("I.1", "per-premise@0", Options(decay_rate=0.25), unforced),
    ("I.2", "ts", Options(), singular),
    ("I.2", "ts", Options(decay_rate=0.5), regular),
    ("I.2", "reduced", Options(), regular),
    ("I.2", "per-premise", Options(slack=Slack.NONE), regular),
    ("I.2", "per-premise@0", Options(), singular),
    ("I.2", "grouped=0,1", Options(), uncertain),
    ("I.53", "reduced", Options(), singular),
    ("I.53", "ts", Options(decay_rate=0.5), regular),
    ("II.5", "per-premise", Options(), scalar),
    ("II.5", "ts", Options(common=True), scalar),
    ("II.5", "per-premise", Options(common=True), scalar_singular),
    ("II.5", "per-premise", Options(common=True, slack=Slack.NONE), scalar_singular),
    ("II.6", "per-premise", Options(), mechanical),
    ("II.6", "ts", Options(decay_rate=0.5), mechanical),
    ("II.6-direct", "per-premise", Options(slack=Slack.NONE), mechanical),
    ("III.9", "uncertain", Options(), uncertain_input),
    ("III.9", "uncertain", Options(common=True), uncertain),
]


@pytest.mark.parametrize(("name", "representation", "options", "make"), CASES)
def test_reduced_and_published_forms_agree_and_their_laws_hold(
    name: str, representation: str, options: Options, make: Callable[[int], DescriptorSystem]
) -> None:
    feasible = 0
    for seed in range(6):
        model = polytopic_model(make(seed), representation)
        reduced, published = (_decide(name, model, options, form) for form in (Form.REDUCED, Form.PUBLISHED))
        assert reduced == published, f"seed {seed}"
        feasible += reduced
    assert 0 < feasible < 6


@pytest.mark.parametrize("slack", [Slack.NONE, Slack.THESIS])
def test_a_double_sum_with_constant_input_is_a_single_one(slack: Slack) -> None:
    feasible = 0
    for seed in range(6):
        model = polytopic_model(regular(seed), "per-premise")
        single, double = (decided(i2.with_gains(model, Options(slack=slack), single=s).problem) for s in (True, False))
        assert single.outcome == double.outcome
        feasible += single.feasible
    assert 0 < feasible < 6


def _decide(name: str, model: PolytopicModel, options: Options, form: Form) -> bool:
    """The verdict of a form; a feasible one is judged by its law."""
    statement = condition(name).inequalities(model, replace(options, form=form))
    decision = decided(statement.problem)
    assert decision.outcome in DECIDED
    if decision.feasible:
        rate = worst_rate(model.system, statement.feedback(decision.values), np.random.default_rng(0))
        assert rate < -2.0 * options.decay_rate
    return decision.feasible
