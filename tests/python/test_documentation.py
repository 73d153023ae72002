"""The documentation says what is so: its code runs, its links resolve, its figures have a command, its tests exist."""

from __future__ import annotations

import ast
import contextlib
import io
import re
import shlex
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

from quasilpv.cli.app import run
from quasilpv.cli.verbs import VERBS
from quasilpv.conditions.registry import CONDITIONS

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("[!_]*.md"), *(ROOT / "docs").glob("[!_]*/*.md")])
README = ROOT / "README.md"
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

# Quick enough for every run; all other lines are run, page by page and in order, by ./tools/test --full.
QUICK_COMMANDS = (
    "design solve ",
    "design boundary ",
    "design complexity ",
    "design reproduce fig-II.1",
    "design robot show examples/",
)

NOT_RUN = {
    "./tools/demo": "installs and builds",
    "./tools/test": "runs this",
    "source .venv/bin/activate": "of the reader's shell",
    "pip install ": "test_packaging.py installs the wheel",
    "python3 -m venv ": "test_packaging.py has an environment of its own",
    "quasilpv/bin/": "test_packaging.py runs the installed wheel",
    "cmake --install ": "test_packaging.py builds a project against what is installed",
    "dask ": "test_studies.py starts a cluster of its own",
    "design region ex-I.1 --condition II.7 ": "for a cluster",
    "design reproduce --all": "test_reproduction.py runs every item",
    "design view ": "ends when its reader says so; test_view.py opens it",
    "python examples/four_link_arm.py": "test_new_robot.py runs it",
    "design robot show tests/": "test_descriptions.py shows the same files, which are not where this runs",
    "qlpv-controller --doctor ": "measures the machine; doctor_test.cpp",
}
"""Beginnings of lines in console blocks that no test runs, and why."""


@dataclass(frozen=True)
class Fence:
    """A fenced block: its language, its text, and the line it begins at."""

    language: str
    text: str
    line: int


@cache
def tokens(page: Path) -> list[Token]:
    """Of a page, those inside paragraphs and tables too."""
    parsed = MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))
    return [part for token in parsed for part in (token, *(token.children or ()))]


def fences(page: Path) -> list[Fence]:
    return [Fence(t.info.strip(), t.content, t.map[0] + 1) for t in tokens(page) if t.type == "fence" and t.map]


def console_lines(page: Path) -> list[str]:
    """Commands of the console blocks, without their comments."""
    text = "\n".join(fence.text for fence in fences(page) if fence.language == "console")
    return [line for raw in text.splitlines() if (line := shlex.join(shlex.split(raw, comments=True)))]


def design_lines(page: Path) -> Iterator[str]:
    """Lines that call `design`, in console blocks and in indented ones."""
    yield from (line for line in console_lines(page) if line.startswith("design "))
    for token in tokens(page):
        if token.type == "code_block":
            yield from (line for line in token.content.splitlines() if line.startswith("design "))


def is_skipped(line: str) -> bool:
    return any(line.startswith(beginning) for beginning in NOT_RUN)


def with_console(pages: list[Path]) -> list[Path]:
    return [page for page in pages if console_lines(page)]


def assert_runs(line: str) -> None:
    code = run(shlex.split(line)[1:])
    assert code == 0, f"{line}: exit code {code}"


# ---- code ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n, p in zip(NAMES, PAGES, strict=True) if any(design_lines(p))])
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


QUICK_LINES = sorted({line for page in PAGES for line in console_lines(page) if line.startswith(QUICK_COMMANDS)})


@pytest.mark.parametrize("line", QUICK_LINES)
def test_a_quick_command_of_the_documentation_runs(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere_with_examples(tmp_path, monkeypatch)
    assert_runs(line)


@pytest.mark.full
@pytest.mark.parametrize("name", [str(page.relative_to(ROOT)) for page in with_console(PAGES)])
def test_the_commands_of_a_page_run_in_their_order(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere_with_examples(tmp_path, monkeypatch)
    for line in console_lines(ROOT / name):
        if not is_skipped(line):
            assert_runs(line)


@pytest.mark.full
def test_the_table_of_the_readme_is_what_the_demo_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    [table] = [f.text for f in fences(README) if f.language == "text" and "controller" in f.text]
    assert_runs("design demo")
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert len(table.splitlines()) > 6
    assert [line for line in table.splitlines() if line not in printed] == []


def test_the_boundary_beside_a_command_of_the_readme_is_the_one_it_finds(capsys: pytest.CaptureFixture[str]) -> None:
    [line] = [line for line in README.read_text(encoding="utf-8").splitlines() if line.startswith("design boundary ")]
    command, _, found = line.partition("#")
    assert_runs(command)
    assert found.strip() in capsys.readouterr().out


def test_every_line_of_a_console_block_is_run_or_listed_with_a_reason() -> None:
    lines = [line for page in PAGES for line in console_lines(page)]
    assert [line for line in lines if not line.startswith("design ") and not is_skipped(line)] == []
    assert [reason for reason in NOT_RUN if not any(line.startswith(reason) for line in lines)] == []


@pytest.mark.parametrize(
    "name", [n for n, p in zip(NAMES, PAGES, strict=True) if any(f.language == "python" for f in fences(p))]
)
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


def test_no_block_is_in_a_language_that_nothing_checks() -> None:
    checked = {"python", "console", "text"}
    directive = re.compile(r"\{[a-z-]+\}")
    # cpp: excerpts of examples/hardware_driver, which is built and tested; sh: of CONTRIBUTING.md, for contributors;
    # cpp, diff and sh of the page about an own law: test_own_law.py applies, builds and runs them.
    # math: ./tools/docs sets it, and what it cannot set is an error.
    known = checked | {"cpp", "diff", "sh", "math"}
    others = [(n, f.language) for n, p in zip(NAMES, PAGES, strict=True) for f in fences(p) if f.language not in known]
    assert [(name, language) for name, language in others if not directive.match(language)] == []


# ---- links -----------------------------------------------------------------------------------------------------------


def heading_slugs(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site make them."""
    parsed = tokens(page)
    titles = [after.content for before, after in pairwise(parsed) if before.type == "heading_open"]
    plain = [re.sub(r"[`*]", "", title).lower() for title in titles]
    return {re.sub(r"[^\w\- ]", "", title).replace(" ", "-") for title in plain}


def targets(page: Path) -> Iterator[str]:
    """What a page links to or shows."""
    for token in tokens(page):
        if token.type in {"link_open", "image"}:
            yield str(token.attrs.get("href") or token.attrs["src"])
    for fence in fences(page):
        if match := re.match(r"\{(?:image|include)\}\s+(\S+)", fence.language):
            yield match[1]


def broken_link(page: Path, target: str) -> bool:
    path, _, anchor = target.partition("#")
    file = page if not path else (page.parent / path).resolve()
    return not file.is_file() or bool(anchor and file.suffix == ".md" and anchor not in heading_slugs(file))


@pytest.mark.parametrize("name", NAMES)
def test_every_internal_link_of_a_page_leads_somewhere(name: str) -> None:
    page = ROOT / name
    internal = [target for target in targets(page) if not re.match(r"[a-z]+:", target)]
    assert [target for target in internal if broken_link(page, target)] == []


def test_when_a_file_or_a_heading_is_missing_expect_a_broken_link() -> None:
    page = README
    assert broken_link(page, "docs/concepts/nowhere.md")
    assert broken_link(page, "docs/concepts/polytopes.md#nothing")
    assert not broken_link(page, "docs/concepts/polytopes.md#what-it-loses-the-matrix-cube")


# ---- figures, files and tests that are named -------------------------------------------------------------------------


def test_every_figure_is_shown_and_has_a_command_that_draws_it() -> None:
    figures = {path.name for path in (ROOT / "docs/images").iterdir()}
    shown = {Path(target).name for page in PAGES for target in targets(page) if "images/" in target}
    drawn = set(re.findall(r"docs/images/([\w.-]+)", (ROOT / "tools/doc-figures").read_text(encoding="utf-8")))
    assert figures
    assert (figures - shown, figures - drawn, drawn - figures) == (set(), set(), set())


def code_spans(page: Path) -> Iterator[str]:
    yield from (token.content for token in tokens(page) if token.type == "code_inline")


def test_every_file_named_in_the_documentation_exists() -> None:
    path = re.compile(r"(?:cpp|docs|examples|lcmtypes|python|tests|tools)/[\w/.-]+")
    pairs = {(name, span) for name, page in zip(NAMES, PAGES, strict=True) for span in code_spans(page)}
    named = {(name, span) for name, span in pairs if "slotine_li." not in span}  # the reader writes it
    assert [(name, span) for name, span in named if path.fullmatch(span) and not (ROOT / span).exists()] == []


def test_every_test_named_in_the_documentation_exists() -> None:
    defined = {
        node.name
        for file in (ROOT / "tests/python").glob("test_*.py")
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }
    named = {span for page in PAGES for span in code_spans(page) if re.fullmatch(r"test_\w+", span)}
    assert len(named) > 40
    assert named - defined == set()


def test_the_architecture_names_every_room_of_the_package() -> None:
    rooms = {path.parent.name for path in (ROOT / "python/design/quasilpv").glob("*/__init__.py")}
    assert len(rooms) > 10
    assert rooms - set(code_spans(ROOT / "docs/architecture.md")) == set()


def test_every_public_header_says_in_its_first_line_what_it_is_for() -> None:
    headers = [*ROOT.glob("cpp/*/include/**/*.hpp")]
    assert headers
    assert [path.name for path in headers if not re.match(r"// \S", path.read_text(encoding="utf-8"))] == []


# ---- the site --------------------------------------------------------------------------------------------------------


def test_when_the_script_is_called_wrongly_expect_its_help_and_exit_2() -> None:
    wrong = subprocess.run([ROOT / "tools/docs", "--fast"], capture_output=True, text=True, check=False)
    assert (wrong.returncode, "builds the documentation site" in wrong.stdout) == (2, True)
