"""``design inspect``: what an artifact contains."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table


def inspect_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    json: JsonOption = False,
) -> None:
    """Check an artifact and print what it contains.

    \b
    Example:
      design inspect out/arm3/artifact.json
    """
    from quasilpv.artifact import read_artifact, summary
    from quasilpv.artifact.system_store import read_system_artifact, system_summary

    system = read_system_artifact(artifact)
    contents = summary(read_artifact(artifact)) if system is None else system_summary(system)
    if json:
        print_json(contents)
        return
    print_table(str(artifact), ("", ""), list(_rows("", contents)), left_columns=2)


def _rows(path: str, value: Any) -> list[tuple[str, str]]:
    """One row per leaf, named by its path; lists of numbers on one line."""
    if isinstance(value, dict) and value:
        return [row for name, member in value.items() for row in _rows(f"{path}.{name}" if path else name, member)]
    if isinstance(value, list):
        return [(path, ", ".join(_leaf(item) for item in value))]
    return [(path, _leaf(value))]


def _leaf(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
