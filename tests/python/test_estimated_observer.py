"""Observers scheduled with estimated premises: contraction at random pairs of states, and what must not be accepted."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from quasilpv.conditions.condition import Feedback, Options
from quasilpv.conditions.forms.mismatch import inner_bounded, lipschitz, with_one_sided
from quasilpv.conditions.registry import condition
from quasilpv.conditions.theorems import estimated_observer
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.reproduction.observers.speed_observer import SpeedObserver, speed_observer
from quasilpv.reproduction.observers.velocity_classes import VelocityClasses
from quasilpv.systems.catalogue import system
from quasilpv.systems.robots.registry import robot
from reference.mutants import Mutant

OPTIONS = Options(decay_rate=5.0, sample_period_s=1e-3)


@cache
def arm2() -> PolytopicModel:
    """Without gravity, which depends on measured angles only."""
    source = robot("arm2")
    plant = replace(source.model, gravity_m_s2=0.0).as_descriptor_system(source.domain)
    return polytopic_model(plant, "per-premise")


@cache
def arm3_observer() -> SpeedObserver:
    source = robot("arm3")
    return speed_observer(source, VelocityClasses(source.model, source.domain).energy.proved, 20.0, 1e-3)


def states(domain: dict, count: int) -> np.ndarray:
    low, high = np.array(list(domain.values())).T
    return np.random.default_rng(0).uniform(low, high, (count, 2, len(low)))


def test_error_contracts_for_every_pair_of_states_of_the_domain() -> None:
    """The observer's own recursion on Euler's model of the nonlinear plant: no Jacobian, no class, no inequality."""
    model = arm2()
    statement = condition("estimated-observer").build(model, OPTIONS)
    decision = decide(CompiledProblem.of(statement.problem))
    assert decision.feasible
    law = statement.feedback(decision.values)
    assert law.observer is not None
    plant, h = model.system, OPTIONS.sample_period_s
    norm = np.linalg.cholesky(np.linalg.inv(law.lyapunov)).T
    for x, estimate in states(dict(plant.domain), 500):
        seen = np.concatenate([x[:2], estimate[2:]])  # premises take theta from y
        z, z_hat = plant.premise_values(x), plant.premise_values(seen)
        E, A, _, C = plant.evaluate(z)
        drift = h * (A @ x - plant.evaluate(z_hat).A @ estimate)
        following = (x - estimate) + np.linalg.solve(E, drift - law.observer(z) @ C @ (x - estimate))
        before = np.linalg.norm(norm @ (x - estimate))
        assert np.linalg.norm(norm @ following) < np.exp(-OPTIONS.decay_rate * h) * before


def worst_step(model: PolytopicModel, law: Feedback, options: Options) -> float:
    """Largest factor on small errors per step over the promised one, at the corners of the speeds: no class is used.

    ``|| N (I + E^-1 (h df/dx - L C)) N^-1 || exp(alpha h)`` with N'N = Q and f(x) = A(z(x)) x, theta measured. f is
    quadratic in the speeds, so central differences are its derivative.
    """
    plant, h, worst = model.system, options.sample_period_s, 0.0
    norm = np.linalg.cholesky(np.linalg.inv(law.lyapunov)).T
    first, second, *speeds = plant.domain.values()
    for theta, *omega in product(np.linspace(*second, 9), *speeds):
        x = np.array([sum(first) / 2.0, theta, *omega])
        z = plant.premise_values(x)
        E, jacobian, _, C = plant.evaluate(z)
        for column in np.eye(4)[2:]:
            ahead, behind = (plant.evaluate(plant.premise_values(y)).A @ y for y in (x + column, x - column))
            jacobian = jacobian + np.outer((ahead - behind) / 2.0 - jacobian @ column, column)
        assert law.observer is not None
        step = np.eye(4) + np.linalg.solve(E, h * jacobian - law.observer(z) @ C)
        worst = max(worst, float(np.linalg.norm(norm @ step @ np.linalg.inv(norm), 2)))
    return worst * np.exp(options.decay_rate * h)


CLASS_TERM = "he(X) + Q * rate + ee"
CLASS_WEIGHT = "drive[j] * t, pp]"
CLASS_ERRORS = [
    (Mutant("class in e", CLASS_TERM, "he(X) + Q * rate"), 5e-3),
    (Mutant("class in e, sign", CLASS_TERM, "he(X) + Q * rate - ee"), 5e-3),
    (Mutant("class in p", CLASS_WEIGHT, "drive[j] * t, pp * 100]"), 5e-3),
    (Mutant("p in the error", "drive[j] + pe", "pe"), 1e-3),
]


@pytest.mark.parametrize(("mutant", "period_s"), CLASS_ERRORS, ids=lambda entry: getattr(entry, "block", ""))
def test_when_the_builder_errs_in_the_class_expect_an_error_that_does_not_decay_as_promised(
    monkeypatch: pytest.MonkeyPatch, mutant: Mutant, period_s: float
) -> None:
    model, options = arm2(), replace(OPTIONS, decay_rate=0.5, sample_period_s=period_s)
    steps = []
    for builder in (estimated_observer, mutant.loaded(monkeypatch, estimated_observer.__name__)):
        statement = builder.CONDITION.build(model, options)
        decision = decide(CompiledProblem.of(statement.problem))
        assert decision.feasible
        steps.append(worst_step(model, statement.feedback(decision.values), options))
    sound, wrong = steps
    assert sound < 1.0 < wrong


def test_class_of_the_catalogue_system_holds_its_sampled_differences() -> None:
    plant = system("arm2", theta_max=0.7)
    mismatch = estimated_observer.jacobian_class(plant)
    drift, drive = mismatch.drift.astype(float), mismatch.input.astype(float)
    estimated = [k for k, premise in enumerate(plant.premises) if premise.kind == "estimated"]
    for x, other in states(dict(plant.domain), 300):
        second = np.concatenate([x[:2], other[2:]])
        parts = [
            np.tensordot(plant.premise_values(y)[estimated], plant.A.coefficients[estimated], axes=1) @ y
            for y in (x, second)
        ]
        e = x - second
        residual = parts[0] - parts[1] - drift @ e
        reach = np.abs(drive) @ np.array([np.sqrt(abs(e @ f.ee.astype(float) @ e)) for f in mismatch.forms])
        assert (np.abs(residual) <= reach + 1e-9).all()


@pytest.mark.parametrize("alternative", ["lipschitz", "one-sided"])
def test_bounded_jacobian_proves_no_less_than_coarser_classes(alternative: str) -> None:
    """At 5 ms the entries of the Jacobian suffice and its norm does not: the classes are ordered as they should be."""
    model, source = arm2(), robot("arm2")
    options = replace(OPTIONS, sample_period_s=5e-3)
    assert decide(CompiledProblem.of(condition("estimated-observer").build(model, options).problem)).feasible
    classes = VelocityClasses(source.model, source.domain)
    rows, columns = np.vstack([np.zeros((2, 2)), np.eye(2)]), np.hstack([np.zeros((2, 2)), np.eye(2)])
    coarse = lipschitz(rows, columns, classes.lipschitz.proved)
    if alternative == "one-sided":
        coarse = with_one_sided(coarse, columns, classes.one_sided.proved)
    own = estimated_observer.measured_part(model)
    problem = estimated_observer.statement(own, [coarse] * own.vertex_count, options).problem
    assert not decide(CompiledProblem.of(problem)).feasible


def test_lipschitz_is_inner_boundedness_without_its_second_constant() -> None:
    rows, columns = np.eye(3), np.eye(3)
    first, second = lipschitz(rows, columns, 3.0), inner_bounded(rows, columns, 9.0, 0.0)
    for part in ("ee", "pe", "pp"):
        np.testing.assert_array_equal(getattr(first.forms[0], part), getattr(second.forms[0], part))


def test_arm3_speed_error_decays_at_the_proved_rate_at_random_states() -> None:
    """``V' <= -2 alpha' V`` of the true difference of accelerations, ``alpha' = (1 - exp(-2 alpha h)) / (2 h)``."""
    source, observer = robot("arm3"), arm3_observer()
    rate = (1.0 - np.exp(-2.0 * observer.decay_per_s * 1e-3)) / 2e-3
    domain = dict(enumerate(source.domain.angle_rad + source.domain.speed_rad_s))
    for x, other in states(domain, 2000):
        theta, speed, estimate = x[:3], x[3:], other[3:]
        e = np.concatenate([0.05 * (other[:3] - theta), speed - estimate])
        torque = source.model.coriolis(theta, speed) - source.model.coriolis(theta, estimate)
        z = np.cos([theta[1], theta[2], theta[1] + theta[2]])
        slope = np.concatenate([e[3:], -np.linalg.solve(source.model.inertia(theta), torque)])
        slope -= observer.gain(z) @ e[:3]
        value = e @ observer.lyapunov @ e
        assert 2.0 * (e @ observer.lyapunov @ slope) < -2.0 * rate * value


def test_when_the_mismatch_is_far_larger_expect_no_observer() -> None:
    with pytest.raises(InfeasibleError, match="mismatch"):
        speed_observer(robot("arm3"), 200.0, 20.0, 1e-3)


def test_the_proved_gains_do_not_stand_a_thirtyfold_mismatch() -> None:
    source = robot("arm3")
    gains = arm3_observer()
    theta, speed = np.array([0.0, 1.5, -0.8]), np.array([1.7, 2.0, 1.9])
    J = VelocityClasses(source.model, source.domain).jacobian(theta, 30.0 * speed)
    z = np.cos([theta[1], theta[2], theta[1] + theta[2]])
    error = np.block(
        [[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 3)), np.linalg.solve(source.model.inertia(theta), J)]]
    )
    error -= gains.gain(z) @ np.eye(3, 6)
    decay = gains.lyapunov @ error + error.T @ gains.lyapunov
    assert np.linalg.eigvalsh(decay).max() > 0.0


@pytest.mark.parametrize(("name", "words"), [("ex-I.1", "no estimated premises"), ("ex-II.7", "algebraic")])
def test_systems_the_condition_is_not_about_are_refused(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        condition("estimated-observer").build(polytopic_model(system(name), "per-premise"), OPTIONS)
