"""What a notebook shows of a result in place of its text: a table of a few rows."""

from __future__ import annotations

import html
from collections.abc import Mapping


def html_table(caption: str, rows: Mapping[str, object]) -> str:
    """Two columns under a caption; text is text, whatever characters it has, and numbers have six digits."""
    cells = "".join(
        f"<tr><th style='text-align:left;padding-right:1em'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(f'{value:.6g}' if isinstance(value, float) else str(value))}</td>"
        "</tr>"
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(caption)}</caption>{cells}</table>"
