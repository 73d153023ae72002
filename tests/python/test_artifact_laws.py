"""Laws in artifacts: what each kind asks of its tables, programs and gains."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import Artifact, evaluate
from quasilpv.documents.canonical import canonical_cbor, parse_document
from quasilpv.documents.tables import PolytopeTable
from quasilpv.errors import InputError
from quasilpv.systems.robots.registry import robot
from reference.artifacts import SCHEDULE_GAINS, Change, arm3_document, at, refusal, schedule_table, without

DELAYED = ("law", "lyapunov", "blocks", 1, "vertices", 0)


def test_when_programs_and_inertia_are_read_back_expect_the_model_of_the_arm() -> None:
    model = robot("arm3").model
    computed = Artifact.from_document(arm3_document("pid"))
    domain = np.array(computed.domain.angle_rad)
    table = computed.law.inertia
    rng = np.random.default_rng(7)
    for _ in range(100):
        theta = rng.uniform(domain[:, 0], domain[:, 1])
        omega, rate = rng.uniform(-2, 2, (2, 3))
        np.testing.assert_allclose(evaluate(computed.programs["gravity"], theta), model.gravity(theta), rtol=1e-12)
        coriolis = evaluate(computed.programs["coriolis_reference"], theta, omega, rate)
        np.testing.assert_allclose(coriolis, model.coriolis(theta, omega, rate), rtol=1e-10, atol=1e-10)
        centred = copy.deepcopy(table.model_dump(mode="json"))
        centred["centre"] = evaluate(computed.programs["premises"], theta).tolist()
        at_theta = PolytopeTable.model_validate_json(json.dumps(centred)).at_centre()
        np.testing.assert_allclose(at_theta, model.inertia(theta), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        (at("law", "feedback", "lower", 1, value=0.4), "law.feedback", "that of law.inertia"),
        (at("law", "observer", "centre", 0, value=0.0), "law.observer", "that of law.inertia"),
        (at("law", "feedback", "blocks", value=[]), "law.feedback.blocks", "in exactly one block"),
        (at("law", "observer", value=1), "law.observer", "got 1"),
        (without("law", "filter_time_constant_s"), "law.filter_time_constant_s", "got nothing"),
    ],
)
def test_when_a_gain_table_does_not_fit_the_inertia_expect_it_named(change: Change, field: str, message: str) -> None:
    error = refusal(arm3_document("dob-torque"), change)
    assert error.field == field
    assert message in str(error)


def test_when_gain_tables_are_exchanged_expect_the_size_of_a_vertex_named() -> None:
    document = arm3_document("dob-torque")
    law = document["law"]
    law["feedback"], law["observer"] = law["observer"], law["feedback"]
    with pytest.raises(InputError, match=r"law.feedback.blocks\[0\].vertices\[0\]: got 12 x 3, expected 3 x 9"):
        Artifact.from_document(document, "artifact.json")


def premultiplied() -> dict[str, Any]:
    document = arm3_document("dob-torque")
    table = copy.deepcopy(document["law"]["inertia"])
    for block in table["blocks"]:
        block["vertices"] = [np.triu(vertex).tolist() for vertex in block["vertices"]]
    document["law"]["premultiplication"] = table
    return document


def test_when_a_law_is_premultiplied_or_not_expect_the_member_kept_or_absent() -> None:
    document, without_it = premultiplied(), arm3_document("dob-torque")
    law = Artifact.from_document(document).to_document()["law"]
    assert law["premultiplication"] == document["law"]["premultiplication"]
    assert "premultiplication" not in Artifact.from_document(without_it).to_document()["law"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (at("law", "premultiplication", value=None), "got null, expected a block polytope, or no member of this name"),
        (at("law", "premultiplication", "upper", 1, value=0.99), "that of law.inertia"),
        (at("law", "premultiplication", "blocks", 0, "vertices", 0, value=[[1.0]]), "vertices[1]: got another shape"),
    ],
)
def test_when_a_premultiplication_breaks_a_rule_expect_it_named(change: Change, message: str) -> None:
    error = refusal(premultiplied(), change)
    assert error.field.startswith("law.premultiplication")
    assert message in str(error)


def watched() -> dict[str, Any]:
    document = arm3_document("dob-acceleration")
    document["law"]["lyapunov_bound"] = {"signals": np.diag([1, 2, 3, 4, 5.5]).tolist(), "joints": np.eye(3).tolist()}
    return document


def test_when_a_law_has_a_lyapunov_bound_or_none_expect_the_member_kept_or_absent_in_either_twin() -> None:
    document, without_it = watched(), arm3_document("dob-acceleration")
    artifact = Artifact.from_document(document)
    assert artifact.to_document()["law"]["lyapunov_bound"] == document["law"]["lyapunov_bound"]
    assert parse_document(canonical_cbor(artifact.to_document()), "cbor") == artifact.to_document()
    assert "lyapunov_bound" not in Artifact.from_document(without_it).to_document()["law"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (at("law", "lyapunov_bound", value=None), "lyapunov_bound: got null, expected two matrices"),
        (at("law", "lyapunov_bound", "surprise", value=1), "surprise"),
        (at("law", "lyapunov_bound", "joints", value=np.eye(2).tolist()), "joints: got 2 x 2, expected 3 x 3"),
        (
            at("law", "lyapunov_bound", "signals", 0, 1, value=9.0),
            "signals[0][1]: got 9.0, expected 0.0, the symmetric",
        ),
        (at("law", "lyapunov_bound", "signals", 3, 3, value=-1.0), "signals: got smallest eigenvalue -1"),
        (at("law", "lyapunov_bound", "signals", 3, 3, value=math.nan), "finite"),
        (at("law", "lyapunov_bound", "joints", value=[[1.0]]), "joints: got 1 x 1, expected 3 x 3"),
        (
            at("law", "observer", 0, value=1.0),
            "law.observer[0]: got 1, expected another number with law.lyapunov_bound",
        ),
    ],
)
def test_when_a_lyapunov_bound_breaks_a_rule_expect_it_named(change: Change, message: str) -> None:
    assert message in str(refusal(watched(), change))


@pytest.mark.parametrize(
    ("kind", "change", "field", "message"),
    [
        ("state-feedback", at("law", "gain", value=schedule_table(SCHEDULE_GAINS[:4, :2])), "law.gain", "got 2 x 6"),
        ("state-feedback", at("programs", "schedule", "outputs", value=1), "programs.schedule.outputs", "expected 2"),
        (
            "state-feedback",
            at("programs", "schedule", "code", 0, value=["angle", 3]),
            "programs.schedule.code",
            "below 3",
        ),
        ("descriptor-feedback", at("law", "lyapunov", 0, 1, value=9.0), "law.lyapunov[0][1]", "the symmetric entry"),
        ("descriptor-feedback", at("law", "lyapunov", 0, 0, value=-1.0), "law.lyapunov", "a positive definite matrix"),
        ("descriptor-feedback", without("law", "lyapunov", 5), "law.lyapunov", "got 5 x 6, expected 6 x 6"),
        ("delayed-feedback", without("law", "numerators", 7), "law.numerators", "got 63 matrices, expected 64"),
        ("delayed-feedback", at("law", "numerators", 9, value=[[1.0]]), "law.numerators[9]", "got 1 x 1"),
        ("delayed-feedback", at(*DELAYED, 0, 0, value=-1.0), "law.lyapunov.blocks[1].vertices[0]", "positive definite"),
        ("delayed-feedback", at("law", "window_samples", value=4), "law.window_samples", "or at least 5"),
        ("delayed-feedback", at("law", "window_samples", value=4097), "law.window_samples", "less than or equal to"),
        ("delayed-feedback", at("law", "descriptor", value=1), "law.descriptor", "a valid boolean"),
    ],
)
def test_when_a_scheduled_law_breaks_a_rule_expect_it_named(
    kind: str, change: Change, field: str, message: str
) -> None:
    error = refusal(arm3_document(kind), change)
    assert error.field.startswith(field)
    assert message in str(error)


@pytest.mark.parametrize(("kind", "bandwidth"), [("ctc", 50.0), ("ctc-dob", 0)])
def test_when_the_observer_bandwidth_contradicts_the_kind_expect_it_named(kind: str, bandwidth: float) -> None:
    document = arm3_document(kind)
    document["law"]["disturbance_observer_bandwidth_rad_s"] = bandwidth
    with pytest.raises(InputError, match=f"law.disturbance_observer_bandwidth_rad_s: .* for kind {kind}"):
        Artifact.from_document(document)


def test_when_a_gain_vector_has_too_few_joints_expect_it_named() -> None:
    document = arm3_document("pid")
    document["law"]["kd"] = [1, 2]
    with pytest.raises(InputError, match=r"law\.kd: got 2 entries, expected 3"):
        Artifact.from_document(document)


def test_when_the_inertia_is_indefinite_at_the_centre_expect_it_refused() -> None:
    document = arm3_document()
    for block in document["law"]["inertia"]["blocks"]:
        block["vertices"] = (-np.array(block["vertices"])).tolist()
    with pytest.raises(InputError, match=r"law\.inertia: got smallest eigenvalue -.* a positive definite inertia"):
        Artifact.from_document(document)


def test_when_no_premise_is_scheduled_expect_one_block_with_one_vertex() -> None:
    document = arm3_document()
    vertex = np.diag([36.0, 9.0, 1.3]).tolist()
    constant = {"premises": 0, "lower": [], "upper": [], "centre": []}
    block = {"kind": "box", "premises": [], "vertices": [vertex]}
    document["programs"]["premises"] = {"outputs": 0, "code": []}
    document["law"]["inertia"] = {**constant, "blocks": [block]}
    assert Artifact.from_document(document).law.inertia.at_centre().tolist() == vertex
    for blocks in ([], [block, block]):
        document["law"]["inertia"]["blocks"] = blocks
        with pytest.raises(InputError, match=r"law\.inertia\.blocks"):
            Artifact.from_document(document)
