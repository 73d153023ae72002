"""Logs as MCAP files, which Foxglove and PlotJuggler open: messages in JSON, each channel with its JSON schema."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from quasilpv.files import written_whole
from quasilpv.telemetry.log import ARTIFACT, RunLog
from quasilpv.telemetry.message_types import MessageType
from quasilpv.telemetry.system_recording import names_of, units_of

NOTHING: Mapping[str, Any] = MappingProxyType({})

_HIDDEN = ("fingerprint", "crc")
_PER_PREMISE = "premise"


def write_mcap(log: RunLog, path: Path) -> int:
    """Write a log as an MCAP file; arrays have one entry per joint, or per premise, and are objects with the names of
    the signals of general systems. Return how many messages it holds.

    The documents of the log are attachments, the hash of the artifact is in the metadata record ``quasilpv``.

    Raises:
        InputError: the file cannot be written.
    """
    with written_whole(path) as file:
        return _write(log, Writer(file, compression=CompressionType.ZSTD))


def _write(log: RunLog, writer: Writer) -> int:
    writer.start(profile="", library="quasilpv")
    metadata = {"source": log.source.encode(errors="backslashreplace").decode()}  # a name need not be text
    if ARTIFACT in log.documents:
        metadata |= {"artifact": log.any_artifact.name, "artifact_hash": log.any_artifact.hash}
    named = names_of(log.system_artifact) if log.is_of_system else {}
    units = units_of(log.system_artifact) if log.is_of_system else {}
    writer.add_metadata("quasilpv", metadata)
    for name, document in log.documents.items():
        writer.add_attachment(0, 0, f"{name.removeprefix('QLPV_').lower()}.json", "application/json", document)
    count = 0
    for channel, messages in log.channels.items():
        schema = writer.register_schema(
            f"quasilpv.{messages.type.name}",
            "jsonschema",
            json.dumps(json_schema(messages.type, named, units)).encode(),
        )
        topic = writer.register_channel(f"/{channel.removeprefix('QLPV_').lower()}", "json", schema)
        for utime, record in zip(messages.utime.tolist(), messages.records, strict=True):
            data = json.dumps(as_json(messages.type, record, named), allow_nan=False).encode()
            writer.add_message(topic, 1000 * utime, data, 1000 * utime, int(record["seq"]) & 0xFFFF_FFFF)
            count += 1
    writer.finish()  # type: ignore[no-untyped-call]
    return count


def json_schema(
    kind: MessageType, named: Mapping[str, Sequence[str]] = NOTHING, units: Mapping[str, str] = NOTHING
) -> dict[str, Any]:
    """The JSON schema of what `as_json` makes of messages of a type.

    Args:
        kind: the type.
        named: the names of the values in an array, by its member.
        units: of these names.
    """
    members: dict[str, Any] = {}
    for name in _shown(kind):
        layout = kind.record[name]
        scalar: dict[str, Any] = {"type": "integer" if layout.base.kind == "i" else ["number", "null"]}
        if layout.shape and name in named:
            own = {each: {**scalar, "description": units[each]} if units.get(each) else scalar for each in named[name]}
            members[name] = {"type": "object", "properties": own}
        else:
            members[name] = {"type": "array", "items": scalar} if layout.shape else scalar
    return {"title": f"quasilpv.{kind.name}", "type": "object", "properties": members}


def as_json(kind: MessageType, record: Any, named: Mapping[str, Sequence[str]] = NOTHING) -> dict[str, Any]:
    """A message as a JSON-able tree; numbers that are not finite, which JSON does not know, are null.

    Args:
        kind: its type.
        record: it.
        named: the names of the values in an array, by its member, which then is an object.
    """
    tree: dict[str, Any] = {}
    for name in _shown(kind):
        value = np.asarray(record[name]).tolist()
        if isinstance(value, list) and name in named:
            tree[name] = dict(zip(named[name], map(_finite, value), strict=False))  # behind the last name is nothing
            continue
        if isinstance(value, list) and "joints" in (kind.record.names or ()):
            value = value[: int(record["premises" if name == _PER_PREMISE else "joints"])]
        tree[name] = [_finite(entry) for entry in value] if isinstance(value, list) else _finite(value)
    return tree


def _shown(kind: MessageType) -> list[str]:
    return [name for name in kind.record.names or () if name not in _HIDDEN]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
