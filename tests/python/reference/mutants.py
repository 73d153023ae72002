"""Errors to plant in the source of a builder of inequalities."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

BLOCKS = "quasilpv.conditions.forms.blocks"


@dataclass(frozen=True)
class Mutant:
    """One error in one block.

    Attributes:
        block: which, rows and columns of blocks counted from 1.
        right, wrong: the piece of source and what takes its place.
        room: module the piece is in, if it is not the builder's.
        place: which of the occurrences of the piece, counted from 0, and how many there are.
    """

    block: str
    right: str
    wrong: str
    room: str = ""
    place: tuple[int, int] = (0, 1)

    def loaded(self, monkeypatch: pytest.MonkeyPatch, builder: str) -> ModuleType:
        """The builder's module, made anew with this error in it."""
        module = ModuleType("nothing")
        for name in dict.fromkeys((BLOCKS, builder)):
            spec = importlib.util.find_spec(name)
            assert spec is not None
            assert spec.origin is not None
            source = Path(spec.origin).read_text(encoding="utf-8")
            if name == (self.room or builder):
                source = self._applied(source, name)
            module = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, name, module)
            exec(compile(source, spec.origin, "exec"), module.__dict__)
        return module

    def _applied(self, source: str, name: str) -> str:
        index, count = self.place
        parts = source.split(self.right)
        assert len(parts) == count + 1, f"{self.right!r} is {len(parts) - 1} times in {name}: adapt this mutant"
        return self.right.join(parts[: index + 1]) + self.wrong + self.right.join(parts[index + 1 :])
