"""The directive ``header-table``: public headers of a C++ library, each with its first line and doxygen page."""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]


def summary(header: Path) -> str:
    """The comment a header begins with, on one line.

    Raises:
        ValueError: it does not begin with a comment.
    """
    lines = header.read_text(encoding="utf-8").splitlines()
    end = next(number for number, line in enumerate(lines) if not line.startswith("//"))
    if end == 0:
        raise ValueError(f"{header}: expected a first line // that says what it is for")
    return " ".join(line.lstrip("/ ") for line in lines[:end])


def doxygen_page(header: str) -> str:
    """Name of doxygen's page of a header of the folder quasilpv: underscores are doubled, the point is _8."""
    return f"cpp/{header.replace('_', '__').replace('.', '_8')}.html"


class HeaderTable(Directive):
    """A table of all headers of the folder given as argument, relative to the project's root."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table as nodes."""
        group = nodes.tgroup(cols=2)
        group += [nodes.colspec(colwidth=25), nodes.colspec(colwidth=75)]
        body = nodes.tbody()
        for header in sorted((ROOT / self.arguments[0]).glob("*.hpp")):
            link = nodes.reference(refuri=f"../{doxygen_page(header.name)}", internal=False)
            link += nodes.literal(text=header.name)
            body += _row(nodes.paragraph("", "", link), nodes.paragraph(text=summary(header)))
        group += body
        return [nodes.table("", group)]


def _row(*cells: nodes.Node) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", cell)
    return row


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("header-table", HeaderTable)
    return {"parallel_read_safe": True}
