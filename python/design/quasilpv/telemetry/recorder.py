"""Logs of what processes say to each other over LCM, as they say it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Protocol, Self

import numpy as np
import numpy.typing as npt

from quasilpv.telemetry.event_log import Event, write_events
from quasilpv.telemetry.listening import listen
from quasilpv.telemetry.message_types import Records, channel_type
from quasilpv.telemetry.recording import Columns

_POLL_MS = 20
_LINGER_MS = 250


class LoggedRun(Protocol):
    """What a log has to know of a run besides what is sent."""

    measurement: ClassVar[str]
    """Channel of what the plant sends once per sample."""
    truth: ClassVar[str]
    """Channel, in logs only, of what no sensor tells."""

    def events(self, utime: int) -> Iterator[Event]:
        """The documents of the run, at one time."""

    def truth_records(self, seq: npt.NDArray[np.int64], columns: Columns, session: int) -> Records:
        """The messages about these samples, from the columns of the plant's record."""


class Recorder:
    """Hears everything on an LCM URL from `with` to its end, and writes it as a log, whatever ended the run.

    It listens in a thread of its own and keeps the messages in memory: about 1.4 kB per sample.

    Args:
        url: where the processes talk.
        path: of the log.
        documents: of the run.
    """

    def __init__(self, url: str, path: Path, documents: LoggedRun) -> None:
        """Nothing is heard before `with`."""
        self._url, self._path, self._documents = url, path, documents
        self._heard: list[Event] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="log", daemon=True)
        self._truth: Columns | None = None

    def __enter__(self) -> Self:
        """Subscribe, then listen. Errors as `listen`."""
        self._wire = listen(self._url, self._hear)
        self._begun = _now_us()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Hear the rest, then write the log."""
        self._stopping.set()
        self._thread.join()
        events = [*self._heard, *self._truth_events()]
        events.sort(key=lambda event: event.utime)
        write_events(self._path, [*self._documents.events(self._begun), *events])

    def add_truth(self, columns: Columns) -> None:
        """Add what the plant did, from its record (with the column ``seq``), to the log."""
        self._truth = columns

    def _hear(self, channel: str, data: bytes) -> None:
        self._heard.append(Event(_now_us(), channel, data))

    def _listen(self) -> None:
        while not self._stopping.is_set():
            self._wire.handle_timeout(_POLL_MS)
        while self._wire.handle_timeout(_LINGER_MS):  # what was sent last is still on its way
            pass

    def _truth_events(self) -> Iterator[Event]:
        """The plant's samples at the time its measurements were heard; of unheard measurements nothing is logged."""
        if self._truth is None:
            return
        channel = self._documents.measurement
        kind = channel_type(channel)
        valid = [event for event in self._heard if event.channel == channel and not kind.refusal(event.data)]
        measurements = kind.decode([event.data for event in valid])
        times = {int(m["seq"]): event.utime for m, event in zip(measurements[::-1], valid[::-1], strict=True)}
        seq = self._truth["seq"].astype(np.int64)
        session = int(measurements["session"][0]) if measurements.size else 0
        records = self._documents.truth_records(seq, self._truth, session)
        truth = channel_type(self._documents.truth)
        for k, packet in zip(seq, truth.encode(records), strict=True):
            if int(k) in times:
                yield Event(times[int(k)], self._documents.truth, packet)


def _now_us() -> int:
    return time.time_ns() // 1000
