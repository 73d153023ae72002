"""LCM event logs as files: a sequence of events, read strictly.

Each event is, big endian: the synchronisation word EDA1DA01, its number (8 bytes), a time in microseconds (8), the
lengths of channel and data (4 each), channel, data. The reader of the LCM library skips what it does not understand, or
dies of it; here a damaged log is refused, and of one that ends inside an event every whole event is read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from quasilpv.errors import InputError
from quasilpv.files import read_large, written_whole

SUFFIX = ".lcmlog"
_SYNC_WORD = b"\xed\xa1\xda\x01"
_HEAD = struct.Struct(">4sqqiI")
_MAX_CHANNEL_BYTES = 63
_NO_LOG = "an LCM event log"
_ZEROS_LOOKED_AT = 64


class Event(NamedTuple):
    """One event of a log.

    Attributes:
        utime: microseconds; of the clock of whoever wrote the log.
        channel: LCM channel.
        data: the encoded message.
    """

    utime: int
    channel: str
    data: bytes


@dataclass(frozen=True)
class EventLog:
    """The events of a log.

    Attributes:
        events: all whole ones, in the order of the file.
        incomplete_bytes: of an event behind them that was not written whole, as a recorder leaves it that was stopped
            by force; 0 of a log that was closed.
    """

    events: tuple[Event, ...]
    incomplete_bytes: int = 0

    def __iter__(self) -> Iterator[Event]:
        """The whole events."""
        return iter(self.events)


def read_events(path: Path | str) -> EventLog:
    """Read a log, up to its last whole event.

    Raises:
        InputError: the file cannot be read, is no log, holds other bytes between events, or not one whole event.
    """
    source = str(path)
    content = read_large(path, _NO_LOG)
    if not content:
        raise InputError(source, "file", "an empty file", _NO_LOG)
    events: list[Event] = []
    offset = 0
    while offset < len(content):
        found = _event_at(content, offset)
        if found is None:
            break
        event, offset = found
        events.append(event)
    if offset < len(content):
        _require_cut_short(content, offset, source, len(events))
    return EventLog(tuple(events), len(content) - offset)


def _event_at(content: bytes, offset: int) -> tuple[Event, int] | None:
    """The event that begins at an offset, and where it ends; None if there is no whole one."""
    if len(content) - offset < _HEAD.size:
        return None
    word, _, utime, channel_bytes, data_bytes = _HEAD.unpack_from(content, offset)
    start, end = offset + _HEAD.size, offset + _HEAD.size + channel_bytes + data_bytes
    if word != _SYNC_WORD or not 0 < channel_bytes <= _MAX_CHANNEL_BYTES or end > len(content):
        return None
    channel = content[start : start + channel_bytes].decode("ascii", errors="replace")
    return Event(utime, channel, content[start + channel_bytes : end]), end


def _require_cut_short(content: bytes, offset: int, source: str, number: int) -> None:
    """Accept what follows the last whole event if it is the beginning of another one, or space that was never written.

    Raises:
        InputError: it is not, events follow it, or there was no whole event before it.
    """
    rest = memoryview(content)[offset:]
    if not any(rest[:_ZEROS_LOOKED_AT]) and content.count(0, offset) == len(rest):
        return
    if not _SYNC_WORD.startswith(bytes(rest[: len(_SYNC_WORD)])):
        raise InputError(source, f"event {number}", "other bytes", f"{_NO_LOG} (events begin with eda1da01)")
    if len(rest) >= _HEAD.size:
        channel_bytes = _HEAD.unpack_from(content, offset)[3]
        if not 0 < channel_bytes <= _MAX_CHANNEL_BYTES:
            expected = f"1 to {_MAX_CHANNEL_BYTES} (the log is damaged)"
            raise InputError(source, f"event {number}: length of the channel", channel_bytes, expected)
    next_at = content.find(_SYNC_WORD + struct.pack(">q", number + 1), offset + 1)
    if next_at >= 0 and _event_at(content, next_at) is not None:
        expected = "that of the bytes before the next event (the log is damaged)"
        raise InputError(source, f"event {number}: length", "more than there are", expected)
    if number == 0:
        raise InputError(source, "event 0", "the end of the file", "a complete event (the log is truncated)")


@dataclass
class EventWriter:
    """Appends events to an open file and numbers them.

    Attributes:
        file: opened for writing bytes.
        number: of the next event.
    """

    file: BinaryIO
    number: int = 0

    def write(self, event: Event) -> None:
        """Append one event. OSError: it cannot be written."""
        channel = event.channel.encode("ascii")
        self.file.write(_HEAD.pack(_SYNC_WORD, self.number, event.utime, len(channel), len(event.data)))
        self.file.write(channel)
        self.file.write(event.data)
        self.number += 1


def write_events(path: Path, events: Iterable[Event]) -> Path:
    """Write a log whole or not at all.

    Raises:
        InputError: the file cannot be written; nothing half-written is left behind.
    """
    with written_whole(path) as file:
        writer = EventWriter(file)
        for event in events:
            writer.write(event)
    return path
