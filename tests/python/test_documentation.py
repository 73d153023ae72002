"""The documentation says what is so: its links resolve, its figures have a command, its files and tests exist."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from pages import NAMES, PAGES, ROOT, fences, tokens

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
    page = ROOT / "README.md"
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
