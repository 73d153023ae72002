"""The claims that tie a law to its robot: the box covers the operating domain, the inertia table is the robot's own."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.certificate import verify
from quasilpv.cli import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope
from quasilpv.release import to_artifact
from quasilpv.synthesis import DesignRequest, Specification, synthesise
from quasilpv.systems.robots.registry import robot
from reference.checked import check_design_model
from reference.gated_arms import arm4, artifact_document, multiple_pole_loop

Document = dict[str, Any]
LOOP = multiple_pole_loop(60, 1200, 1e-3, 1e-3)
SCALE = 0.7


def acceleration(name: str) -> Document:
    """All cosines scheduled, one block each."""
    return artifact_document(arm4() if name == "arm4" else robot(name), LOOP, SCALE)


@cache
def _torque() -> Document:
    design = synthesise(DesignRequest.of("arm2", "dob-torque", Specification(rate_hz=4000.0)))
    return to_artifact(design).content()


def torque() -> Document:
    return copy.deepcopy(_torque())


def lumped(held: float) -> Document:
    """arm3 with cos(theta_2) held at a value, the other two cosines in one block."""
    document = acceleration("arm3")
    affine, table = robot("arm3").model.inertia_affine(), document["law"]["inertia"]
    polytope = BlockPolytope.takagi_sugeno(table["lower"][1:], table["upper"][1:])
    constant = SCALE * (affine.constant + held * affine.coefficients[0])
    document["law"]["inertia"] = polytope.to_document(polytope.vertices(constant, SCALE * affine.coefficients[1:]))
    code = document["programs"]["premises"]["code"]
    assert code[:2] == [["angle", 1], ["cos"]]
    document["programs"]["premises"] = {"outputs": 2, "code": code[2:]}
    return document


# ---- what holds ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm2", "arm3", "arm4"])
def test_when_a_law_is_scheduled_with_every_cosine_expect_the_box_and_the_scaled_inertia_claimed(name: str) -> None:
    claims = check_design_model(acceleration(name))
    joints = (arm4() if name == "arm4" else robot(name)).model.joints
    assert len(claims) == joints * (joints - 1) // 2 + 1
    assert all(claim.holds and claim.margin > 0.9 for claim in claims)
    assert claims[-1].name == "inertia table: 0.7 times the robot's own"


def test_when_a_cosine_is_held_expect_its_value_claimed_and_how_far_it_is_from_those_it_does_not_take() -> None:
    low, high = (float(np.cos(angle)) for angle in (2.044, 0.960))  # theta_2 of arm3
    held = 0.75 * low + 0.25 * high
    claims = {claim.name: claim for claim in check_design_model(lumped(held))}
    (name,) = (name for name in claims if "held" in name)
    assert name == f"inertia table: cos(theta_2) held at {held:.4g}, a value it takes"
    assert claims[name].holds
    assert claims[name].margin == pytest.approx(0.25, rel=1e-9)
    assert all(claim.holds for claim in claims.values())


def test_when_the_domain_ends_exactly_at_a_bound_expect_it_covered_and_one_ulp_less_refused() -> None:
    document = torque()
    (low, high), table = document["domain"]["angle_rad"][1], document["law"]["inertia"]
    assert low < 0.0 < high
    assert table["upper"] == [1.0]  # cos(0), reached inside the interval
    assert check_design_model(document)[0].holds
    table["upper"] = [math.nextafter(1.0, 0.0)]
    claim = check_design_model(document)[0]
    assert not claim.holds
    assert claim.margin < 0.0


# ---- what does not hold is refused -----------------------------------------------------------------------------------

Change = Callable[[Document], object]


def vertex(document: Document) -> list[list[float]]:
    return document["law"]["inertia"]["blocks"][0]["vertices"][0]  # type: ignore[no-any-return]


def scaled_link(field: str, factor: float) -> Change:
    def change(document: Document) -> None:
        document["robot"]["parameters"]["links"][1][field] *= factor

    return change


def widened(joint: int, by_rad: float) -> Change:
    def change(document: Document) -> None:
        document["domain"]["angle_rad"][joint][1] += by_rad

    return change


def bumped(row: int, column: int, by: float) -> Change:
    """A symmetric change of one vertex, the others as they are: no longer affine, or of another robot."""

    def change(document: Document) -> None:
        first = vertex(document)
        first[row][column] *= by
        first[column][row] = first[row][column]

    return change


def negated(document: Document) -> None:
    for block in document["law"]["inertia"]["blocks"]:
        for matrix in block["vertices"]:
            matrix[:] = [[-entry for entry in row] for row in matrix]


def narrowed(document: Document) -> None:
    for name in ("inertia", "feedback", "observer"):
        if "lower" in document["law"][name]:
            document["law"][name]["lower"][0] += 1e-9


def swapped_premises(document: Document) -> None:
    """theta_3 where theta_2 was: the program and the table no longer speak of the same cosine."""
    code = document["programs"]["premises"]["code"]
    assert code[0] == ["angle", 1]
    assert code[2] == ["angle", 2]
    code[0], code[2] = code[2], code[0]


MUTANTS: dict[str, tuple[Callable[[], Document], Change, str]] = {
    "a wider domain, every cosine": (lambda: acceleration("arm3"), widened(2, 0.01), "premise box"),
    "a wider domain, torque law": (torque, widened(1, 1e-6), "premise box"),
    "a narrower box": (torque, narrowed, "premise box"),
    "a heavier link": (lambda: acceleration("arm3"), scaled_link("mass_kg", 1.001), "inertia table"),
    "another moment of inertia": (lambda: acceleration("arm2"), scaled_link("inertia_kg_m2", 1.0 + 1e-9), "inertia"),
    "another centre of mass": (torque, scaled_link("com_m", 0.999), "inertia table"),
    "a changed diagonal": (torque, bumped(0, 0, 1.0 + 1e-10), "inertia table"),
    "a changed last entry": (torque, bumped(1, 1, 1.01), "inertia table"),
    "a changed coupling": (lambda: acceleration("arm3"), bumped(0, 2, 1.0 + 1e-9), "inertia table"),
    "a negative inertia": (lambda: acceleration("arm2"), negated, "positive multiple"),
    "swapped premises": (lambda: acceleration("arm3"), swapped_premises, "inertia table"),
    "a cosine held where it never is": (lambda: lumped(0.6), lambda document: None, "cos(theta_2) held at 0.6"),
    "a cosine held at the other sign": (lambda: lumped(-0.5), lambda document: None, "cos(theta_2) held at -0.5"),
}


@pytest.mark.parametrize("what", MUTANTS)
def test_when_the_law_is_not_that_of_its_robot_or_domain_expect_the_claim_refused_by_name(what: str) -> None:
    make, change, name = MUTANTS[what]
    document = make()
    change(document)
    refused = [claim for claim in check_design_model(document) if not claim.holds]
    assert any(name in claim.name for claim in refused), [claim.name for claim in refused]
    assert all(-1.0 <= claim.margin < 0.0 for claim in refused)


@pytest.mark.parametrize("change", [widened(1, 0.01), scaled_link("mass_kg", 1.01)])
def test_when_the_hash_is_made_again_expect_exit_1_and_the_claim_named(
    change: Change, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = torque()
    assert verify(document).verified
    change(document)
    file = tmp_path / "artifact.json"
    file.write_bytes(canonical_json(with_hash(document)))
    assert run(["verify", str(file), "--json"]) == 1
    failed = json.loads(capsys.readouterr().out)["failed"]
    assert failed
    assert all(name.startswith(("premise box: cos(theta_2)", "inertia table: ")) for name in failed)


def test_when_the_robot_is_no_serial_arm_expect_an_input_error() -> None:
    document = torque()
    del document["robot"]["parameters"]["links"]
    with pytest.raises(InputError, match=r"robot\.parameters\.links: got nothing"):
        verify(document)
