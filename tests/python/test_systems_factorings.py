"""Factorings of one drift: all are the same system, in different matrices."""

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.factorings import MOST_FACTORINGS, factorings
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

x3, x4 = sp.symbols("x3 x4", real=True)


def tora() -> DescriptorSystem:
    """A translating oscillator with a rotating mass, eccentricity 1/5."""
    return DescriptorSystem.from_equations(
        [
            "x1' = x2",
            "x2' + 1/5*cos(x3)*x4' = -x1 + 1/5*x4**2*sin(x3)",
            "x3' = x4",
            "1/5*cos(x3)*x2' + x4' = u",
        ],
        name="tora",
        state="x1 x2 x3 x4",
        inputs="u",
        domain={"x3": (-1, 1), "x4": (-1, 1)},
    )


def uncertain() -> DescriptorSystem:
    return DescriptorSystem.from_equations(
        ["x' = -x + p*x*y**2 + u", "y' = x*y - sin(x)*y"],
        state="x y",
        inputs="u",
        domain={"x": (-1, 1), "y": (-2, 1), "p": (1, 2)},
        unknown="p",
    )


@pytest.mark.parametrize("model", [tora(), uncertain(), system("ex-II.7"), system("spring-disc")], ids=lambda m: m.name)
def test_every_factoring_moves_like_the_system(model: DescriptorSystem) -> None:
    found = list(factorings(model))
    assert 1 <= len(found) <= MOST_FACTORINGS
    assert model in found
    assert [len(other.premises) for other in found] == sorted(len(other.premises) for other in found)
    rng = np.random.default_rng(3)
    for _ in range(5):
        x = rng.uniform(-1, 1, model.order)
        parameters = {symbol: rng.uniform(1, 2) for symbol in model.parameters}
        reference = model.evaluate(model.premise_values(x, parameters))
        for other in found:
            z = other.premise_values(x, {symbol: parameters[symbol] for symbol in other.parameters})
            E, A, B, C = other.evaluate(z)
            assert_allclose(E, reference.E, atol=1e-12)
            assert_allclose(B, reference.B, atol=1e-12)
            assert_allclose(C, reference.C, atol=1e-12)
            assert_allclose(A @ x, reference.A @ x, atol=1e-12)
    kinds = {p.kind for p in model.premises}
    for other in found:
        unknown = [p for p in other.premises if p.kind is PremiseKind.UNKNOWN]
        assert bool(unknown) is (PremiseKind.UNKNOWN in kinds)
        assert all(p.expression.free_symbols & set(model.parameters) for p in unknown)


def test_tora_is_factored_by_its_angle_too() -> None:
    documented, *others = factorings(tora())
    assert [sp.simplify(p.expression) for p in documented.premises] == [sp.cos(x3), x4 * sp.sin(x3)]
    assert [sp.cos(x3), x4**2 * sp.sinc(x3)] in [[sp.simplify(p.expression) for p in o.premises] for o in others]


def test_a_system_of_one_factoring_is_its_own() -> None:
    model = DescriptorSystem.from_equations(["x' = -x**3 + u"], state="x", inputs="u", domain={"x": (-1, 1)})
    assert list(factorings(model)) == [model]


def test_no_more_are_built_than_asked_for() -> None:
    assert len(list(factorings(uncertain(), limit=2))) == 2
