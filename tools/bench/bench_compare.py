"""Two kept results of `tools/bench/all` beside each other: what became cheaper, what dearer, and what is noise."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from quasilpv.errors import InputError

LEAST_NOISE = 1.05
"""A change by less is never told from noise."""


Row: TypeAlias = Mapping[str, Any]
"""A row as it is kept: `bench_report.Row`."""


@dataclass(frozen=True)
class Change:
    """One row of both results.

    Attributes:
        name: layer and row.
        old, new: cost, in the row's unit.
        noise: factor by which the same code can differ between these two runs.
    """

    name: str
    old: float
    new: float
    noise: float

    @property
    def ratio(self) -> float:
        """New over old: above 1 it costs more now."""
        return self.new / self.old

    @property
    def mark(self) -> str:
        """``cheaper``, ``dearer``, or ``~`` for a change within the noise."""
        if abs(math.log(self.ratio)) <= math.log(self.noise):
            return "~"
        return "dearer" if self.ratio > 1.0 else "cheaper"


def read_results(path: Path) -> dict[str, Any]:
    """A document that `tools/bench/all` has kept.

    Raises:
        InputError: the file cannot be read, or is something else.
    """
    try:
        document = json.loads(path.read_bytes())
        layers = document["layers"]
        assert all(isinstance(row["value"], int | float) for layer in layers.values() for row in layer["rows"])
    except OSError as error:
        raise InputError(str(path), "file", error.strerror, "a readable file") from error
    except (ValueError, KeyError, TypeError, AttributeError, AssertionError) as error:
        raise InputError(str(path), "document", "something else", "results kept by tools/bench/all") from error
    return dict(document)


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    """The rows that both results have, in the order of the new one.

    What the machine does within a run shows in the spread of a row, or in the widest of its layer if the row was
    measured once. What it does between the runs shows in competitors that are not of this project: that of the row,
    else all of its layer, else all there are. The noise is their product; counts have none.
    """
    pairs = {layer: _in_both(old["layers"].get(layer, {"rows": []}), found) for layer, found in new["layers"].items()}
    foreign = {layer: bool(found.get("foreign")) for layer, found in new["layers"].items()}
    moved_anywhere = max((_moved(*pair) for layer in pairs if foreign[layer] for pair in pairs[layer]), default=1.0)
    for layer, common in pairs.items():
        widest = max((_spread(*pair) for pair in common), default=1.0)
        moved = max((_moved(*pair) for pair in common), default=1.0) if foreign[layer] else moved_anywhere
        for before, after in common:
            within = widest if after.get("spread") is None else _spread(before, after)
            between = _moved(before, after) if foreign[layer] and after["against"] else moved
            noise = 1.0 if after["unit"] == "1" else max(LEAST_NOISE, within * between)
            yield Change(f"{layer}: {after['name']}", before["value"], after["value"], noise)


def _in_both(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[tuple[Row, Row]]:
    """The rows of one layer that both results have."""
    before = {row["name"]: row for row in old["rows"]}
    return [(before[row["name"]], row) for row in new["rows"] if row["name"] in before]


def _spread(old: Row, new: Row) -> float:
    """The wider spread of the two; 1 if the row was measured once in each run."""
    return max(old.get("spread") or 1.0, new.get("spread") or 1.0)


def _moved(old: Row, new: Row) -> float:
    """How the cost of a row's competitor changed, as a factor of at least 1; 1 without one."""
    if old["ratio"] is None or new["ratio"] is None or old["against"] != new["against"]:
        return 1.0
    factor = float(new["ratio"] * new["value"] / (old["ratio"] * old["value"]))
    return max(factor, 1.0 / factor)
