"""The exact checker: what it certifies holds wherever one looks, what does not hold it refuses, and it says how."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import example, given
from hypothesis import strategies as st

from quasilpv.arrays import FloatArray
from quasilpv.certificate import verify
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import is_positive_definite, matrix, rational, scaled_to_unit_diagonal
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.cli import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest, Specification
from reference.checked import vertex_table

Document = dict[str, Any]
POINTS = 5000
ROUNDING = 1e-9
seeds = st.integers(0, 2**32 - 1)


@cache
def kept(kind: str) -> Document:
    if kind == "dob-acceleration":
        return release(DesignRequest.of("arm3")).artifact.content()
    return release(DesignRequest.of("arm2", kind, Specification(rate_hz=4000.0))).artifact.content()


def document_of(kind: str) -> Document:
    return copy.deepcopy(kept(kind))


KINDS = ("dob-acceleration", "dob-torque")


# ---- what is certified holds at every point --------------------------------------------------------------------------


def table_at(table: Document, z: FloatArray) -> FloatArray:
    """``sum_i w_i(z) X_i`` at premise vectors (B, p), from the weights as the format defines them."""
    lower, upper = np.array(table["lower"]), np.array(table["upper"])
    omega = (z - lower) / (upper - lower)
    total = np.zeros((len(z), *np.shape(table["blocks"][0]["vertices"][0])))
    for block in table["blocks"]:
        bits = len(block["premises"])
        for corner, vertex in enumerate(block["vertices"]):
            weight = np.full(len(z), 1.0 / len(table["blocks"]))
            for k, p in enumerate(block["premises"]):
                upper_bound = (corner >> (bits - 1 - k)) & 1
                weight *= omega[:, p] if upper_bound else 1.0 - omega[:, p]
            total += weight[:, None, None] * np.array(vertex)
    return total


def random_premises(table: Document, rng: np.random.Generator) -> FloatArray:
    """`POINTS` points of the box, a tenth of them on its boundary."""
    lower, upper = np.array(table["lower"]), np.array(table["upper"])
    share = rng.uniform(size=(POINTS, len(lower)))
    share[: POINTS // 10] = rng.integers(0, 2, size=(POINTS // 10, len(lower)))
    return np.asarray(lower + share * (upper - lower))


def in_lyapunov_coordinates(system: FloatArray, lyapunov: FloatArray) -> FloatArray:
    """``R A R^-1`` with ``R' R`` the Lyapunov matrix, in which ``V = |x|^2``."""
    R = np.linalg.cholesky(lyapunov).T
    return np.asarray(R @ system @ np.linalg.inv(R))


def assert_decay_and_disk(system: FloatArray, lyapunov: FloatArray, decay: float, disk: float) -> None:
    """``V`` decays at least like exp(-2 decay t), and the frozen poles lie in the disk, at each of many systems."""
    fast = in_lyapunov_coordinates(system, lyapunov)
    rates = np.linalg.eigvalsh((fast + fast.swapaxes(1, 2)) / 2.0)[:, -1]
    assert rates.max() <= -decay * (1.0 - ROUNDING)
    poles = np.linalg.eigvals(fast)
    assert np.abs(poles).max() <= disk * (1.0 + ROUNDING)
    assert poles.real.max() <= -decay * (1.0 - ROUNDING)


def assert_l2_gain(system: FloatArray, drive: FloatArray, output: FloatArray, squared: float, disk: float) -> None:
    """``|C (j w I - A)^-1 B|^2 <= gamma`` at many frequencies, for each of many systems."""
    rows = output.shape[-2]
    for frequency in disk * np.geomspace(1e-4, 1e2, 40):
        response = output @ np.linalg.solve(1j * frequency * np.eye(system.shape[-1]) - system, drive)
        gain = np.linalg.norm(response.reshape(len(system), rows, -1), ord=2, axis=(1, 2)).max()
        assert gain**2 <= squared * (1.0 + ROUNDING)


def test_when_5000_points_of_the_box_are_drawn_expect_the_torque_law_to_keep_what_was_certified() -> None:
    content = kept("dob-torque")
    law, witness = content["law"], content["witness"]
    z = random_premises(law["inertia"], np.random.default_rng(5))
    M, K, L = (table_at(law[name], z) for name in ("inertia", "feedback", "observer"))
    n = M.shape[-1]
    mobility, eye, none = np.linalg.inv(M), np.broadcast_to(np.eye(n), M.shape), np.zeros_like(M)

    # e' = w, M w' = K (e, w, int e) + d, (int e)' = e
    system = np.block([[none, eye, none], [mobility @ K], [eye, none, none]])
    claim = witness["feedback"]
    lyapunov = np.linalg.inv(np.array(claim["P"]))
    lyapunov = (lyapunov + lyapunov.T) / 2.0
    assert_decay_and_disk(system, lyapunov, claim["decay_per_s"], claim["disk_rad_s"])
    drive = np.concatenate([none, mobility, none], axis=1)
    output = np.concatenate([eye, none, none], axis=2)
    assert_l2_gain(system[:300], drive[:300], output[:300], claim["gamma"], claim["disk_rad_s"])

    # theta' = w, M w' = d, d' = dd, minus L times the error of the measured angle, which includes nu n
    chain = np.block(
        [[none, eye, none, none], [none, none, mobility, none], [none, none, none, eye], [none, none, none, none]]
    )
    measured = np.concatenate([eye, none, none, none], axis=2)
    system = chain - L @ measured
    claim = witness["observer"]
    assert_decay_and_disk(system, np.array(claim["Q"]), claim["decay_per_s"], claim["disk_rad_s"])
    drive = np.concatenate([np.concatenate([none, none, none, eye], axis=1), -claim["noise"] * L], axis=2)
    output = np.concatenate([none, none, eye, none], axis=2)
    assert_l2_gain(system[:300], drive[:300], output[:300], claim["gamma"], claim["disk_rad_s"])


def test_when_5000_points_of_the_box_are_drawn_expect_the_acceleration_law_to_keep_what_was_certified() -> None:
    content = kept("dob-acceleration")
    law, witness, T = content["law"], content["witness"], content["sample_period_s"]
    z = random_premises(law["inertia"], np.random.default_rng(6))
    M = table_at(law["inertia"], z)
    n = M.shape[-1]
    eye, none = np.broadcast_to(np.eye(n), M.shape), np.zeros_like(M)
    kp, kd, ki = (law["feedback"][name] for name in ("kp", "kd", "ki"))
    # The plant has the design inertia: torque in, angles out, all joints at once.
    acceleration = np.linalg.solve(M, np.concatenate([kp * M, kd * M, ki * M], axis=2))
    position = np.concatenate([eye, T * eye, none], axis=2) + T**2 / 2.0 * acceleration
    speed = np.concatenate([none, eye, none], axis=2) + T * acceleration
    feedback = np.concatenate([position, speed, np.concatenate([T * eye, none, eye], axis=2)], axis=1)
    claim = witness["feedback"]
    assert np.abs(np.linalg.eigvals(feedback) - claim["disk_centre"]).max() <= claim["disk_radius"] * (1 + ROUNDING)

    chain = np.array([[1, T, T**2 / 2, T**3 / 6], [0, 1, T, T**2 / 2], [0, 0, 1, T], [0, 0, 0, 1]])
    gains = np.array(law["observer"])[:, None]
    error = chain @ (np.eye(4) - gains @ np.eye(4)[:1])
    claim = witness["observer"]
    scale = claim["bandwidth_rad_s"] ** np.arange(4.0)
    poles = np.linalg.eigvals(error * np.outer(1.0 / scale, scale))
    assert np.abs(poles - claim["disk_centre"]).max() <= claim["disk_radius"] * (1 + ROUNDING)


# ---- what does not hold is refused -----------------------------------------------------------------------------------

Change = Callable[[Document], None]


def scaled(*path: str | int, by: float) -> Change:
    """Multiply one number of a document, named by its path."""

    def change(document: Document) -> None:
        place: Any = document
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] *= by

    return change


TABLE = ("blocks", 0, "vertices", 0)
SPOILED: dict[str, tuple[str, Change]] = {
    "a feedback scalar": ("dob-acceleration", scaled("law", "feedback", "kp", by=1.5)),
    "an observer scalar": ("dob-acceleration", scaled("law", "observer", 2, by=0.7)),
    "the sign of a gain": ("dob-acceleration", scaled("law", "feedback", "ki", by=-1.0)),
    "the sample period": ("dob-acceleration", scaled("sample_period_s", by=2.0)),
    "a smaller disk": ("dob-acceleration", scaled("witness", "feedback", "disk_radius", by=0.9)),
    "a smaller variance": ("dob-acceleration", scaled("witness", "observer", "objective", by=0.9)),
    "an entry of P": ("dob-acceleration", scaled("witness", "feedback", "P", 0, 0, by=0.5)),
    "a feedback vertex": ("dob-torque", scaled("law", "feedback", *TABLE, 0, 0, by=2.0)),
    "an observer vertex": ("dob-torque", scaled("law", "observer", *TABLE, 0, 0, by=0.5)),
    "an inertia vertex": ("dob-torque", scaled("law", "inertia", *TABLE, 0, 0, by=1.5)),
    "a faster decay of the error": ("dob-torque", scaled("witness", "feedback", "decay_per_s", by=3.0)),
    "no decay at all": ("dob-torque", scaled("witness", "observer", "decay_per_s", by=-1.0)),
    "a smaller feedback disk": ("dob-torque", scaled("witness", "feedback", "disk_rad_s", by=0.8)),
    "a smaller observer disk": ("dob-torque", scaled("witness", "observer", "disk_rad_s", by=0.8)),
    "a smaller gain to the error": ("dob-torque", scaled("witness", "feedback", "gamma", by=0.8)),
    "a smaller gain to the estimate": ("dob-torque", scaled("witness", "observer", "gamma", by=0.8)),
    "less noise": ("dob-torque", scaled("witness", "observer", "noise", by=3.0)),
    "an entry of Q": ("dob-torque", scaled("witness", "observer", "Q", 1, 0, by=1.01)),
}


@pytest.mark.parametrize("what", SPOILED)
def test_when_a_number_is_changed_and_the_hash_recomputed_expect_exit_1_and_the_inequality_named(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, change = SPOILED[what]
    document = document_of(kind)
    change(document)
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(document)))
    assert run(["verify", str(file), "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["verified"] is False
    assert answer["failed"]
    assert answer["worst_margin"] < 0


@pytest.mark.parametrize("kind", KINDS)
def test_when_an_artifact_is_sound_expect_exit_0_and_the_evidence_it_carries(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = document_of(kind)
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(document)))
    assert run(["verify", str(file), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer.pop("seconds") < 5.0
    assert answer == document["verification"]["certificate"]
    assert answer["verified"] is True
    assert 0 < answer["worst_margin"] < 1
    assert run(["verify", str(file)]) == 0
    assert f"verified: {answer['lmis']} inequalities" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("dob-acceleration", scaled("law", "feedback", "kp", by=1.0 + 1e-7)),
        ("dob-acceleration", scaled("law", "observer", 0, by=1.0 - 1e-7)),
        ("dob-torque", scaled("law", "feedback", *TABLE, 0, 0, by=1.0 + 1e-7)),
        ("dob-torque", scaled("law", "observer", *TABLE, 0, 0, by=1.0 - 1e-8)),
        ("dob-torque", scaled("law", "inertia", *TABLE, 0, 0, by=1.0 + 1e-14)),
        ("dob-torque", scaled("witness", "feedback", "gamma", by=1.1)),
        ("dob-torque", scaled("witness", "observer", "disk_rad_s", by=1.1)),
    ],
)
def test_when_a_number_changes_within_the_margin_expect_it_verified(kind: str, change: Change) -> None:
    document = document_of(kind)
    change(document)
    verdict = verify(document)
    assert verdict.verified, verdict.failed


@pytest.mark.parametrize("kind", KINDS)
def test_when_the_witness_is_missing_or_malformed_expect_an_input_error(kind: str) -> None:
    matrix_name = {"dob-acceleration": "P", "dob-torque": "Q"}[kind]
    side = {"dob-acceleration": "feedback", "dob-torque": "observer"}[kind]
    malformed: list[Any] = [None, [], [[]], [[1.0, 2.0], [3.0]], [["one"]], {"rows": 3}, 1.0, [[1.0]]]
    for value in malformed:
        document = document_of(kind)
        document["witness"][side][matrix_name] = value
        with pytest.raises(InputError, match="witness"):
            verify(document)
    incomplete: list[Any] = [None, {}, {"feedback": {}}, []]
    for witness in incomplete:
        document = document_of(kind)
        document["witness"] = witness
        with pytest.raises(InputError, match="witness"):
            verify(document)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("huge", [1e300, -1e300, 5e-324])
def test_when_the_witness_is_absurd_expect_a_refusal_and_no_overflow(kind: str, huge: float) -> None:
    document = document_of(kind)
    side, name = {"dob-acceleration": ("feedback", "P"), "dob-torque": ("observer", "Q")}[kind]
    size = len(document["witness"][side][name])
    document["witness"][side][name] = [[huge] * size] * size
    verdict = verify(document)
    assert not verdict.verified
    assert -1.0 <= verdict.worst_margin < 1e-9


def test_when_a_law_makes_no_claim_expect_an_input_error_that_names_those_that_do() -> None:
    with pytest.raises(InputError, match=r"pid.*dob-acceleration, dob-torque"):
        verify(release(DesignRequest.of("arm2", "pid")).artifact.content())


def test_when_the_tables_have_different_boxes_expect_an_input_error() -> None:
    document = document_of("dob-torque")
    document["law"]["observer"]["upper"][0] += 0.5
    with pytest.raises(InputError, match="tables differ"):
        verify(document)


# ---- exact matrices --------------------------------------------------------------------------------------------------


def pivots(exact: fmpq_mat) -> list[Fraction]:
    """Pivots of L D L' with fractions, until one is not positive."""
    work = [[Fraction(int(x.p), int(x.q)) for x in row] for row in exact.table()]
    found: list[Fraction] = []
    for k in range(len(work)):
        found.append(work[k][k])
        if found[-1] <= 0:
            break
        for i in range(k + 1, len(work)):
            factor = work[i][k] / work[k][k]
            work[i] = [a - factor * b for a, b in zip(work[i], work[k], strict=True)]
    return found


@given(seeds, st.integers(1, 5))
@example(3353057, 2)
def test_when_a_matrix_is_decided_exactly_expect_the_pivots_to_agree_whatever_the_units(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    factor = rng.integers(-3, 4, size=(size, size))
    shift = Fraction(int(rng.integers(0, 8)), 3)
    square = [[Fraction(int(x)) for x in row] for row in factor @ factor.T]
    for k in range(size):
        square[k][k] -= shift
    units = [Fraction(10) ** int(e) for e in rng.integers(-12, 13, size=size)]
    exact = matrix([[square[i][j] * units[i] * units[j] for j in range(size)] for i in range(size)])
    expected = all(pivot > 0 for pivot in pivots(exact))
    assert is_positive_definite(exact) is expected
    claim = Claim.positive("it", exact)
    assert claim.holds is expected
    if abs(claim.margin) > 1e-9:
        assert (claim.margin > 0) is expected
    unscaled = Claim.positive("it", matrix(square))
    assert claim.margin == unscaled.margin
    diagonal = [scaled_to_unit_diagonal(exact)[k, k] for k in range(size)]
    assert all(entry <= 0 or fmpq(1, 4) < entry < 4 for entry in diagonal)


@given(seeds, st.integers(1, 5), st.integers(-400, 400))
def test_when_rows_and_columns_are_in_other_units_expect_the_same_margin_even_beyond_double(
    seed: int, size: int, exponent: int
) -> None:
    rng = np.random.default_rng(seed)
    square = rng.integers(-3, 4, size=(size, size)) + int(rng.integers(0, 8)) * np.eye(size, dtype=int)
    units = [Fraction(10) ** (exponent * int(e)) * int(s) for e, s in rng.integers(1, 4, size=(size, 2))]
    other = [[units[i] * int(square[i, j]) * units[j] for j in range(size)] for i in range(size)]
    margin = Claim.positive("it", matrix(square.tolist())).margin
    assert Claim.positive("it", matrix(other)).margin == margin
    diagonal = square.diagonal()
    if np.all(diagonal > 0):
        unit_diagonal = (square + square.T) / 2 / np.sqrt(np.outer(diagonal, diagonal))
        assert margin == pytest.approx(max(-1.0, np.linalg.eigvalsh(unit_diagonal)[0]), abs=1e-12)
    else:
        assert margin == -1.0


def test_when_a_matrix_is_singular_or_not_symmetric_expect_no_certificate() -> None:
    assert not is_positive_definite(matrix([[1, 1], [1, 1]]))
    assert is_positive_definite(matrix([[1, 1], [1, 1 + Fraction(1, 10**60)]]))
    assert not is_positive_definite(matrix([[2, 1], [0, 2]]))
    assert not is_positive_definite(matrix([[0]]))
    assert Claim.positive("huge", matrix([[1, 1e300], [1e300, 1]])).margin == -1.0


# ---- collapse --------------------------------------------------------------------------------------------------------


@given(seeds)
def test_when_a_table_collapses_expect_the_bound_to_cover_every_point_of_the_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    lower = rng.normal(size=count)
    polytope = BlockPolytope.per_premise(lower, lower + rng.uniform(0.1, 3.0, size=count))
    X = polytope.vertices(rng.normal(size=(2, 2)), rng.normal(size=(count, 2, 2)))
    table = polytope.to_document(X)
    parsed = vertex_table(table)
    bound = parsed.collapse_error()
    assert bound < fmpq(1, 10**14)
    (claim,) = parsed.collapse_claim("inertia")
    assert claim.holds

    # As the run-time side does it: value at the centre and slopes in doubles, then affine; exactly evaluated here.
    G = len(table["blocks"])
    z = [Fraction(float(x)) for x in rng.uniform(polytope.lower, polytope.upper)]
    centre = table_at(table, np.array([polytope.centre]))[0]
    for i, j in np.ndindex(2, 2):
        collapsed, vertex_sum = Fraction(float(centre[i, j])), Fraction(0)
        size = max(abs(Fraction(float(v[i, j]))) for v in X)
        for p in range(count):
            low, high = (float(block[i, j]) for block in X[2 * p : 2 * p + 2])
            width = float(polytope.upper[p]) - float(polytope.lower[p])
            collapsed += Fraction((high - low) * ((1.0 / G) / width)) * (z[p] - Fraction(float(polytope.centre[p])))
            exact_low, exact_high = Fraction(float(polytope.lower[p])), Fraction(float(polytope.upper[p]))
            omega = (z[p] - exact_low) / (exact_high - exact_low)
            vertex_sum += ((1 - omega) * Fraction(low) + omega * Fraction(high)) / G
        assert rational(abs(collapsed - vertex_sum) / size) <= bound + fmpq(1, 10**16)


def test_when_the_centre_lies_far_outside_the_box_expect_the_collapse_refused() -> None:
    doubles = (((1.0 / 3.0,),), ((2.0 / 7.0,),))
    table = VertexTable(lower=(0.0,), upper=(1.0,), centre=(3e14 + 0.1,), blocks=((0,),), doubles=doubles)
    (claim,) = table.collapse_claim("inertia")
    assert not claim.holds


def test_when_a_block_has_several_premises_expect_no_collapse_and_no_claim() -> None:
    polytope = BlockPolytope.takagi_sugeno([0.0, 0.0], [1.0, 1.0])
    table = vertex_table(polytope.to_document(np.ones((4, 1, 1))))
    assert table.collapse_claim("feedback") == ()
    with pytest.raises(ValueError, match="one premise"):
        table.collapse_error()
    constant = BlockPolytope.takagi_sugeno([], []).to_document(np.full((1, 1, 1), 0.1))
    assert vertex_table(constant).collapse_error() == 0


@pytest.mark.parametrize(
    ("member", "value"),
    [("upper", [-1.0]), ("lower", [0.0, 0.0]), ("blocks", []), ("blocks", [{"premises": [0], "vertices": [[[1.0]]]}])],
)
def test_when_a_table_is_malformed_expect_it_refused(member: str, value: Any) -> None:
    table = BlockPolytope.per_premise([0.0], [1.0]).to_document([[[1.0]], [[2.0]]])
    table[member] = value
    with pytest.raises(InputError, match="table: "):
        vertex_table(table)
