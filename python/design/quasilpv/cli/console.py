"""What verbs share for output: JSON on stdout, tables, and progress on stderr where a person is looking."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from quasilpv.files import readable_json

if TYPE_CHECKING:
    from rich.progress import Progress

JsonOption: TypeAlias = Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else there.")]

WIDTH_WITHOUT_TERMINAL = 160


def print_json(value: Any) -> None:
    """Print a JSON-able tree on stdout."""
    print(readable_json(value))


def print_note(message: str) -> None:
    """Print a note for people on stderr."""
    print(message, file=sys.stderr)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], left_columns: int = 1) -> None:
    """Print a table on stdout, never cut to a terminal that is not there.

    Args:
        title: printed above.
        columns: headings; a line break in a heading is kept; no heading line if all are empty.
        rows: cells as text.
        left_columns: how many columns, from the left, are text; the others are numbers and align right.
    """
    from rich.console import Console
    from rich.table import Table

    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else WIDTH_WITHOUT_TERMINAL)
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.show_header = any(columns)
    for index, heading in enumerate(columns):
        table.add_column(heading, justify="left" if index < left_columns else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(table)


class Steps:
    """Progress over a known number of steps, and inside the current one over a known number of parts."""

    def __init__(self, progress: Progress, total: int) -> None:
        """Show ``total`` steps on ``progress``."""
        self._progress = progress
        self._steps = progress.add_task("", total=total)
        self._parts = progress.add_task("", total=None, visible=False)

    def begin(self, description: str) -> None:
        """Name the step that starts now."""
        self._progress.update(self._steps, description=description)

    def parts(self, done: int, total: int) -> None:
        """Say how far the current step is: a callback for long computations."""
        self._progress.update(self._parts, description="evaluations", completed=done, total=total, visible=done < total)

    def end(self) -> None:
        """Count the step that has ended."""
        self._progress.advance(self._steps)
        self._progress.reset(self._parts, visible=False)


@contextmanager
def progress(total: int) -> Iterator[Steps]:
    """Progress bars with the time left, on stderr and only on a terminal; they leave nothing behind."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(file=sys.stderr)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        yield Steps(bar, total)
