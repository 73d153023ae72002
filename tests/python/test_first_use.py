"""What a stranger meets first: a wrong use is answered with the line that says what to do instead; completion; demo."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from quasilpv.cli import run
from quasilpv.cli.verbs import VERBS
from quasilpv.errors import MOST_NAMES, one_of
from quasilpv.synthesis import CONTROLLERS

WRONG_USES = {
    "trakc serial-square": f"command line: verb: got trakc, expected one of {', '.join(VERBS)}; did you mean track?",
    "list --colour": "command line: option: got --colour, expected one of --items, --json, --help, -h "
    "(design list --help)",
    "synth": "command line: ROBOT|SYSTEM: got nothing, expected a robot of design list, or a robot.toml: "
    "design robot show (design synth --help)",
    "solve ex-I.1": "command line: --condition: got nothing, expected a condition of design list (design solve --help)",
    "new": "command line: system|robot: got nothing, expected what to start (design new --help)",
    "new robot": "command line: DESCRIPTION: got nothing, expected the URDF or MJCF of the robot",
    "new system arm.urdf": "command line: DESCRIPTION: got arm.urdf, expected nothing: it is for a robot",
    "synth arm3 --rate-hz fast": "command line: --rate-hz: got fast, expected a number (design synth --help)",
    "synth arm9": "robots: robot: got arm9, expected one of arm2, arm3, arm2-upright, arm3-light, fivebar, "
    "spring-disc, ur5; did you mean arm3?",
    "synth arm3 --rate-hz -5": "specification: rate_hz: got -5.0, expected a number in [50, 50000]",
    "verify missing.json": "missing.json: file: got No such file or directory, expected a readable file",
    "hil serial-square serial-circle": "command line: arguments: got serial-circle too, expected no more than SCENARIO "
    "(design hil --help)",
    "hil serial-square --priority 50": "command line: --priority: got 50, expected nothing without --real-time: "
    "lock-step has no clock",
    "solve ex-I.1 --condition II.6 --slack some": "command line: --slack: got some, expected one of none, thesis, "
    "pairs, full (design solve --help)",
    "region ex-I.1 --condition II.6 --x a=-8:8 --y b=0:1:3": "command line: --x: got a=-8:8, expected "
    "NAME=FROM:TO:POINTS",
    "reproduce fig-II.9": "reproduction: item: got fig-II.9, expected fig-II.7, fig-II.6, fig-II.5, or another of "
    "design list --items",
}


@pytest.mark.parametrize(("command", "message"), WRONG_USES.items(), ids=WRONG_USES)
def test_when_used_wrongly_expect_exactly_this_line_and_exit_2(
    command: str, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(command.split()) == 2
    assert capsys.readouterr() == ("", f"error: {message}\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--json=3", "--json: got a value, expected none"),
        ("--rate-hz", "--rate-hz: got nothing, expected a value"),
        ("--encoder-bits 3.5", "--encoder-bits: got 3.5, expected a whole number"),
    ],
)
def test_when_an_option_has_no_value_or_a_wrong_one_expect_the_option_named(
    option: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["synth", "arm3", *option.split()]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("reason", ["libsundials_ida.so.6: cannot open shared object file", "undefined symbol: init"])
def test_when_the_compiled_module_cannot_be_loaded_expect_one_line_that_says_why_and_what_to_do(reason: str) -> None:
    program = f"""
import importlib.abc, sys
class Unloadable(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "quasilpv._runtime":
            raise ImportError({reason!r})
sys.meta_path.insert(0, Unloadable())
from quasilpv.cli import main
main()
"""
    command = [sys.executable, "-c", program, "track", "serial-square"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: installation: quasilpv._runtime: got {reason}, expected ")
    assert "./tools/demo" in done.stderr
    assert done.stderr.count("\n") == 1


def test_when_something_else_cannot_be_imported_expect_it_not_blamed_on_the_compiled_module(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "quasilpv.cli.listing", None)
    with pytest.raises(ImportError, match="listing"):
        run(["list"])


def test_when_many_names_are_known_expect_only_the_closest() -> None:
    many = [f"fig-{number}" for number in range(MOST_NAMES + 1)]
    assert one_of(many, "fgi-7").startswith("fig-7, ")
    assert one_of(many, "?") == "one of design list"
    assert one_of(many[:2], "?") == "one of fig-0, fig-1"


def test_help_of_the_rate_names_every_controller_with_a_rate_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["synth", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split()).rpartition("--rate-hz")[2].partition("]")[0]
    fast = {name for name, kind in CONTROLLERS.items() if kind.rate_hz == 4000.0}
    assert fast
    assert set(text.partition("4000 for ")[2].split(", ")) == fast


def complete(words: str) -> subprocess.CompletedProcess[str]:
    """What bash is offered after these words."""
    program = """
import atexit, sys
from quasilpv.cli import run
atexit.register(lambda: print(*sys.modules, file=sys.stderr))
run([])
"""
    count = len(words.split(" ")) - 1
    environment = {"COMP_WORDS": words, "COMP_CWORD": str(count), "_DESIGN_COMPLETE": "complete_bash"}
    return subprocess.run(
        [sys.executable, "-c", program], env=os.environ | environment, capture_output=True, text=True, check=False
    )


def test_when_a_verb_is_begun_expect_its_completions_and_no_verb_imported() -> None:
    offered = complete("design re")
    assert offered.stdout.split() == [verb for verb in VERBS if verb.startswith("re")] == ["region", "reproduce"]
    assert "sympy" not in offered.stderr.split()


def test_when_an_option_of_a_verb_is_begun_expect_its_completions() -> None:
    assert complete("design list --j").stdout.split() == ["--json"]


def test_when_the_shell_asks_for_its_script_expect_one_that_calls_the_command() -> None:
    # From a shell, as a user does: which one it is, is read off the parents of the process.
    command = f"{shlex.quote(sys.executable)} -m quasilpv --show-completion bash; true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    assert "_DESIGN_COMPLETE=complete_bash" in done.stdout


def test_when_a_file_to_start_from_is_written_expect_it_to_end_in_a_proved_controller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "system"]) == 0
    capsys.readouterr()
    commands = [
        line.split()[1:] for line in Path("my_system.py").read_text().splitlines() if line.startswith("    design ")
    ]
    assert [command[0] for command in commands] == ["synth", "simulate"]
    for command in commands:
        assert run([*command, "--json"]) == 0
    assert run(["new", "system"]) == 2  # it is there, and stays as it is
    assert "my_system.py: file: got one that is there" in capsys.readouterr().err


def test_when_items_are_listed_expect_them_only_if_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["list"]) == 0
    short = capsys.readouterr().out
    assert "fig-II.7" not in short
    assert "design list --items" in short
    assert run(["list", "--items"]) == 0
    assert "fig-II.7" in capsys.readouterr().out
