"""The message types of ``lcmtypes/*.lcm`` as arrays of records: many messages are encoded and decoded at once.

Messages have a fixed size, so a message on the wire is one packed big-endian record: eight bytes of fingerprint, then
the members in order. The definitions themselves are read; no code is generated. ``docs/reference/messages.md`` says
what the members mean, and which rules every type keeps.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Records: TypeAlias = npt.NDArray[Any]
"""A structured array, one record per message, with the members of its type and ``fingerprint`` before them."""

CHANNELS = {
    "QLPV_MEASUREMENT": ("measurement_v3", "measurement_v2", "measurement_v1"),
    "QLPV_COMMAND": ("command_v2", "command_v1"),
    "QLPV_TELEMETRY": ("telemetry_v2", "telemetry_v1"),
    "QLPV_EVENT": ("event_v2", "event_v1"),
    "QLPV_TRUTH": ("truth_v2", "truth_v1"),
    "QLPV_SIGNALS_MEASUREMENT": ("signals_measurement_v1",),
    "QLPV_SIGNALS_COMMAND": ("signals_command_v1",),
    "QLPV_SIGNALS_TELEMETRY": ("signals_telemetry_v1",),
    "QLPV_SIGNALS_TRUTH": ("signals_truth_v1",),
}
"""Types of the messages on each channel: the one that is sent, and before it those that logs may hold."""

EVENTS = "QLPV_EVENT"
SYSTEM_PREFIX = "QLPV_SIGNALS_"
SYSTEM_CHANNELS = (*(name for name in CHANNELS if name.startswith(SYSTEM_PREFIX)), EVENTS)
"""Those of a run of a general system."""
ROBOT_CHANNELS = tuple(name for name in CHANNELS if not name.startswith(SYSTEM_PREFIX))
"""Those of a run of a robot."""

CRC_BYTES = 8
TAG_BYTES = 16
"""Behind every message of a run in authenticated mode."""
_PRIMITIVES = {"int32_t": ">i4", "int64_t": ">i8", "double": ">f8"}
_STRUCT = re.compile(r"struct\s+(\w+)\s*\{(.*?)\}", re.DOTALL)
_MEMBER = re.compile(r"(\w+)\s+(\w+)\s*(?:\[(\d+)\])?\s*;")


@dataclass(frozen=True, eq=False)
class MessageType:
    """A message type of fixed size.

    Attributes:
        name: e.g. ``"command_v2"``.
        fingerprint: what LCM puts before every message of the type, a signed 64-bit integer.
        record: layout of an encoded message, fingerprint included.
    """

    name: str
    fingerprint: int
    record: np.dtype[Any]

    def new(self, count: int) -> Records:
        """Messages of this type with every other member 0."""
        records = np.zeros(count, self.record)
        records["fingerprint"] = self.fingerprint
        return records

    def encode(self, records: Records) -> list[bytes]:
        """The messages as bytes, each with its checksum."""
        packets = []
        for record in records:
            body = record.tobytes()[:-CRC_BYTES]
            packets.append(body + zlib.crc32(body).to_bytes(CRC_BYTES, "big"))
        return packets

    def content(self, packet: bytes) -> bytes:
        """The message in a packet: without its tag, if it has one. The tag is not checked: that takes the key."""
        return packet[:-TAG_BYTES] if len(packet) == self.record.itemsize + TAG_BYTES else packet

    def refusal(self, packet: bytes) -> str | None:
        """Why a packet is no message of this type: its length, fingerprint or checksum; None if it is one."""
        if len(packet) != self.record.itemsize:
            return "wrong size"
        if int.from_bytes(packet[-CRC_BYTES:], "big") != zlib.crc32(packet[:-CRC_BYTES]):
            return "wrong checksum"
        return None if int.from_bytes(packet[:8], "big", signed=True) == self.fingerprint else "wrong type"

    def decode(self, packets: Sequence[bytes]) -> Records:
        """The records of packets that `refusal` has nothing against, in native byte order."""
        records = np.frombuffer(b"".join(packets), self.record)
        return records.astype(self.record.newbyteorder("="))


@cache
def message_type(name: str) -> MessageType:
    """The type of that name, from its definition."""
    definition = files("quasilpv.telemetry").joinpath("lcmtypes", f"{name}.lcm").read_text(encoding="utf-8")
    return parse_definition(definition)


def channel_type(channel: str) -> MessageType:
    """The type of the messages that are sent on a channel of `CHANNELS`."""
    return message_type(CHANNELS[channel][0])


def logged_type(channel: str, packets: Sequence[bytes]) -> MessageType:
    """The type of the messages on a channel of a log: the newest that has nothing against one of its packets."""
    types = [message_type(name) for name in CHANNELS[channel]]
    readable = (kind for kind in types if any(kind.refusal(kind.content(packet)) is None for packet in packets))
    return next(readable, types[0])


def parse_definition(definition: str) -> MessageType:
    """The type that an ``.lcm`` file defines: one struct of int32_t, int64_t and double, alone or in fixed arrays.

    Raises:
        ValueError: the file holds something else.
    """
    text = re.sub(r"//[^\n]*", "", definition)
    struct = _STRUCT.search(text)
    members = _MEMBER.findall(struct[2]) if struct else []
    if not struct or _MEMBER.sub("", struct[2]).strip() or any(kind not in _PRIMITIVES for kind, _, _ in members):
        raise ValueError("expected one struct of int32_t, int64_t and double members")
    fields: list[Any] = [("fingerprint", ">i8")]
    fields += [(name, _PRIMITIVES[kind], *((int(size),) if size else ())) for kind, name, size in members]
    return MessageType(struct[1], _fingerprint(members), np.dtype(fields))


def _fingerprint(members: Sequence[tuple[str, str, str]]) -> int:
    """LCM's fingerprint of a struct without nested types (lcm-gen, ``lcm_struct_hash``), rotated once as emitted."""
    value = 0x12345678
    for kind, name, size in members:
        value = _hash_text(value, name)
        value = _hash_text(value, kind)
        value = _hash_byte(value, 1 if size else 0)
        if size:
            value = _hash_text(_hash_byte(value, 0), size)
    rotated = (value << 1) + (value >> 63 & 1)
    return _signed(rotated)


def _hash_text(value: int, text: str) -> int:
    value = _hash_byte(value, len(text))
    for byte in text.encode("ascii"):
        value = _hash_byte(value, byte)
    return value


def _hash_byte(value: int, byte: int) -> int:
    return _signed((value << 8 ^ value >> 55) + byte)


def _signed(value: int) -> int:
    """The low 64 bits in two's complement."""
    value &= 0xFFFF_FFFF_FFFF_FFFF
    return value - (1 << 64) if value >> 63 else value
