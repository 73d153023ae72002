"""Results as a table for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def markdown_table(rows: Iterable[Mapping[str, Any]]) -> str:
    """One line per item: id, verdict, reason, and what had to be assumed.

    Args:
        rows: of ``results.json``.
    """
    lines = ["| item | verdict | what holds | assumed |", "|---|---|---|---|"]
    for row in rows:
        cells = (row["id"], row["verdict"], row["reason"] or "as printed", "; ".join(row["assumptions"]) or "nothing")
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
