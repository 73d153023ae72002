"""Takagi-Sugeno models given as rules: one vertex per rule, and nothing that no membership allows."""

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from quasilpv.conditions.condition import Options
from quasilpv.conditions.registry import condition
from quasilpv.errors import InputError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import polytopic_model
from quasilpv.systems.descriptor.system import DescriptorSystem

THREE = ["x**2/4", "x/2*(1 - x/2)", "1 - x/2"]  # of 0 <= x <= 2, not negative, sum 1


def random_rules(rng: np.random.Generator, memberships: list[str] = THREE) -> list[tuple]:
    return [(h, np.eye(2), rng.normal(size=(2, 2)).round(2), rng.normal(size=(2, 1)).round(2)) for h in memberships]


def build(rules: list[tuple], **changes: object) -> DescriptorSystem:
    given: dict = {"state": "x v", "inputs": "u", "domain": {"x": (0, 2)}, **changes}
    return DescriptorSystem.from_rules([(h, E.tolist(), A.tolist(), B.tolist()) for h, E, A, B in rules], **given)


@pytest.mark.parametrize("representation", ["rules", "ts"])
def test_vertices_are_the_rules_and_weights_their_memberships(representation: str) -> None:
    rules = random_rules(np.random.default_rng(1))
    model = polytopic_model(build(rules), representation)
    assert model.vertex_count == 3
    for vertex, (_, _, A, B) in enumerate(rules):
        assert_allclose(model.A[vertex].astype(float), A, atol=1e-14)
        assert_allclose(model.B[vertex].astype(float), B, atol=1e-14)
    for x in np.linspace(0, 2, 9):
        z = model.system.premise_values([x, 0.7])
        memberships = [float(sp.sympify(h).subs("x", x)) for h in THREE]
        assert_allclose(model.polytope.weights(z), memberships, atol=1e-15)
        mixed = sum(h * A for h, (_, _, A, _) in zip(memberships, rules, strict=True))
        assert_allclose(model.system.evaluate(z).A, mixed, atol=1e-14)
        vertices = np.array([A for _, _, A, _ in rules])
        assert_allclose(model.polytope.collapse(vertices).evaluate(z), mixed, atol=1e-14)


def test_a_box_of_memberships_loses_solutions_that_the_rules_have() -> None:
    """Three unforced stable rules with a common Lyapunov matrix, the identity; their box holds A_1 + A_2 - A_3."""
    stable = [np.array([[-1.0, s], [-s, -1.0]]) for s in (3.0, -3.0)] + [np.diag([-5.0, -5.0])]
    rules = [(h, np.eye(2), A, np.zeros((2, 0))) for h, A in zip(THREE, stable, strict=True)]
    system = build(rules, inputs="")

    def feasible(representation: str) -> bool:
        statement = condition("I.1").build(polytopic_model(system, representation), Options())
        return decide(CompiledProblem.of(statement.problem)).feasible

    assert feasible("rules")
    box = DescriptorSystem(**{**{f: getattr(system, f) for f in system.__dataclass_fields__}, "given_by_rules": False})
    corner = box.evaluate([1.0, 1.0]).A
    assert np.linalg.eigvals(corner).real.max() > 0  # the box asks for what no membership allows
    statement = condition("I.1").build(polytopic_model(box, "ts"), Options())
    assert not decide(CompiledProblem.of(statement.problem)).feasible


@pytest.mark.parametrize("seed", range(3))
def test_memberships_that_touch_zero_up_to_rounding_keep_weights_that_are_not_negative(seed: int) -> None:
    memberships = ["(1 + sin(3*x))/3", "(1 - sin(3*x))/3", "1/3"]
    model = polytopic_model(build(random_rules(np.random.default_rng(seed), memberships)), "rules")
    for x in np.linspace(0, 2, 201):
        weights = model.polytope.weights(model.system.premise_values([x, 0.0]))
        assert weights.min() >= -1e-16
        assert weights.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("memberships", "words"),
    [
        (["x/2", "1 - x/3"], r"memberships: got the sum .*, expected a sum proved to be 1"),
        (["x", "1 - x"], r"h_2: got 1 - x >= -1, expected a membership proved to be >= 0"),
        (["x/2", "1 - y/2"], r"h_2: column 5: got y"),
        ([], r"rules: got none"),
    ],
)
def test_when_memberships_are_no_partition_expect_refusal(memberships: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        build(random_rules(np.random.default_rng(0), memberships))


def test_when_a_rule_has_an_entry_of_the_state_or_another_shape_expect_refusal() -> None:
    rules = [
        ("x/2", [[1, 0], [0, 1]], [["x", 0], [0, 1]], [[0], [1]]),
        ("1 - x/2", [[1, 0], [0, 1]], [[1, 0], [0, 1]], [[0], [1]]),
    ]
    with pytest.raises(InputError, match=r"A_1: got .*x.*, expected numbers"):
        DescriptorSystem.from_rules(rules, state="x v", inputs="u", domain={"x": (0, 2)})
    with pytest.raises(InputError, match=r"A_1: got shape \(1, 2\), expected shape \(2, 2\)"):
        DescriptorSystem.from_rules(
            [("x/2", [[1, 0], [0, 1]], [[1, 0]], [[0], [1]]), rules[1]], state="x v", inputs="u", domain={"x": (0, 2)}
        )


def test_when_a_system_has_no_rules_expect_the_representation_refused() -> None:
    system = DescriptorSystem.from_equations(["x' = -x**3"], state="x", domain={"x": (-1, 1)})
    with pytest.raises(InputError, match="a system given by rules"):
        polytopic_model(system, "rules")
