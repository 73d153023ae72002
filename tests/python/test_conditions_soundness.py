"""What a condition promises, checked on the closed loop; and variants that promise too much, which must be caught."""

from collections.abc import Callable
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import sympy as sp

from closed_loops import decided, premises, reduced_loop, stated, worst_rate, worst_root
from quasilpv.conditions.condition import Feedback, Form, Options
from quasilpv.conditions.forms.extended import extended_inputs, extended_lyapunov, extended_states, on_differential
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.gains import on_state
from quasilpv.conditions.registry import CONDITIONS, condition
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable, block
from quasilpv.polytopes import BlockPolytope, PolytopicModel, polytopic_model
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from random_systems import random_system

Parameters = dict[str, float]
PUBLISHED = Form.PUBLISHED

CASES: list[tuple[str, str, str, Parameters, Options]] = [
    ("I.1", "ts", "ex-II.6", {"a": 15.0}, Options(decay_rate=0.05)),
    ("I.1", "per-premise", "arm2", {"m2": 5.0, "fv1": 10.0, "fv2": 20.0}, Options()),
    ("I.2", "ts", "ex-I.1", {"b": 3.0}, Options()),
    ("I.2", "ts", "ex-I.1", {"b": 2.0}, Options(decay_rate=0.1)),
    ("I.2", "ts", "ex-II.7", {"b": -22.0}, Options()),
    ("I.2", "ts", "arm3", {}, Options(decay_rate=1.0)),
    ("I.2", "per-premise", "arm2", {}, Options(decay_rate=1.0)),
    ("I.53", "reduced", "arm2", {"theta_max": 3.0}, Options(decay_rate=1.0)),
    ("I.53", "ts", "ex-I.1", {"b": 3.0}, Options()),
    ("I.3", "ts", "spring-disc", {"c": 10.0}, Options()),
    ("I.3", "ts", "ex-III.11", {"b": -25.0}, Options()),
    ("II.5", "per-premise@0", "ex-II.6", {"a": 15.0}, Options()),
    ("II.5", "per-premise@0", "arm2", {}, Options(common=True)),
    ("II.5-cor1", "per-premise@0", "ex-II.6", {"a": 5.5}, Options()),
    ("II.6", "per-premise@0", "ex-I.1", {"b": 2.5}, Options()),
    ("II.6", "per-premise", "ex-I.1", {"b": 3.2}, Options(slack=Slack.FULL)),
    ("II.6", "per-premise@0", "ex-I.1", {"b": 3.1}, Options(slack=Slack.PAIRS)),
    ("II.6", "per-premise@0", "ex-I.1", {"b": 2.0}, Options(decay_rate=0.1)),
    ("II.6", "per-premise", "arm3", {"theta_max": 3.0}, Options(decay_rate=1.0)),
    ("II.6-direct", "per-premise@0", "ex-I.1", {"b": 2.0}, Options(slack=Slack.PAIRS)),
    ("II.6-direct", "per-premise@0", "arm2", {"theta_max": 3.0}, Options()),
    ("TS-Pj", "ts", "ex-I.1", {"b": 3.2}, Options()),
    ("guerra-2007", "ts", "ex-I.1", {"b": 1.7}, Options()),
    ("tanaka-wang", "ts", "ex-II.7", {"b": -22.0}, Options(form=PUBLISHED)),
]

LONG_CASES: list[tuple[str, str, str, Parameters, Options]] = [
    ("II.5", "per-premise@0", "ex-I.1", {"b": 2.9}, Options()),
    ("II.5", "per-premise@0", "ex-II.7", {"b": -22.0}, Options(slack=Slack.FULL)),
    ("II.7", "per-premise@0", "ex-I.1", {"b": 2.5}, Options()),
    ("II.8", "per-premise@0", "ex-I.1", {"b": 2.6}, Options()),
    ("III.9", "uncertain@0", "ex-III.11", {"b": -25.0}, Options()),
    ("III.9", "uncertain@0", "spring-disc", {"c": 60.0}, Options()),
]


def check(name: str, representation: str, plant_name: str, parameters: Parameters, options: Options) -> None:
    plant, statement = stated(condition(name), plant_name, options, representation, **parameters)
    decision = decided(statement.problem)
    assert decision.feasible, decision.solver_status
    feedback = statement.feedback(decision.values)
    rng = np.random.default_rng(0)
    assert worst_rate(plant, feedback, rng, 300) < -2.0 * options.decay_rate
    if feedback.gain is None or feedback.gain(plant.lower).shape[1] == plant.order:
        assert worst_root(plant, feedback, rng) < -options.decay_rate


@pytest.mark.parametrize("case", CASES, ids=lambda case: " ".join(map(str, case[:3])))
def test_the_law_of_a_solution_makes_its_lyapunov_function_decrease(
    case: tuple[str, str, str, Parameters, Options],
) -> None:
    check(*case)


@pytest.mark.full
@pytest.mark.parametrize("case", LONG_CASES, ids=lambda case: " ".join(map(str, case[:3])))
def test_the_law_of_a_large_problem_makes_its_lyapunov_function_decrease(
    case: tuple[str, str, str, Parameters, Options],
) -> None:
    check(*case)


def test_every_condition_is_among_the_cases() -> None:
    # Conditions on sampled models have tests of their own: test_conditions_sampled.py, test_estimated_observer.py.
    sampled = {name for name in CONDITIONS if name.startswith("sampled-")} | {"estimated-observer"}
    assert {case[0] for case in CASES + LONG_CASES} | sampled == set(CONDITIONS)


# ---- memory ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "window"), [("II.7", 0.05), ("II.8", 0.05)])
def test_a_law_with_memory_makes_its_functional_decrease(name: str, window: float) -> None:
    """``dV/dt`` with ``dP/dt = (P(w(z)) - P(w(z_d)))/tau`` at independent z, mean weights and z_d."""
    plant = random_system(1, order=1, differential=1, spread=0.15, instability=0.3, constant_input=False)
    model = polytopic_model(plant, "per-premise")
    statement = condition(name).build(model, Options(window_s=window))
    decision = decided(statement.problem)
    assert decision.feasible
    law = statement.feedback(decision.values).delayed
    assert law is not None
    rng = np.random.default_rng(1)
    weights = model.polytope.weights
    for z, other, delayed in zip(*(premises(plant, rng, 200) for _ in range(3)), strict=True):
        varpi = 0.5 * (weights(other) + weights(delayed))
        P = law.lyapunov(varpi)
        rate = (law.lyapunov(weights(z)) - law.lyapunov(weights(delayed))) / window
        loop = reduced_loop(plant, z, law.gain(z, varpi, delayed))
        assert np.linalg.eigvalsh(loop @ P + P @ loop.T - rate)[-1] < 0.0


# ---- variants that promise too much ----------------------------------------------------------------------------------


def judged(plant: DescriptorSystem, problem: Problem, feedback: Callable[..., Feedback]) -> float:
    """Worst rate of what a variant says is a solution."""
    decision = decided(problem)
    assert decision.feasible
    return worst_rate(plant, feedback(decision.values), np.random.default_rng(0), 2000)


def tuan(problem: Problem, entry: Callable[[int, int], Expression], count: int, factor: Fraction) -> None:
    for i in range(count):
        problem.negative(f"{i} {i}", entry(i, i))
        for j in range(count):
            if i != j:
                problem.negative(f"{i} {j}", entry(i, i) * factor + entry(i, j) + entry(j, i))


def compensation(
    model: PolytopicModel, V: Variable, P: Callable[[int, int], Expression]
) -> tuple[Callable[[int, int], Expression], Callable[..., Feedback]]:
    """Entries and law of Theorem I.2 with any Lyapunov matrices."""
    q, n = model.differential, model.order
    M = [Variable(f"M{j}", model.inputs, q) for j in range(model.vertex_count)]
    A, B = extended_states(model), extended_inputs(model)

    def entry(i: int, j: int) -> Expression:
        return block([[A[i] @ P(i, j) + B[i] @ on_differential(M[j], q, n)]])

    def feedback(values: dict[Variable, np.ndarray]) -> Feedback:
        if not model.inputs:
            return Feedback(values[V], None)
        vertices = np.stack([values[Mj] for Mj in M]) @ on_state(values[V], n)
        return Feedback(values[V], lambda z: model.polytope.evaluate(vertices, z))

    return entry, feedback


def tetrahedron() -> DescriptorSystem:
    """``x' = x/20 + B(z) u`` with B at the four vertices of the reduced form those of a tetrahedron around 0.

    At z = (3, 2, 3)/4 the four weights are equal and B = 0: no law stabilises it.
    """
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    weights = BlockPolytope.reduced_affine(np.zeros(3), np.ones(3)).weights
    constant = (weights(np.zeros(3)) @ corners)[None, :]
    slopes = np.array([(weights(unit) @ corners)[None, :] - constant for unit in np.eye(3)])
    z = sp.symbols("z1:4", real=True)
    return DescriptorSystem(
        name="tetrahedron",
        state=(sp.Symbol("x"),),
        inputs=("u1", "u2", "u3"),
        premises=tuple(Premise(str(symbol), symbol, (0.0, 1.0)) for symbol in z),
        E=AffineMatrix(np.eye(1), np.zeros((3, 1, 1))),
        A=AffineMatrix(np.eye(1) / 20.0, np.zeros((3, 1, 1))),
        B=AffineMatrix(constant, slopes),
        C=AffineMatrix(np.eye(1), np.zeros((3, 1, 1))),
        domain={symbol: (0.0, 1.0) for symbol in z},
    )


def test_the_printed_constant_of_the_double_sum_is_caught() -> None:
    """2/(r-1) with r = 3 premises "proves" a law for a plant without one; 2/(N-1) with N = 4 vertices does not."""
    model = polytopic_model(tetrahedron(), "reduced")
    V, W, Z = Variable("V", 1, symmetric=True), Variable("W", 1), Variable("Z", 1)
    entry, feedback = compensation(model, V, lambda i, j: extended_lyapunov(V, W, Z))
    verdicts = []
    for factor in (Fraction(2, 2), Fraction(2, 3)):
        problem = Problem()
        problem.positive("V", V)
        tuan(problem, entry, model.vertex_count, factor)
        verdicts.append(decided(problem))
    printed, corrected = verdicts
    assert printed.feasible
    assert not corrected.feasible
    z = np.array([0.75, 0.5, 0.75])
    law = feedback(printed.values).gain
    assert law is not None
    assert reduced_loop(model.system, z, law(z))[0, 0] > 0.04


def test_a_lyapunov_matrix_of_both_indices_under_one_of_them_is_caught() -> None:
    """``He(A_i P_ij)`` is no product of sums: it proves a = 300 b for a system whose limit is 20.2."""
    model = polytopic_model(system("ex-II.6", a=300.0), "ts")
    V = Variable("V", 1, symmetric=True)
    rules = range(model.vertex_count)
    P = {ij: extended_lyapunov(V, Variable(f"W{ij}", 2, 1), Variable(f"Z{ij}", 2)) for ij in product(rules, repeat=2)}
    entry, feedback = compensation(model, V, lambda i, j: P[i, j])
    problem = Problem()
    problem.positive("V", V)
    tuan(problem, entry, model.vertex_count, Fraction(2, model.vertex_count - 1))
    assert judged(model.system, problem, feedback) > 0.0


def test_the_printed_sums_of_slack_are_caught() -> None:
    """Theorem II.6 with S and T summed over the vertices 1 ... r instead of one per premise: the mean is not zero."""
    plant = system("ex-I.1", b=8.0)
    model = polytopic_model(plant, "per-premise@0")
    statement = condition("II.6").build(model, Options(slack=Slack.NONE))
    premise_of = model.polytope.block_index
    T = [Variable(f"T{p}", 4, symmetric=True) for p in range(3)]
    printed = sum((T[premise_of[j]].expression for j in range(3)), start=0 * T[0]) * Fraction(-1, 3)
    problem = Problem()
    for constraint in statement.problem.constraints:
        label = constraint.name.split()
        if label[0] == "Xi":
            i, j = int(label[1]), int(label[2])
            added = T[premise_of[i]] + printed
            if i != j:
                added = added * Fraction(2, 5) + T[premise_of[i]] + T[premise_of[j]] + printed * 2
            problem.positive(constraint.name, constraint.expression - added)
        else:
            problem.positive(constraint.name, constraint.expression)
    assert judged(plant, problem, statement.feedback) > 0.0


# ---- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "plant", "representation", "options", "named"),
    [
        ("II.6", "ex-II.7", "per-premise", Options(), "algebraic"),
        ("II.6-direct", "ex-II.7", "per-premise", Options(), "algebraic"),
        ("II.8", "ex-II.7", "per-premise", Options(), "algebraic"),
        ("guerra-2007", "ex-I.1", "per-premise", Options(), "ts"),
        ("I.3", "ex-I.1", "ts", Options(), "unknown premise"),
        ("II.7", "ex-III.11", "uncertain", Options(), "unknown premises"),
        ("II.7", "ex-I.1", "per-premise", Options(decay_rate=1.0), "decay rate"),
    ],
)
def test_what_a_condition_cannot_take_is_refused_by_name(
    name: str, plant: str, representation: str, options: Options, named: str
) -> None:
    with pytest.raises(InputError, match=named):
        stated(condition(name), plant, options, representation)
