"""Answers of a map kept in a file as they come, so that an interrupted map goes on where it stopped.

A file is no authority. A feasible answer carries the solution that proves it, and is believed after that has been
checked in exact arithmetic again; what was proved to be infeasible is proved anew. Every line carries a hash of itself
and of all lines before it, so that an edited file is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from quasilpv.errors import InputError
from quasilpv.studies.answer import Answer, Evidence, Verdict
from quasilpv.studies.question import Question
from quasilpv.studies.region import Axis, Places, Task, sweep_of
from quasilpv.systems.catalogue import system_kind

SCHEMA, SCHEMA_VERSION = "quasilpv.map-checkpoint", 2
"""Version 1 had no first line that names it, and nothing that proves an answer."""


class Forgetful:
    """Keeps nothing."""

    def get(self, _: Places) -> Answer | None:
        """Nothing is known."""
        return None

    def put(self, _: Places, __: Answer) -> None:
        """Nothing is kept."""


class Checkpoint:
    """A first line that says of what, then one JSON line per answer, appended at once.

    A line cut short by an interruption is dropped.

    Args:
        folder: where the file lies; made if it is missing.
        question: of the map.
        swept: names of its parameters: file names tell questions apart by a hash of both.

    Raises:
        InputError: the folder or the file cannot be written, or the file holds something else, is of another version,
            or was changed.
    """

    def __init__(self, folder: Path, question: Question, swept: tuple[str, str]) -> None:
        """Read what is there."""
        self._question, self._swept = question, swept
        identity = _digest([question.to_document(), swept], 16)
        self.path = folder / f"{system_kind(question.system).stem}-{question.condition}-{identity}.jsonl"
        self._known: dict[Places, Answer] = {}
        self._unchecked: set[Places] = set()
        self._hash = ""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if self.path.exists() and not self.path.is_file():
                raise InputError(str(self.path), "checkpoint", "no regular file", "a file")
            self._file = self.path.open("a+b")
            self._read()
        except OSError as error:
            raise InputError(str(self.path), "checkpoint", error.strerror or str(error), "a writable file") from None

    @property
    def size(self) -> int:
        """Number of answers kept."""
        return len(self._known)

    def map_stem(self, x: Axis, y: Axis, kind: str) -> Path:
        """Where a map made of these answers is written, without suffix: maps of a question are told apart by a hash.

        Args:
            x, y: its axes.
            kind: what is evaluated: areas, points, or the whole grid.
        """
        return self.path.with_name(f"{self.path.stem}-{_digest([asdict(x), asdict(y), kind], 8)}")

    def get(self, places: Places) -> Answer | None:
        """The answer at one place or several, if it is known.

        That nothing exists, with a proof, is not known from a file: it is as quick to prove it again.

        Raises:
            InputError: the file says that it is feasible, and what it gives as a proof is none.
        """
        answer = self._known.get(places)
        if answer is None or places not in self._unchecked:
            return answer
        if answer.verdict is Verdict.INFEASIBLE and answer.evidence is Evidence.PROVED:
            return None
        if answer.verdict is Verdict.FEASIBLE:
            task = Task(self._question, self._swept, places)
            if not sweep_of(task.question, task.swept).proves(task.points, answer.witness, answer.units):
                raise self._changed(f"a proof at {places[0]} that does not hold")
        self._unchecked.discard(places)
        return answer

    def put(self, places: Places, answer: Answer) -> None:
        """Keep an answer; it is on disk when this returns. A feasible one without a witness is not kept."""
        again = places in self._unchecked
        self._known[places] = answer
        self._unchecked.discard(places)
        if not again and (answer.witness or not answer.certified):
            self._append({"places": places, **answer.to_document()})

    def _append(self, entry: Mapping[str, Any]) -> None:
        body = json.dumps(entry)
        self._hash = _chained(self._hash, body)
        self._file.write(f'{body[:-1]}, "hash": "{self._hash}"}}\n'.encode())
        self._file.flush()

    def _read(self) -> None:
        """Whole lines from the start of the file; what comes after the last one is cut off."""
        self._file.seek(0)
        text = self._file.read()
        complete = text[: text.rfind(b"\n") + 1]
        if len(complete) < len(text):
            os.truncate(self._file.fileno(), len(complete))
        lines = complete.splitlines()
        if not lines:
            question = self._question.to_document()
            self._append({"schema": SCHEMA, "schema_version": SCHEMA_VERSION, "question": question})
            return
        self._read_head(self._entry(lines[0], 1, chained=False))
        self._entry(lines[0], 1)
        for number, line in enumerate(lines[1:], start=2):
            entry = self._entry(line, number)
            try:
                places = tuple(tuple(map(float, place)) for place in entry["places"])
                del entry["places"], entry["hash"]
                self._known[places] = Answer.from_document(entry)
            except (ValueError, KeyError, TypeError):
                raise self._foreign(line, number) from None
        self._unchecked = set(self._known)

    def _read_head(self, head: Mapping[str, Any]) -> None:
        if "place" in head:
            raise self._refused("checkpoint", "version 1, which proves nothing", f"version {SCHEMA_VERSION}")
        version = head.get("schema_version")
        if head.get("schema") != SCHEMA:
            raise self._foreign(json.dumps(head).encode(), 1)
        if version != SCHEMA_VERSION:
            raise self._refused("schema_version", version, str(SCHEMA_VERSION))

    def _entry(self, line: bytes, number: int, *, chained: bool = True) -> dict[str, Any]:
        """A line as an object, after its hash has been compared."""
        try:
            entry = json.loads(line)
            body, found = line.decode().rsplit(', "hash": "', 1) if chained else ("", "")
        except ValueError:
            raise self._foreign(line, number) from None
        if not isinstance(entry, dict):
            raise self._foreign(line, number)
        if chained:
            self._hash = _chained(self._hash, f"{body}}}")
            if found != f'{self._hash}"}}':
                raise self._changed(f"line {number}, whose hash is another")
        return entry

    def _changed(self, what: str) -> InputError:
        return self._refused("checkpoint", what, "answers as they were written")

    def _refused(self, field: str, got: object, expected: str) -> InputError:
        return InputError(str(self.path), field, got, f"{expected}; move the file away to begin anew")

    def _foreign(self, line: bytes, number: int) -> InputError:
        return InputError(str(self.path), f"line {number}", line[:60].decode("utf-8", "replace"), "an answer of a map")


def _chained(before: str, body: str) -> str:
    return hashlib.sha256((before + body).encode()).hexdigest()


def _digest(identity: Any, digits: int) -> str:
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:digits]
