"""Designs that are shipped: taken for exactly what they answer, and believed only after they were verified again."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from quasilpv.cli.track import CONTROLLERS_IN_SPACE
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.errors import ClaimError, InputError
from quasilpv.experiments import designs
from quasilpv.experiments.designs import kept_design, shipped_design
from quasilpv.release import checked_artifact
from quasilpv.synthesis import DesignRequest, specification_for, synthesise
from quasilpv.systems.robots.registry import any_robot

UR5 = any_robot("ur5")


@pytest.mark.parametrize("controller", CONTROLLERS_IN_SPACE)
def test_every_controller_of_the_table_is_shipped_and_still_answers_its_request(
    controller: str, tmp_path: Path
) -> None:
    def searched(done: int, total: int) -> None:
        raise AssertionError("a shipped design is read")

    found = kept_design(DesignRequest.of(UR5, controller), folder=tmp_path, progress=searched)
    assert found.name == f"ur5-{controller}-1000hz"
    assert list(tmp_path.iterdir()) == []


def test_another_request_is_not_answered_by_a_shipped_design() -> None:
    asked = DesignRequest.of(UR5)
    lively = specification_for(UR5, torque_activity=0.15)
    assert shipped_design(asked) is not None
    assert shipped_design(replace(asked, specification=lively)) is None
    assert shipped_design(replace(asked, compensated=False)) is None
    assert shipped_design(replace(asked, robot=any_robot("arm3"))) is None
    assert shipped_design(replace(asked, robot=replace(UR5, payload=None))) is None


def heavier(document: dict[str, Any]) -> None:
    document["payloads"]["load"]["mass_kg"] = 6.0


def tighter(document: dict[str, Any]) -> None:
    document["witness"]["chain"]["highest"]["bound"] *= 0.98


@pytest.mark.parametrize(
    ("change", "error", "reason"),
    [(tighter, ClaimError, "does not hold"), (heavier, InputError, "payloads: got others")],
)
def test_a_shipped_file_that_was_changed_is_refused(
    change: Callable[[dict[str, Any]], None],
    error: type[Exception],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    document = json.loads((designs.SHIPPED / "ur5/dob-acceleration.json").read_bytes())
    del document["hash"]
    change(document)
    (tmp_path / "ur5").mkdir()
    (tmp_path / "ur5/dob-acceleration.json").write_bytes(canonical_json(with_hash(document)))
    monkeypatch.setattr(designs, "SHIPPED", tmp_path)
    with pytest.raises(error, match=reason):
        kept_design(DesignRequest.of(UR5))


@pytest.mark.full
@pytest.mark.parametrize("controller", CONTROLLERS_IN_SPACE)
def test_a_shipped_design_is_as_good_as_one_made_now(controller: str) -> None:
    asked = DesignRequest.of(UR5, controller)
    shipped, made = shipped_design(asked), checked_artifact(synthesise(asked))
    assert shipped is not None
    gains = [artifact.verification["report"]["disturbance_gain_s2"] for artifact in (shipped, made)]
    assert gains[0] == pytest.approx(gains[1], rel=0.05)  # the descents end where their constraints meet, not exactly
