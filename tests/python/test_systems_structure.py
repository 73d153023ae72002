"""What is reported of the structure of a system is proved, and what is not true is not reported."""

from itertools import product

import numpy as np
import pytest
import sympy as sp

from quasilpv.systems.catalogue import SYSTEMS, system
from quasilpv.systems.descriptor.invertible_cells import cells_with_inverse
from quasilpv.systems.descriptor.premise import Premise
from quasilpv.systems.descriptor.structure import Standing, StructureVerdict, structure_report
from quasilpv.systems.descriptor.system import DescriptorSystem

x, y, w = sp.symbols("x y w", real=True)
REGULAR = {"ex-I.1", "ex-II.9", "ex-II.8", "arm2", "arm3"}


def toy(E: sp.Matrix, A: sp.Matrix, reach: float = 1.0) -> DescriptorSystem:
    return DescriptorSystem.from_symbols(
        name="toy",
        state=(x, y),
        inputs=("u",),
        E=E,
        A=A,
        B=sp.Matrix([1, 0]),
        C=sp.eye(2),
        domain={x: (-reach, reach), y: (0.0, reach)},
    )


@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_of_the_catalogue_is_proved_regular_or_of_index_one(name: str) -> None:
    report = structure_report(system(name))
    assert report.verdict is (StructureVerdict.REGULAR if name in REGULAR else StructureVerdict.INDEX_ONE)
    assert report.leading.standing is Standing.PROVED
    assert report.algebraic_pivot.standing is Standing.PROVED
    assert str(report).startswith(f"{name}: {report.verdict}")


def test_when_the_pivot_is_zero_expect_it_refuted() -> None:
    report = structure_report(system("ex-II.6", b=0.0))
    assert report.verdict is StructureVerdict.NOT_PROVED
    assert report.algebraic_pivot.standing is Standing.REFUTED


@pytest.mark.parametrize(
    ("pivot", "standing"),
    [
        (2 + x, Standing.PROVED),  # affine in its premise: decided at the corners
        (x, Standing.REFUTED),
        (1 + x**2 - 3 * sp.sin(x), Standing.REFUTED),  # changes sign between corners
        # Over the box of premises x^2 and cos x are independent, and the corner (0, cos 1) is below 0.
        (sp.Rational(6, 10) * x**2 + sp.cos(x) - sp.Rational(7, 10), Standing.PROVED),
    ],
)
def test_sign_of_a_pivot_is_decided_by_proof(pivot: sp.Expr, standing: Standing) -> None:
    report = structure_report(toy(sp.diag(1, 0), sp.Matrix([[0, 1], [1, pivot]])))
    assert report.algebraic_pivot.standing is standing


def test_when_only_the_relation_between_premises_makes_a_pivot_nonzero_expect_the_domain_named() -> None:
    # The determinant is 5/2 + x^2; in the box the premises x^2 = 0 and x = 1 make it -3/2.
    E = sp.Matrix([[1 + 2 * x**2, 2 * x], [2 * x, sp.Rational(5, 2)]])
    report = structure_report(toy(E, sp.eye(2)))
    assert report.leading.standing is Standing.PROVED_OVER_DOMAIN
    assert report.verdict is StructureVerdict.REGULAR
    assert "box" in str(report)


def test_determinant_that_is_not_multi_affine_is_enclosed() -> None:
    E = sp.Matrix([[2, x], [x, 2]])  # 4 - x^2 > 0 for |x| <= 1, and not affine in x
    report = structure_report(toy(E, sp.eye(2)))
    assert report.leading.standing is Standing.PROVED
    assert "enclosed" in report.leading.reason
    beyond = structure_report(toy(E, sp.eye(2), reach=3.0))
    assert not beyond.leading.holds


def algebraic(*equations: str, state: str = "x w", reach: float = 1.2) -> DescriptorSystem:
    names = state.split()
    return DescriptorSystem.from_equations(
        ["x' = -x + u", *equations], state=state, inputs="u", domain={name: (-reach, reach) for name in names}
    )


@pytest.mark.parametrize(
    ("model", "standing"),
    [
        (algebraic("0 = x - (w - 2/5*w**3)"), Standing.REFUTED),  # folds at 0.91, although 1 - 2/5 w^2 > 0
        (algebraic("0 = x - (w - 2/5*w**3)", reach=0.9), Standing.PROVED_OVER_DOMAIN),
        (algebraic("0 = x - (w + 2/5*w**3)"), Standing.PROVED_OVER_DOMAIN),  # increases
        (algebraic("0 = 3*x - sin(2*w)"), Standing.REFUTED),  # at w = pi/4
        (algebraic("0 = 3*x - tan(w)"), Standing.PROVED_OVER_DOMAIN),
        (algebraic("0 = x - w*exp(-w)"), Standing.REFUTED),  # at w = 1
        (algebraic("0 = x + u - w - w**3"), Standing.NOT_PROVED),  # then w depends on the input
        (algebraic("0 = x - w - w*abs(w)"), Standing.NOT_PROVED),  # a corner
        (algebraic("0 = x - w - y**2/9", "0 = x - y + w**2/9", state="x w y"), Standing.PROVED_OVER_DOMAIN),
        (algebraic("0 = x - w - y**2", "0 = x - y + w**2", state="x w y"), Standing.NOT_PROVED),  # det = 1 + 4 w y
    ],
)
def test_premises_of_algebraic_states_are_allowed_where_those_follow_from_the_others(
    model: DescriptorSystem, standing: Standing
) -> None:
    report = structure_report(model)
    assert report.assumption_1.standing is standing
    assert report.assumption_1.reason.startswith("z1 ")
    expected = StructureVerdict.INDEX_ONE if standing is Standing.PROVED_OVER_DOMAIN else StructureVerdict.NOT_PROVED
    assert report.verdict is expected


@pytest.mark.parametrize(("radicand", "holds"), [(1 + x**2, True), (1 + x, False)])
def test_a_square_root_is_differentiable_where_its_argument_is_positive(radicand: sp.Expr, holds: bool) -> None:
    report = structure_report(toy(sp.diag(1, 0), sp.Matrix([[sp.sqrt(radicand), 1], [1, 2]])))
    assert report.assumption_1.holds is holds


def test_inertia_of_arm3_is_invertible_at_every_posture_but_not_at_every_corner_of_its_premises() -> None:
    model = system("arm3", theta_max=1.0)
    report = structure_report(model)
    assert report.verdict is StructureVerdict.REGULAR
    assert report.leading.standing is Standing.PROVED_OVER_DOMAIN
    corners = [model.evaluate(np.where(bits, model.upper, model.lower)).E for bits in product([0, 1], repeat=12)]
    determinants = np.linalg.det(np.array(corners))
    assert determinants.min() < 0 < determinants.max()


def test_when_the_domain_is_not_stated_expect_the_box_to_decide() -> None:
    model = DescriptorSystem.from_symbols(
        name="toy",
        state=(x,),
        inputs=(),
        E=sp.Matrix([[w]]),
        A=sp.eye(1),
        B=sp.zeros(1, 0),
        C=sp.eye(1),
        premises=[Premise("z1", w, (-1.0, 1.0))],
        domain={},
    )
    assert structure_report(model).leading.standing is Standing.REFUTED


def random_descriptor(rng: np.random.Generator) -> tuple[DescriptorSystem, np.ndarray]:
    """A random E(z), often singular somewhere, and the determinants of E at 2000 random states."""
    n, (x, y) = int(rng.integers(1, 4)), sp.symbols("x y", real=True)
    shapes = [sp.cos(x), sp.sin(y), x * y, sp.cos(x + y), x**2]
    shapes = [shapes[k] for k in rng.permutation(5)[: int(rng.integers(1, 4))]]
    size = float(rng.uniform(0, 1))
    entries = sp.Matrix(n, n, lambda i, j: sum(size * float(rng.normal()) * shape for shape in shapes))
    E = entries + sp.eye(n) * float(rng.uniform(1, 4))
    domain = {x: (-float(rng.uniform(0.2, 3)), 1.0), y: (-1.0, float(rng.uniform(0.2, 3)))}
    plant = DescriptorSystem.from_symbols(
        state=[*sp.symbols(f"v1:{n + 1}"), x, y],
        E=sp.diag(E, 1, 1),
        A=-sp.eye(n + 2),
        B=sp.ones(n + 2, 1),
        C=sp.eye(n + 2),
        inputs="u",
        domain=domain,
    )
    points = [rng.uniform(*domain[symbol], 2000) for symbol in (x, y)]
    return plant, np.broadcast_to(sp.lambdify((x, y), E.det(), "numpy")(*points), (2000,))


def test_what_is_proved_cell_by_cell_is_invertible_at_every_state() -> None:
    """A proof is never given where a state has the other sign of det E; both kinds occur, so that this can fail."""
    proved, singular = 0, 0
    for seed in range(40):
        plant, determinants = random_descriptor(np.random.default_rng(seed))
        changes_sign = determinants.min() <= 0.0 <= determinants.max()
        cells = cells_with_inverse(plant, plant.E, slice(0, plant.order))
        assert not (changes_sign and cells is not None), seed
        proved, singular = proved + (cells is not None), singular + changes_sign
    assert min(proved, singular) >= 5


def test_inertias_of_wide_postures_are_invertible_although_the_box_of_cosines_holds_singular_ones() -> None:
    plant = system("ex-II.8", m3=9.0, theta_max=np.pi)
    finding = structure_report(plant).leading
    assert finding.standing is Standing.PROVED_OVER_DOMAIN
    assert "cells of the domain" in finding.reason
    rng = np.random.default_rng(2)
    for _ in range(200):
        values = {symbol: rng.uniform(low, high) for symbol, (low, high) in plant.domain.items()}
        E = plant.E.evaluate([float(premise.expression.subs(values)) for premise in plant.premises])
        assert np.linalg.eigvalsh(E).min() > 0.0
