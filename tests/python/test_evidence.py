"""What a verdict on a claim rests on: exact, enclosed, or sampled, which is no proof."""

from __future__ import annotations

import ast
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import given, settings
from hypothesis import strategies as st

import quasilpv
from quasilpv.artifact import read_artifact
from quasilpv.certificate import LAWS, Evidence, gate, shipped, verify
from quasilpv.certificate.exact.claims import Claim, Verification, all_positive
from quasilpv.certificate.exact.matrices import matrix
from quasilpv.certificate.exact.trigonometric import Polynomial, UnsupportedError
from quasilpv.certificate.robot import stabilised_model
from quasilpv.certificate.robot.equations_of_motion import equations_of_motion
from quasilpv.cli import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import ClaimError, InfeasibleError, InputError
from quasilpv.polytopes import BlockPolytope
from quasilpv.release import checked_artifact, to_artifact
from quasilpv.synthesis import CONTROLLERS, DesignRequest, synthesise
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot, robots
from reference.checked import artifact_of

QUICK = [("arm2", "dob-acceleration"), ("arm2", "pdc"), ("arm2", "delayed"), ("spring-disc", "robust")]
EVERY = [(entry.id, controller) for entry in robots() for controller in CONTROLLERS]


@cache
def design(robot_id: str, controller: str) -> TrackingDesign:
    return synthesise(DesignRequest.of(robot_id, controller))


def content(robot_id: str, controller: str) -> dict[str, Any]:
    return json.loads(json.dumps(to_artifact(design(robot_id, controller)).content()))  # type: ignore[no-any-return]


# ---- every claim -----------------------------------------------------------------------------------------------------


def check_every_claim(robot_id: str, controller: str) -> None:
    document = content(robot_id, controller)
    found = verify(document)
    assert found.verified
    assert sum(found.evidence.values()) == len(found.claims)
    assert found.evidence["exact"] > 0
    assert found.evidence["sampled"] == 0
    boxes = [claim for claim in found.claims if "on the operating domain" in claim.name]
    assert {claim.evidence for claim in boxes} <= {Evidence.ENCLOSED}


@pytest.mark.parametrize(("robot_id", "controller"), QUICK)
def test_every_claim_of_a_shipped_law_is_proved(robot_id: str, controller: str) -> None:
    check_every_claim(robot_id, controller)


@pytest.mark.full
@pytest.mark.parametrize(("robot_id", "controller"), EVERY)
def test_every_claim_of_every_law_of_every_robot_is_proved(robot_id: str, controller: str) -> None:
    try:
        made = design(robot_id, controller)
    except (InfeasibleError, InputError) as refusal:
        pytest.skip(str(refusal))
    if LAWS[made.law["kind"]].checks:
        check_every_claim(robot_id, controller)
        by_proof = made.law["kind"] == "dob-acceleration"
        assert gate(content(robot_id, controller)).evidence is (Evidence.ENCLOSED if by_proof else Evidence.SAMPLED)


def test_claims_are_made_by_methods_that_know_their_evidence_only() -> None:
    """Whoever writes ``Claim(..., Evidence.EXACT)`` beside a number in double would get away with it."""
    for file in Path(quasilpv.__file__).parent.rglob("*.py"):
        if file.name == "claims.py":
            continue
        calls = [node.func for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)]
        names = [getattr(called, "id", getattr(called, "attr", "")) for called in calls]
        assert "Claim" not in names, file


@pytest.mark.parametrize(
    "make",
    [
        lambda: Claim.positive("it", np.eye(2)),  # type: ignore[arg-type]
        lambda: Claim.positive("it", [[1.0]]),  # type: ignore[arg-type]
        lambda: Claim.at_most("it", 1e-12, fmpq(1)),  # type: ignore[arg-type]
        lambda: Claim.at_most("it", fmpq(1), 2.0),  # type: ignore[arg-type]
        lambda: all_positive("it", [0.5]),  # type: ignore[list-item]
    ],
)
def test_doubles_make_no_exact_claim(make: Callable[[], Claim]) -> None:
    with pytest.raises(TypeError):
        make()


def test_a_claim_of_several_is_worth_the_weakest() -> None:
    exact, boxed, seen = (
        Claim.positive("a", fmpq_mat(1, 1, [1])),
        Claim.enclosed("b", holds=True, margin=1.0),
        Claim.sampled("c", 0.0, 1.0),
    )
    assert Claim.all_of("it", [exact, exact]).evidence is Evidence.EXACT
    assert Claim.all_of("it", [boxed, exact]).evidence is Evidence.ENCLOSED
    assert Claim.all_of("it", [exact, seen, boxed]).evidence is Evidence.SAMPLED
    together = Verification((exact, exact, seen), 0.0)
    assert together.evidence == {"exact": 2, "enclosed": 0, "sampled": 1}
    assert together.evidence_in_words == "2 exact, 1 sampled"
    assert together.weaker_than(Evidence.ENCLOSED) == (seen,)
    assert not together.weaker_than(Evidence.SAMPLED)


# ---- trigonometric polynomials ---------------------------------------------------------------------------------------

ANGLES = st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(-2, 2))


@st.composite
def expressions(draw: st.DrawFn, depth: int = 3) -> Callable[[Any, Any], Any]:
    """From angles and speeds to a value, in whatever arithmetic these have."""
    kind = draw(st.sampled_from(["number", "angle", "speed", "wave"] if depth == 0 else ["wave", "sum", "product"]))
    if kind == "number":
        value = draw(st.integers(-8, 8)) / 4.0
        return lambda theta, omega: 0 * theta[0] + value
    if kind in {"angle", "speed"}:
        k = draw(st.integers(0, 2))
        return lambda theta, omega: (theta if kind == "angle" else omega)[k]
    if kind == "wave":
        factors, function = draw(ANGLES), draw(st.sampled_from(["sin", "cos", "sinc"]))

        def wave(theta: Any, omega: Any) -> Any:
            angle = sum((factor * x for factor, x in zip(factors, theta, strict=True)), 0 * theta[0])
            if isinstance(angle, Polynomial):
                return getattr(angle, function)()
            return np.sinc(angle / np.pi) if function == "sinc" else getattr(np, function)(angle)

        return wave
    one, two = draw(expressions(depth=depth - 1)), draw(expressions(depth=depth - 1))
    if kind == "sum":
        return lambda theta, omega: one(theta, omega) + two(theta, omega)
    return lambda theta, omega: one(theta, omega) * two(theta, omega)


def value_of(polynomial: Polynomial, theta: np.ndarray, omega: np.ndarray) -> complex:
    """From the definition of a monomial."""
    total = 0j
    for monomial, (real, imaginary) in polynomial.terms.items():
        size = complex(int(real.p) / int(real.q), int(imaginary.p) / int(imaginary.q))
        size *= np.prod(np.concatenate([theta, omega]) ** np.array(monomial.powers))
        size *= np.exp(1j * np.array(monomial.phase) @ theta)
        total += size * np.prod([np.sinc(np.array(angle) @ theta / np.pi) for angle in monomial.sincs])
    return total


@given(expressions(), st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None)
def test_a_polynomial_has_the_values_of_its_expression_and_its_bound_holds(
    expression: Callable[[Any, Any], Any], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    found = expression(*Polynomial.variables(3))
    reach = [fmpq(2)] * 3 + [fmpq(3)] * 3
    bound = found.bound(reach)
    for _ in range(5):
        theta, omega = rng.uniform(-2, 2, 3), rng.uniform(-3, 3, 3)
        expected = expression(theta, omega)
        assert abs(value_of(found, theta, omega) - expected) <= 1e-9 * (1.0 + float(bound.p) / float(bound.q))
        assert abs(expected) <= int(bound.p) / int(bound.q) * (1.0 + 1e-9) + 1e-9


def test_identities_are_zero_and_what_is_no_identity_is_not() -> None:
    (x, y), _ = Polynomial.variables(2)
    nothing = [
        x.sin() ** 2 + x.cos() ** 2 - 1,
        (x + y).sin() - x.sin() * y.cos() - x.cos() * y.sin(),
        (2 * x - y).sinc() * (2 * x - y) - (2 * x - y).sin(),
        (x + y).sinc() * x + (x + y).sinc() * y - (x + y).sin(),
        (0 * x).sinc() - 1,
        (x - x).sin(),
        (-x).sinc() - x.sinc(),
    ]
    assert not any(expression.terms for expression in nothing)
    assert (x.sin() - x).terms
    for unsupported in ((x * y).sin, (x / 2).cos, lambda: 1 * x / y, lambda: x**-1):
        with pytest.raises(UnsupportedError):
            unsupported()


@pytest.mark.parametrize("robot_id", ["arm2", "arm2-upright", "arm3-light", "fivebar", "spring-disc"])
def test_equations_of_motion_are_those_of_the_model(robot_id: str) -> None:
    entry = robot(robot_id)
    n = entry.model.joints
    document = {
        "robot": {"id": robot_id, "parameters": entry.model.parameters_document()},
        "payloads": entry.payloads.to_document(),
        "domain": entry.domain.to_document(),
        "law": {
            "kind": "pid",
            **{gain: [1.0] * n for gain in ("kp", "kd", "ki")},
            "velocity_filter_time_constant_s": 0.0,
            "inertia": BlockPolytope.takagi_sugeno([], []).to_document(np.eye(n)[None]),
        },
    }
    found = equations_of_motion(artifact_of(document))
    rng = np.random.default_rng(5)
    for _ in range(5):
        theta, omega = rng.uniform(-3, 3, (2, n))
        inertia = [[value_of(entry_, theta, omega) for entry_ in row] for row in found.inertia]
        np.testing.assert_allclose(inertia, entry.model.inertia(theta), rtol=1e-12, atol=1e-12)
        torque = [value_of(component, theta, omega) for component in found.torque]
        expected = entry.model.coriolis(theta, omega) + entry.model.gravity(theta)
        np.testing.assert_allclose(torque, expected, rtol=1e-11, atol=1e-10)
    step = 1e-6
    rest = np.zeros(n)
    stiffness = np.array(
        [(entry.model.gravity(step * e) - entry.model.gravity(-step * e)) / (2 * step) for e in np.eye(n)]
    ).T
    friction = np.array([entry.model.coriolis(rest, step * e) / step for e in np.eye(n)]).T
    for exact, numerical in ((found.stiffness, stiffness), (found.friction, friction)):
        doubles = [[int(x.p) / int(x.q) for x in row] for row in exact.table()]
        np.testing.assert_allclose(doubles, numerical, rtol=1e-6, atol=1e-4)


# ---- claims about the model ------------------------------------------------------------------------------------------


def with_exponential(document: dict[str, Any]) -> dict[str, Any]:
    """The same premises, written with ``0 * exp(theta_1)``: no polynomial."""
    code = document["programs"]["schedule"]["code"]
    code += [["const", 0.0], ["angle", 0], ["exp"], ["mul"], ["add"]]
    return document


MODEL = {"pdc": "equations of motion", "delayed": "linearised at rest", "robust": "equations of motion"}


@pytest.mark.parametrize(("robot_id", "controller"), QUICK[1:])
def test_a_model_that_is_off_by_more_than_rounding_is_found_exactly_and_in_samples(
    robot_id: str, controller: str
) -> None:
    for relative, holds in ((1e-7, False), (1e-14, True)):
        for prepare, evidence in ((lambda x: x, Evidence.EXACT), (with_exponential, Evidence.SAMPLED)):
            document = prepare(content(robot_id, controller))
            for block in document["witness"]["feedback"]["model"]["A"]["blocks"]:
                block["vertices"] = (np.array(block["vertices"]) * (1.0 + relative)).tolist()
            (claim,) = [claim for claim in verify(document).claims if MODEL[controller] in claim.name]
            assert (claim.holds, claim.evidence) == (holds, evidence)
            assert ("sampled" in claim.name) == (evidence is Evidence.SAMPLED)


def test_a_payload_that_moves_the_first_moment_is_found() -> None:
    document = content("spring-disc", "robust")
    assert stabilised_model.payload_claim(shipped(document)).holds
    arm = content("arm2", "pdc")
    assert arm["payloads"]["mass_scale"][-1] != 1.0
    assert not stabilised_model.payload_claim(shipped(arm)).holds
    arm["payloads"] = {name: [1.0] * len(scales) for name, scales in arm["payloads"].items() if "scale" in name} | {
        name: value for name, value in arm["payloads"].items() if "scale" not in name
    }
    claim = stabilised_model.payload_claim(shipped(arm))
    assert (claim.holds, claim.evidence) == (True, Evidence.EXACT)


# ---- through the chain -----------------------------------------------------------------------------------------------


def test_a_release_says_what_evidence_it_needs_and_refuses_less(monkeypatch: pytest.MonkeyPatch) -> None:
    made = design("arm2", "pdc")
    evidence = checked_artifact(made).verification or {}
    assert evidence["needed_evidence"] == {"claims": "enclosed", "gate": "sampled"}
    assert evidence["schema_version"] == 2
    assert evidence["certificate"]["evidence"]["sampled"] == 0
    assert evidence["gate"]["evidence"] == "sampled"

    def unsupported(*_: Any) -> Any:
        raise UnsupportedError

    monkeypatch.setattr(stabilised_model, "_on_trajectories", unsupported)
    with pytest.raises(ClaimError, match=r"\(sampled\): sampled, enclosed evidence is needed"):
        checked_artifact(made)
    marked = checked_artifact(made, allow_unverified=True).verification or {}
    assert marked["released_unverified"] is True
    assert marked["certificate"]["evidence"]["sampled"] == 1


def test_verify_prints_the_evidence_of_every_claim_and_how_many_of_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = with_exponential(content("spring-disc", "robust"))
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(document)))
    assert run(["verify", str(file), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["evidence"] == {"exact": 9, "enclosed": 1, "sampled": 1}
    assert sum(answer["evidence"].values()) == answer["lmis"]
    assert run(["verify", str(file)]) == 0
    shown = capsys.readouterr().out
    assert "verified: 11 inequalities, 9 exact, 1 enclosed, 1 sampled, in " in shown


def test_an_artifact_of_before_loads_with_the_bytes_it_had(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its verification has no version and tells no kinds of evidence apart."""
    document = content("arm2", "dob-acceleration")
    document["verification"] = {
        "report": {},
        "certificate": {"verified": True, "lmis": 12, "worst_margin": 1e-3, "failed": []},
        "gate": {"passed": True, "proved": True},
    }
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(document)))
    read = read_artifact(file)
    assert read.content() == document
    assert read.hash == with_hash(document)["hash"]
    assert run(["inspect", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verification"] == document["verification"]
    assert run(["verify", str(file)]) == 0


def test_matrices_of_rationals_are_exact_whatever_they_were_made_of() -> None:
    assert Claim.positive("it", matrix([[1.5, 0.1], [0.1, 2.0]])).evidence is Evidence.EXACT
