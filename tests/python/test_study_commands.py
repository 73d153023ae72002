"""The verbs that ask about conditions, as a person calls them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from quasilpv.cli import run


class Done(NamedTuple):
    """What a command said, and how it ended."""

    returncode: int
    stdout: str
    stderr: str


Design = Callable[..., Done]


@pytest.fixture
def design(capsys: pytest.CaptureFixture[str]) -> Design:
    """The command, in this process: one of its own takes longer to start than most of these take to answer."""

    def call(*arguments: str) -> Done:
        code = run(arguments)
        return Done(code, *capsys.readouterr())

    return call


def test_solve_prints_the_documented_members(design: Design) -> None:
    done = design("solve", "ex-I.1", "--condition", "II.6", "--set", "b=2.5", "--json")
    answer = json.loads(done.stdout)
    assert done.returncode == 0
    sizes = {"certified", "margin", "unknowns", "rows", "seconds"}
    assert set(answer) == {"verdict", "evidence", "reason", "relies_on", "refutation", "factoring"} | sizes
    assert (answer["verdict"], answer["evidence"], answer["certified"]) == ("feasible", "proved", True)
    assert answer["margin"] > 0


def test_infeasible_is_exit_code_1_and_a_negative_margin(design: Design) -> None:
    done = design("solve", "ex-I.1", "--condition", "II.6", "--set", "b=4", "--json")
    answer = json.loads(done.stdout)
    assert done.returncode == 1
    assert (answer["verdict"], answer["certified"]) == ("infeasible", False)
    assert answer["margin"] < 0


def test_region_writes_map_and_figure(design: Design, tmp_path: Path) -> None:
    axes = ("--x", "a=-2:6:3", "--y", "b=-4:8:3")
    done = design("region", "ex-I.1", "-c", "II.6", *axes, "-j", "1", "-o", str(tmp_path), "--json")
    document = json.loads(done.stdout)
    assert {"points", "boundary", "seconds_per_point", "proved_share", "areas"} <= set(document)
    assert {path.suffix for path in tmp_path.iterdir()} == {".json", ".png", ".jsonl"}
    assert len(document["points"]) == 9


def test_maps_of_different_questions_lie_beside_each_other(design: Design, tmp_path: Path) -> None:
    axes = ("--x", "a=-2:6:2", "--y", "b=-4:8:2", "--grid", "-j", "1", "-o", str(tmp_path))
    for options in ((), ("--representation", "ts"), ("--slack", "full")):
        assert design("region", "ex-I.1", "-c", "II.6", *axes, *options).returncode == 0
    assert len(list(tmp_path.glob("ex-I.1-II.6-*.json"))) == 3


def test_maps_of_one_question_over_other_ranges_share_answers_and_keep_their_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def mapped(x: str, *options: str) -> dict[Path, bytes]:
        axes = ("--x", x, "--y", "b=-4:8:2", "-j", "1", "-o", str(tmp_path))
        assert run(["region", "ex-I.1", "-c", "II.6", *axes, *options]) == 0
        return {path: path.read_bytes() for path in tmp_path.iterdir() if path.suffix != ".jsonl"}

    made = mapped("a=-2:6:3")
    changes = (("a=-2:6:5",), ("a=-2:2:3",), ("a=-2:6:5", "--grid"), ("a=-2:6:5", "--adaptive"))
    for number, change in enumerate(changes, start=2):
        more = mapped(*change)
        assert made.items() <= more.items()
        assert len(more) == 2 * number  # JSON and PNG
        made = more
    assert mapped("a=-2:6:3").keys() == made.keys()
    assert len(list(tmp_path.glob("*.jsonl"))) == 1
    said = capsys.readouterr()
    assert "answers known from" in said.err
    assert [line.split(",")[0].split(":")[0] for line in said.out.splitlines()[::2]] == [
        *["feasible"] * 3,
        *["points only"] * 2,
        "feasible",
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("solve", "ex-I.1", "-c", "II.6", "--set", "b"), "NAME=VALUE"),
        (("solve", "ex-I.1", "-c", "II.6", "--decay", "-1"), "decay rate"),
        (("solve", "ex-II.7", "-c", "II.6"), "regular system"),
        (("solve", "ex-I.1", "-c", "II.6", "--representation", "tensor"), "one of ts"),
        (("boundary", "ex-I.1", "-c", "II.6", "--over", "b=0"), "NAME=FROM:TO"),
        (("boundary", "ex-I.1", "-c", "II.6", "--over", "b=0:1", "--tolerance", "2"), "tolerance"),
        (("region", "ex-I.1", "-c", "II.6", "--x", "a=0:1:2.5", "--y", "b=0:1:2"), "whole number"),
        (("region", "ex-I.1", "-c", "II.6", "--x", "a=0:1:2", "--y", "b=0:1:2", "-j", "0"), "--processes"),
        (("complexity", "ex-I.9", "-c", "II.6"), "ex-I.1"),
        (("solve", "arm2", "-c", "II.5", "--representation", "ts", "--memory-limit", "0.001"), "cheaper: "),
        (("solve", "ex-I.1", "-c", "II.8", "--window-s", "0"), "window"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(design: Design, arguments: tuple[str, ...], words: str) -> None:
    done = design(*arguments)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
