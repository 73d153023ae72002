"""Every value of every verb, from the verbs' own option lists: what is no usable number, or nothing, is one line.

An option that is added is covered by these tests without a change of them; of a new verb, `VERB_ARGUMENTS` asks for a
way to call it.
"""

from __future__ import annotations

import inspect
import signal
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import quasilpv as ql
from quasilpv.artifact import write_artifact
from quasilpv.cli import run
from quasilpv.cli.usage import LARGEST_WRITTEN, number
from quasilpv.cli.verbs import VERBS
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest, Specification

NO_NUMBERS = ("nan", "inf", "-inf", "1e308", "-1e308", "1e18", "", "0x10", "\udcff")
EXTREMES = ("-1", "0", "1e-300", "1e15")
TEXTS = ("", "\udcff")
LIMIT_S = 60


@dataclass(frozen=True)
class Call:
    """How a verb is called in these tests.

    Attributes:
        arguments: positional ones.
        options: those it needs.
        stubs: names of the package whose call is the beginning of the work.
    """

    arguments: tuple[str, ...] = ()
    options: dict[str, str] = field(default_factory=dict)
    stubs: tuple[str, ...] = ()


QUESTION = {"--condition": "II.6"}
ROBOT = str(Path(__file__).parents[1] / "data" / "robots" / "two_links.xml")
VERB_ARGUMENTS = {
    "new": Call(("robot", ROBOT)),
    "robot": Call(("show", ROBOT)),
    "demo": Call(stubs=("cli.synth.write_released",)),
    "list": Call(),
    "synth": Call(("arm3",), {"--design": "pid"}),
    "inspect": Call(("ARTIFACT",)),
    "verify": Call(("ARTIFACT",)),
    "robust": Call(("ARTIFACT",), stubs=("certificate.gate",)),
    "export": Call(("ARTIFACT",), {"--out": "x"}),
    "export-sdp": Call(("ARTIFACT",), {"--out": "x"}, stubs=("synthesis.shipped_problem.shipped_problem",)),
    "track": Call(("stabilise-arm2",), {"--controller": "pid"}, stubs=("cli.track.run_all",)),
    "animate": Call(("stabilise-arm2",), stubs=("cli.animate.progress",)),
    "simulate": Call(("SYSTEM",), {"--duration": "0.1"}, stubs=("figures.systems.draw_system_run",)),
    "hil": Call(("serial-square",), {"--controller": "pid", "--real-time": ""}, stubs=("cli.session.Session",)),
    "log": Call(("info", "LAST")),
    "view": Call((), {"--live": "", "--artifact": "ARTIFACT"}, stubs=("view.live.LiveMotion",)),
    "solve": Call(("ex-I.1",), QUESTION),
    "boundary": Call(("ex-I.1",), QUESTION | {"--over": "b=0:1"}, stubs=("studies.find_boundary",)),
    "region": Call(
        ("ex-I.1",), QUESTION | {"--x": "a=0:1:2", "--y": "b=0:1:2"}, stubs=("studies.checkpoint.Checkpoint",)
    ),
    "complexity": Call(("ex-I.1",), QUESTION, stubs=("cli.complexity.print_table",)),
    "reproduce": Call(("fig-II.1",), stubs=("reproduction.reproduce",)),
}


class LegitimateError(Exception):
    """The values were accepted and the work would begin."""


@pytest.fixture(scope="module")
def artifacts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Files, by the word that stands for them: a controller of a robot, and one of a system."""
    robots = tmp_path_factory.mktemp("pid")
    path, _ = write_artifact(robots, release(DesignRequest.of("arm3", "pid", Specification())).artifact)
    system = ql.DescriptorSystem.from_equations(
        ["x' = x^2 + u"], state="x", inputs="u", domain={"x": (-1, 1)}, name="square"
    )
    made = ql.stabilise(system, decay_rate=1.0, input_limits={"u": 5.0})
    return {"ARTIFACT": str(path), "SYSTEM": str(made.write(tmp_path_factory.mktemp("square")))}


@pytest.fixture(autouse=True)
def limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """In a folder of its own, and none computes for ever."""
    monkeypatch.chdir(tmp_path)
    signal.alarm(LIMIT_S)
    yield
    signal.alarm(0)


def function_of(verb: str) -> Any:
    module = VERBS[verb].module
    return getattr(__import__(f"quasilpv.cli.{module}", fromlist=[module]), f"{module}_command")


def holds_number(verb: str, parameter: Any) -> bool:
    """Whether a parameter is a number for the verb's function."""
    annotation = inspect.signature(function_of(verb), eval_str=True).parameters[parameter.name].annotation
    kinds = {annotation, *get_args(annotation)}
    return any({kind, *get_args(kind)} & {int, float} for kind in kinds)


def filled(metavar: str) -> list[str]:
    """``NAME=FROM:TO:POINTS`` with a hole for each number in turn."""
    shape = {
        "VALUE": ["{}"],
        "FORM": ["{}", "step:{},1", "step:1,{}", "step:1,2,{}", "sine:{},2", "sine:1,{}", "sine:1,2,{}", "noise:{}"],
        "FROM:TO": ["{}:2", "1:{}"],
        "FROM:TO:POINTS": ["{}:2:3", "1:{}:3", "1:2:{}"],
    }
    return [f"b={numbers}" for numbers in shape[metavar.partition("=")[2]]]


@dataclass(frozen=True)
class Option:
    verb: str
    name: str
    is_number: bool
    holes: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.verb} {self.name}"


def options_of(verb: str) -> list[Option]:
    """All options of a verb that take a value, and where in it a number stands."""
    found = []
    for parameter in VERBS[verb].load(verb).params:
        if parameter.param_type_name != "option" or getattr(parameter, "is_flag", False):
            continue
        structured = str(parameter.metavar or "").startswith("NAME=")
        holes = filled(str(parameter.metavar)) if structured else ["{}"]
        is_number = structured or holds_number(verb, parameter)
        found.append(Option(verb, max(parameter.opts, key=len), is_number, tuple(holes)))
    return found


OPTIONS = [option for verb in VERBS for option in options_of(verb)]


def test_every_verb_is_called_here() -> None:
    assert VERB_ARGUMENTS.keys() == VERBS.keys()
    assert sum(option.is_number for option in OPTIONS) > 20


@pytest.mark.parametrize("values", [NO_NUMBERS, pytest.param(EXTREMES, marks=pytest.mark.full)], ids=["no", "extreme"])
@pytest.mark.parametrize("option", OPTIONS, ids=str)
def test_when_a_value_is_no_usable_number_or_nothing_expect_one_line_or_the_work_begun(
    option: Option,
    values: tuple[str, ...],
    artifacts: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    call = VERB_ARGUMENTS[option.verb]

    def begin(*_: object, **__: object) -> None:
        raise LegitimateError

    for stub in call.stubs:
        monkeypatch.setattr(f"quasilpv.{stub}", begin)
    others = [word for name, value in call.options.items() if name != option.name for word in (name, value)]
    base = [artifacts.get(word, word) for word in [*call.arguments, *filter(None, others)]]
    for hole in option.holes:
        for value in values if option.is_number else TEXTS:
            text = hole.format(value)
            try:
                code = run([option.verb, *base, f"{option.name}={text}"])
            except LegitimateError:
                code = 0
            out, err = capsys.readouterr()
            if value == "" or (option.is_number and value in NO_NUMBERS):
                assert code == 2, (text, out)
            if code == 2:
                assert out == "", text
                assert err.startswith("error: "), (text, err)
                assert err.count("\n") == 1, (text, err)
            else:
                assert code in (0, 1), (text, err)


@pytest.mark.parametrize("verb", VERBS)
def test_when_an_argument_or_a_value_is_empty_expect_it_named(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([verb, ""]) == 2
    assert capsys.readouterr() == ("", "error: command line: arguments: got nothing, expected a value\n")
    for option in options_of(verb):
        assert run([verb, option.name, ""]) == 2
        assert capsys.readouterr() == ("", f"error: command line: {option.name}: got nothing, expected a value\n")


@given(st.floats(allow_nan=True, allow_infinity=True), st.sampled_from(["{!r}", "{:.3e}", "{:f}", "+{!r}"]))
@example(LARGEST_WRITTEN, "{!r}")
def test_a_number_is_read_as_it_is_written_or_not_at_all(value: float, form: str) -> None:
    text = form.format(value)
    if abs(value) <= LARGEST_WRITTEN and not text.startswith("+-"):
        assert number(text) == float(text)
    elif not abs(value) <= 1.001 * LARGEST_WRITTEN:  # rounding of the text apart
        assert number(text) is None


@pytest.mark.parametrize("text", ["1_0", "\u0663", " 5", "5 ", "0x1p3", "1e", ".", "--1", "1,5", "Infinity", "5\n"])
def test_what_only_looks_like_a_number_is_none(text: str) -> None:
    assert number(text) is None
