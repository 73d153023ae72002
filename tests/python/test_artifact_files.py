"""Files of artifacts: both twins, damage, and writing that fails."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.documents.canonical import canonical_cbor, canonical_json, parse_document, with_hash
from quasilpv.errors import InputError
from reference.artifacts import LAWS, arm3_document

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
