"""Exact factors and null spaces, and positive definiteness decided by short integers first."""

import numpy as np
import pytest

from quasilpv.lmi.exact import has_positive_minors, is_positive_triangle, null_space, rank_factors, to_rational


@pytest.mark.parametrize("seed", range(20))
def test_factors_have_the_rank_of_the_matrix_and_its_product(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rank = int(rng.integers(0, 4))
    X = (
        to_rational(rng.integers(-3, 4, (4, rank))) @ to_rational(rng.integers(-3, 4, (rank, 5)))
        if rank
        else (to_rational(np.zeros((4, 5), dtype=int)))
    )
    left, right = rank_factors(X)
    assert left.shape[1] == right.shape[0] == np.linalg.matrix_rank(X.astype(float))
    np.testing.assert_array_equal(left @ right if left.size else 0 * X, X)


@pytest.mark.parametrize("seed", range(20))
def test_null_space_is_all_of_it(seed: int) -> None:
    X = to_rational(np.random.default_rng(seed).integers(-2, 3, (3, 5)))
    X[2] = X[0] - 2 * X[1]
    N = null_space(X)
    assert not (X @ N).any()
    assert N.shape[1] == 5 - np.linalg.matrix_rank(X.astype(float))
    assert np.linalg.matrix_rank(N.astype(float)) == N.shape[1]


@pytest.mark.parametrize("shift", [-1, 0, 1])
def test_short_integers_decide_as_all_minors_do_next_to_singularity(shift: int) -> None:
    """``v v' + shift I`` with entries of 400 bits, times a diagonal of very different sizes: the last bit decides."""
    rng = np.random.default_rng(3)
    v = [int(x) * 2**200 + int(y) for x, y in rng.integers(1, 2**30, (5, 2))]
    scale = [1, 2**40, 2**9, 2**120, 3]
    rows = [[(v[i] * v[j] + shift * (i == j)) * scale[i] * scale[j] for j in range(i, 5)] for i in range(5)]
    expected = has_positive_minors([list(row) for row in rows])
    assert is_positive_triangle(rows) == expected == (shift > 0)
