"""The pages as tests read them: their blocks, their commands, and what they say these print."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import isnan
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("[!_]*.md"), *(ROOT / "docs").glob("[!_]*/*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

NOT_RUN = {
    "./tools/demo": "installs and builds",
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


@dataclass(frozen=True)
class Command:
    """A line of a console block, without its comment, and the block of text below it, if it is the last one."""

    line: str
    printed: str | None = None

    @property
    def is_skipped(self) -> bool:
        return any(self.line.startswith(beginning) for beginning in NOT_RUN)


@cache
def tokens(page: Path) -> list[Token]:
    """Of a page, those inside paragraphs and tables too."""
    parsed = MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))
    return [part for token in parsed for part in (token, *(token.children or ()))]


def fences(page: Path) -> list[Fence]:
    return [Fence(t.info.strip(), t.content, t.map[0] + 1) for t in tokens(page) if t.type == "fence" and t.map]


def commands(page: Path) -> Iterator[Command]:
    """Of the console blocks, in their order; a block of text is what the block before it prints."""
    for fence, after in pairwise([*fences(page), Fence("", "", 0)]):
        if fence.language == "console":
            whole = fence.text.replace("\\\n", " ")
            bare = [shlex.join(shlex.split(raw, comments=True)) for raw in whole.splitlines()]
            *before, last = [line for line in bare if line]
            yield from map(Command, before)
            yield Command(last, after.text if after.language == "text" else None)


def unprinted(said: str, printed: str) -> list[str]:
    """Lines of a page that a command did not print, in their order: it may print more lines between them.

    Words have to be the same, and numbers within 1 %, those with a point and what rounding makes of that: last digits
    are the machine's, its libraries' and solvers'.
    A page writes `...` for a number that is another one every time.
    """
    rest, missing = iter(printed.splitlines()), []
    for line in said.splitlines():
        if not any(_same(line, candidate) for candidate in rest):
            missing.append(line)
            rest = iter(printed.splitlines())
    return missing


NUMBER = re.compile(r"(?<![A-Za-z_])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?|(?<= )\.\.\.(?= )")


def _same(said: str, printed: str) -> bool:
    (here, numbers), (there, others) = _parted(said), _parted(printed)
    pairs = zip(numbers, others, strict=False)
    return here == there and all(abs(a - b) <= 0.01 * abs(a) + rounding or isnan(a) for (a, rounding), (b, _) in pairs)


def _parted(line: str) -> tuple[str, list[tuple[float, float]]]:
    """Words of a line with a mark for each number, and the numbers, with half of their last place after a point."""
    numbers = [
        (float(text.replace("−", "-").replace("...", "nan")), _half_a_digit(text)) for text in NUMBER.findall(line)
    ]
    return " ".join(NUMBER.sub("#", line).split()), numbers


def _half_a_digit(number: str) -> float:
    digits, _, exponent = number.partition("e")
    _, point, decimals = digits.partition(".")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(decimals)) if point and decimals else 0.0
