"""Answers of a map kept in a file as they come, so that an interrupted map goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from quasilpv.errors import InputError
from quasilpv.studies.answer import Answer
from quasilpv.studies.question import Question
from quasilpv.studies.region import Axis
from quasilpv.systems.catalogue import system_kind


class Forgetful:
    """Keeps nothing."""

    def get(self, _: tuple[float, float]) -> Answer | None:
        """Nothing is known."""
        return None

    def put(self, _: tuple[float, float], __: Answer) -> None:
        """Nothing is kept."""


class Checkpoint:
    """One JSON line per answer, appended at once; a line cut short by an interruption is dropped.

    Args:
        folder: where the file lies; made if it is missing.
        question: of the map.
        swept: names of its parameters: file names tell questions apart by a hash of both.

    Raises:
        InputError: the folder or the file cannot be written, or the file holds something else.
    """

    def __init__(self, folder: Path, question: Question, swept: tuple[str, str]) -> None:
        """Read what is there."""
        identity = _digest([question.to_document(), swept], 16)
        self.path = folder / f"{system_kind(question.system).stem}-{question.condition}-{identity}.jsonl"
        self._known: dict[tuple[float, float], Answer] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._read()
            self._file = self.path.open("a", encoding="utf-8")
        except OSError as error:
            raise InputError(str(self.path), "checkpoint", error.strerror or str(error), "a writable file") from None

    @property
    def size(self) -> int:
        """Number of answers kept."""
        return len(self._known)

    def map_stem(self, x: Axis, y: Axis, *, full: bool) -> Path:
        """Where a map made of these answers is written, without suffix: maps of a question are told apart by a hash.

        Args:
            x, y: its axes.
            full: every point of the grid, or the refined ones only.
        """
        return self.path.with_name(f"{self.path.stem}-{_digest([asdict(x), asdict(y), full], 8)}")

    def get(self, place: tuple[float, float]) -> Answer | None:
        """The answer at a point, if it is known."""
        return self._known.get(place)

    def put(self, place: tuple[float, float], answer: Answer) -> None:
        """Keep an answer; it is on disk when this returns."""
        self._known[place] = answer
        self._file.write(json.dumps({"place": list(place), **answer.to_document()}) + "\n")
        self._file.flush()

    def _read(self) -> None:
        if not self.path.exists():
            return
        text = self.path.read_bytes()
        complete = text[: text.rfind(b"\n") + 1]
        if len(complete) < len(text):
            self.path.write_bytes(complete)
        for number, line in enumerate(complete.splitlines(), start=1):
            try:
                entry = json.loads(line)
                place = (float(entry["place"][0]), float(entry["place"][1]))
                fields = {name: value for name, value in entry.items() if name != "place"}
                self._known[place] = Answer.from_document(fields)
            except (ValueError, KeyError, TypeError, IndexError):
                raise InputError(
                    str(self.path), f"line {number}", line[:60].decode("utf-8", "replace"), "an answer of a map"
                ) from None


def _digest(identity: Any, digits: int) -> str:
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:digits]
