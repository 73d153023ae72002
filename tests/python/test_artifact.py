"""Artifacts: both twins, damage, the rules of the format, comparison and summary."""

import copy
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.artifact import Artifact, diff, evaluate, read_artifact, summary, write_artifact
from quasilpv.artifact.canonical import canonical_cbor, canonical_json, parse_document, with_hash
from quasilpv.artifact.compilation import compile_program
from quasilpv.artifact.schema import REQUIRED_PROGRAMS
from quasilpv.artifact.tables import PolytopeTable
from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.registry import robot

W = 47.12388980384690
GAINS = {"p": [24.28e4, 6.413e4, 8.66e3], "d": [5.152e3, 1.361e3, 183.8], "i": [3.814e6, 1.007e6, 1.36e5]}
LAWS: dict[str, dict[str, Any]] = {
    "dob-acceleration": {
        "feedback": {"kp": -3 * 60.0**2, "kd": -180.0, "ki": -(60.0**3)},
        "observer": [2.9, 2534.7, 1.0132e6, 1.5e8],
        "filter_time_constant_s": 1e-3,
        "disturbance_compensation": True,
    },
    "dob-torque": {"filter_time_constant_s": 5e-4},  # and gain tables, made with the inertia
    "pid": {**{f"k{name}": gains for name, gains in GAINS.items()}, "velocity_filter_time_constant_s": 2e-3},
    "ctc": {
        **{"gp": [3 * W**2] * 3, "gd": [3 * W] * 3, "gi": [W**3] * 3},
        "velocity_filter_time_constant_s": 2e-3,
        "disturbance_observer_bandwidth_rad_s": 0,
    },
    "ctc-dob": {
        **{"gp": [3 * W**2] * 3, "gd": [3 * W] * 3, "gi": [W**3] * 3},
        "velocity_filter_time_constant_s": 0.0,
        "disturbance_observer_bandwidth_rad_s": 50.0,
    },
}


SCHEDULE_GAINS = np.array([np.hstack([-(i + 3.0) * np.eye(3), -np.eye(3)]) for i in range(64)])
SCHEDULE_LYAPUNOV = np.array([np.diag([2.0 + i, 2.0, 2.0, 5.0, 5.0, 5.0]) for i in range(4)])


def schedule_table(vertices: Any) -> dict[str, Any]:
    """A table over the premises of ``schedule``."""
    return BlockPolytope.per_premise([-1.0, -2.0], [1.0, 2.0]).to_document(vertices)


STABILISING = {
    "state-feedback": {"gain": schedule_table(SCHEDULE_GAINS[:4])},
    "descriptor-feedback": {
        "numerator": schedule_table(SCHEDULE_GAINS[:4]),
        "lyapunov": SCHEDULE_LYAPUNOV[0].tolist(),
    },
    "delayed-feedback": {
        "lyapunov": schedule_table(SCHEDULE_LYAPUNOV),
        "numerators": SCHEDULE_GAINS.tolist(),
        "window_samples": 20,
        "descriptor": True,
    },
}
LAWS |= {kind: {**law, "velocity_filter_time_constant_s": 2e-3} for kind, law in STABILISING.items()}


def arm3_programs() -> dict[str, Any]:
    """The programs of the 3-DoF arm, compiled from its symbolic model."""
    arm3 = robot("arm3")
    symbolic = arm3.model.symbolic
    angles = {symbol: ("angle", i) for i, symbol in enumerate(symbolic.theta)}
    speeds = {symbol: ("speed", i) for i, symbol in enumerate(symbolic.omega)}
    rates = sp.symbols("rate_1:4", real=True)
    reference_speeds = {symbol: ("reference_speed", i) for i, symbol in enumerate(rates)}
    return {
        "premises": compile_program([premise.expression for premise in symbolic.inertia_premises(arm3.domain)], angles),
        "gravity": compile_program(list(symbolic.gravity), angles),
        "coriolis": compile_program(list(symbolic.coriolis * sp.Matrix(symbolic.omega)), {**angles, **speeds}),
        "schedule": compile_program(
            [sp.cos(symbolic.theta[1]), symbolic.omega[0] * sp.sin(symbolic.theta[1])], {**angles, **speeds}
        ),
        "coriolis_reference": compile_program(
            list(symbolic.coriolis * sp.Matrix(rates)), {**angles, **speeds, **reference_speeds}
        ),
    }


ARM3_PROGRAMS = {name: program.model_dump(mode="json") for name, program in arm3_programs().items()}


def arm3_document(kind: str = "dob-acceleration") -> dict[str, Any]:
    """A realistic artifact of the 3-DoF arm as a JSON tree."""
    arm3 = robot("arm3")
    bounds = [premise.bounds for premise in arm3.model.inertia_premises(arm3.domain)]
    polytope = BlockPolytope.per_premise(*np.array(bounds).T)
    affine = arm3.model.inertia_affine()
    inertia = polytope.to_document(polytope.vertices(affine.constant, affine.coefficients))
    law = {"kind": kind, **LAWS[kind], "inertia": inertia}
    if kind == "dob-torque":
        vertices = np.ones((polytope.vertex_count, 3, 9)) * np.arange(9.0)
        law["feedback"] = polytope.to_document(-vertices)
        law["observer"] = polytope.to_document(np.concatenate([vertices.swapaxes(1, 2), vertices[:, :, :3]], axis=1))
    document = {
        "schema": "quasilpv.artifact",
        "schema_version": 1,
        "name": f"arm3-{kind}-1000hz",
        "creator": {"tool": "design", "version": "0.1.0"},
        "design_hash": "5f" * 32,
        "units": "SI",
        "sample_period_s": 1e-3,
        "joints": 3,
        "robot": {"id": "arm3", "parameters": arm3.model.parameters_document()},
        "payloads": arm3.payloads.to_document(),
        "domain": arm3.domain.to_document(),
        "limits": arm3.limits.to_document(),
        "programs": {name: ARM3_PROGRAMS[name] for name in REQUIRED_PROGRAMS[kind]},
        "law": law,
        "witness": {"condition": "chain-lmi", "P": [[1.5, 0.25], [0.25, 2.0]]},
        "verification": {"gate": {"margin": 0.03}},
    }
    return copy.deepcopy(document)


ARTIFACT = Artifact.from_document(arm3_document())
TWINS = {"json": canonical_json(ARTIFACT.to_document()), "cbor": canonical_cbor(ARTIFACT.to_document())}


@pytest.mark.parametrize("kind", LAWS)
def test_when_an_artifact_is_written_expect_both_twins_to_read_back_equal(kind: str, tmp_path: Path) -> None:
    artifact = Artifact.from_document(arm3_document(kind))
    paths = write_artifact(tmp_path / "new" / "folder", artifact)
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == ["artifact.cbor", "artifact.json"]
    for path in paths:
        assert read_artifact(path) == artifact
        assert read_artifact(path).hash == artifact.hash
    assert json.loads(paths[0].read_bytes())["hash"] == artifact.hash


def test_when_an_artifact_is_written_again_from_its_own_file_expect_the_same_bytes(tmp_path: Path) -> None:
    first = write_artifact(tmp_path / "a", ARTIFACT)
    second = write_artifact(tmp_path / "b", read_artifact(first[1]))
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


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


@pytest.mark.parametrize("twin", TWINS)
def test_when_2000_bits_are_flipped_one_by_one_expect_every_damaged_file_refused(twin: str) -> None:
    data = TWINS[twin]
    rng = np.random.default_rng(2000)
    for bit in rng.choice(8 * len(data), size=2000, replace=False):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(InputError) as error:
            Artifact.from_document(parse_document(bytes(damaged), f"artifact.{twin}"), f"artifact.{twin}")
        assert str(error.value).startswith(f"artifact.{twin}: ")
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("twin", TWINS)
def test_when_a_file_is_cut_short_at_any_byte_expect_it_refused(twin: str) -> None:
    for size in range(len(TWINS[twin])):
        with pytest.raises(InputError):
            parse_document(TWINS[twin][:size], "artifact")


@given(st.data())
def test_when_a_number_anywhere_is_changed_and_the_hash_kept_expect_it_refused(data: st.DataObject) -> None:
    document = ARTIFACT.to_document()
    row = document["law"]["inertia"]["blocks"][0]["vertices"][0][0]
    i = data.draw(st.integers(0, len(row) - 1))
    row[i] = data.draw(st.floats(-1e6, 1e6).filter(lambda x: x != row[i]))
    with pytest.raises(InputError, match="hash"):
        parse_document(canonical_json(document), "artifact")


def at(*path: str | int, value: Any) -> Callable[[dict], None]:
    """A change of the document that sets the field at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


def without(*path: str | int) -> Callable[[dict], None]:
    """A change of the document that removes the field at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return change


VERTICES = ("law", "inertia", "blocks", 0, "vertices")


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        (at("schema", value="quasilpv.trajectory"), "schema", "expected 'quasilpv.artifact'"),
        (at("schema_version", value=2), "schema_version", "got 2, expected 1"),
        (without("schema_version"), "schema_version", "got nothing"),
        (at("units", value="imperial"), "units", "expected 'SI'"),
        (at("design_hash", value="5F" * 32), "design_hash", "expected text matching"),
        (at("joints", value=3.7), "joints", "got 3.7, expected a valid integer"),
        (at("joints", value=True), "joints", "got True, expected a valid integer"),
        (at("joints", value=0), "joints", "greater than or equal to 1"),
        (at("joints", value=8), "joints", "less than or equal to 7"),
        (at("joints", value=2), "domain.angle_rad", "got 3 entries, expected 2"),
        (at("sample_period_s", value=0), "sample_period_s", "greater than 0"),
        (at("sample_period_s", value="1e-3"), "sample_period_s", "got '1e-3', expected a valid number"),
        (at("sample_period_s", value=float("nan")), "sample_period_s", "got nan, expected a finite double"),
        (at("surprise", value=1), "surprise", "got 1, expected no member of this name"),
        (at("robot", "serial_number", value=1), "robot.serial_number", "no member of this name"),
        (at("witness", value=[1]), "witness", "got [1]"),
        (without("witness"), "witness", "got nothing"),
        (at("domain", "angle_rad", 1, value=[2, 1]), "domain.angle_rad[1]", "a lower bound below the upper bound"),
        (at("domain", "speed_rad_s", 0, value=[1]), "domain.speed_rad_s[0][1]", "got nothing"),
        (at("limits", "torque_nm", value=[1, 2]), "limits.torque_nm", "got 2 entries, expected 3"),
        (at("limits", "slew_nm_per_s", 2, value=0), "limits.slew_nm_per_s[2]", "greater than 0"),
        (
            at("law", "kind", value="lqr"),
            "law",
            f"got 'lqr', expected one of {', '.join(repr(kind) for kind in REQUIRED_PROGRAMS)}",
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
    change: Callable[[dict], None], field: str, message: str
) -> None:
    document = arm3_document()
    change(document)
    with pytest.raises(InputError) as error:
        Artifact.from_document(document, "artifact.json")
    assert error.value.field == field
    assert message in str(error.value)
    assert str(error.value).startswith("artifact.json: ")
    assert "\n" not in str(error.value)


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
def test_when_a_gain_table_does_not_fit_the_inertia_expect_it_named(
    change: Callable[[dict], None], field: str, message: str
) -> None:
    document = arm3_document("dob-torque")
    change(document)
    with pytest.raises(InputError) as error:
        Artifact.from_document(document, "artifact.json")
    assert (error.value.field, message in str(error.value)) == (field, True)


def premultiplied() -> dict:
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
def test_when_a_premultiplication_breaks_a_rule_expect_it_named(change: Callable[[dict], None], message: str) -> None:
    document = premultiplied()
    change(document)
    with pytest.raises(InputError) as error:
        Artifact.from_document(document, "artifact.json")
    assert error.value.field.startswith("law.premultiplication")
    assert message in str(error.value)


DELAYED = ("law", "lyapunov", "blocks", 1, "vertices", 0)


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
    kind: str, change: Callable[[dict], None], field: str, message: str
) -> None:
    document = arm3_document(kind)
    change(document)
    with pytest.raises(InputError) as error:
        Artifact.from_document(document, "artifact.json")
    assert error.value.field.startswith(field)
    assert message in str(error.value)


def test_when_gain_tables_are_exchanged_expect_the_size_of_a_vertex_named() -> None:
    document = arm3_document("dob-torque")
    law = document["law"]
    law["feedback"], law["observer"] = law["observer"], law["feedback"]
    with pytest.raises(InputError, match=r"law.feedback.blocks\[0\].vertices\[0\]: got 12 x 3, expected 3 x 9"):
        Artifact.from_document(document, "artifact.json")


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


def test_when_an_artifact_is_changed_in_place_expect_an_error() -> None:
    with pytest.raises(ValueError, match="frozen"):
        ARTIFACT.law.feedback.kp = 0.0
    with pytest.raises(TypeError):
        ARTIFACT.law.inertia.lower[0] = 0.0


def test_when_writing_fails_half_way_expect_the_old_files_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path.name: path.read_bytes() for path in write_artifact(tmp_path, ARTIFACT)}
    changed = Artifact.from_document({**arm3_document(), "name": "other"})
    synced: list[int] = []

    def fail_on_the_second_file(descriptor: int) -> None:
        synced.append(descriptor)
        if len(synced) == 2:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail_on_the_second_file)
    with pytest.raises(InputError, match="No space left on device"):
        write_artifact(tmp_path, changed)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_when_the_target_directory_is_a_file_expect_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="a writable file"):
        write_artifact(tmp_path / "file", ARTIFACT)


def test_when_a_file_is_missing_or_a_directory_expect_input_error_with_its_name(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere.json", tmp_path):
        with pytest.raises(InputError, match="a readable file") as error:
            read_artifact(path)
        assert error.value.source == str(path)


def test_when_a_trajectory_is_read_as_an_artifact_expect_its_schema_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_bytes(canonical_json(with_hash({"schema": "quasilpv.trajectory"})))
    with pytest.raises(InputError, match="schema"):
        read_artifact(path)


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
