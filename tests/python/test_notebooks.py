"""The notebooks of the documentation run as they are, and show what is stored in them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "docs/notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
QUICK = "own_system"


def kinds(cell: Any) -> list[set[str]]:
    """What a cell shows: the types of every output."""
    return [set(output.get("data", {"stream": ""})) for output in cell.get("outputs", [])]


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=() if path.stem == QUICK else pytest.mark.full) for path in NOTEBOOKS],
    ids=lambda path: path.stem,
)
def test_a_notebook_runs_and_its_stored_outputs_are_of_the_same_kinds(path: Path, tmp_path: Path) -> None:
    stored = nbformat.read(str(path), as_version=4)
    fresh = nbformat.read(str(path), as_version=4)
    client = NotebookClient(fresh, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}})
    client.execute()  # an exception in a cell is one here
    shown = [(kinds(old), kinds(new)) for old, new in zip(stored.cells, fresh.cells, strict=True)]
    assert [old for old, _ in shown] == [new for _, new in shown]
    assert sum("image/png" in output for old, _ in shown for output in old) > 0


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_shows_is_short_and_of_no_machine(path: Path) -> None:
    for cell in nbformat.read(str(path), as_version=4).cells:
        for output in cell.get("outputs", []):
            text = output.get("data", {}).get("text/plain", output.get("text", ""))
            assert len(text.splitlines()) <= 10
            assert "/" + "work" not in text
            assert not re.search(r"\b0x[0-9a-f]", text)  # no address


def test_there_are_notebooks() -> None:
    assert {path.stem for path in NOTEBOOKS} == {"condition", "own_system", "robot_arm"}
