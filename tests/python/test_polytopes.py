"""The block polytope: every representation is exact, convex, and the one the thesis or the textbook writes down."""

from itertools import product

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from quasilpv.errors import InputError
from quasilpv.polytopes import Block, BlockPolytope, MultilinearForm
from quasilpv.systems.robots.registry import Robot, robot, robots

Array = NDArray[np.float64]


def random_partition(rng: np.random.Generator, r: int) -> list[list[int]]:
    order = rng.permutation(r)
    cuts = np.flatnonzero(rng.random(r - 1) < 0.5) + 1 if r > 1 else []
    return [[int(p) for p in group] for group in np.split(order, cuts)]


def representations(lower: Array, upper: Array, rng: np.random.Generator) -> dict[str, BlockPolytope]:
    """Every representation of one box, partitions drawn at random."""
    r = len(lower)
    mixed = [Block("simplex" if rng.random() < 0.5 else "box", tuple(group)) for group in random_partition(rng, r)]
    elsewhere = lower + (upper - lower) * rng.uniform(-1, 2, r)
    known = int(rng.integers(0, r + 1))
    return {
        "takagi-sugeno": BlockPolytope.takagi_sugeno(lower, upper),
        "per premise": BlockPolytope.per_premise(lower, upper),
        "per premise, centred at 0": BlockPolytope.per_premise(lower, upper, centre=0.0),
        "grouped, centred anywhere": BlockPolytope.grouped(lower, upper, random_partition(rng, r), centre=elsewhere),
        "reduced affine": BlockPolytope.reduced_affine(lower, upper),
        "mixed": BlockPolytope.from_blocks(lower, upper, mixed, centre=elsewhere),
        "uncertain": BlockPolytope.uncertain((lower[:known], upper[:known]), (lower[known:], upper[known:])),
    }


@st.composite
def boxes(draw: st.DrawFn, most: int = 6) -> tuple[Array, Array, np.random.Generator]:
    r = draw(st.integers(1, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    lower = rng.uniform(-3, 3, r)
    return lower, lower + 10 ** rng.uniform(-2, 1, r), rng


def points_of(lower: Array, upper: Array, rng: np.random.Generator) -> Array:
    inside = rng.uniform(lower, upper, (20, len(lower)))
    corners = np.where(rng.random((20, len(lower))) < 0.5, lower, upper)
    return np.vstack([inside, corners])


def assert_is_exact(polytope: BlockPolytope, constant: Array, coefficients: Array, points: Array) -> None:
    """X(z) is reproduced to 1e-12 of the size of its vertices, weights are non-negative, blocks sum to 1/G."""
    vertices = polytope.vertices(constant, coefficients)
    weights = polytope.weights(points)
    blocks = len(polytope.blocks)
    assert weights.min() >= 0.0
    for block in range(blocks):
        assert_allclose(weights[:, polytope.block_index == block].sum(axis=1), 1.0 / blocks, rtol=1e-14)
    expected = constant + np.tensordot(points, coefficients, axes=1)
    represented = np.tensordot(weights, vertices, axes=1)
    assert_allclose(represented, expected, rtol=0, atol=1e-12 * max(1.0, np.abs(vertices).max()))
    assert_allclose(polytope.evaluate(vertices, points[0]), represented[0], rtol=1e-13, atol=1e-12)


# ---- exactness -------------------------------------------------------------------------------------------------------


@given(boxes())
def test_every_representation_of_a_random_affine_matrix_is_exact(case: tuple) -> None:
    lower, upper, rng = case
    constant, coefficients = rng.normal(size=(3, 2)), rng.normal(size=(len(lower), 3, 2))
    for polytope in representations(lower, upper, rng).values():
        assert_is_exact(polytope, constant, coefficients, points_of(lower, upper, rng))


@pytest.mark.parametrize("entry", robots(), ids=lambda entry: entry.id)
def test_every_representation_of_a_robot_is_exact(entry: Robot) -> None:
    system = entry.model.as_descriptor_system(entry.domain)
    rng = np.random.default_rng(1)
    points = points_of(system.lower, system.upper, rng)
    for polytope in representations(system.lower, system.upper, rng).values():
        for matrix in (system.E, system.A, system.B, system.C):
            assert_is_exact(polytope, matrix.constant, matrix.coefficients, points)


def test_a_constant_matrix_has_one_vertex() -> None:
    for polytope in (
        BlockPolytope.per_premise([], []),
        BlockPolytope.takagi_sugeno([], []),
        BlockPolytope.reduced_affine([], []),
    ):
        assert polytope.vertex_count == 1
        X = np.arange(6.0).reshape(2, 3)
        vertices = polytope.vertices(X, np.zeros((0, 2, 3)))
        assert_array_equal(polytope.evaluate(vertices, np.zeros(0)), X)


@given(boxes())
def test_vertex_counts_are_those_of_the_table(case: tuple) -> None:
    lower, upper, rng = case
    r = len(lower)
    partition = random_partition(rng, r)
    assert BlockPolytope.takagi_sugeno(lower, upper).vertex_count == 2**r
    assert BlockPolytope.per_premise(lower, upper).vertex_count == 2 * r
    assert BlockPolytope.reduced_affine(lower, upper).vertex_count == r + 1
    grouped = BlockPolytope.grouped(lower, upper, partition)
    assert grouped.vertex_count == sum(2 ** len(group) for group in partition)
    owners = [grouped.block_of(vertex) for vertex in range(grouped.vertex_count)]
    assert owners == [block for block, group in enumerate(partition) for _ in range(2 ** len(group))]


# ---- the representations of the textbook and of the thesis -----------------------------------------------------------


@given(boxes())
def test_takagi_sugeno_is_the_textbook_product_form(case: tuple) -> None:
    """Vertices X(corner), memberships the product of sector functions or their complements (Tanaka and Wang, 2001)."""
    lower, upper, rng = case
    r = len(lower)
    constant, coefficients = rng.normal(size=(2, 2)), rng.normal(size=(r, 2, 2))
    polytope = BlockPolytope.takagi_sugeno(lower, upper)
    z = rng.uniform(lower, upper)
    for vertex, bits in enumerate(product((0, 1), repeat=r)):  # first premise most significant, 0 = lower bound
        corner, membership = np.where(bits, upper, lower), 1.0
        for p, bit in enumerate(bits):
            share = (z[p] - lower[p]) / (upper[p] - lower[p])
            membership *= share if bit else 1.0 - share
        X = constant + sum(corner[p] * coefficients[p] for p in range(r))
        assert_allclose(polytope.vertices(constant, coefficients)[vertex], X, atol=1e-11)
        assert_allclose(polytope.weights(z)[vertex], membership, atol=1e-14)


@given(boxes())
def test_per_premise_centred_at_zero_has_the_printed_vertices(case: tuple) -> None:
    """Dehak 2022, (II.10): X evaluated with one premise at r times its bound and all others at 0."""
    lower, upper, rng = case
    r = len(lower)
    constant, coefficients = rng.normal(size=(2, 2)), rng.normal(size=(r, 2, 2))
    vertices = BlockPolytope.per_premise(lower, upper, centre=0.0).vertices(constant, coefficients)
    for p in range(r):
        assert_allclose(vertices[2 * p], constant + r * lower[p] * coefficients[p], atol=1e-10)
        assert_allclose(vertices[2 * p + 1], constant + r * upper[p] * coefficients[p], atol=1e-10)


def lemma_i6_index_sets(r: int, j: int) -> tuple[set[int], set[int]]:
    """(I_j^+, I_j^-) of Dehak 2022, section I.5.2, as printed: which of the 2^r vertices have X_j with +1 or -1."""
    if j == 1:
        return {1 + 4 * k for k in range(2 ** (r - 2))}, {4 + 4 * k for k in range(2 ** (r - 2))}
    if j == 2:
        return {2 + 2 * k for k in range(2 ** (r - 1))}, set()
    p = (j + 1).bit_length() - 1
    if p == r:
        return set(range(1 + 2 ** (r - 1), 2**r + 1)), set()
    repeats = [2 ** (p + 1) * k for k in range(2 ** (r - p - 1))]
    plus = {i + shift for i in range(1 + 2 ** (p - 1), 2**p + 1) for shift in repeats}
    minus = {i + shift for i in range(1 + 2**p, 2 ** (p - 1) + 2**p + 1) for shift in repeats}
    return plus, minus


@pytest.mark.parametrize("r", [2, 3, 4, 5, 6])
def test_reduced_affine_form_is_lemma_i6_and_theorem_i4(r: int) -> None:
    """Vertex i of the thesis has premise 1 as its *least* significant bit; J_r = {1, 2, 3, 7, ..., 2^r - 1}."""
    rng = np.random.default_rng(r)
    lower = rng.uniform(-2, 2, r)
    upper = lower + rng.uniform(0.1, 3, r)
    constant, coefficients = rng.normal(size=(2, 3)), rng.normal(size=(r, 2, 3))
    X = {}
    for i in range(1, 2**r + 1):
        corner = np.array([upper[p] if (i - 1) >> p & 1 else lower[p] for p in range(r)])
        X[i] = constant + np.tensordot(corner, coefficients, axes=1)
    J = sorted({2**p - 1 for p in range(1, r + 1)} | {2})
    stretched = {j: r * X[j] - sum(X[2**p - 1] for p in range(1, r)) for j in J}  # (I.51)

    polytope = BlockPolytope.reduced_affine(lower, upper)
    assert_allclose(polytope.vertices(constant, coefficients), [stretched[j] for j in J], atol=1e-11)
    for z in points_of(lower, upper, rng):
        mu = {}
        for i in range(1, 2**r + 1):
            share = (z - lower) / (upper - lower)
            mu[i] = np.prod([share[p] if (i - 1) >> p & 1 else 1 - share[p] for p in range(r)])
        weights = []
        for j in J:
            plus, minus = lemma_i6_index_sets(r, j)
            omega = sum(mu[i] for i in plus) - sum(mu[i] for i in minus)  # (I.49)
            weights.append((omega if j in (2, 2**r - 1) else 1 + omega) / r)
        assert_allclose(polytope.weights(z), weights, atol=1e-13)


def test_uncertain_premises_come_last_and_are_unknown() -> None:
    polytope = BlockPolytope.uncertain(([0.0, 1.0], [1.0, 3.0]), ([-1.0], [1.0]))
    assert polytope.vertex_count == 2 * (2 + 1)
    assert polytope.unknown == {2}
    assert polytope.known_vertices == (0, 1, 2, 3)
    assert polytope.shared_gain == (0, 1, 2, 3, 4, 4)


# ---- what an unknown premise forbids ---------------------------------------------------------------------------------


@given(boxes(most=5))
def test_shared_gains_make_the_control_independent_of_what_is_unknown(case: tuple) -> None:
    lower, upper, rng = case
    r = len(lower)
    unknown = [int(p) for p in np.flatnonzero(rng.random(r) < 0.5)]
    blocks = [Block("simplex" if rng.random() < 0.3 else "box", tuple(group)) for group in random_partition(rng, r)]
    polytope = BlockPolytope.from_blocks(lower, upper, blocks, unknown=unknown)
    gains = rng.normal(size=(polytope.vertex_count, 2, 2))[list(polytope.shared_gain)]
    z, other = rng.uniform(lower, upper), rng.uniform(lower, upper)
    known = np.setdiff1d(np.arange(r), unknown)
    other[known] = z[known]
    assert_allclose(polytope.evaluate(gains, z), polytope.evaluate(gains, other), atol=1e-12)
    for vertex in polytope.known_vertices:
        assert_allclose(polytope.weights(z)[vertex], polytope.weights(other)[vertex], atol=1e-15)


# ---- slack and centring ----------------------------------------------------------------------------------------------


@given(boxes())
def test_slack_shifts_leave_the_matrix_unchanged(case: tuple) -> None:
    lower, upper, rng = case
    constant, coefficients = rng.normal(size=(3, 3)), rng.normal(size=(len(lower), 3, 3))
    z = rng.uniform(lower, upper)
    for polytope in representations(lower, upper, rng).values():
        vertices = polytope.vertices(constant, coefficients)
        slacks = 10 * rng.normal(size=(len(polytope.blocks), 3, 3))
        shifted = polytope.slack_shift(vertices, slacks)
        assert_allclose(
            polytope.evaluate(shifted, z), polytope.evaluate(vertices, z), atol=1e-12 * (100 + np.abs(vertices).max())
        )
        if len(polytope.blocks) == 1:
            assert_allclose(shifted, vertices, atol=1e-13)  # one block: no slack at all
        else:
            assert np.abs(shifted - vertices).max() > 1e-3


@given(boxes())
def test_moving_the_centre_is_a_slack_shift(case: tuple) -> None:
    """T_b = -G sum_{p in b} (zc'_p - zc_p) X_p takes the vertices centred at zc to those centred at zc'."""
    lower, upper, rng = case
    constant, coefficients = rng.normal(size=(2, 2)), rng.normal(size=(len(lower), 2, 2))
    partition = random_partition(rng, len(lower))
    at_zero = BlockPolytope.grouped(lower, upper, partition, centre=0.0)
    at_centre = BlockPolytope.grouped(lower, upper, partition)
    slacks = np.array(
        [-len(partition) * sum(at_centre.centre[p] * coefficients[p] for p in group) for group in partition]
    )
    shifted = at_zero.slack_shift(at_zero.vertices(constant, coefficients), slacks)
    assert_allclose(shifted, at_centre.vertices(constant, coefficients), atol=1e-10)


def test_slack_pattern_is_membership_minus_the_mean() -> None:
    polytope = BlockPolytope.grouped([0, 0, 0], [1, 1, 1], [[0, 1], [2]])
    assert_allclose(polytope.slack_pattern, [[0.5, -0.5]] * 4 + [[-0.5, 0.5]] * 2)


@pytest.mark.parametrize("seed", range(4))
def test_slack_relaxation_is_the_matrix_cube_relaxation(seed: int) -> None:
    """Equal largest t: all shifted vertices <= -t I; or X(zc) + sum S_p <= -t I with S_p >= +-radius_p X_p."""
    rng = np.random.default_rng(seed)
    r, size = 3, 3
    half = rng.normal(size=(r + 1, size, size))
    constant, *coefficients = half + half.transpose(0, 2, 1)
    lower = rng.uniform(-1, 0, r)
    upper = lower + rng.uniform(0.2, 2, r)
    polytope = BlockPolytope.per_premise(lower, upper)
    identity = np.eye(size)

    t, T = cp.Variable(), [cp.Variable((size, size), symmetric=True) for _ in range(r)]
    vertices = polytope.vertices(constant, np.array(coefficients))
    shifts = [sum(z * slack for z, slack in zip(row, T, strict=True)) for row in polytope.slack_pattern]
    shifted = [X + shift << -t * identity for X, shift in zip(vertices, shifts, strict=True)]
    slack_margin = cp.Problem(cp.Maximize(t), shifted).solve(solver=cp.CLARABEL)

    S = [cp.Variable((size, size), symmetric=True) for _ in range(r)]
    radius, centre = (upper - lower) / 2, (upper + lower) / 2
    cube = [constant + sum(c * X for c, X in zip(centre, coefficients, strict=True)) + sum(S) << -t * identity]
    for p in range(r):
        cube += [S[p] >> radius[p] * coefficients[p], S[p] >> -radius[p] * coefficients[p]]
    cube_margin = cp.Problem(cp.Maximize(t), cube).solve(solver=cp.CLARABEL)
    assert_allclose(slack_margin, cube_margin, atol=1e-6)


# ---- collapse --------------------------------------------------------------------------------------------------------


@given(boxes())
def test_collapsed_gains_equal_the_vertex_sum(case: tuple) -> None:
    lower, upper, rng = case
    scale = 1.0 + np.abs(np.concatenate([lower, upper])).max() / (upper - lower).min()
    for name, polytope in representations(lower, upper, rng).items():
        gains = rng.normal(size=(polytope.vertex_count, 2, 3))
        form = polytope.collapse(gains)
        degree = max(len(block.premises) if block.kind == "box" else 1 for block in polytope.blocks)
        assert form.degree == degree, name
        z = rng.uniform(lower, upper)
        assert_allclose(form.evaluate(z), polytope.evaluate(gains, z), atol=1e-13 * scale**degree)
        if degree == 1:
            constant, coefficients = form.affine()
            value = constant + np.tensordot(z, coefficients, axes=1)
            assert_allclose(value, polytope.evaluate(gains, z), atol=1e-13 * scale)


@given(boxes())
def test_collapsing_the_vertices_of_an_affine_matrix_recovers_it(case: tuple) -> None:
    lower, upper, rng = case
    constant, coefficients = rng.normal(size=(2, 2)), rng.normal(size=(len(lower), 2, 2))
    polytope = BlockPolytope.per_premise(lower, upper)
    recovered = polytope.collapse(polytope.vertices(constant, coefficients)).affine()
    assert_allclose(recovered[0], constant, atol=1e-8)
    assert_allclose(recovered[1], coefficients, atol=1e-8)


def test_when_form_is_not_affine_expect_refusal() -> None:
    with pytest.raises(InputError, match="degree: got 2"):
        MultilinearForm(2, {(): np.ones(()), (0, 1): np.ones(())}).affine()


# ---- the 3-DoF arm ---------------------------------------------------------------------------------------------------


def inertia_vertex_eigenvalues(premises: list[int], centre: float | None) -> Array:
    """Smallest eigenvalue of each vertex of the arm3 inertia; premises left out stay at the centre of their range."""
    arm3 = robot("arm3")
    affine = arm3.model.inertia_affine()
    bounds = np.array([premise.bounds for premise in arm3.model.inertia_premises(arm3.domain)])
    fixed = [p for p in range(3) if p not in premises]
    constant = affine.constant + np.tensordot(bounds[fixed].mean(axis=1), affine.coefficients[fixed], axes=1)
    polytope = BlockPolytope.per_premise(*bounds[premises].T, centre=centre)
    return np.linalg.eigvalsh(polytope.vertices(constant, affine.coefficients[premises]))[:, 0]


def test_arm3_inertia_vertices_are_definite_for_two_centred_premises_only() -> None:
    assert inertia_vertex_eigenvalues([1, 2], centre=None).min() > 0.1
    assert inertia_vertex_eigenvalues([0, 1, 2], centre=None).min() < -1.0
    assert inertia_vertex_eigenvalues([1, 2], centre=0.0).min() < 0.0  # Dehak 2022, IV.5.1 claims otherwise


def test_grouping_makes_all_arm3_inertia_vertices_definite_at_no_cost_in_vertices() -> None:
    """Three measured premises: six vertices either way, indefinite one by one, definite with z_2 and z_3 together."""
    arm3 = robot("arm3")
    affine = arm3.model.inertia_affine()
    bounds = np.array([premise.bounds for premise in arm3.model.inertia_premises(arm3.domain)])
    smallest = {}
    for name, partition in {"alone": [[0], [1], [2]], "together": [[1, 2], [0]]}.items():
        polytope = BlockPolytope.grouped(*bounds.T, partition)
        assert polytope.vertex_count == 6
        smallest[name] = np.linalg.eigvalsh(polytope.vertices(affine.constant, affine.coefficients))[:, 0].min()
    assert smallest["alone"] < 0.0 < smallest["together"]


def test_arm3_inertia_vertices_printed_for_the_generic_box_have_the_published_eigenvalues() -> None:
    """(II.10) with z_2, z_3 in [-1, 1] and z_1 = 0: -.873, -.160, .223, .233."""
    affine = robot("arm3").model.inertia_affine()
    vertices = BlockPolytope.per_premise([-1, -1], [1, 1]).vertices(affine.constant, affine.coefficients[1:])
    eigenvalues = np.sort(np.linalg.eigvalsh(vertices)[:, 0])
    assert_allclose(eigenvalues, [-0.873, -0.160, 0.223, 0.233], atol=1e-3)


# ---- saturation, documents, misuse -----------------------------------------------------------------------------------


def test_outside_the_box_saturation_is_reported_and_restores_non_negative_weights() -> None:
    polytope = BlockPolytope.per_premise([0.0, -1.0], [1.0, 1.0])
    assert polytope.weights([1.5, 0.0]).min() < 0
    clamped, outside = polytope.saturate([1.5, 0.0])
    assert outside
    assert_array_equal(clamped, [1.0, 0.0])
    assert polytope.weights(clamped).min() >= 0
    assert polytope.saturate([1.0, -1.0])[1] is False


def test_document_states_the_same_matrix_when_read_by_the_rules_of_the_format() -> None:
    rng = np.random.default_rng(8)
    lower, upper = np.array([-1.0, 0.0, 2.0]), np.array([1.0, 0.5, 5.0])
    constant, coefficients = rng.normal(size=(2, 2)), rng.normal(size=(3, 2, 2))
    polytope = BlockPolytope.grouped(lower, upper, [[2, 0], [1]])
    document = polytope.to_document(polytope.vertices(constant, coefficients))
    assert set(document) == {"premises", "lower", "upper", "centre", "blocks"}
    z, total = rng.uniform(lower, upper), np.zeros((2, 2))
    for block in document["blocks"]:
        assert block["kind"] == "box"
        for vertex, matrix in enumerate(block["vertices"]):
            weight = 1.0 / len(document["blocks"])
            for position, p in enumerate(block["premises"]):
                bit = vertex >> (len(block["premises"]) - 1 - position) & 1
                share = (z[p] - document["lower"][p]) / (document["upper"][p] - document["lower"][p])
                weight *= share if bit else 1.0 - share
            total += weight * np.array(matrix)
    assert_allclose(total, constant + np.tensordot(z, coefficients, axes=1), atol=1e-12)


def test_when_document_would_hold_a_simplex_expect_refusal() -> None:
    polytope = BlockPolytope.reduced_affine([0, 0], [1, 1])
    with pytest.raises(InputError, match=r"blocks\[0\]\.kind: got simplex"):
        polytope.to_document(np.zeros((3, 1, 1)))


@pytest.mark.parametrize(
    ("lower", "upper", "partition", "words"),
    [
        ([0, 1], [1, 1], [[0], [1]], "bounds of premise 1: .*lower < upper"),
        ([0, 0], [1, 1], [[0]], r"each premise of 0\.\.1 in exactly one block"),
        ([0, 0], [1, 1], [[0, 1], [1]], "exactly one block"),
        ([0, 0], [1, 1], [[0, 1], []], "at least one premise per block"),
        ([0, 0], [1], [[0, 1]], "upper"),
        ([0, float("nan")], [1, 1], [[0, 1]], "lower: .*finite numbers"),
    ],
)
def test_when_box_or_partition_is_malformed_expect_refusal(
    lower: list[float], upper: list[float], partition: list[list[int]], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        BlockPolytope.grouped(lower, upper, partition)


def test_when_shapes_disagree_expect_both_printed() -> None:
    polytope = BlockPolytope.per_premise([0, 0], [1, 1])
    with pytest.raises(InputError, match=r"coefficients: got shape \(1, 2, 2\), expected shape \(2, 2, 2\)"):
        polytope.vertices(np.eye(2), np.zeros((1, 2, 2)))
    with pytest.raises(InputError, match=r"z: got shape \(3,\)"):
        polytope.weights([0, 0, 0])
    with pytest.raises(InputError, match="expected 4 vertices"):
        polytope.evaluate(np.zeros((3, 2, 2)), [0, 0])
    with pytest.raises(InputError, match=r"slacks: got shape \(1, 2, 2\), expected shape \(2, 2, 2\)"):
        polytope.slack_shift(np.zeros((4, 2, 2)), np.zeros((1, 2, 2)))
    with pytest.raises(InputError, match="unknown"):
        BlockPolytope.per_premise([0], [1], unknown=[1])
