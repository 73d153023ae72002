"""Pages say what is so: their commands and programs run, and print what stands below them."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import patch

import pytest

from pages import NAMES, NOT_RUN, PAGES, ROOT, Command, commands, fences, tokens, unprinted
from quasilpv.cli.app import run
from quasilpv.cli.verbs import VERBS
from quasilpv.conditions.registry import CONDITIONS

# Quick enough for every run; all other lines are run, page by page and in order, by ./tools/test --full.
QUICK_COMMANDS = (
    "design solve ",
    "design boundary ",
    "design complexity ",
    "design reproduce fig-II.1",
    "design robot show examples/",
)


def design_lines(page: Path) -> Iterator[str]:
    """Lines that call `design`, in console blocks and in indented ones."""
    yield from (command.line for command in commands(page) if command.line.startswith("design "))
    for token in tokens(page):
        if token.type == "code_block":
            yield from (line for line in token.content.splitlines() if line.startswith("design "))


def named(has: Callable[[Path], bool]) -> list[str]:
    """Names of the pages of which this is true."""
    return [name for name, page in zip(NAMES, PAGES, strict=True) if has(page)]


def assert_runs(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    """And prints what the page says it does."""
    capsys.readouterr()
    code = run(shlex.split(command.line)[1:])
    assert code == 0, f"{command.line}: exit code {code}"
    if command.printed is not None:
        printed = capsys.readouterr().out
        assert unprinted(command.printed, printed) == [], printed


@pytest.mark.parametrize("name", named(lambda page: any(design_lines(page))))
def test_every_command_of_a_page_is_one_the_command_line_accepts(name: str) -> None:
    for line in design_lines(ROOT / name):
        _, verb, *arguments = shlex.split(line, comments=True)
        VERBS[verb].load(verb).make_context(verb, arguments)


def test_when_a_documented_option_does_not_exist_expect_it_found() -> None:
    with pytest.raises(Exception, match="--colour"):
        VERBS["solve"].load("solve").make_context("solve", ["ex-I.1", "--condition", "II.6", "--colour", "red"])


def elsewhere_with_examples(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands of pages are given in a clone, and what they write is not to stay there."""
    (folder / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(folder)


QUICK = sorted(
    {command for page in PAGES for command in commands(page) if command.line.startswith(QUICK_COMMANDS)},
    key=lambda command: command.line,
)


@pytest.mark.parametrize("command", QUICK, ids=[command.line for command in QUICK])
def test_a_quick_command_of_the_documentation_runs(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere_with_examples(tmp_path, monkeypatch)
    assert_runs(command, capsys)


@pytest.mark.full
@pytest.mark.parametrize("name", named(lambda page: any(commands(page))))
def test_the_commands_of_a_page_run_in_their_order_and_print_what_it_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere_with_examples(tmp_path, monkeypatch)
    for command in commands(ROOT / name):
        if not command.is_skipped:
            assert_runs(command, capsys)


def test_every_line_of_a_console_block_is_run_or_listed_with_a_reason() -> None:
    every = [command for page in PAGES for command in commands(page)]
    assert [c.line for c in every if not c.line.startswith("design ") and not c.is_skipped] == []
    assert [reason for reason in NOT_RUN if not any(c.line.startswith(reason) for c in every)] == []
    assert [c.line for c in every if c.is_skipped and c.printed is not None] == []  # nothing would compare it


def test_when_a_page_says_something_else_than_is_printed_expect_the_line() -> None:
    printed = "controller      rms\npd             93.6\nctc-dob       -1e-3\n"
    assert unprinted("controller  rms\nctc-dob  -1.004e-3\n", printed) == []
    assert unprinted("ctc-dob  -1.02e-3\n", printed) == ["ctc-dob  -1.02e-3"]
    assert unprinted("in ... s\n", "in 0.1 s") == []
    assert unprinted("pid  93.6\n", printed) == ["pid  93.6"]
    assert unprinted("pid  1.99\n", "pid  1.97") == []  # 1 % and half a digit
    assert unprinted("pid  1.99\n", "pid  1.95") == ["pid  1.99"]
    assert unprinted("pid  1.99e+3\n", "pid  1970.0") == []
    assert unprinted("pid  199\n", "pid  196") == ["pid  199"]
    assert unprinted("ctc-dob  -1e-3\npd  93.6\n", printed) == ["pd  93.6"]  # another order


@pytest.mark.parametrize("name", named(lambda page: any(fence.language == "python" for fence in fences(page))))
@patch.dict(CONDITIONS)  # what a page registers, other tests never see
def test_the_python_of_a_page_runs_and_prints_what_the_page_says(name: str) -> None:
    namespace: dict[str, object] = {"__name__": "page"}
    printed: str | None = None
    for fence in fences(ROOT / name):
        if fence.language == "python":
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(compile("\n" * fence.line + fence.text, name, "exec"), namespace)
            printed = output.getvalue()
        elif fence.language == "text" and printed is not None:
            assert fence.text == printed
        else:
            printed = None  # a text below another block is not the output of a program


def test_every_text_stands_below_what_prints_it() -> None:
    for name, page in zip(NAMES, PAGES, strict=True):
        before = ""
        for fence in fences(page):
            if fence.language == "text":
                assert before in {"python", "console"}, f"{name}, line {fence.line}"
            before = fence.language


def test_no_block_is_in_a_language_that_nothing_checks() -> None:
    checked = {"python", "console", "text"}
    directive = re.compile(r"\{[a-z-]+\}")
    # cpp: excerpts of examples/hardware_driver, which is built and tested; sh: of CONTRIBUTING.md, for contributors;
    # cpp, diff and sh of the page about an own law: test_own_law.py applies, builds and runs them.
    # math: ./tools/docs sets it, and what it cannot set is an error.
    known = checked | {"cpp", "diff", "sh", "math"}
    others = [(n, f.language) for n, p in zip(NAMES, PAGES, strict=True) for f in fences(p) if f.language not in known]
    assert [(name, language) for name, language in others if not directive.match(language)] == []
