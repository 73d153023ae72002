"""The command design as its tests call it: in this process, in an empty folder, or in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from quasilpv.cli import run


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Design = Callable[..., Outcome]


@pytest.fixture
def design(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Design:
    """The command in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call


@pytest.fixture(scope="module")
def artifact(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Bytes of a valid artifact."""
    folder = tmp_path_factory.mktemp("pid")
    assert run(["synth", "arm3", "--design", "pid", "-o", str(folder), "--json"]) == 0
    return (folder / "artifact.json").read_bytes()


def assert_refused(outcome: Outcome, *mentions: str, code: int = 2) -> None:
    assert outcome.code == code
    assert outcome.out == ""
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1
    for text in mentions:
        assert text in outcome.err


def in_a_process(*arguments: object, cwd: Path) -> Outcome:
    command = [sys.executable, "-m", "quasilpv", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)
