"""Text whose lines stand in columns gets the class ``columns``: on a narrow screen it scrolls, other text wraps."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx

COLUMNS = re.compile(r"\S {2,}\S")
LEAST_LINES = 3


def in_columns(text: str) -> bool:
    """Whether most lines have a gap, and enough of them to call it a table."""
    lines = [line for line in text.splitlines() if line.strip()]
    gaps = sum(COLUMNS.search(line) is not None for line in lines)
    return gaps >= LEAST_LINES and 2 * gaps >= len(lines)


def mark(_app: Sphinx, doctree: nodes.document) -> None:
    """Mark those of a page; texts of help pages, which say their own class, go on below."""
    for block in doctree.findall(nodes.literal_block):
        if block.get("language") == "text" and not block["classes"] and in_columns(block.astext()):
            block["classes"].append("columns")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the above."""
    app.connect("doctree-read", mark)
    return {"parallel_read_safe": True}
