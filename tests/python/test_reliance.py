"""What conditions rely on: proved, refuted or assumed for a model, and what is refuted is refused by name."""

import numpy as np
import pytest
import sympy as sp

from closed_loops import decided
from quasilpv.conditions.condition import Options
from quasilpv.conditions.invertibility import proof_of_invertibility
from quasilpv.conditions.registry import CONDITIONS, condition
from quasilpv.conditions.reliance import Reliance, Status
from quasilpv.errors import InputError
from quasilpv.polytopes import polytopic_model
from quasilpv.systems.catalogue import SYSTEMS, system
from quasilpv.systems.descriptor.equations import rate
from quasilpv.systems.descriptor.system import DescriptorSystem
from random_systems import random_system

x, v, u, m, lam = (sp.Symbol(name, real=True) for name in ("x", "v", "u", "m", "lam"))
ON_INVERSE = ("II.6", "II.6-direct", "II.8")
ONE_STATE = ("II.6", "II.6-direct", "II.8", "sampled-feedback", "guerra-2007")


def unknown_mass() -> DescriptorSystem:
    return DescriptorSystem.from_equations(
        [m * rate(v) - 4 * x + v - u, rate(x) - v],
        name="unknown mass",
        state=[x, v],
        inputs=[u],
        domain={m: (0.5, 2.0)},
        unknown=[m],
    )


def singular_at_one(bound: float) -> DescriptorSystem:
    return DescriptorSystem.from_equations(
        [(1 - v**2) * rate(v) + v - u], name="singular at one", state=[v], inputs=[u], domain={v: (-bound, bound)}
    )


def index_two() -> DescriptorSystem:
    return DescriptorSystem.from_equations(
        [rate(x) - v, rate(v) + x - lam, v], name="index two", state=[x, v, lam], inputs=[], domain={}
    )


@pytest.mark.parametrize("name", ["II.6", "II.6-direct", "II.8", "sampled-feedback", "guerra-2007"])
def test_a_law_that_would_need_an_unknown_premise_is_refused_by_its_name(name: str) -> None:
    with pytest.raises(InputError, match=r"unknown premise.* = ?.*m"):
        condition(name).build(polytopic_model(unknown_mass(), condition(name).representation), Options())


@pytest.mark.parametrize("name", ON_INVERSE)
def test_a_law_with_an_inverse_is_refused_where_the_descriptor_matrix_becomes_singular(name: str) -> None:
    with pytest.raises(InputError, match="singular"):
        condition(name).build(polytopic_model(singular_at_one(2.0), condition(name).representation), Options())


@pytest.mark.parametrize("name", ON_INVERSE)
def test_a_law_with_an_inverse_is_found_where_the_descriptor_matrix_is_invertible(name: str) -> None:
    model = polytopic_model(singular_at_one(0.9), condition(name).representation)
    assert decided(condition(name).build(model, Options()).problem).feasible


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_system_of_index_two_is_refused(name: str) -> None:
    model = polytopic_model(index_two(), "ts")
    with pytest.raises(InputError, match=r"not index one|algebraic states|no unknown premise"):
        condition(name).build(model, Options())


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_descriptor_matrix_of_the_catalogue_is_proved_invertible_by_one_inequality(name: str) -> None:
    assert proof_of_invertibility(system(name)) is not None


def test_a_rotation_by_more_than_a_right_angle_is_no_matter_for_one_inequality_but_is_for_determinants() -> None:
    """``[c -s; s c]`` with c, s premises of their own: det = c^2 + s^2 > 0 on the domain, 0 in the box."""
    w = sp.Symbol("w", real=True)
    plant = DescriptorSystem.from_equations(
        [sp.cos(x) * rate(x) - sp.sin(x) * rate(w) + x - u, sp.sin(x) * rate(x) + sp.cos(x) * rate(w) + w],
        name="rotation",
        state=[x, w],
        inputs=[u],
        domain={x: (-2.0, 2.0)},
    )
    assert proof_of_invertibility(plant) is None
    found = {one.reliance: one for one in condition("II.6").relied(polytopic_model(plant, "ts"))}
    assert found[Reliance.INVERTIBLE_E].status is Status.PROVED


def test_the_inequality_for_the_descriptor_matrix_proves_nothing_false() -> None:
    """Random affine E: where it is proved invertible no sampled determinant has another sign."""
    rng = np.random.default_rng(5)
    proved = 0
    for seed in range(24):
        plant = random_system(seed, order=3, differential=3, spread=0.2 + rng.random(), premises=1 + seed % 8)
        if proof_of_invertibility(plant) is None:
            continue
        proved += 1
        z = rng.uniform(plant.lower, plant.upper, (500, len(plant.premises)))
        signs = {np.sign(np.linalg.det(plant.E.evaluate(point))) for point in z}
        assert len(signs) == 1
    assert 5 < proved < 20


def test_what_is_assumed_names_what_has_to_be_measured() -> None:
    found = {one.reliance: one for one in condition("I.2").relied(polytopic_model(system("arm2"), "ts"))}
    assert found[Reliance.STATE].status is Status.ASSUMED
    assert "omega_1" in found[Reliance.STATE].detail
    assert "z4" in found[Reliance.SCHEDULED].detail
    assert "theta_1" in found[Reliance.DOMAIN].detail
    assert found[Reliance.INDEX_ONE].status is Status.PROVED
