"""Never a proved law that uses what nobody knows, never one over a singular E: every condition, judged from outside.

Random systems with unknown premises, descriptor matrices that become singular in the box, index two and premises that
no output gives. A law that is proved is judged by what it does: by its values at premises that differ in what is
unknown, by generalized eigenvalues, and by simulation.
"""

from __future__ import annotations

from collections import Counter
from enum import StrEnum

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import sympy as sp

from closed_loops import premises, worst_rate
from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Feedback, Options
from quasilpv.conditions.registry import CONDITIONS, condition
from quasilpv.errors import InputError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import polytopic_model
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

ANALYSIS = {"I.1"}
SAMPLED = {"sampled-feedback", "sampled-observer", "estimated-observer"}
SLOW = {"II.7", "II.8"}
PERIOD_S = 0.02


class Trap(StrEnum):
    """What is wrong with a system."""

    UNKNOWN = "an unknown premise in E and A"
    SINGULAR = "E singular in the box"
    INDEX_TWO = "A_22 = 0"
    UNMEASURED = "premises of states no output gives"


def trapped(trap: Trap, seed: int, premise_count: int) -> DescriptorSystem:
    """A random system of two differential states, and one algebraic one for index two, with a trap in it.

    Its premises are functions of the first state, which no output gives where that is the trap, or unknown numbers.
    """
    rng = np.random.default_rng(seed)
    q, n, r = 2, 3 if trap is Trap.INDEX_TWO else 2, premise_count
    mask = np.zeros((n, n))
    mask[:q, :q] = 1.0
    constant, slopes = mask * np.eye(n), 0.2 * rng.standard_normal((r, n, n)) * mask
    if trap is Trap.SINGULAR:
        slopes[0] = np.diag([0.0, -1.0])
        constant[1, 1] = rng.uniform(0.2, 0.9)
    drift = rng.standard_normal((n, n)) - 0.3 * np.eye(n)
    if trap is Trap.INDEX_TWO:
        drift[2] = [0.0, 1.0, 0.0]
    A = AffineMatrix(drift, 0.2 * rng.standard_normal((r, n, n)) * (mask if trap is Trap.INDEX_TWO else 1.0))
    B = np.vstack([rng.standard_normal((q, 1)), np.zeros((n - q, 1))]) + (0.0 if n > q else 0.5)
    state = sp.symbols(f"x1:{n + 1}", real=True)
    shapes = (state[0], state[0] ** 2 - 1)
    p = sp.Symbol("p", real=True)
    own = [Premise(f"z{k + 1}", shapes[k], (-1.0, 1.0)) for k in range(r)]
    if trap is Trap.UNKNOWN:
        own[-1] = Premise("p", p, (-1.0, 1.0), PremiseKind.UNKNOWN)
    seen = np.eye(n)[1:] if trap is Trap.UNMEASURED else np.eye(n)
    return DescriptorSystem(
        name=f"{trap} {seed}",
        state=state,
        inputs=("u",),
        premises=tuple(own),
        E=AffineMatrix(constant, slopes),
        A=A,
        B=AffineMatrix(B, np.zeros((r, n, 1))),
        C=AffineMatrix(seen, np.zeros((r, *seen.shape))),
        domain={state[0]: (-1.0, 1.0), p: (-1.0, 1.0)},
    )


def proved(plant: DescriptorSystem, name: str) -> Feedback | str:
    """The law of a proved answer, or why there is none."""
    representation = condition(name).representation
    try:
        model = polytopic_model(plant, representation)
        statement = condition(name).build(model, Options(sample_period_s=PERIOD_S))
    except InputError as error:
        return str(error)
    decision = decide(CompiledProblem.of(statement.problem))
    return statement.feedback(decision.values) if decision.feasible else "no solution"


def changes_with_the_unknown(plant: DescriptorSystem, feedback: Feedback) -> float:
    """Largest relative change of a law between premise vectors that differ in unknown premises only."""
    rng = np.random.default_rng(0)
    unknown = [k for k, premise in enumerate(plant.premises) if premise.kind is PremiseKind.UNKNOWN]
    worst = 0.0
    for z, other in zip(premises(plant, rng, 20), premises(plant, rng, 20), strict=True):
        same = z.copy()
        same[unknown] = other[unknown]
        for law in (feedback.gain, feedback.observer):
            if law is not None:
                worst = max(worst, float(np.abs(law(z) - law(same)).max() / (1e-12 + np.abs(law(z)).max())))
    return worst


def worst_frozen_mode(plant: DescriptorSystem, feedback: Feedback) -> float:
    """Largest real part of the finite generalized eigenvalues of ``(A + B K, E)`` over the box, or infinity."""
    worst = -np.inf
    for z in premises(plant, np.random.default_rng(1), 60):
        E, A, B, _ = plant.evaluate(z)
        q = plant.differential
        if feedback.gain is not None and feedback.gain(z).shape[1] != plant.order:
            K = feedback.gain(z)
            A = A + B @ np.hstack([K[:, :q], K[:, 2 * q :]])
            E = E.copy()
            E[:, :q] -= B @ K[:, q : 2 * q]
        elif feedback.gain is not None:
            A = A + B @ feedback.gain(z)
        alpha, beta = scipy.linalg.eigvals(A, E, homogeneous_eigvals=True)
        finite = np.abs(beta) > 1e-9 * np.abs(alpha)
        worst = max(worst, np.inf if finite.sum() < q else float((alpha[finite] / beta[finite]).real.max()))
    return worst


def grows(plant: DescriptorSystem, feedback: Feedback, seed: int) -> float:
    """Growth of V over a second of the nonlinear loop of a regular plant, from a state near the origin."""
    rng = np.random.default_rng(seed)
    p = float(rng.uniform(-1.0, 1.0))
    gain = feedback.gain

    def slope(_: float, x: FloatArray) -> FloatArray:
        z = plant.premise_values(x, {symbol: p for symbol in plant.parameters})
        E, A, B, _ = plant.evaluate(z)
        return np.asarray(np.linalg.solve(E, A @ x + (B @ gain(z) @ x if gain is not None else 0.0)))

    x = 0.05 * rng.standard_normal(plant.order)
    run = scipy.integrate.solve_ivp(slope, (0.0, 1.0), x, method="LSODA", rtol=1e-9, atol=1e-12)
    before, after = (float(s @ np.linalg.solve(feedback.lyapunov, s)) for s in (run.y[:, 0], run.y[:, -1]))
    return after / before


def judge(name: str, trap: Trap, seed: int) -> str:
    """Ask, and check what a proved law does; what came of it."""
    plant = trapped(trap, seed, 1 if name in SLOW else 2)
    found = proved(plant, name)
    if isinstance(found, str):
        return found
    assert trap is not Trap.INDEX_TWO or name == "I.53", plant.name
    assert changes_with_the_unknown(plant, found) < 1e-9, plant.name
    singular = [abs(float(np.linalg.det(plant.E.evaluate(z)))) for z in premises(plant, np.random.default_rng(2), 400)]
    if trap is Trap.SINGULAR:
        # A law that feeds back derivatives replaces E by E - B K; no other law is proved where E becomes singular.
        assert name == "I.53" or min(singular) > 0.05, plant.name
    if name not in SAMPLED:
        assert worst_rate(plant, found, np.random.default_rng(3), 100) < 0.0, plant.name
        assert worst_frozen_mode(plant, found) < 0.0, plant.name
    if name not in SAMPLED | {"I.53"} and plant.order == plant.differential:
        assert grows(plant, found, seed) < 1.0, plant.name
    if name == "sampled-observer":
        assert trap is not Trap.UNMEASURED
    return "proved"


@pytest.mark.parametrize("trap", Trap)
@pytest.mark.parametrize("name", CONDITIONS)
def test_no_condition_proves_a_law_that_falls_into_a_trap(name: str, trap: Trap) -> None:
    judge(name, trap, 1)


@pytest.mark.full
@pytest.mark.parametrize("trap", Trap)
@pytest.mark.parametrize("name", CONDITIONS)
def test_no_condition_proves_a_law_that_falls_into_any_of_many_traps(name: str, trap: Trap) -> None:
    Counter(judge(name, trap, seed) for seed in range(2, 32))


@pytest.mark.parametrize(
    ("trap", "named"),
    [
        (Trap.UNKNOWN, "unknown premise"),
        (Trap.SINGULAR, "singular"),
        (Trap.INDEX_TWO, "algebraic"),
    ],
)
@pytest.mark.parametrize("name", ["II.6", "II.6-direct", "II.8"])
def test_laws_with_an_inverse_refuse_every_trap_by_its_name(name: str, trap: Trap, named: str) -> None:
    found = proved(trapped(trap, 0, 1), name)
    assert isinstance(found, str)
    assert named in found


def test_an_observer_refuses_premises_that_no_output_gives() -> None:
    found = proved(trapped(Trap.UNMEASURED, 0, 2), "sampled-observer")
    assert isinstance(found, str)
    assert "z1 = x1" in found


def test_some_trapped_systems_have_laws_all_the_same() -> None:
    """Otherwise nothing above could fail: laws that need nothing that is unknown are found."""
    found = Counter(judge(name, Trap.UNKNOWN, seed) for name in ("I.2", "TS-Pj") for seed in range(2))
    assert found["proved"] > 0


@pytest.mark.parametrize(("name", "trap"), [("II.6", Trap.UNKNOWN), ("II.6-direct", Trap.SINGULAR)])
def test_the_judge_catches_what_is_proved_without_refusals(
    name: str, trap: Trap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quasilpv.conditions.condition.refuse_refuted", lambda *_: None)
    with pytest.raises(AssertionError, match=str(trap)):
        Counter(judge(name, trap, seed) for seed in range(12))
