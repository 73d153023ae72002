"""Computing items one after the other, each kept as soon as it is done."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from quasilpv.defaults import DEFAULT_FORMATS
from quasilpv.errors import InputError, QuasilpvError
from quasilpv.figures.style import save
from quasilpv.files import write_atomically, write_readable_json
from quasilpv.reproduction.item import Effort, Item, ItemResult
from quasilpv.reproduction.report import markdown_table

RESULTS, REPORT = "results.json", "results.md"


def reproduce(
    items: Sequence[Item],
    effort: Effort,
    out: Path,
    *,
    formats: Sequence[str] = DEFAULT_FORMATS,
    begin: Callable[[str], None] = lambda _: None,
    end: Callable[[], None] = lambda: None,
) -> list[Mapping[str, Any]]:
    """Compute items and write figures, ``<id>.json`` each, and all current rows as ``results.json``, ``results.md``.

    An item whose result is already in the folder, computed with the same effort from the same code and drawn in these
    formats, is not computed again: an interrupted run goes on where it stopped.

    Args:
        items: which.
        effort: how fine.
        out: folder; made if it is missing.
        formats: of the figures, see `quasilpv.figures.style.FORMATS`.
        begin, end: called around every item.

    Returns:
        One row per item, see `ItemResult.to_document`.

    Raises:
        InputError: the folder cannot be written; or items were refused, after all the others have been computed.
    """
    refused: dict[str, QuasilpvError] = {}
    rows: list[Mapping[str, Any]] = []
    code = _code_digest()
    stamp = {"effort": effort.value, "code": code, "formats": [*formats]}
    _write_results(out, rows, code)  # a folder that cannot be written is found before anything is computed
    for one in items:
        begin(one.id)
        row = _kept(out / f"{one.id}.json", effort, code, formats)
        try:
            row = row or {**_computed(one, effort, out, formats), **stamp}
        except QuasilpvError as error:
            refused[one.id] = error  # the others do not depend on it
        else:
            write_readable_json(out / f"{one.id}.json", row)
            rows.append(row)
            _write_results(out, rows, code)
        end()
    if refused:
        reasons = "; ".join(f"{name}: {error}" for name, error in refused.items())
        raise InputError(str(out / RESULTS), "items", f"{len(refused)} refused: {reasons}", "a result of every item")
    return rows


def _computed(one: Item, effort: Effort, out: Path, formats: Sequence[str]) -> dict[str, Any]:
    start = time.perf_counter()
    finding = one.compute(effort)
    result = ItemResult(one, finding, time.perf_counter() - start)
    for name, figure in finding.figures.items():
        save(figure, out / (f"{one.id}-{name}" if name else one.id), formats)
    return result.to_document()


def _write_results(out: Path, rows: Sequence[Mapping[str, Any]], code: str) -> None:
    """Rows of earlier runs of the same code, replaced by or followed by those of this one."""
    known = {row["id"]: row for row in [*_rows(out / RESULTS), *rows] if row["code"] == code}
    merged = list(known.values())
    write_readable_json(out / RESULTS, merged)
    write_atomically({out / REPORT: markdown_table(merged).encode()})


def _kept(path: Path, effort: Effort, code: str, formats: Sequence[str]) -> Mapping[str, Any] | None:
    """The row of an earlier run, if it is of the same effort and code, and drew these formats."""
    rows = _rows(path)
    if not rows or (rows[0]["effort"], rows[0]["code"]) != (effort.value, code):
        return None
    return rows[0] if {*formats} <= {*rows[0].get("formats", ())} else None


def _rows(path: Path) -> list[Mapping[str, Any]]:
    """What a file of this program holds, nothing if there is none."""
    if not path.exists():
        return []
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        rows: list[Mapping[str, Any]] = content if isinstance(content, list) else [content]
        if not all(isinstance(row[name], str) for row in rows for name in ("id", "effort", "code")):
            raise ValueError("not text")
    except (OSError, ValueError, KeyError, TypeError) as error:
        expected = "a result of this program, or no file"
        raise InputError(str(path), "file", f"{type(error).__name__}: {error}", expected) from None
    return rows


def _code_digest() -> str:
    """SHA-256 over the sources of the package: a change anywhere makes every kept result stale."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()
