"""The norm-bounded view of unknown premises is the same family of systems."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from quasilpv.errors import InputError
from quasilpv.systems.catalogue import SYSTEMS, system
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

UNCERTAIN = ["ex-III.10", "ex-III.11", "ex-III.12", "spring-disc"]
MODELS = {name: system(name) for name in UNCERTAIN}


def test_only_systems_with_unknown_premises_have_an_uncertainty() -> None:
    assert [name for name in SYSTEMS if system(name).uncertainty is not None] == UNCERTAIN


@pytest.mark.parametrize("name", UNCERTAIN)
@given(d=st.floats(-1, 1), known=st.floats(0, 1))
def test_nominal_plus_factors_is_the_system_at_every_value_of_the_unknown_premise(
    name: str, d: float, known: float
) -> None:
    model = MODELS[name]
    uncertainty = model.uncertainty
    assert uncertainty is not None
    z = model.lower + known * (model.upper - model.lower)
    z[-1] = 0.5 * (model.lower[-1] + model.upper[-1]) + d * 0.5 * (model.upper[-1] - model.lower[-1])
    E, A, B, _ = model.evaluate(z)
    nominal = uncertainty.nominal.evaluate(z[:-1])
    assert_allclose(nominal.E, E, atol=1e-14)
    assert_allclose(nominal.A + d * uncertainty.Ha @ uncertainty.Wa, A, atol=1e-13)
    assert_allclose(nominal.B + d * uncertainty.Hb @ uncertainty.Wb, B, atol=1e-13)
    assert uncertainty.Ha.shape[1] == uncertainty.Hb.shape[1] == 1  # both have rank 1, as printed
    assert uncertainty.nominal.uncertainty is None


def test_factors_of_example_ten_are_the_printed_ones_up_to_a_scaling() -> None:
    uncertainty = system("ex-III.10").uncertainty
    assert uncertainty is not None
    assert_allclose(uncertainty.Ha[:, 0] / uncertainty.Ha[0, 0], np.array([0.5, 0.4, 0.6]) / 0.5, rtol=1e-14)
    assert_allclose(uncertainty.Ha @ uncertainty.Wa, np.outer([0.5, 0.4, 0.6], [0.1, -0.1, 0.3]), atol=1e-16)
    assert_allclose(uncertainty.Hb @ uncertainty.Wb, [[0.0], [0.16], [0.12]], atol=1e-16)


def with_two_unknowns(entry_of_E: Callable[[sp.Symbol], sp.Expr]) -> DescriptorSystem:
    x, y, p, q = sp.symbols("x y p q", real=True)
    return DescriptorSystem.from_symbols(
        name="toy",
        state=(x, y),
        inputs=("u",),
        E=sp.Matrix([[1, 0], [0, entry_of_E(p)]]),
        A=sp.Matrix([[p, 2 + q], [p - q, 3 * p]]),
        B=sp.Matrix([1, q]),
        C=sp.eye(2),
        premises=[Premise("p", p, (1.0, 5.0), PremiseKind.UNKNOWN), Premise("q", q, (-2.0, 0.0), PremiseKind.UNKNOWN)],
        domain={p: (1.0, 5.0), q: (-2.0, 0.0)},
    )


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_an_unknown_premise_of_rank_two_gets_two_columns(d_p: float, d_q: float) -> None:
    model = with_two_unknowns(lambda _: sp.S.One)
    uncertainty = model.uncertainty
    assert uncertainty is not None
    _, A, B, _ = model.evaluate([3 + 2 * d_p, -1 + d_q])
    nominal = uncertainty.nominal.evaluate([])
    # The coefficient of p in A has rank 2; that of q in A has rank 2 and in B rank 1.
    assert uncertainty.Ha.shape == (2, 4)
    assert_allclose(nominal.A + uncertainty.Ha @ np.diag([d_p, d_p, d_q, d_q]) @ uncertainty.Wa, A, atol=1e-14)
    assert_allclose(nominal.B + uncertainty.Hb @ np.diag([d_q]) @ uncertainty.Wb, B, atol=1e-14)


def test_when_E_depends_on_an_unknown_premise_expect_refusal() -> None:
    with pytest.raises(InputError, match=r"toy: E: .* unknown premises in A and B only"):
        _ = with_two_unknowns(lambda p: p).uncertainty
