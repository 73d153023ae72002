"""The operating envelope of the torque-level law: its sets hold however the premises move, what is wrong is refused."""

from __future__ import annotations

import copy
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.arrays import FloatArray
from quasilpv.certificate import verify
from quasilpv.errors import InputError
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest, Specification

Document = dict[str, Any]
seeds = st.integers(0, 2**32 - 1)
STEPS = 40


@cache
def kept() -> Document:
    return release(DesignRequest.of("arm2", "dob-torque", Specification(rate_hz=4000.0))).artifact.content()


def envelope() -> Document:
    member: Document = kept()["witness"]["envelope"]
    return member


def vertices(name: str) -> FloatArray:
    return np.array([vertex for block in kept()["law"][name]["blocks"] for vertex in block["vertices"]])


def mixed(name: str, weights: FloatArray) -> FloatArray:
    return np.tensordot(weights, vertices(name), axes=1)


def feedback_loop(weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``xi' = A xi + B d`` at one point of the box, the inertia inverted."""
    n = kept()["joints"]
    M, K = mixed("inertia", weights), mixed("feedback", weights)
    A = np.zeros((3 * n, 3 * n))
    A[:n, n : 2 * n] = A[2 * n :, :n] = np.eye(n)
    A[n : 2 * n] = np.linalg.solve(M, K)
    return A, np.vstack([np.zeros((n, n)), np.linalg.inv(M), np.zeros((n, n))])


def estimation_loop(weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``eps' = A eps + H d''`` at one point of the box."""
    n = kept()["joints"]
    A = np.kron(np.diag([1.0, 0.0, 1.0], 1), np.eye(n))
    A[n : 2 * n, 2 * n : 3 * n] = np.linalg.inv(mixed("inertia", weights))
    A[:, :n] -= mixed("observer", weights)
    return A, np.vstack([np.zeros((3 * n, n)), np.eye(n)])


def advanced(A: FloatArray, B: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Exact map of one step with the input held."""
    size, inputs = B.shape
    larger = scipy.linalg.expm(np.block([[A, B], [np.zeros((inputs, size + inputs))]]) * step_s)
    return larger[:size, :size], larger[:size, size:]


def weights_of(rng: np.random.Generator) -> FloatArray:
    return rng.dirichlet(np.full(len(vertices("inertia")), 0.3))


@settings(max_examples=6)
@given(seeds)
def test_when_errors_start_on_the_border_and_premises_jump_expect_them_to_stay_and_to_keep_the_bounds(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    n = kept()["joints"]
    for name in ("box_set", "torque_set"):
        X, bounds = np.array(envelope()[name]["X"]), envelope()[name]["bounds"]
        x = np.linalg.cholesky(X) @ rng.normal(size=3 * n)
        x /= np.sqrt(x @ np.linalg.solve(X, x))
        previous = 1.0 + 1e-9
        for _ in range(STEPS):
            weights = weights_of(rng)
            assert (np.abs(x[:n]) <= bounds["angle_rad"]).all()
            assert (np.abs(x[n : 2 * n]) <= bounds["speed_rad_s"]).all()
            assert (np.abs(mixed("feedback", weights) @ x) <= bounds["torque_nm"]).all()
            x = advanced(*feedback_loop(weights), 1e-3)[0] @ x
            level = np.sqrt(x @ np.linalg.solve(X, x))
            assert level <= previous
            previous = level * (1.0 + 1e-9)


@settings(max_examples=6)
@given(seeds)
def test_when_disturbances_of_unit_size_act_expect_the_errors_inside_the_peak_sets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = kept()["joints"]
    residual, observer = envelope()["residual_set"], envelope()["observer_set"]
    X, Q = np.array(residual["X"]), np.array(observer["Q"])
    peak = observer["peak_nm_per_s2"]
    xi, eps = np.zeros(3 * n), np.zeros(4 * n)
    for _ in range(STEPS):
        weights = weights_of(rng)
        directions = rng.normal(size=(2, n))
        d, second = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        A, B = advanced(*feedback_loop(weights), 5e-3)
        xi = A @ xi + B @ d
        A, B = advanced(*estimation_loop(weights), 1e-3)
        eps = A @ eps + B @ (peak * second)
        assert xi @ np.linalg.solve(X, xi) <= 1.0
        assert eps @ Q @ eps <= 1.0
        assert (np.abs(xi[:n]) <= residual["bounds"]["angle_rad"]).all()
        assert np.linalg.norm(eps[2 * n : 3 * n]) <= observer["bounds"]["disturbance_nm"]
        effort = mixed("feedback", weights)[:, : 2 * n] @ eps[: 2 * n]
        assert np.linalg.norm(effort) <= observer["bounds"]["feedback_nm"]


def test_when_the_residual_is_constant_at_the_worst_vertex_expect_an_error_of_the_size_of_the_bound() -> None:
    """The bound is no vacuous one: a step of the residual at a frozen vertex already needs a good part of it."""
    n = kept()["joints"]
    bounds = np.array(envelope()["residual_set"]["bounds"]["angle_rad"])
    reached = np.zeros(n)
    for weights in np.eye(len(vertices("inertia"))):
        A, B = feedback_loop(weights)
        step, drive = advanced(A, B, 1e-3)
        response = np.zeros((3 * n, n))
        for _ in range(1000):
            response = step @ response + drive
            reached = np.maximum(reached, np.linalg.norm(response[:n], axis=1))
    assert (reached < bounds).all()
    assert (reached > 0.3 * bounds).all()


def test_when_only_angles_are_off_expect_the_set_of_the_box_to_waste_little_of_it() -> None:
    n = kept()["joints"]
    box = envelope()["box_set"]
    alone = np.linalg.inv(np.array(box["X"])).diagonal()[:n] ** -0.5
    assert (alone > 0.9 * np.array(box["bounds"]["angle_rad"])).all()


@pytest.mark.parametrize(
    ("path", "by", "claim"),
    [
        (("box_set", "level"), 1.0 + 1e-6, "box set, level"),
        (("torque_set", "level"), 1.0 + 1e-6, "torque set, level"),
        (("torque_set", "level"), -1.0, "torque set, level"),
        (("residual_set", "peak"), 1.0 + 1e-6, "residual set, peak"),
        (("torque_share",), 2.0, "torque share"),
        (("reference_margin_rad",), 20.0, "room for a reference"),
        (("box_set", "X"), 1.01, "box set, bounds"),
        (("box_set", "X", 0, 0), 0.5, "box set"),
        (("torque_set", "X"), -1.0, "torque set, X"),
        (("box_set", "decay_per_s"), 100.0, "box set, decrease"),
        (("box_set", "decay_per_s"), -1.0, "box set, decay rate"),
        (("box_set", "bounds", "speed_rad_s", 1), 0.99, "box set, bounds"),
        (("torque_set", "bounds", "torque_nm", 0), 0.99, "torque set, bounds"),
        (("residual_set", "X"), 0.9, "residual set, decrease"),
        (("residual_set", "multiplier"), 3.0, "residual set, decrease"),
        (("residual_set", "multiplier"), -1.0, "residual set, multiplier"),
        (("residual_set", "bounds", "angle_rad", 0), 0.99, "residual set, bounds"),
        (("observer_set", "Q"), 1.2, "observer set, decrease"),
        (("observer_set", "Q"), 0.9, "observer set"),
        (("observer_set", "F"), -1.0, "observer set, decrease"),
        (("observer_set", "multiplier"), 3.0, "observer set, decrease"),
        (("observer_set", "bounds", "disturbance_nm"), 0.99, "observer set, disturbance"),
        (("observer_set", "bounds", "feedback_nm"), 0.9, "observer set, torque"),
    ],
)
def test_when_a_number_of_the_envelope_changes_expect_that_claim_refused(
    path: tuple[Any, ...], by: float, claim: str
) -> None:
    document = copy.deepcopy(kept())
    place: Any = document["witness"]["envelope"]
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = np.asarray(np.array(place[path[-1]]) * by).tolist()
    failed = verify(document).failed
    assert any(claim in name for name in failed), failed


@pytest.mark.parametrize("name", ["box_set", "residual_set", "observer_set", "reference_margin_rad"])
@pytest.mark.parametrize("value", [None, [], {}, "one", [[1.0]]])
def test_when_the_envelope_is_malformed_expect_an_input_error(name: str, value: Any) -> None:
    document = copy.deepcopy(kept())
    document["witness"]["envelope"][name] = value
    with pytest.raises(InputError, match="witness"):
        verify(document)
