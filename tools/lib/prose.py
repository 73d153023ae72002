#!/usr/bin/env python3
"""Lines of Markdown: one sentence begins each, and none is longer than 120 characters.

    prose.py FILE...           names lines that are longer; exit code 1 if there are any
    prose.py --write FILE...   breaks them at sentences, long ones at words; the rendered page stays the same

Code, tables, headings, HTML and what cannot be broken (a link, a formula, a word) may be longer.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

LONGEST = 120

FENCE = re.compile(r"\s*(`{3,}|~{3,}|:{3,})")
MARKER = re.compile(r"(?:[-*+]|\d+[.)]) +")
KEPT = re.compile(r"\s*(?:[#|<]|\[[^\]]+\]:|\$\$|!\[|---|===|\(\w+\)=)")
"""Beginnings of lines that stay as they are: headings, tables, HTML, link targets, formulas, figures, rules."""

ATOM = re.compile(r"`+[^`]+`+|!?\[[^\]]*\]\([^)]*\)|\$[^$]+\$|\S")
"""What is not broken: code, links, formulas."""

ABBREVIATION = re.compile(r"(?:\b(?:e\.g|i\.e|cf|vs|al|[Ff]igs?|[Ee]qs?|approx|incl|ca|pp?|Sect?|Ch|No|Ex)|\b[A-Z])\.$")
END = re.compile(r"[.!?][)\"'”*_`]*$")
BEGIN = re.compile(r"[\"'“(*_`\[]*[A-Z0-9`$\[]")
STRUCTURE = re.compile(r"(?:[-+*]$|-{2}|[#>|=~]|\d+[.)]|`{3}|:{3})")
"""What would begin something else than prose at the beginning of a line."""


def words(text: str) -> list[str]:
    """Words of a paragraph, with code, links and formulas unbroken."""
    found, start, place = [], 0, 0
    while place < len(text):
        if text[place] == " ":
            if place > start:
                found.append(text[start:place])
            start = place = place + 1
            continue
        atom = ATOM.match(text, place)
        place = atom.end() if atom else place + 1
    return [*found, text[start:]] if start < len(text) else found


def sentences(text: str) -> Iterator[list[str]]:
    """Words of one sentence after the other."""
    sentence: list[str] = []
    for word in words(text):
        ended = bool(sentence) and bool(END.search(sentence[-1])) and not ABBREVIATION.search(sentence[-1])
        if ended and BEGIN.match(word) and not STRUCTURE.match(word):
            yield sentence
            sentence = []
        sentence.append(word)
    if sentence:
        yield sentence


def broken(text: str, first: str, indent: str) -> Iterator[str]:
    """Lines of a paragraph.

    Args:
        text: of it, on one line.
        first, indent: what stands before its first line, and before the others.
    """
    lead = first
    for sentence in sentences(text):
        line = lead + sentence[0]
        for word in sentence[1:]:
            if len(line) + 1 + len(word) > LONGEST and not STRUCTURE.match(word):
                yield line
                line = indent + word
            else:
                line += " " + word
        yield line
        lead = indent


@dataclass
class Block:
    """Lines that belong together: a paragraph, or one line that stays as it is.

    Attributes:
        lines: as they are, the first one being line `number` of the page.
        first, indent: what stands before the first line of a paragraph, and before the others.
        words: of each line of a paragraph, without that; none of a line that stays.
    """

    number: int
    lines: list[str]
    first: str = ""
    indent: str = ""
    words: list[str] = field(default_factory=list)

    @property
    def broken(self) -> list[str]:
        """The lines as they should be."""
        return list(broken(" ".join(self.words), self.first, self.indent)) if self.words else self.lines


def blocks(page: str) -> Iterator[Block]:
    """Of a page, in order."""
    paragraph: Block | None = None
    fence, item = "", False
    for number, line in enumerate(page.splitlines(), 1):
        opening = FENCE.match(line)
        bare = line.lstrip()
        depth = len(line) - len(bare)
        marker = MARKER.match(bare)
        continues = paragraph is not None and not marker and (depth == len(paragraph.indent) or depth < 4)
        is_code = depth >= 4 and not continues and not marker and not item
        stays = not bare or bool(KEPT.match(line)) or is_code or bare.startswith(">") or line.endswith(("  ", "\\"))
        if fence or opening or stays:
            if paragraph is not None:
                yield paragraph
            paragraph = None
            yield Block(number, [line])
            if fence and opening and opening[1].startswith(fence) and bare == opening[1]:
                fence = ""
            elif opening and not fence:
                fence = opening[1]
            item = item and (not bare or depth > 0)
        elif continues and paragraph is not None:
            paragraph.lines.append(line)
            paragraph.words.append(bare.rstrip())
        else:
            if paragraph is not None:
                yield paragraph
            lead = " " * depth + (marker[0] if marker else "")
            text = bare[len(marker[0]) if marker else 0 :].rstrip()
            paragraph = Block(number, [line], lead, " " * len(lead), [text])
            item = bool(marker) or depth > 0
    if paragraph is not None:
        yield paragraph


def reflowed(page: str) -> str:
    """A page with its prose broken at sentences."""
    return "".join(line + "\n" for block in blocks(page) for line in block.broken)


def too_long(page: str) -> Iterator[int]:
    """Numbers of lines of prose that are longer than allowed and that can be broken."""
    for block in blocks(page):
        kept = block.broken
        for number, line in enumerate(block.lines, block.number):
            if len(line) > LONGEST and line not in kept:
                yield number


def main(arguments: list[str]) -> int:
    """Check or rewrite files; see the module."""
    write, status = "--write" in arguments, 0
    for name in arguments:
        if name == "--write":
            continue
        path = Path(name)
        page = path.read_text(encoding="utf-8")
        if write:
            path.write_text(reflowed(page), encoding="utf-8")
            continue
        for number in too_long(page):
            print(f"{name}:{number}: longer than {LONGEST} characters; tools/lib/prose.py --write breaks it")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
