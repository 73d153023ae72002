"""Systems on block polytopes, by the name of the representation: exact vertices, and what a controller may know."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope, PolytopicModel, polytopic_model
from quasilpv.systems.catalogue import SYSTEMS, system

CASES = [
    ("ex-I.1", "ts", 8),
    ("ex-I.1", "reduced", 4),
    ("ex-I.1", "per-premise", 6),
    ("ex-I.1", "per-premise@0", 6),
    ("ex-I.1", "grouped=0,1+2", 6),
    ("ex-I.1", "grouped=2+0,1@0", 6),
    ("ex-III.11", "uncertain", 6),
]


@pytest.mark.parametrize(("name", "representation", "count"), CASES)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_weighted_exact_vertices_are_the_system(name: str, representation: str, count: int, seed: int) -> None:
    model = polytopic_model(system(name), representation)
    assert model.vertex_count == count
    z = np.random.default_rng(seed).uniform(model.system.lower, model.system.upper)
    weights = model.polytope.weights(z)
    for vertices, expected in zip((model.E, model.A, model.B), model.system.evaluate(z)[:3], strict=True):
        combined = sum(w * X.astype(float) for w, X in zip(weights, vertices, strict=True))
        np.testing.assert_allclose(combined, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ex-I.1", "ex-II.7", "ex-III.11"])
def test_vertices_are_not_rounded(name: str) -> None:
    """Per premise: X_2p + X_2p+1 - 2 X(zc) = 0 for every p, in exact arithmetic, with the centre of the box."""
    model = polytopic_model(system(name), "per-premise")
    for vertices in (model.E, model.A, model.B):
        centres = [lower + upper for lower, upper in zip(vertices[::2], vertices[1::2], strict=True)]
        assert all(isinstance(entry, Fraction) for X in vertices for entry in X.flat)
        assert all(np.array_equal(centre, centres[0]) for centre in centres)


@pytest.mark.parametrize("representation", ["ts", "reduced", "per-premise", "uncertain", "grouped=0+2,1"])
def test_no_representation_lets_the_controller_know_an_unknown_premise(representation: str) -> None:
    model = polytopic_model(system("ex-III.11"), representation)
    rng = np.random.default_rng(1)
    gains = rng.standard_normal((model.vertex_count, 2))
    shared = gains[list(model.polytope.shared_gain)]
    known = [k for k in range(len(model.system.premises)) if k not in model.polytope.unknown]
    z = rng.uniform(model.system.lower, model.system.upper)
    other = rng.uniform(model.system.lower, model.system.upper)
    other[known] = z[known]
    np.testing.assert_allclose(model.polytope.evaluate(shared, z), model.polytope.evaluate(shared, other), atol=1e-12)


def test_a_polytope_of_another_box_is_refused() -> None:
    example = system("ex-I.1")
    with pytest.raises(InputError, match="another box"):
        PolytopicModel(example, BlockPolytope.per_premise(example.lower, example.upper + 1.0))


def test_a_polytope_whose_controller_knows_too_much_is_refused() -> None:
    uncertain = system("ex-III.11")
    with pytest.raises(InputError, match="unknown premises"):
        PolytopicModel(uncertain, BlockPolytope.per_premise(uncertain.lower, uncertain.upper))


@pytest.mark.parametrize(
    "representation", ["uncertain", "grouped", "grouped=0,1", "grouped=0,1+x", "ts=1", "tensor", "grouped=0,0+1+2"]
)
def test_nonsense_is_refused(representation: str) -> None:
    with pytest.raises(InputError):
        polytopic_model(system("ex-I.1"), representation)


def test_every_system_of_the_catalogue_has_a_polytopic_model() -> None:
    for name in SYSTEMS:
        model = polytopic_model(system(name), "per-premise")
        assert model.vertex_count == 2 * len(model.system.premises)
