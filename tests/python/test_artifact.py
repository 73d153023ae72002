"""Artifacts: the rules of the format, comparison and summary."""

from __future__ import annotations

import json

import pytest

from quasilpv.artifact import Artifact, diff, summary
from quasilpv.certificate import LAWS
from reference.artifacts import ARM3_PROGRAMS, Change, arm3_document, at, refusal, without

ARTIFACT = Artifact.from_document(arm3_document())
VERTICES = ("law", "inertia", "blocks", 0, "vertices")


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        (at("schema", value="quasilpv.trajectory"), "schema", "expected 'quasilpv.artifact'"),
        (at("schema_version", value=3), "schema_version", "got 3, expected 1 or 2"),
        (without("schema_version"), "schema_version", "got nothing"),
        (at("units", value="imperial"), "units", "expected 'SI'"),
        (at("design_hash", value="5F" * 32), "design_hash", "expected text matching"),
        (at("joints", value=3.7), "joints", "got 3.7, expected a valid integer"),
        (at("joints", value=True), "joints", "got True, expected a valid integer"),
        (at("joints", value=0), "joints", "greater than or equal to 1"),
        (at("joints", value=8), "joints", "less than or equal to 7"),
        (at("joints", value=2), "domain.angle_rad", "got 3 entries, expected 2"),
        (at("sample_period_s", value=0), "sample_period_s", "greater than"),
        (at("sample_period_s", value="1e-3"), "sample_period_s", "got '1e-3', expected a valid number"),
        (at("sample_period_s", value=float("nan")), "sample_period_s", "got nan, expected a finite double"),
        (at("surprise", value=1), "surprise", "got 1, expected no member of this name"),
        (at("robot", "serial_number", value=1), "robot.serial_number", "no member of this name"),
        (at("witness", value=[1]), "witness", "got [1]"),
        (without("witness"), "witness", "got nothing"),
        (at("domain", "angle_rad", 1, value=[2, 1]), "domain.angle_rad[1]", "a lower bound below the upper bound"),
        (at("domain", "speed_rad_s", 0, value=[1]), "domain.speed_rad_s[0][1]", "got nothing"),
        (at("limits", "torque_nm", value=[1, 2]), "limits.torque_nm", "got 2 entries, expected 3"),
        (at("limits", "slew_nm_per_s", 2, value=0), "limits.slew_nm_per_s[2]", "greater than"),
        (
            at("law", "kind", value="lqr"),
            "law",
            f"got 'lqr', expected one of {', '.join(repr(kind) for kind in LAWS)}",
        ),
        (without("law", "kind"), "law", "got nothing, expected a member 'kind'"),
        (without("law", "observer"), "law.observer", "got nothing"),
        (at("law", "observer", value=[1, 2, 3, 4, 5]), "law.observer", "got 5 entries, expected at most 4"),
        (at("law", "observer", value=[1, 2, 3]), "law.observer[3]", "got nothing"),
        (at("law", "feedback", "kp", value=None), "law.feedback.kp", "got None, expected a valid number"),
        (
            at("law", "disturbance_compensation", value=1),
            "law.disturbance_compensation",
            "got 1, expected a valid boolean",
        ),
        (at("law", "gp", value=[1, 2, 3]), "law.gp", "no member of this name"),
        (without("programs", "gravity"), "programs", "expected ['gravity', 'premises'] for kind dob-acceleration"),
        (at("programs", "coriolis", value=ARM3_PROGRAMS["coriolis"]), "programs", "for kind dob-acceleration"),
        (at("programs", "gravity", value=ARM3_PROGRAMS["coriolis"]), "programs.gravity.code", "only angle as inputs"),
        (
            at("programs", "premises", value={"outputs": 1, "code": [["angle", 0]]}),
            "programs.premises.outputs",
            "got 1, expected 3",
        ),
        (at("programs", "premises", "code", 0, value=["angle", 3]), "programs.premises.code", "joint indices below 3"),
        (at("programs", "premises", "code", 0, value=["angle", 0.5]), "programs.premises.code[0]", "one joint index"),
        (at("programs", "premises", "code", 0, value=["tan"]), "programs.premises.code[0]", "an operation of the list"),
        (at("programs", "premises", "outputs", value=2), "programs.premises.outputs", "got 2, expected 3"),
        (at("law", "inertia", "premises", value=33), "law.inertia.premises", "less than or equal to 32"),
        (at("law", "inertia", "lower", value=[0, 0]), "law.inertia.lower", "got 2 entries, expected 3"),
        (at("law", "inertia", "upper", 1, value=-2), "law.inertia.upper[1]", "more than lower[1]"),
        (at("law", "inertia", "blocks", 0, "kind", value="simplex"), "law.inertia.blocks[0].kind", "'box'"),
        (at("law", "inertia", "blocks", 0, "premises", value=[1]), "law.inertia.blocks", "in exactly one block"),
        (without("law", "inertia", "blocks", 2), "law.inertia.blocks", "in exactly one block"),
        (without(*VERTICES, 1), "law.inertia.blocks[0].vertices", "got 1 entries, expected 2"),
        (without(*VERTICES, 1, 2), "law.inertia.blocks[0].vertices[1]", "a 3 x 3 matrix"),
        (without(*VERTICES, 1, 2, 2), "law.inertia.blocks[0].vertices[1]", "a 3 x 3 matrix"),
        (at(*VERTICES, 0, 0, 1, value=1e6), "law.inertia.blocks[0].vertices[0][0][1]", "the symmetric entry"),
    ],
)
def test_when_a_rule_of_the_format_is_broken_expect_one_line_with_field_got_and_expected(
    change: Change, field: str, message: str
) -> None:
    error = refusal(arm3_document(), change)
    assert error.field == field
    assert message in str(error)
    assert str(error).startswith("artifact.json: ")
    assert "\n" not in str(error)


def test_when_an_artifact_is_changed_in_place_expect_an_error() -> None:
    with pytest.raises(ValueError, match="frozen"):
        ARTIFACT.law.feedback.kp = 0.0
    with pytest.raises(TypeError):
        ARTIFACT.law.inertia.lower[0] = 0.0


def test_when_two_artifacts_are_compared_expect_exactly_the_fields_that_differ() -> None:
    document = arm3_document()
    document["law"]["feedback"]["kp"] = -1.0
    document["limits"]["torque_nm"][1] = 7.0
    document["verification"] = None
    differences = diff(ARTIFACT, Artifact.from_document(document))
    assert [(d.path, d.left, d.right) for d in differences] == [
        ("law.feedback.kp", -10800.0, -1.0),
        ("limits.torque_nm[1]", 1200.0, 7.0),
        ("verification", {"gate": {"margin": 0.03}}, None),
    ]
    assert diff(ARTIFACT, ARTIFACT) == []


def test_when_an_artifact_is_summarised_expect_what_it_was_made_of() -> None:
    report = summary(ARTIFACT)
    assert json.loads(json.dumps(report)) == report
    assert report["hash"] == ARTIFACT.hash
    assert (report["law"], report["joints"], report["premises"], report["vertices"]) == ("dob-acceleration", 3, 3, 6)
    assert report["gains"]["feedback"] == {"kp": -10800.0, "kd": -180.0, "ki": -216000.0}
    assert "inertia" not in report["gains"]
