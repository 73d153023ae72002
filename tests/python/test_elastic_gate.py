"""The gate of elastic joints: its law, its aliases and its polygon against matrices, and its verdict against a grid."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import numpy as np
import pytest
from flint import acb, arb, ctx, fmpq

from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.certificate import gate, verify
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.gate.elastic import WHAT, ElasticGate
from quasilpv.certificate.gate.exclusion import Cell
from quasilpv.certificate.gate.motor_loop import CorrectionSource, MotorLoopData, OneJoint
from quasilpv.certificate.gate.two_mass import BITS, ElasticSet, TwoMassExclusion, _aliases, _Enclosed
from quasilpv.cli.robust import _answer
from quasilpv.conditions.tracking.sampled_chains import observer_gains
from quasilpv.errors import InputError
from quasilpv.figures.gate import gate_figure
from quasilpv.loops.elastic_loop import ElasticPlant, MotorLaw, growth_rate, loop_matrix
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.elastic.motor_pid import Gains
from reference.elastic_robots import elastic_ur5

T = 1e-3
SOURCES: tuple[CorrectionSource, ...] = get_args(CorrectionSource)
QUICK_LAWS, ALL_LAWS = 14, 200
QUICK_CELLS = 3000


def law_of(choice: Gains, B: FloatArray, K: FloatArray) -> MotorLaw:
    observer = np.asarray(observer_gains(choice.observer, T).gains)
    return MotorLaw(T, choice.feedback(), observer, B, K, choice.correction)


def data_of(law: MotorLaw) -> MotorLoopData:
    def numbers(values: FloatArray) -> Any:
        return tuple(float(value) for value in values)

    arms = numbers(law.rotors), numbers(law.stiffness)
    return MotorLoopData(T, numbers(law.feedback), numbers(law.observer), law.correction_rad_s, *arms, law.source)


def samples(interval: tuple[float, float], unit: float = 1.0) -> tuple[fmpq, fmpq]:
    low, high = (rational(float(end / unit)) for end in interval)
    return low, high


STIFFEST = law_of(Gains(700.0, 45.0, 4.0, 400.0), np.array([0.6, 0.13]), np.array([3e4, 6e3]))


@pytest.mark.parametrize("integral", [4.0, 0.0])
def test_when_the_law_is_written_as_polynomials_expect_the_transfer_function_of_its_recursion(integral: float) -> None:
    law = law_of(Gains(700.0, 45.0, integral, 400.0), STIFFEST.rotors, STIFFEST.stiffness)
    data = data_of(law)
    D, N, R = data.polynomials
    pole = float(arb(data.correction_poles[0]).mid())
    for joint, phase in enumerate((0.3, 2.0)):
        z = np.exp(1j * phase)
        A, b, c, d = law.state_space(joint)
        expected = c @ np.linalg.solve(z * np.eye(7) - A, b) + d

        def value(polynomial: Any, zeta: complex = z - 1.0) -> complex:
            return complex(sum(float(arb(a).mid()) * zeta**k for k, a in enumerate(polynomial.coeffs())))

        beta = float(arb(data.windings[joint]).mid())
        lagging = (1.0 - pole) ** 2 * z / (z - pole) ** 2
        found = value(N) / (value(D) + beta * lagging * value(R))
        assert abs(found / T**2 - expected) < 1e-9 * abs(expected)


@pytest.mark.parametrize(
    ("delay", "lag", "source"),
    [(0.0, 0.0, "motor-torque"), (0.5, 0.0, "deflection"), (1.25, 0.7, "motor-torque"), (1.25, 0.7, "joint-torque")],
)
def test_when_one_joint_is_a_matrix_of_balls_expect_the_polynomial_of_the_loop_in_doubles(
    delay: float, lag: float, source: CorrectionSource
) -> None:
    law = replace(law_of(Gains(250.0, 45.0, 4.0, 1100.0), np.array([0.5]), np.array([2e4])), source=source)
    data = data_of(law)
    one = OneJoint(rational(3.0), rational(30.0), rational(0.2), rational(delay), rational(lag))
    K = 0.5 / (30.0 * T**2)
    plant = ElasticPlant(np.array([[1.5]]), np.array([0.5]), np.array([K]), np.array([0.2 * T * K]), lag * T)
    expected = loop_matrix(law, plant, delay * T)
    with ctx.workprec(200):
        loop = data.loop(one, data.windings[0], data.correction_poles[0])
        assert loop.nrows() == len(expected)
        characteristic = loop.charpoly()
        for z in np.exp(1j * np.linspace(0.05, 3.1, 7)):
            found = complex(characteristic(acb(z)).mid())
            assert abs(found - np.linalg.det(z * np.eye(len(expected)) - expected)) < 1e-8 * abs(found)


def random_plant(rng: np.random.Generator, n: int = 3) -> tuple[ElasticPlant, FloatArray]:
    """Some arm, and its M over its rotors."""
    B = rng.uniform(0.1, 0.6, n)
    turned = np.linalg.qr(rng.normal(size=(n, n)))[0]
    relative = turned @ np.diag(np.exp(rng.uniform(np.log(0.05), np.log(20.0), n))) @ turned.T
    root = np.diag(np.sqrt(B))
    K = B / rng.uniform(1e-5, 5e-5, n)
    return ElasticPlant(root @ relative @ root, B, K, rng.uniform(1e-4, 5e-4, n) * K), relative


def set_around(plant: ElasticPlant, relative: FloatArray, delay: float) -> ElasticSet:
    m, b = np.linalg.eigvalsh(relative), plant.rotors / plant.stiffness
    eta = plant.damping / plant.stiffness
    wide = 1e-9
    return ElasticSet(
        samples((m[0] * (1.0 - wide), m[-1] * (1.0 + wide))),
        samples((b.min(), b.max()), T**2),
        samples((eta.min(), eta.max()), T),
        fmpq(0),
        samples((delay, delay)),
        samples((0.0, 0.0)),
    )


@pytest.mark.parametrize("delay", [0.0, 0.5, 1.3])
def test_when_motors_are_sampled_expect_rotor_first_springs_and_aliases_within_their_bound(delay: float) -> None:
    """The sampled transfer function from the matrices of the arm is ``g + c Z^-1 / phi^2 + E``, and |E| is bounded."""
    rng = np.random.default_rng(3)
    whole = math.floor(delay)
    largest = 0.0
    for phase in (0.05, 0.4, 1.1, 2.3, 3.1):
        plant, relative = random_plant(rng)
        n, z = len(plant.rotors), np.exp(1j * phase)
        late = (delay - whole) * T
        before, by_old = plant.held(late, plant.rotors)
        after, by_new = plant.held(T - late, plant.rotors)
        held = by_new * z**-whole + after @ by_old * z ** -(whole + 1)
        root = np.sqrt(plant.rotors)
        sampled = np.linalg.solve(z * np.eye(4 * n) - after @ before, held)[n : 2 * n]
        sampled = root[:, None] * sampled / root[None, :] / T**2
        alpha, g = np.sinc(phase / 2.0 / np.pi), 1.0 - (delay - whole)
        c = alpha * np.exp(-1j * phase * (0.5 + delay))
        rotor = (1.0 + (g + 0.5) * (z - 1.0) + g**2 / 2.0 * (z - 1.0) ** 2) / (z ** (whole + 1) * (z - 1.0) ** 2)
        b, eta = plant.rotors / plant.stiffness / T**2, plant.damping / plant.stiffness / T
        Z = np.eye(n) + np.linalg.inv(relative) - phase**2 * np.diag(b / (1.0 + 1j * eta * phase))
        aliased = np.linalg.norm(sampled - rotor * np.eye(n) - c * np.linalg.inv(Z) / phase**2, 2)
        with ctx.workprec(BITS):
            bound = float(_aliases(arb(phase), set_around(plant, relative, delay)))
        assert aliased <= bound * (1.0 + 1e-6) + 1e-12 / phase**2
        largest = max(largest, aliased / bound)
    assert largest > 0.02


def test_when_arms_are_of_the_set_expect_their_numerical_ranges_in_the_polygon() -> None:
    rng = np.random.default_rng(9)
    plant, relative = random_plant(rng)
    plants = set_around(plant, relative, 0.5)
    exclusion = TwoMassExclusion(data_of(STIFFEST), plants)
    n, phase = len(plant.rotors), 0.9
    b, eta = plant.rotors / plant.stiffness / T**2, plant.damping / plant.stiffness / T
    Z = np.eye(n) + np.linalg.inv(relative) - phase**2 * np.diag(b / (1.0 + 1j * eta * phase))
    with ctx.workprec(BITS):
        at = rational(phase)
        cell = Cell((at, at), samples((0.5, 0.5)), samples((0.0, 0.0)))
        corners = np.array([complex(corner.mid()) for corner in _Enclosed(exclusion, cell, 0)._polygon()])
    vectors = rng.normal(size=(200, n)) + 1j * rng.normal(size=(200, n))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    values = np.einsum("ki,ij,kj->k", vectors.conj(), Z, vectors)
    for angle in np.linspace(0.0, 2.0 * np.pi, 60):
        towards = np.exp(1j * angle)
        assert (towards * values).real.min() >= (towards * corners).real.min() - 1e-7


def drawn(rng: np.random.Generator) -> tuple[MotorLaw, ElasticSet, dict[str, Any]]:
    """A law and a set, both at random."""
    n = 3
    B = rng.uniform(0.1, 0.6, n)
    K = B / rng.uniform(1.5e-5, 4e-5, n)
    proportional = rng.uniform(15.0, 80.0)
    choice = Gains(
        float(np.exp(rng.uniform(np.log(60.0), np.log(1500.0)))),
        proportional,
        proportional * rng.uniform(0.0, 0.25) * rng.integers(0, 2),
        float(np.exp(rng.uniform(np.log(150.0), np.log(1800.0)))),
        float(rng.choice([0.0, 3.0, 5.0, 8.0])),
    )
    source = SOURCES[rng.integers(len(SOURCES))]
    law = replace(law_of(choice, B, K), source=source)
    factor, least = float(rng.choice([1.2, 2.0])), float(rng.choice([0.5e-4, 1e-4, 1.5e-4]))
    b = B / K
    numbers: dict[str, Any] = {
        "links": (0.1, 20.0),
        "windings": (b.min() / factor, b.max() * factor),
        "dampings": (least, 10.0 * least),
        "tolerance": float(rng.choice([0.0, 0.0, 0.1])),
        "delay": (0.0, float(rng.choice([0.0, 0.5, 1.0, 1.5]))),
        "lag": (0.0, float(rng.choice([0.0, 0.0, 0.3, 1.0]))),
    }
    plants = ElasticSet(
        samples(numbers["links"]),
        samples(numbers["windings"], T**2),
        samples(numbers["dampings"], T),
        rational(numbers["tolerance"]),
        samples(numbers["delay"]),
        samples(numbers["lag"]),
    )
    return law, plants, numbers


def grows(law: MotorLaw, numbers: dict[str, Any], loops: int) -> bool:
    """Whether a loop of a grid over the set does."""
    rng, n = np.random.default_rng(7), len(law.rotors)
    low, high = numbers["links"]
    for j in range(loops):
        turned = np.eye(n) if j % 6 == 0 else np.linalg.qr(rng.normal(size=(n, n)))[0]
        root = np.diag(np.sqrt(law.rotors))
        M = root @ turned @ np.diag(rng.choice([low, high, 1.0, 3.0], n)) @ turned.T @ root
        rotors = law.rotors * (1.0 + rng.choice([-1.0, 1.0], n) * numbers["tolerance"])
        K = law.rotors / rng.choice(numbers["windings"], n)
        lag = float(rng.choice(numbers["lag"])) * T
        plant = ElasticPlant(M, rotors, K, rng.choice(numbers["dampings"], n) * K, lag)
        if growth_rate(law, plant, float(rng.choice(numbers["delay"])) * T) > 1e-9:
            return True
    return False


def against_the_grid(count: int, budget: int, loops: int) -> tuple[int, int]:
    """Nothing accepted grows; how many are stable on the grid, and how many of these are accepted."""
    rng, stable, accepted = np.random.default_rng(16), 0, 0
    for _ in range(count):
        law, plants, numbers = drawn(rng)
        found = TwoMassExclusion(data_of(law), plants).decide(budget)
        unstable = grows(law, numbers, loops)
        assert not (found.proved and unstable)
        stable += not unstable
        accepted += found.proved
    return stable, accepted


def test_when_laws_are_random_expect_nothing_accepted_that_grows_on_a_grid() -> None:
    stable, accepted = against_the_grid(QUICK_LAWS, QUICK_CELLS, 24)
    assert 0 < accepted <= stable < QUICK_LAWS


@pytest.mark.full
def test_when_two_hundred_laws_are_random_expect_two_fifths_of_the_stable_ones_accepted() -> None:
    stable, accepted = against_the_grid(ALL_LAWS, 10_000, 60)
    print(f"of {ALL_LAWS} laws {stable} are stable on the grid, {accepted} accepted, none of them unstable")
    assert accepted >= 0.4 * stable


def test_when_the_least_damping_is_none_expect_aliases_of_light_links_not_excluded() -> None:
    """A light link on an undamped spring rings above pi / T: there is no bound of its aliases."""
    _, plants, _ = drawn(np.random.default_rng(3))
    undamped = replace(
        plants,
        delay=samples((0.0, 0.5)),
        lag=samples((0.0, 0.0)),
        links=samples((1e-3, 20.0)),
        dampings=samples((0.0, 0.0)),
        rotor_tolerance=fmpq(0),
    )
    found = TwoMassExclusion(data_of(STIFFEST), undamped).decide()
    assert not found.proved
    assert found.anchored
    assert found.given_up_rad_s is not None


@cache
def designed() -> Artifact:
    return checked_artifact(synthesise(DesignRequest.of(elastic_ur5(uncertainty=2.0), "motor-pid")))


def test_when_a_design_is_proved_expect_the_artifact_alone_to_say_so() -> None:
    artifact = designed()
    verdict, found = verify(artifact), gate(artifact)
    assert verdict.verified
    assert [claim.name for claim in verdict.claims][-1] == WHAT
    assert verdict.evidence == {"exact": 0, "enclosed": 3, "sampled": 0}
    assert isinstance(found, ElasticGate)
    assert found.passed
    assert found.delay_margin_s == pytest.approx(T / 2.0)
    low, high = found.links.sampled
    assert found.links.needed is not None
    bounds = found.links.needed.to_floats()
    assert 0.0 < bounds[0] < low < high < bounds[1]
    figure = gate_figure(found)
    assert figure.axes[0].get_lines()


def changed(path: tuple[str, ...], value: Any) -> Artifact:
    content = designed().content()
    member = content
    for name in path[:-1]:
        member = member[name]
    member[path[-1]] = value
    return Artifact.from_document(content)


@pytest.mark.parametrize(
    ("path", "value", "failed"),
    [
        (("law", "feedback", "kd"), -3000.0, WHAT),
        (("witness", "exclusion", "longest_delay_samples"), 2.0, WHAT),
        (("witness", "chain", "highest", "bound"), 15.0, "links: at most m2 rotors"),
        (("witness", "chain", "lowest", "bound"), 0.002, "links: at least m1 rotors"),
    ],
)
def test_when_a_member_of_a_proved_artifact_is_changed_expect_the_claim_to_fail(
    path: tuple[str, ...], value: Any, failed: str
) -> None:
    verdict = verify(changed(path, value))
    assert not verdict.verified
    assert failed in verdict.failed


def test_when_gears_or_rotors_are_others_expect_the_artifact_refused_by_name() -> None:
    payloads = designed().content()["payloads"]
    without = changed(("payloads",), {name: member for name, member in payloads.items() if name != "gears"})
    with pytest.raises(InputError, match=r"payloads\.gears"):
        gate(without)
    with pytest.raises(InputError, match=r"rotor_inertia_kg_m2"):
        gate(changed(("law", "rotor_inertia_kg_m2"), [0.5] * 6))
    with pytest.raises(InputError, match=r"payloads\.gears: .*6"):
        gate(changed(("payloads", "gears"), payloads["gears"][:2]))


def test_when_a_person_asks_expect_what_is_proved_in_words() -> None:
    rows, verdict = _answer(gate(designed()))
    assert verdict.startswith(f"passed: {WHAT}: proved for every posture, load, gear and constant delay up to 0.5")
    assert dict(rows)["damping over stiffness"] == "[0.15, 1.5] ms"
    refused = gate(changed(("law", "feedback", "kd"), -3000.0))
    assert not refused.passed
    assert _answer(refused)[1].startswith("NOT passed: ")
