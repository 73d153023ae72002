"""Every condition in every representation on the smallest systems there are: an answer, or an error of one line."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import sympy as sp

from closed_loops import decided, worst_rate
from quasilpv.conditions.condition import Form, Options
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.registry import CONDITIONS
from quasilpv.errors import InputError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.polytopes import polytopic_model
from quasilpv.systems.descriptor.equations import rate
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

REPRESENTATIONS = ("ts", "reduced", "per-premise", "per-premise@0", "uncertain", "grouped=0")
OPTIONS = (
    Options(),
    Options(form=Form.PUBLISHED),
    Options(slack=Slack.FULL, common=True),
    Options(slack=Slack.NONE, decay_rate=0.5),
)
WITH_MEMORY = {"II.7", "II.8"}


def small_system(seed: int) -> DescriptorSystem:
    """One or two states, none to three inputs, none to two premises of any kind, some a point, none to two outputs."""
    rng = np.random.default_rng(seed)
    n, m, r, outputs = (int(rng.integers(low, high)) for low, high in ((1, 3), (0, 4), (0, 3), (0, 3)))
    q = int(rng.integers(1, n + 1))
    mask = np.zeros((n, n))
    mask[:q, :q] = 1.0
    state = sp.symbols(f"x1:{n + 1}", real=True)
    own = sp.symbols("z1:3", real=True)[:r]
    kinds = rng.choice([kind.value for kind in PremiseKind], r)
    premises, domain = [], {}
    for k, symbol in enumerate(own):
        of_state = bool(rng.integers(2))
        variable = state[0] if of_state else symbol
        low, high = (-1.0, 1.0) if rng.random() < 0.85 else (0.5, 0.5)
        premises.append(Premise(f"z{k + 1}", variable, (low, high), PremiseKind(kinds[k])))
        domain[variable] = (-1.0, 1.0)

    def affine(rows: int, columns: int, constant: np.ndarray, spread: float) -> AffineMatrix:
        return AffineMatrix(constant, spread * rng.standard_normal((r, rows, columns)))

    E = affine(n, n, mask * np.eye(n), 0.2)
    return DescriptorSystem(
        name=f"small {seed}",
        state=state,
        inputs=tuple(f"u{k}" for k in range(m)),
        premises=tuple(premises),
        E=AffineMatrix(E.constant, E.coefficients * mask),
        A=affine(n, n, rng.integers(-2, 3, (n, n)).astype(float), 0.3),
        B=affine(n, m, rng.integers(-1, 2, (n, m)).astype(float), 0.2 * float(rng.integers(2))),
        C=affine(outputs, n, rng.integers(0, 2, (outputs, n)).astype(float), 0.0),
        domain=domain,
    )


def asked(plant: DescriptorSystem, name: str, representation: str, options: Options) -> bool:
    """Ask, and use the law of a yes; whether there was an answer."""
    try:
        model = polytopic_model(plant, representation)
        statement = CONDITIONS[name].build(model, options)
    except InputError:  # its message is one line by construction
        return False
    if name in WITH_MEMORY and model.vertex_count > 2:
        assert len(CompiledProblem.of(statement.problem).layout.sizes) > 1
        return True
    decision = decided(statement.problem)
    if decision.feasible:
        feedback = statement.feedback(decision.values)
        for z in (plant.lower, plant.upper):
            for law in (feedback.gain, feedback.observer):
                assert law is None or np.isfinite(law(z)).all()
        if not (name.startswith("sampled") or name == "estimated-observer"):
            assert worst_rate(plant, feedback, np.random.default_rng(0), 20) < -2.0 * options.decay_rate
    return True


def ask_everything(seed: int, options: Options) -> int:
    plant = small_system(seed)
    return sum(asked(plant, name, shape, options) for name, shape in product(CONDITIONS, REPRESENTATIONS))


@pytest.mark.parametrize("seed", range(3))
def test_small_systems_get_an_answer_or_an_error_of_one_line(seed: int) -> None:
    ask_everything(seed, OPTIONS[seed % len(OPTIONS)])


@pytest.mark.full
@pytest.mark.parametrize("seed", range(3, 200))
def test_many_small_systems_get_an_answer_or_an_error_of_one_line(seed: int) -> None:
    ask_everything(seed, OPTIONS[seed % len(OPTIONS)])


@pytest.mark.parametrize("representation", ["ts", "per-premise"])
@pytest.mark.parametrize("seed", [21, 42, 62, 72])  # with as many inputs as states, and more, nothing asks for a P_22
def test_a_solution_with_a_singular_lyapunov_matrix_has_a_law_near_it(seed: int, representation: str) -> None:
    plant = small_system(seed)
    statement = CONDITIONS["I.53"].build(polytopic_model(plant, representation), Options())
    decision = decided(statement.problem)
    assert decision.feasible
    feedback = statement.feedback(decision.values)
    assert feedback.gain is not None
    assert np.abs(feedback.gain(plant.lower)).max() < 1e3
    assert worst_rate(plant, feedback, np.random.default_rng(0), 20) < 0.0


def test_the_small_systems_get_answers_too() -> None:
    assert ask_everything(3, Options()) > 5


def fully_actuated(drift: sp.Expr) -> DescriptorSystem:
    x, u = sp.symbols("x u", real=True)
    return DescriptorSystem.from_equations(
        [rate(x) - drift.subs("x", x) - u], name="one", state=[x], inputs=[u], domain={x: (-1.0, 1.0)}
    )


@pytest.mark.parametrize("name", [name for name in CONDITIONS if name not in {"I.1", "I.3", "III.9"}])
@pytest.mark.parametrize("drift", ["x**3", "0", "x", "-x"])
def test_as_many_inputs_as_states_are_stabilised_by_every_law(name: str, drift: str) -> None:
    plant = fully_actuated(sp.sympify(drift))
    if name == "estimated-observer":
        with pytest.raises(InputError, match="no estimated premises"):
            CONDITIONS[name].build(polytopic_model(plant, "per-premise"), Options())
        return
    statement = CONDITIONS[name].build(polytopic_model(plant, CONDITIONS[name].representation), Options())
    decision = decided(statement.problem)
    assert decision.feasible
    feedback = statement.feedback(decision.values)
    if feedback.gain is not None:
        assert worst_rate(plant, feedback, np.random.default_rng(0), 20) < 0.0
