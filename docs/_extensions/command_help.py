"""The directive ``command-help``: every verb of the command, in the words of its own ``--help``."""

from __future__ import annotations

import contextlib
import io

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from quasilpv.cli.app import run
from quasilpv.cli.verbs import VERBS


def help_of(*verb: str) -> str:
    """What ``design VERB --help`` prints.

    Raises:
        RuntimeError: the command does not explain itself.
    """
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        code = run([*verb, "--help"])
    if code != 0:
        raise RuntimeError(f"design {' '.join(verb)} --help: exit code {code}")
    return printed.getvalue().strip()


class CommandHelp(Directive):
    """One section per verb, after the help of the command itself."""

    def run(self) -> list[nodes.Node]:
        """The sections as nodes."""
        content: list[nodes.Node] = [_listing(help_of())]
        for verb in VERBS:
            title = f"design {verb}"
            section = nodes.section(ids=[nodes.make_id(title)], names=[nodes.fully_normalize_name(title)])
            section += [nodes.title(text=title), _listing(help_of(verb))]
            content.append(section)
        return content


def _listing(text: str) -> nodes.literal_block:
    return nodes.literal_block(text, text, language="text", classes=["help"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True}
