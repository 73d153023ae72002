"""Pages as text: lines of a length that can be read and compared, and the words they define."""

from pathlib import Path

import prose
import pytest
from markdown_it import MarkdownIt

from pages import PAGES, ROOT
from quasilpv.conditions.reliance import Reliance

WRITTEN = [page for page in PAGES if page.name != "benchmark-results.md"]  # that one is generated

MARKDOWN = MarkdownIt("commonmark").enable("table")


def rendered(page: str) -> str:
    """What a reader sees, with lines joined."""
    return " ".join(MARKDOWN.render(page).split())


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_of_a_page_is_longer_than_can_be_read(page: Path) -> None:
    assert list(prose.too_long(page.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_when_a_page_is_broken_at_sentences_expect_the_same_page_once_and_for_all(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    broken = prose.reflowed(text)
    assert rendered(broken) == rendered(text)
    assert prose.reflowed(broken) == broken


def test_when_a_paragraph_has_two_sentences_expect_two_lines_that_begin_nothing_else() -> None:
    text = "See fig. I.2, e.g. this one. It has `a. b` and [a. B](x). Then " + "word " * 30 + "1. is no list.\n"
    lines = prose.reflowed(text).splitlines()
    assert lines[:2] == ["See fig. I.2, e.g. this one.", "It has `a. b` and [a. B](x)."]
    assert max(map(len, lines)) <= prose.LONGEST
    assert not any(line.startswith("1.") for line in lines)


def test_when_a_line_is_too_long_expect_its_number_unless_it_is_code_or_a_table() -> None:
    long = "word " * 40
    page = f"# Title\n\n{long}\n\n```\n{long}\n```\n\n| {long} |\n|---|\n"
    assert list(prose.too_long(page)) == [3]


def test_the_glossary_says_what_everything_means_that_a_condition_relies_on() -> None:
    page = (ROOT / "docs/reference/glossary.md").read_text(encoding="utf-8")
    assert [one.value for one in Reliance if f"| {one.value} |" not in page] == []
