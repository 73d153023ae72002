"""The one document of a robot: the same in artifacts and scenarios, typed by its tag, read without one from before."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import Artifact
from quasilpv.documents.mechanism import FiveBar, MechanismDocument, SerialArm, SpringDisc, Tree
from quasilpv.documents.robot import ARTIFACT_VERSION, read_mechanism, read_payloads
from quasilpv.errors import InputError
from quasilpv.scenarios import build_scenario
from quasilpv.systems.robots.registry import robot, robots
from quasilpv.trajectories import rest
from reference.artifacts import arm3_document
from reference.random_trees import random_tree

KINDS = {"arm2": SerialArm, "arm2-upright": SerialArm, "arm3": SerialArm, "fivebar": FiveBar, "spring-disc": SpringDisc}


def tree_parameters(n: int = 3) -> dict[str, Any]:
    return random_tree(np.random.default_rng(4), n).parameters_document()


@pytest.mark.parametrize("name", [entry.id for entry in robots()])
def test_every_robot_describes_itself_as_a_mechanism_with_a_payload_set_of_its_form(name: str) -> None:
    entry = robot(name)
    mechanism = read_mechanism(entry.model.parameters_document())
    assert isinstance(mechanism, KINDS.get(name, MechanismDocument))
    assert mechanism.joints == entry.model.joints
    read_payloads(entry.payloads.to_document(), mechanism)


@pytest.mark.parametrize("name", KINDS)
def test_the_plant_of_a_scenario_is_the_same_mechanism(name: str) -> None:
    entry = robot(name)
    plant = build_scenario(entry, rest("rest", entry.model.joints, 1.0), plant="nominal").plant
    mechanism = read_mechanism(entry.model.parameters_document())
    shared = (type(mechanism).model_fields.keys() & type(plant).model_fields.keys()) - {"gravity_m_s2"}
    assert {"kind"} < shared
    assert all(getattr(plant, field) == getattr(mechanism, field) for field in shared)


@pytest.mark.parametrize("name", KINDS)
def test_parameters_of_before_there_were_tags_are_the_same_mechanism(name: str) -> None:
    tagged = robot(name).model.parameters_document()
    untagged = {field: value for field, value in tagged.items() if field != "kind"}
    assert read_mechanism(untagged, version=1) == read_mechanism(tagged)
    with pytest.raises(InputError, match=r"robot\.parameters: got nothing, expected a member 'kind'"):
        read_mechanism(untagged)


def test_an_artifact_of_before_keeps_its_content_and_its_hash() -> None:
    document = arm3_document() | {"schema_version": 1}
    del document["robot"]["parameters"]["kind"]
    before = Artifact.from_document(document)
    assert "kind" not in before.content()["robot"]["parameters"]
    assert Artifact.from_document(before.to_document()).hash == before.hash
    tagged = Artifact.from_document(arm3_document())
    assert tagged.schema_version == ARTIFACT_VERSION
    assert tagged.mechanism == before.mechanism
    assert tagged.hash != before.hash


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "delta"}, "'delta', expected one of 'serial-arm', 'five-bar', 'spring-disc', 'tree'"),
        ({"radius_m": 1.0}, r"robot\.parameters\.radius_m: got 1\.?0?, expected no member of this name"),
        ({"equilibrium": "sideways"}, r"robot\.parameters\.equilibrium: got 'sideways'"),
    ],
)
def test_what_is_no_mechanism_is_refused_with_its_field(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_mechanism(robot("arm3").model.parameters_document() | change)


def test_a_payload_set_of_another_mechanism_is_refused() -> None:
    arm, disc = robot("arm3"), robot("spring-disc")
    mechanism = read_mechanism(arm.model.parameters_document())
    with pytest.raises(InputError, match=r"payloads\."):
        read_payloads(disc.payloads.to_document(), mechanism)
    with pytest.raises(InputError, match=r"payloads\.mass_scale: got 2 entries, expected 3"):
        read_payloads(arm.payloads.to_document() | {"mass_scale": [1.0, 1.0]}, mechanism)
    with pytest.raises(InputError, match=r"payloads\.fraction: got \[0\.0, 2\.0\]"):
        read_payloads(arm.payloads.to_document() | {"fraction": [0.0, 2.0]}, mechanism)


# ---- robots in space -------------------------------------------------------------------------------------------------


def tree_artifact() -> dict[str, Any]:
    """A law whose design inertia is the robot itself."""
    document = arm3_document()
    parameters = tree_parameters()
    return document | {
        "robot": {"id": "space", "parameters": parameters},
        "payloads": {"link_tolerance": 0.05, "rotor_tolerance": [0.1] * 3, "load": None},
        "programs": {},
        "law": document["law"] | {"inertia": parameters},
    }


def test_a_law_may_have_a_robot_in_space_for_its_design_inertia() -> None:
    artifact = Artifact.from_document(tree_artifact())
    assert isinstance(artifact.mechanism, Tree)
    assert artifact.law.inertia == artifact.mechanism
    assert Artifact.from_document(artifact.to_document()) == artifact


def test_when_such_a_law_brings_programs_or_another_number_of_joints_expect_it_refused() -> None:
    document = tree_artifact()
    with pytest.raises(InputError, match="programs"):
        Artifact.from_document(document | {"programs": arm3_document()["programs"]})
    other = document | {"law": document["law"] | {"inertia": tree_parameters(2)}}
    with pytest.raises(InputError, match=r"law\.inertia\.joints: got 2 entries, expected 3"):
        Artifact.from_document(other)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rotation", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
        ("axis", [0.0, 0.0, 2.0]),
        ("rotational_kg_m2", [[1.0, 0.5, 0.0], [0.4, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("mass_kg", 0.0),
        ("friction_viscous_nm_s", 1.0),
    ],
)
def test_when_a_body_or_a_frame_is_none_expect_the_joint_named(field: str, value: Any) -> None:
    parameters = copy.deepcopy(tree_parameters())
    parameters["joints"][1][field] = value
    with pytest.raises(InputError, match=r"robot\.parameters\.joints\[1\]"):
        read_mechanism(parameters)
