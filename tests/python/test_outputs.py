"""Every verb with outputs that cannot be written: exit codes, one line, and nothing destroyed.

The verbs come from the table of the command; a new one is covered once `CALLS` says how to call it cheaply.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO
from unittest.mock import MagicMock

import pytest

import quasilpv as ql
from quasilpv.artifact import write_artifact
from quasilpv.cli import run
from quasilpv.cli.verbs import VERBS
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.files import claim_file, claim_folder, one_command
from quasilpv.release import release
from quasilpv.scenarios import Sensors, TrackingExperiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.telemetry import LOG_NAME
from quasilpv.trajectories import rest

READER_LEFT = 141


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An artifact with everything that can be checked, a log, and the description of a robot."""
    folder = tmp_path_factory.mktemp("inputs")
    artifact = release(DesignRequest.of("arm2", "dob-acceleration", Specification())).artifact
    experiment = TrackingExperiment("hold", robot("arm2"), rest("hold", 2, 0.05), external_torque=())
    track(RunSetup(experiment, artifact, plant="nominal", sensors=Sensors()), folder)
    described = folder / ROBOT.name
    described.write_bytes(ROBOT.read_bytes())
    artifact_path = write_artifact(folder, artifact)[0]
    system = ql.DescriptorSystem.from_equations(
        ["x' = x^2 + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="square"
    )
    made = ql.stabilise(system, decay_rate=1.0, input_limits={"u": 5.0}).write(folder / "square")
    files = {"ARTIFACT": artifact_path, "SYSTEM": made, "LOG": folder / LOG_NAME, "ROBOT": described}
    return {word: str(path) for word, path in files.items()}


# ---- calls -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Call:
    """A call of a verb that takes a moment, and what it writes.

    Attributes:
        arguments: of the verb; ARTIFACT and LOG stand for files.
        answers: what names of the package return instead of working for minutes.
        folder, file: the option for its output is of this kind.
        says: on standard output even without ``--json``.
    """

    arguments: tuple[str, ...] = ()
    answers: tuple[tuple[str, object], ...] = ()
    folder: bool = False
    file: bool = False
    says: bool = True


RELEASED = {"artifact": {}, "name": "name", "report": {}, "verification": {}}
QUESTION = ("ex-I.1", "--condition", "II.6")
ROBOT = Path(__file__).parents[1] / "data" / "robots" / "two_links.xml"
CALLS = {
    "new": Call(("robot", "ROBOT"), file=True),
    "robot": Call(("show", "ROBOT"), file=True),
    "demo": Call(
        (),
        (("cli.synth.write_released", RELEASED), ("cli.track.run_all", [])),
        folder=True,
        says=False,
    ),
    "list": Call(),
    "synth": Call(
        ("arm3", "--design", "pid"), (("cli.synth.write_released", RELEASED | {"report": {"a": 1}}),), folder=True
    ),
    "inspect": Call(("ARTIFACT",)),
    "verify": Call(("ARTIFACT",)),
    "robust": Call(("ARTIFACT",), folder=True),
    "export": Call(("SYSTEM",), file=True, says=False),
    "simulate": Call(("SYSTEM", "--duration", "0.05"), folder=True),
    "export-sdp": Call(("ARTIFACT",), file=True, says=False),
    "track": Call(("stabilise-arm2", "--no-figures"), (("cli.track.run_all", []),), folder=True, says=False),
    "animate": Call(
        ("stabilise-arm2",),
        (("cli.animate._animate", {}), ("cli.gallery.Gallery", MagicMock()), ("cli.session.Session.run", None)),
        True,
    ),
    "hil": Call(("stabilise-arm2", "--controller", "pdc", "--no-log"), folder=True),
    "log": Call(("info", "LOG")),
    "view": Call(
        ("--log", "LOG", "--no-browser"),
        (("view.page.Page", MagicMock(url="http://127.0.0.1")), ("cli.view._run", None)),
    ),
    "solve": Call((*QUESTION, "--set", "b=2.5")),
    "boundary": Call((*QUESTION, "--over", "b=0:1")),
    "region": Call((*QUESTION, "--x", "a=0:1:2", "--y", "b=0:1:2", "-j", "1"), folder=True),
    "complexity": Call(QUESTION),
    "reproduce": Call(("fig-II.1", "--quick"), (("reproduction.reproduce", []),), folder=True),
}
WITHOUT_JSON = {"view"}
MORE = {
    "log plot": Call(("plot", "LOG"), (("figures.gallery.write_gallery", [Path("path.png")]),), folder=True),
    "log to-mcap": Call(("to-mcap", "LOG"), file=True),
    "new system": Call(("system",), file=True, says=False),
}
"""Actions of a verb that write files."""

Design = Callable[..., int]


@pytest.fixture
def design(inputs: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Design:
    """Calls a verb as `CALLS` says, in this process and an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(name: str, *more: str) -> int:
        verb = name.split(maxsplit=1)[0]
        wanted = {**CALLS, **MORE}[name]
        for stub, value in wanted.answers:
            monkeypatch.setattr(f"quasilpv.{stub}", MagicMock(return_value=value))
        return run([verb, *(inputs.get(word, word) for word in wanted.arguments), *more])

    return call


def test_every_verb_is_called_here() -> None:
    assert CALLS.keys() == VERBS.keys()
    outputs = {name.split()[0] for name, call in {**CALLS, **MORE}.items() if call.folder or call.file}
    with_option = {
        name for name, verb in VERBS.items() if any("--out" in parameter.opts for parameter in verb.load(name).params)
    }
    assert outputs == with_option


# ---- standard output -------------------------------------------------------------------------------------------------


def full() -> int:
    return os.open("/dev/full", os.O_WRONLY)


def closed() -> int:
    """What the command finds, and opens, where its caller closed the stream: nothing can be written on it."""
    return os.open(os.devnull, os.O_RDONLY)


def left() -> int:
    reading, writing = os.pipe()
    os.close(reading)
    return writing


STREAMS = {"full": (full, "No space left on device"), "closed": (closed, "Bad file descriptor"), "left": (left, "")}


@contextmanager
def standard_output(descriptor: int, *, buffered: bool) -> Iterator[None]:
    before = sys.stdout
    stream: TextIO = os.fdopen(descriptor, "w", encoding="utf-8")
    if not buffered:
        stream.reconfigure(write_through=True)  # type: ignore[attr-defined]  # of any TextIO that os.fdopen makes
    sys.stdout = stream
    try:
        yield
    finally:
        sys.stdout = before
        stream.close()


def assert_lost(code: int, errors: str, reason: str) -> None:
    lines = [line for line in errors.splitlines() if line.startswith("error")]
    assert "Traceback" not in errors
    if reason:
        assert (code, lines) == (
            2,
            [f"error: standard output: stream: got {reason}, expected one that takes the answer"],
        )
    else:
        assert (code, lines) == (READER_LEFT, [])


SLOW = {"hil", "region"}
"""Verbs that start processes: one kind of stream is enough."""
LOST = [(verb, kind) for verb in CALLS for kind in STREAMS if verb not in SLOW or kind == "full"]


@pytest.mark.parametrize(("verb", "kind"), LOST)
def test_when_the_answer_cannot_be_written_expect_no_verdict_and_at_most_one_line(
    verb: str, kind: str, design: Design, capsys: pytest.CaptureFixture[str]
) -> None:
    opened, reason = STREAMS[kind]
    form = () if verb in WITHOUT_JSON else ("--json",)
    output = ("-o", "x") if CALLS[verb].file else ()
    with standard_output(opened(), buffered=kind != "left"):
        code = design(verb, *form, *output)
    assert_lost(code, capsys.readouterr().err, reason)


@pytest.mark.parametrize("kind", STREAMS)
@pytest.mark.parametrize("verb", ["list", "inspect", "verify", "solve", "complexity"])
def test_when_a_table_cannot_be_written_expect_the_same(
    verb: str, kind: str, design: Design, capsys: pytest.CaptureFixture[str]
) -> None:
    opened, reason = STREAMS[kind]
    for words in ((), ("--help",)):
        with standard_output(opened(), buffered=kind == "left"):
            code = design(verb, *words)
        assert_lost(code, capsys.readouterr().err, reason)


REDIRECTIONS = {
    ">/dev/full": (2, r"error: standard output: stream: got No space left on device, .*\n"),
    ">&-": (2, r"error: standard output: stream: got Bad file descriptor, .*\n"),
    "| true": (READER_LEFT, ""),
    "2>&-": (0, ""),
    "2>/dev/full": (0, ""),
    "<&- >&- 2>&-": (2, ""),
}


def in_a_shell(command: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """A command of a shell; its exit code is that of the first program of a pipe."""
    return subprocess.run(
        ["bash", "-c", f'{command}; exit "${{PIPESTATUS[0]}}"'],
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("redirection", REDIRECTIONS)
def test_when_a_real_process_cannot_write_expect_the_same(
    redirection: str, inputs: dict[str, str], tmp_path: Path
) -> None:
    code, errors = REDIRECTIONS[redirection]
    command = f"{sys.executable} -m quasilpv inspect {inputs['ARTIFACT']} {redirection}"
    done = in_a_shell(command, tmp_path, PYTHONUNBUFFERED="1")
    assert done.returncode == code
    assert re.fullmatch(errors, done.stderr)


def test_when_standard_error_is_closed_expect_errors_not_on_standard_output(tmp_path: Path) -> None:
    done = in_a_shell(f"{sys.executable} -m quasilpv inspect missing.json 2>&-", tmp_path)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.full
@pytest.mark.parametrize("redirection", [">/dev/full", ">&-", "| true"])
@pytest.mark.parametrize("verb", [verb for verb, call in CALLS.items() if not call.answers])
def test_when_any_verb_as_a_real_process_cannot_write_expect_the_same(
    verb: str, redirection: str, inputs: dict[str, str], tmp_path: Path
) -> None:
    words = [inputs.get(word, word) for word in CALLS[verb].arguments] + (["-o", "x"] if CALLS[verb].file else [])
    code, errors = REDIRECTIONS[redirection]
    done = in_a_shell(f"{sys.executable} -m quasilpv {verb} {' '.join(words)} --json {redirection}", tmp_path)
    assert done.returncode == code
    assert re.search(f"{errors}$", done.stderr)
    assert "Traceback" not in done.stderr


# ---- files -----------------------------------------------------------------------------------------------------------

WRITING = {name: call for name, call in {**CALLS, **MORE}.items() if call.folder or call.file}


def make_targets(folder: Path) -> None:
    """What an output may name by mistake."""
    (folder / "file").write_bytes(b"kept")
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "circle").symlink_to("circle")


TARGETS = {
    "folder": ("file", "file/below", "pipe", "circle", "/dev/null", "/dev/full", "/proc/nowhere", "y" * 300),
    "file": ("folder", "file/below", "pipe", "circle", "/dev/null", "/dev/full", "/proc/nowhere", "y" * 300),
}


@pytest.mark.parametrize("name", WRITING)
def test_when_the_output_is_no_place_to_write_expect_one_line_and_it_left_as_it_is(
    name: str, design: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_targets(tmp_path)
    before = {path.name: path.lstat().st_mode for path in tmp_path.iterdir()}
    for target in TARGETS["folder" if WRITING[name].folder else "file"]:
        code = design(name, "-o", target)
        out, errors = capsys.readouterr()
        assert (code, out) == (2, ""), target
        assert errors.startswith(f"error: {target}: "), errors
        assert errors.count("\n") == 1, errors
    after = {path.name: path.lstat().st_mode for path in tmp_path.iterdir()}
    assert after == before
    assert (tmp_path / "file").read_bytes() == b"kept"


@pytest.mark.parametrize("name", WRITING)
def test_when_another_command_writes_there_expect_it_named(
    name: str, design: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with one_command("design anything"):
        (claim_folder if WRITING[name].folder else claim_file)(tmp_path / "out")
        assert design(name, "-o", "out") == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"error: out: output: got the output of process \d+, design anything too, .*\n", errors)


@pytest.mark.parametrize("name", [name for name in WRITING if name not in SLOW])
def test_when_the_output_has_a_name_that_is_no_text_expect_it_written_and_named_in_json(
    name: str, design: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = os.fsdecode(b"\xff out\xfe")
    assert design(name, "-o", target, "--json") == 0
    parsed = json.loads(capsys.readouterr().out)
    if WRITING[name].file or name == "robust":
        assert (tmp_path / target).exists()
    if name == "export-sdp":
        assert parsed["file"] == target


def test_when_a_run_is_tracked_into_a_folder_whose_name_is_no_text_expect_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = os.fsdecode(b"\xff")
    assert run(["track", "stabilise-arm2", "--controller", "pid", "-o", folder, "--no-figures"]) == 0
    capsys.readouterr()
    assert run(["log", "to-mcap", "LAST", "--json"]) == 0
    converted = Path(json.loads(capsys.readouterr().out)["mcap"])
    assert converted == (tmp_path / folder / "stabilise-arm2" / "pid" / "run.mcap")
    assert converted.stat().st_size > 1000


@pytest.mark.parametrize("alias", ["itself", "link", "hard link"])
@pytest.mark.parametrize("name", [name for name, call in WRITING.items() if call.file and name != "new system"])
def test_when_the_output_is_the_input_expect_one_line_and_it_whole(
    name: str, alias: str, design: Design, inputs: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    given = Path(inputs[WRITING[name].arguments[-1]])
    target = given if alias == "itself" else Path("alias")  # in the folder of the test
    if alias == "link":
        target.symlink_to(given)
    elif alias == "hard link":
        target.hardlink_to(given)
    before = given.read_bytes()
    assert design(name, "-o", str(target)) == 2
    words = "one that is there" if name == "new" else "an input of this command"  # that verb replaces nothing at all
    assert words in capsys.readouterr().err
    assert given.read_bytes() == before


# ---- two at once -----------------------------------------------------------------------------------------------------


@pytest.mark.full
@pytest.mark.parametrize("name", [name for name in WRITING if name not in {"demo", "animate", "reproduce"}])
def test_when_two_commands_write_into_one_place_expect_one_whole_and_the_other_refused_or_after_it(
    name: str, inputs: dict[str, str], tmp_path: Path
) -> None:
    verb = name.split(maxsplit=1)[0]
    words = [inputs.get(word, word) for word in WRITING[name].arguments]
    more = ["--controller", "pid"] if name == "track" else []
    command = [sys.executable, "-m", "quasilpv", verb, *words, *more, "--json", "-o"]
    for place in ("alone", "again"):
        alone = subprocess.run([*command, place], cwd=tmp_path, capture_output=True, check=False)
        assert alone.returncode == 0, alone.stderr
    both = [
        subprocess.Popen([*command, "shared"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    ends = [(process.communicate(), process.returncode) for process in both]
    codes = sorted(code for _, code in ends)
    assert codes in ([0, 0], [0, 2])
    for (_, errors), code in ends:
        if code == 2:
            beside = r"output: got the output of process \d+, design "
            after = r"file: got one that is there, " if verb == "new" else beside  # it never replaces a file
            assert re.search(rf"^error: shared: ({beside}|{after})", errors, re.MULTILINE), errors
    shared, first, second = (contents(tmp_path / place) for place in ("shared", "alone", "again"))
    assert shared.keys() == first.keys()
    # What two runs write alike, byte for byte, is there as they write it; the rest has times and durations in it.
    assert not [name for name in first if first[name] == second[name] != shared[name]]
    assert all(shared.values())
    assert not [path for path in tmp_path.rglob(".quasilpv*")]


def contents(place: Path) -> dict[str, bytes]:
    """The files of an output, by name."""
    if place.is_file():
        return {"": place.read_bytes()}
    return {str(path.relative_to(place)): path.read_bytes() for path in place.rglob("*") if path.is_file()}
