"""A user's mistake is one line that names it, exit code 2, and leaves nothing."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Design, assert_refused, in_a_process
from quasilpv.documents.canonical import canonical_json, parse_document, with_hash

pytest_plugins = ["command"]


@pytest.mark.parametrize(
    ("arguments", "mentions"),
    [
        (["synth", "arm9"], ["arm9", "arm3"]),
        (["synth", "arm3", "--design", "lqr"], ["lqr", "dob-acceleration"]),
        (["synth", "arm3", "--rate-hz", "-5"], ["rate_hz", "-5"]),
        (["synth", "arm3", "--rate-hz", "nan"], ["--rate-hz", "nan"]),
        (["synth", "arm3", "--rate-hz", "fast"], ["--rate-hz"]),
        (["synth"], ["ROBOT"]),
        (["track"], ["SCENARIO"]),
        (["track", "serial-star"], ["serial-star", "serial-square"]),
        (["track", "serial-square", "--controller", "lqr"], ["lqr"]),
        (["track", "serial-square", "--plant", "broken"], ["broken", "perturbed"]),
        (["track", "serial-square", "--encoder-bits", "64"], ["64"]),
        (["track", "serial-square", "--no-compensation", "--controller", "pid"], ["pid"]),
        (["track", "serial-square", "--artifact", "missing.json"], ["missing.json"]),
        (["track", "--trajectory", "missing.json", "--robot", "arm3"], ["missing.json"]),
        (["track", "--trajectory", "missing.json"], ["--robot", "--artifact"]),
        (["track", "--trajectory", "missing.json", "--robot", "arm9"], ["arm9", "arm3"]),
        (["track", "serial-square", "--robot", "arm3"], ["--robot", "--trajectory"]),
        (["track", "serial-square", "--figure-format", "jpeg"], ["jpeg", "png, svg, pdf"]),
        (["log", "info", "LAST", "--figure-format", "svg"], ["--figure-format", "plot"]),
        (["track", "serial-square", "--artifact", "x.json", "--rate-hz", "2000"], ["--rate-hz", "--artifact"]),
        (["hil", "serial-star"], ["serial-star"]),
        (["hil"], ["SCENARIO"]),
        (["inspect", "missing.json"], ["missing.json"]),
        (["inspect", "."], ["directory"]),
        (["inspect"], ["ARTIFACT"]),
        (["paint"], ["paint"]),
        (["list", "--colour"], ["--colour"]),
    ],
)
def test_when_the_command_line_is_wrong_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, arguments: list[str], mentions: list[str]
) -> None:
    assert_refused(design(*arguments), *mentions)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["synth"], ["inspect"], ["synth", "arm3", "--design"], ["list", "--rate-hz"]])
def test_when_a_value_is_longer_than_a_line_expect_its_beginning_and_its_length(
    design: Design, arguments: list[str]
) -> None:
    outcome = design(*arguments, "a" * 5000)
    assert_refused(outcome)
    assert len(outcome.err) < 1000


@pytest.mark.parametrize("arguments", [["synth", "arm3", "--design", "pid"], ["track", "serial-square", "--json"]])
def test_when_the_output_cannot_be_written_expect_one_line_and_nothing_half_written(
    design: Design, tmp_path: Path, arguments: list[str]
) -> None:
    (tmp_path / "file").touch()
    assert_refused(design(*arguments, "--out", "file/below", *(["--controller", "pid"] * ("track" in arguments))))
    assert not [path for path in tmp_path.iterdir() if path.name not in ("file", "out")]


JUNK = {
    "empty": b"",
    "an executable": b"\x7fELF\x02\x01",
    "half an object": b"{",
    "an endless CBOR map": b"\xbf\xff",
    "null": b"null",
    "random bytes": np.random.default_rng(5).bytes(64),
    "many objects": b"{}" * 1000,
}


@pytest.mark.parametrize("junk", JUNK.values(), ids=JUNK.keys())
def test_when_the_artifact_is_junk_expect_one_line_and_exit_2(design: Design, tmp_path: Path, junk: bytes) -> None:
    (tmp_path / "junk.json").write_bytes(junk)
    assert_refused(design("inspect", "junk.json"), "junk.json")
    assert_refused(design("track", "serial-square", "--artifact", "junk.json"), "junk.json")


def flipped(data: bytes, bit: int) -> bytes:
    damaged = bytearray(data)
    damaged[bit // 8] ^= 1 << (bit % 8)
    return bytes(damaged)


def test_when_any_of_fifty_single_bits_of_an_artifact_is_flipped_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    rng = np.random.default_rng(11)
    file = tmp_path / "flipped.json"
    for bit in rng.choice(8 * len(artifact), size=50, replace=False):
        file.write_bytes(flipped(artifact, int(bit)))
        assert_refused(design("track", "serial-square", "--artifact", file), "flipped.json")
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("bit", [5, 4000, 20000])
def test_when_a_flipped_artifact_is_given_to_a_real_process_expect_one_line_and_exit_2(
    tmp_path: Path, artifact: bytes, bit: int
) -> None:
    (tmp_path / "flipped.json").write_bytes(flipped(artifact, bit))
    outcome = in_a_process("track", "serial-square", "--artifact", "flipped.json", "--json", cwd=tmp_path)
    assert_refused(outcome, "flipped.json")


@pytest.mark.parametrize(("verb", "scenario"), [("track", "stabilise-arm2"), ("hil", "stabilise-arm2")])
def test_when_the_artifact_is_of_another_robot_expect_both_named(
    design: Design, tmp_path: Path, artifact: bytes, verb: str, scenario: str
) -> None:
    (tmp_path / "arm3.json").write_bytes(artifact)
    assert_refused(design(verb, scenario, "--artifact", "arm3.json"), "robot.id: got arm3, expected arm2")


def singular(document: dict[str, Any]) -> dict[str, Any]:
    for block in document["law"]["inertia"]["blocks"]:
        block["vertices"] = [[[0.0] * 3] * 3 for _ in block["vertices"]]
    return document


def test_when_the_design_inertia_is_singular_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    document = singular(parse_document(artifact, "artifact"))
    (tmp_path / "singular.json").write_bytes(canonical_json(with_hash(document)))
    assert_refused(design("track", "serial-square", "--artifact", "singular.json", "--json"), "inertia")


@pytest.mark.parametrize(
    ("to", "mention"), [([5.0, -1.7], "distance"), ([1.9, 0.9], "short.json"), ([0.6, -0.6], "short.json")]
)
def test_when_a_path_leaves_reach_or_modelling_box_expect_one_line_with_the_reason(
    design: Design, tmp_path: Path, to: list[float], mention: str
) -> None:
    segment = {"line": {"to": to, "duration_s": 1.0}}
    path = {"name": "short", "tool_angle_rad": 0.785, "start": [1.4, -1.7], "segments": [segment]}
    (tmp_path / "short.json").write_text(json.dumps(path), encoding="utf-8")
    command = ("track", "--trajectory", "short.json", "--robot", "arm3", "--controller", "ctc")
    assert_refused(design(*command), mention)


def test_when_the_executables_are_missing_expect_one_line(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    assert_refused(design("hil", "serial-circle", "--controller", "ctc"), "qlpv-controller")
