"""Systems given by nonlinear matrices: the premises are found, few, bounded, and the matrices are what was given."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

x, y, p = sp.symbols("x y p", real=True)
DOMAIN = {x: (-1.5, 2.0), y: (0.25, 3.0), p: (-0.5, 0.5)}
# Linearly independent functions, with a constant too; products of two stay so.
POOL = [sp.cos(x), sp.sin(y), sp.sinc(x + y), x**2, x * y, 1 / (1 + x**2), sp.exp(-y), sp.sqrt(1 + y**2), x * sp.sin(y)]
numbers = st.integers(-40, 40).map(lambda n: n / 8) | st.floats(-10, 10, allow_nan=False, allow_subnormal=False)
sparse = st.lists(st.tuples(st.integers(0, len(POOL) - 1), numbers), max_size=3)


def own(A: sp.Matrix, E: sp.Matrix | None = None, unknown: tuple[sp.Symbol, ...] = ()) -> DescriptorSystem:
    occurring = {x, y, *A.free_symbols, *(E.free_symbols if E is not None else ())}
    return DescriptorSystem.from_symbols(
        name="own",
        state=(x, y),
        inputs=("u",),
        E=sp.eye(2) if E is None else E,
        A=A,
        B=sp.Matrix([0, 1]),
        C=sp.eye(2),
        domain={name: interval for name, interval in DOMAIN.items() if name in occurring},
        unknown=unknown,
    )


def one_row(*entries: sp.Expr) -> sp.Matrix:
    return sp.Matrix([[*entries], [0, 0]])


@st.composite
def entries(draw: st.DrawFn) -> sp.Expr:
    return draw(numbers) + sp.Add(*(c * POOL[k] for k, c in draw(sparse)))


@given(st.lists(entries(), min_size=6, max_size=6), st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_matrices_at_the_found_premises_are_the_matrices_that_were_given(values: list[sp.Expr], seed: int) -> None:
    given_A, given_E = sp.Matrix(2, 2, values[:4]), sp.eye(2) * 50 + sp.diag(*values[4:])
    system = own(given_A, given_E)
    exact_A, exact_E = sp.lambdify((x, y), given_A, "numpy"), sp.lambdify((x, y), given_E, "numpy")
    rng = np.random.default_rng(seed)
    for _ in range(10):
        state = [rng.uniform(*DOMAIN[x]), rng.uniform(*DOMAIN[y])]
        z = system.premise_values(state)
        assert np.all(system.lower - 1e-12 <= z)
        assert np.all(z <= system.upper + 1e-12)
        for X, exact in ((system.A, exact_A(*state)), (system.E, exact_E(*state))):
            terms = np.abs(X.constant) + np.tensordot(np.abs(z), np.abs(X.coefficients), axes=1)  # before cancellation
            assert np.all(np.abs(X.evaluate(z) - exact) <= 1e-12 * (1 + terms))


@given(st.lists(st.lists(numbers, min_size=3, max_size=3), min_size=4, max_size=4))
@settings(max_examples=40, deadline=None)
def test_there_are_as_many_premises_as_the_entries_have_dimensions(rows: list[list[float]]) -> None:
    table = np.round(np.array(rows))
    system = own(sp.Matrix(2, 2, [sp.Add(*(c * f for c, f in zip(row, POOL, strict=False))) + 3 for row in table]))
    assert len(system.premises) == np.linalg.matrix_rank(table)


@pytest.mark.parametrize(
    ("A", "expressions"),
    [
        (one_row(2 * sp.cos(x) + 7, 3 - 5 * sp.cos(x)), [sp.cos(x)]),  # a factor and a constant make no new premise
        (one_row(x**2 + sp.cos(x), x**2 - sp.cos(x)), [x**2, sp.cos(x)]),  # sums of the same terms
        (one_row(x**2 + sp.cos(x), 2 * x**2 + 2 * sp.cos(x)), [x**2 + sp.cos(x)]),  # always together: one premise
        (one_row((x + y) ** 2, x**2 + y**2 + 2 * x * y), [(x + y) ** 2]),  # found after expansion
        (one_row(sp.sin(x) ** 2, sp.cos(x) ** 2), [sp.sin(x) ** 2]),  # dependent as functions
        (one_row(x**2 / (1 + x**2), 1 / (1 + x**2)), [x**2 / (1 + x**2)]),
        (one_row(0.1 * x + 0.2 * x, 0.3 * x), [x]),  # equal up to the rounding of doubles
        (one_row(sp.pi * x, sp.sqrt(2) * x), [x]),
        (one_row(sp.Integer(1), sp.Float(2.5)), []),
    ],
)
def test_equal_terms_and_dependent_ones_share_a_premise(A: sp.Matrix, expressions: list[sp.Expr]) -> None:
    system = own(A)
    assert [premise.name for premise in system.premises] == [f"z{k}" for k in range(1, len(expressions) + 1)]
    for premise, expected in zip(system.premises, expressions, strict=True):
        assert sp.expand(premise.expression - expected) == 0
    at = np.array([0.7, 1.1])
    exact = np.array(A.subs({x: at[0], y: at[1]}), dtype=float)
    assert_allclose(system.evaluate(system.premise_values(at)).A, exact, rtol=1e-14)


def test_sums_that_are_proportional_up_to_rounding_share_a_premise() -> None:
    first, second = 0.1 * x**2 + 0.7 * sp.cos(x), 0.3 * x**2 + 2.1 * sp.cos(x)
    assert sp.Rational(0.3) / sp.Rational(0.1) != sp.Rational(2.1) / sp.Rational(0.7)
    system = own(one_row(first, second))
    assert len(system.premises) == 1
    A = system.evaluate(system.premise_values([0.7, 1.0])).A
    assert_allclose(A[0], [float(first.subs(x, 0.7)), float(second.subs(x, 0.7))], rtol=1e-14)


def test_a_small_number_of_a_large_term_is_not_taken_for_rounding() -> None:
    system = own(one_row(x + 1e-14 * sp.exp(20 * x), sp.S.Zero))
    A = system.evaluate(system.premise_values([2.0, 1.0])).A
    assert_allclose(A[0, 0], 2.0 + 1e-14 * np.exp(40.0), rtol=1e-9)


def test_functions_that_only_look_dependent_on_the_domain_stay_apart() -> None:
    # sin(x) = x within 2e-11 of its size here, which is no identity.
    narrow = {x: (-1e-5, 1e-5)}
    system = DescriptorSystem.from_symbols(
        name="own",
        state=(x,),
        inputs=(),
        E=sp.Matrix([[2 + sp.sin(x)]]),
        A=sp.Matrix([[x]]),
        B=sp.zeros(1, 0),
        C=sp.eye(1),
        domain=narrow,
    )
    assert len(system.premises) == 2


def test_unknown_parameters_make_unknown_premises_of_their_own() -> None:
    system = own(one_row(x**2 + p, p * sp.cos(x) - x**2), unknown=(p,))
    assert [(z.expression, z.kind) for z in system.premises] == [
        (x**2, PremiseKind.MEASURED),
        (p, PremiseKind.UNKNOWN),
        (p * sp.cos(x), PremiseKind.UNKNOWN),
    ]
    assert_array_equal(system.evaluate([4.0, 0.5, 0.25]).A[0], [4.5, -3.75])


def test_when_a_found_premise_has_no_bounds_expect_the_reason() -> None:
    with pytest.raises(InputError, match="division"):
        own(one_row(1 / x, sp.S.Zero))
    with pytest.raises(InputError, match=r"own: A\[0,0\]: got q, expected a name that is declared"):
        own(one_row(sp.Symbol("q"), sp.S.Zero))


@pytest.mark.parametrize(
    "E", [sp.diag(0, 1), sp.Matrix([[1, x], [0, 0]]), sp.Matrix([[0, 0], [1, 1]]), sp.Matrix([[1, 0], [1, 0]])]
)
def test_when_E_is_not_differential_then_algebraic_expect_refusal(E: sp.Matrix) -> None:
    with pytest.raises(InputError, match=r"own: E: got non-zero rows .*, expected diag\(E_1, 0\)"):
        own(sp.eye(2), E)
