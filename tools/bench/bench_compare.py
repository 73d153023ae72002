"""Two kept results of `tools/bench/all` beside each other: what became cheaper, what dearer, and what is noise."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from quasilpv.errors import InputError

LEAST_NOISE = 1.05
"""A change by less is never told from noise."""


@dataclass(frozen=True)
class Change:
    """One row of both results.

    Attributes:
        name: layer and row.
        old, new: cost, in the row's unit.
        noise: factor by which the competitors of its layer moved between the two runs, one way or the other. Their
            code is the same in both, so this is what the machine does.
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
    """The rows that both results have, in the order of the new one."""
    for layer, found in new["layers"].items():
        before = {row["name"]: row for row in old["layers"].get(layer, {"rows": []})["rows"]}
        pairs = [(before[row["name"]], row) for row in found["rows"] if row["name"] in before]
        noise = max([LEAST_NOISE, *(_moved(one, other) for one, other in pairs)])
        for one, other in pairs:
            yield Change(f"{layer}: {other['name']}", one["value"], other["value"], noise)


def _moved(old: Mapping[str, Any], new: Mapping[str, Any]) -> float:
    """How the cost of a row's competitor changed, as a factor of at least 1; 1 without one."""
    if old["ratio"] is None or new["ratio"] is None or old["against"] != new["against"]:
        return 1.0
    factor = new["ratio"] * new["value"] / (old["ratio"] * old["value"])
    return max(factor, 1.0 / factor)
