"""A verdict does not depend on units, and what is found in other units is true of the system."""

from dataclasses import asdict, dataclass

import numpy as np
import pytest
import sympy as sp

import quasilpv as ql
from closed_loops import premises, worst_rate
from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import condition
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import polytopic_model
from quasilpv.polytopes.scaling import ladder
from quasilpv.polytopes.units import Units
from quasilpv.studies import Answer, Sweep, Verdict
from quasilpv.studies.examination import stated
from quasilpv.studies.front_door import question
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.system import DescriptorSystem
from random_systems import random_system
from rescaled_systems import rescaled
from test_conditions_boundaries import LIMITS
from test_conditions_soundness import CASES, LONG_CASES


@dataclass(frozen=True)
class Asked:
    """A question of the suite whose verdict is known."""

    condition: str
    representation: str
    system: str
    parameters: tuple[tuple[str, float], ...]
    options: Options
    expected: Verdict

    def __str__(self) -> str:
        """Name of the test."""
        return f"{self.condition} {self.system} {dict(self.parameters)} {self.options.slack} {self.expected}"

    def answer(self, seed: int | None = None) -> Answer:
        """The answer, in random units if a seed is given."""
        plant, options = system(self.system, **dict(self.parameters)), self.options
        if seed is not None:
            plant, options = rescaled(plant, options, seed)
        return ql.solve(plant, self.condition, representation=self.representation, **asdict(options))


def of_the_suite() -> list[Asked]:
    """The soundness tests, which are feasible, and both sides of every limit."""
    known = [Asked(c, r, s, tuple(p.items()), o, Verdict.FEASIBLE) for c, r, s, p, o in CASES + LONG_CASES]
    for entry in LIMITS:
        limit = entry.values[0] if hasattr(entry, "values") else entry
        for side, expected in ((-1.0, Verdict.FEASIBLE), (1.0, Verdict.INFEASIBLE)):
            parameters = limit.fixed | {limit.over: limit.value * (1.0 + side * limit.tolerance)}
            representation = limit.representation or condition(limit.condition).representation
            given = (limit.condition, representation, limit.system, tuple(parameters.items()), limit.options)
            known.append(Asked(*given, expected))
    return known


QUESTIONS = of_the_suite()
QUICK = {("I.1", "ex-II.6"), ("I.2", "ex-I.1"), ("I.3", "spring-disc"), ("I.53", "ex-I.1"), ("II.6", "ex-I.1")}
SAMPLE = list({(q.condition, q.expected): q for q in QUESTIONS if (q.condition, q.system) in QUICK}.values())


@pytest.mark.parametrize("asked", SAMPLE, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_verdict_is_the_same_in_random_units(asked: Asked, seed: int) -> None:
    assert asked.answer(seed).verdict is asked.expected


@pytest.mark.full
@pytest.mark.parametrize("asked", QUESTIONS, ids=str)
def test_every_verdict_of_the_suite_is_the_same_in_twenty_random_units(asked: Asked) -> None:
    """Three where one answer takes seconds."""
    assert asked.answer().verdict is asked.expected
    long = asked.condition in ("II.7", "II.8", "III.9") or (asked.condition == "II.5" and asked.system != "ex-II.6")
    long = long or (asked.condition, asked.system) == ("II.6", "arm3")
    seeds = range(3 if long else 20)
    assert [asked.answer(seed).verdict for seed in seeds] == [asked.expected] * len(seeds)


def circuit(L: float) -> DescriptorSystem:
    """``L i' = -i/10 - v + u``, ``L v' = i + (1/10 - v^2/1000) v``: L is a unit of time."""
    i, v, u = sp.symbols("i v u", real=True)
    equations = [L * ql.rate(i) - (-i / 10 - v + u), L * ql.rate(v) - (i + (sp.Rational(1, 10) - v**2 / 1000) * v)]
    return DescriptorSystem.from_equations(
        equations, name="circuit", state=(i, v), inputs=(u,), domain={v: (-5.0, 5.0)}
    )


@pytest.mark.parametrize("name", ["I.2", "guerra-2007", "TS-Pj"])
@pytest.mark.parametrize("L", [1.0, 1e-3, 1e-5, 1e-9])
def test_small_components_are_as_good_as_large_ones(name: str, L: float) -> None:
    plant = circuit(L)
    answer = ql.solve(plant, name)
    assert answer.headline == "feasible, proved"
    assert answer.law is not None
    for z in np.linspace(plant.lower, plant.upper, 5):
        E, A, B, _ = plant.evaluate(z)
        assert np.linalg.eigvals(np.linalg.solve(E, A + B @ answer.law.gain(z))).real.max() < 0.0


def test_a_heavy_disc_is_as_good_as_a_light_one() -> None:
    heavy = {"M": 100.0, "k1": 1000.0, "k2": 1000.0, "damping": 2000.0, "J": 4000.0, "c": 0.003}
    for parameters in ({}, heavy):
        assert ql.solve("spring-disc", "I.3", parameters=parameters).verdict is Verdict.FEASIBLE


def test_sweeps_change_the_units_as_single_questions_do() -> None:
    def lc(L: float = 1.0, gain: float = 0.1) -> DescriptorSystem:
        i, v, u = sp.symbols("i v u", real=True)
        return DescriptorSystem.from_equations(
            [L * ql.rate(i) - (-i / 10 - v + u), L * ql.rate(v) - (i + (gain - v**2 / 1000) * v)],
            name="lc",
            state=(i, v),
            inputs=(u,),
            domain={v: (-5.0, 5.0)},
        )

    sweep = Sweep(question(lc, "I.2"), ("L",))
    assert [sweep.at({"L": L}).verdict for L in (1.0, 1e-5, 1e-7)] == [Verdict.FEASIBLE] * 3


# ---- what is found in other units ------------------------------------------------------------------------------------


def units_of(plant: DescriptorSystem, seed: int = 0) -> Units:
    """Mild random units: every solver finds its way in them."""
    rng = np.random.default_rng(seed)

    def exponents(count: int) -> tuple[int, ...]:
        return tuple(rng.integers(-3, 4, count).tolist())

    n, m, outputs = plant.order, len(plant.inputs), plant.C.shape[0]
    return Units(exponents(n), exponents(m), exponents(outputs), exponents(n), 2, plant.differential)


LAWS = [CASES[k] for k in (0, 6, 7, 9, 14, 18, 20, 22)]


@pytest.mark.parametrize("case", LAWS, ids=lambda case: " ".join(map(str, case[:3])))
def test_a_law_found_in_other_units_is_one_of_the_system(case: tuple) -> None:
    name, representation, plant_name, parameters, options = case
    model = polytopic_model(system(plant_name, **parameters), representation)
    units = units_of(model.system)
    statement = stated(condition(name), model, options, units)
    decision = decide(CompiledProblem.of(statement.problem))
    assert decision.feasible
    feedback = statement.feedback(decision.values).in_old_units(units)
    assert worst_rate(model.system, feedback, np.random.default_rng(0)) < -2.0 * options.decay_rate


def test_an_observer_found_in_other_units_is_one_of_the_system() -> None:
    plant, options = random_system(3, order=3, differential=3, inputs=0), Options(sample_period_s=0.01, decay_rate=1.0)
    model = polytopic_model(plant, "per-premise")
    units = units_of(plant)
    statement = stated(condition("sampled-observer"), model, options, units)
    decision = decide(CompiledProblem.of(statement.problem))
    assert decision.feasible
    feedback = statement.feedback(decision.values).in_old_units(units)
    assert feedback.observer is not None
    assert feedback.observer.sample_period_s == options.sample_period_s
    root = np.linalg.cholesky(np.linalg.inv(feedback.lyapunov)).T
    for z in premises(plant, np.random.default_rng(1), 100):
        E, A, _, C = plant.evaluate(z)
        step = np.eye(3) + np.linalg.solve(E, options.sample_period_s * A - feedback.observer(z) @ C)
        assert np.linalg.norm(root @ step @ np.linalg.inv(root), 2) < np.exp(-0.01)


@pytest.mark.full
@pytest.mark.parametrize("name", ["II.7", "II.8"])
def test_a_law_with_memory_found_in_other_units_is_one_of_the_system(name: str) -> None:
    plant = random_system(1, order=1, differential=1, spread=0.15, instability=0.3, constant_input=False)
    model, units = polytopic_model(plant, "per-premise"), units_of(plant)
    statement = stated(condition(name), model, Options(window_s=0.05), units)
    decision = decide(CompiledProblem.of(statement.problem))
    assert decision.feasible
    found = statement.feedback(decision.values).in_old_units(units)
    law = found.delayed
    assert law is not None
    assert law.window_s == 0.05
    assert worst_rate(plant, found, np.random.default_rng(0)) < 0.0
    weights = model.polytope.weights
    rng = np.random.default_rng(1)
    for z, other, delayed in zip(*(premises(plant, rng, 100) for _ in range(3)), strict=True):
        varpi = 0.5 * (weights(other) + weights(delayed))
        P = law.lyapunov(varpi)
        rate = (law.lyapunov(weights(z)) - law.lyapunov(weights(delayed))) / 0.05
        E, A, B, _ = plant.evaluate(z)
        loop = np.linalg.solve(E, A + B @ law.gain(z, varpi, delayed))
        assert np.linalg.eigvalsh(loop @ P + P @ loop.T - rate)[-1] < 0.0


COVARIANT = [
    ("I.1", "ts"),
    ("I.2", "ts"),
    ("I.53", "ts"),
    pytest.param("II.5", "per-premise", marks=pytest.mark.full),
    ("II.6", "per-premise"),
    ("II.6-direct", "per-premise"),
    pytest.param("II.8", "per-premise", marks=pytest.mark.full),
    pytest.param("III.9", "uncertain", marks=pytest.mark.full),
    ("TS-Pj", "ts"),
    ("guerra-2007", "ts"),
    ("sampled-feedback", "per-premise"),
    ("sampled-observer", "per-premise"),
]


@pytest.mark.parametrize(("name", "representation"), COVARIANT)
def test_inequalities_in_other_units_are_the_same_ones(name: str, representation: str) -> None:
    """Every coefficient is multiplied by a power of two: one per row and column of its inequality, one per unknown."""
    plant = random_system(5, premises=1, constant_input=False, unknown=int(name == "III.9"))
    model, units = polytopic_model(plant, representation), units_of(plant)
    options = Options(decay_rate=0.0 if name == "II.8" else 0.25, form="published", sample_period_s=0.125)
    old, new = (CompiledProblem.of(stated(condition(name), model, options, u).problem) for u in (None, units))
    layout = old.layout
    assert np.array_equal(layout.row, new.layout.row)
    assert np.array_equal(layout.unknown, new.layout.unknown)
    before, after = (np.array([int(c) for c in p.coefficients], dtype=float) / float(p.denominator) for p in (old, new))
    assert np.array_equal(before == 0.0, after == 0.0)
    kept = np.flatnonzero(before)
    exponents = np.log2(after[kept] / before[kept])
    assert np.abs(exponents - np.round(exponents)).max() < 1e-9
    i, j = triangle(layout.sizes)
    total = sum(layout.sizes)
    equations = np.zeros((len(exponents), total + layout.unknowns))
    for number, (row, column) in enumerate(zip(layout.row[kept], layout.unknown[kept], strict=True)):
        equations[number, i[row]] += 1.0
        equations[number, j[row]] += 1.0
        equations[number, total + column] = 1.0
    found = np.linalg.lstsq(equations, exponents, rcond=None)[0]
    assert np.abs(equations @ found - exponents).max() < 1e-6


def triangle(sizes: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of every entry of the upper triangles, numbered through all inequalities."""
    rows, columns, start = [], [], 0
    for size in sizes:
        for j in range(size):
            rows += [start + i for i in range(j + 1)]
            columns += [start + j] * (j + 1)
        start += size
    return np.array(rows), np.array(columns)


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e160, 1e300])
def test_numbers_that_would_leave_the_range_of_doubles_stay_as_they_are(size: float) -> None:
    """The verdict may be unknown, but no number is lost on the way to it."""
    x, u = sp.symbols("x u", real=True)
    plant = DescriptorSystem.from_equations(
        [ql.rate(x) - size * x - u], name="extreme", state=(x,), inputs=(u,), domain={x: (-1.0, 1.0)}
    )
    for units in ladder(plant):
        if units is not None:
            assert (units.of(plant).A.constant / units.D[:, None] / units.T == plant.A.constant).all()
    answer = ql.solve(plant, "I.2")
    assert answer.verdict is not Verdict.INFEASIBLE
