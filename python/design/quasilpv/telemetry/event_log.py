"""LCM event logs as files: a sequence of events, read strictly.

Each event is, big endian: the synchronisation word EDA1DA01, its number (8 bytes), a time in microseconds (8), the
lengths of channel and data (4 each), channel, data. The reader of the LCM library skips what it does not understand, or
dies of it; here a damaged log is refused.
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


def read_events(path: Path | str) -> Iterator[Event]:
    """The events of a log, in the order of the file.

    Raises:
        InputError: the file cannot be read, is no log, or ends inside an event.
    """
    source = str(path)
    content = read_large(path, _NO_LOG)
    if not content:
        raise InputError(source, "file", "an empty file", _NO_LOG)
    offset, number = 0, 0
    while offset < len(content):
        head = content[offset : offset + _HEAD.size]
        if not _SYNC_WORD.startswith(head[: len(_SYNC_WORD)]):
            raise InputError(source, f"event {number}", "other bytes", f"{_NO_LOG} (events begin with eda1da01)")
        if len(head) < _HEAD.size:
            raise _truncated(source, number)
        _, _, utime, channel_bytes, data_bytes = _HEAD.unpack(head)
        if not 0 < channel_bytes <= _MAX_CHANNEL_BYTES:
            expected = f"1 to {_MAX_CHANNEL_BYTES} (the log is damaged)"
            raise InputError(source, f"event {number}: length of the channel", channel_bytes, expected)
        start = offset + _HEAD.size
        offset = start + channel_bytes + data_bytes
        if offset > len(content):
            raise _truncated(source, number)
        channel = content[start : start + channel_bytes].decode("ascii", errors="replace")
        yield Event(utime, channel, content[start + channel_bytes : offset])
        number += 1


def _truncated(source: str, number: int) -> InputError:
    return InputError(source, f"event {number}", "the end of the file", "a complete event (the log is truncated)")


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
