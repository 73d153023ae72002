"""What an artifact of a general system says of premises outside their box, in both versions of its schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from quasilpv import _runtime
from quasilpv.artifact.system_store import read_system_artifact, system_summary
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError
from reference.released_systems import released


def old_content() -> dict[str, Any]:
    """As version 1 had it."""
    content = released("two-tanks").content()
    del content["law"]["premise_fault_s"], content["observer"]
    return {**content, "schema_version": 1}


def test_a_file_of_version_1_is_read_as_it_was_by_both_sides(tmp_path: Path) -> None:
    document = with_hash(old_content())
    path = tmp_path / "artifact.json"
    path.write_bytes(canonical_json(document))
    read = read_system_artifact(path)
    assert read is not None
    assert read.to_document() == document
    assert read.law.premise_fault_s == 1.0
    assert _runtime.SystemArtifact.load(str(path)).hash == read.hash
    assert read.hash != released("two-tanks").hash


@pytest.mark.parametrize("version", [1, 2])
def test_a_version_without_its_members_is_refused_by_both_sides(version: int) -> None:
    content = old_content() if version == 2 else released("two-tanks").content()
    content["schema_version"] = version
    with pytest.raises(InputError, match=r"premise_fault_s|observer"):
        validate(SystemArtifactDocument, content, "test")
    with pytest.raises(InputError, match=r"premise_fault_s|observer"):
        _runtime.SystemArtifact.parse(canonical_json(with_hash(content)))


@pytest.mark.parametrize(("policy", "said"), [("clamp", "no fault"), ("fault", "at once"), ("0.25", "after 0.25 s")])
def test_the_command_states_the_policy(
    policy: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(
        "import quasilpv as ql\n"
        "plant = ql.DescriptorSystem.from_equations(\n"
        "    ['x\\' = sin(x) + u'], state='x', inputs='u', domain={'x': (-1, 1)}, name='mine'\n"
        ")\n",
        encoding="utf-8",
    )
    options = ["--input-limit", "u=5", "--premise-policy", policy, "-o", "out", "--json"]
    assert run(["synth", "mine.py:plant", *options]) == 0
    assert said in json.loads(capsys.readouterr().out)["premise_outside"]
    read = read_system_artifact("out/artifact.json")
    assert read is not None
    assert said in system_summary(read)["premise_outside"]
    assert run(["synth", "mine.py:plant", "--premise-policy", "-1"]) == 2
    assert "--premise-policy" in capsys.readouterr().err
