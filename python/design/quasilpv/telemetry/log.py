"""The log of one run: its documents, and its messages by channel as arrays.

A log explains itself: before the messages it holds, as JSON, the run's artifact, trajectory, scenario and a header that
says how it was made. Messages follow the rules of ``docs/reference/messages.md``; those that break one are counted.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import Field

from quasilpv.artifact import Artifact
from quasilpv.defaults import LAST
from quasilpv.documents.canonical import canonical_json, parse_document, parse_strict_json
from quasilpv.documents.strict_model import StrictModel, validate
from quasilpv.documents.system_artifact import SAMPLING_METHODS, SystemArtifactDocument
from quasilpv.errors import InputError
from quasilpv.files import write_atomically
from quasilpv.scenarios import Scenario, SystemScenario
from quasilpv.telemetry.event_log import SUFFIX, Event, read_events
from quasilpv.telemetry.message_types import (
    CHANNELS,
    EVENTS,
    ROBOT_CHANNELS,
    SYSTEM_CHANNELS,
    SYSTEM_PREFIX,
    MessageType,
    Records,
    logged_type,
)
from quasilpv.trajectories import Trajectory

Mode: TypeAlias = Literal["in-process", "lockstep", "realtime"]

LOG_NAME = f"run{SUFFIX}"
RUNS_FOLDER = Path("out")
POINTER_NAME = "last-log"
"""In `RUNS_FOLDER`: the path of the log of the last run, wherever that was written."""

HEADER, ARTIFACT, TRAJECTORY, SCENARIO = "QLPV_RUN", "QLPV_ARTIFACT", "QLPV_TRAJECTORY", "QLPV_SCENARIO"
DOCUMENT_CHANNELS = (HEADER, ARTIFACT, TRAJECTORY, SCENARIO)
"""Channels of a log that hold one JSON document each; they are never sent."""


class RunHeader(StrictModel):
    """How a run was made.

    Attributes:
        mode: controller and plant in one process, in two in lock-step, or in two paced by the clock.
        controller: what the run's controller was called.
    """

    schema_: Literal["quasilpv.run"] = Field(alias="schema", default="quasilpv.run")
    schema_version: Literal[1] = 1
    mode: Mode
    controller: str

    def to_bytes(self) -> bytes:
        """The document as a log holds it."""
        return canonical_json(self.model_dump(mode="json", by_alias=True))


def hash_prefix(artifact_hash: str) -> int:
    """What messages carry of an artifact's hash: its first eight bytes, big endian, as a signed integer."""
    return int.from_bytes(bytes.fromhex(artifact_hash)[:8], "big", signed=True)


@dataclass(frozen=True, eq=False)
class Messages:
    """The messages of one channel.

    Attributes:
        type: of the channel.
        utime: (N,) microseconds of the log's clock.
        records: (N,) decoded, in the order of the log.
        refused: how many packets were no such message, by reason.
    """

    type: MessageType
    utime: npt.NDArray[np.int64]
    records: Records
    refused: Mapping[str, int]

    @cached_property
    def samples(self) -> Records:
        """The first message of every ``seq``, sorted by it."""
        return self.records[np.unique(self.records["seq"], return_index=True)[1]]

    @property
    def rate_hz(self) -> float | None:
        """Messages per second on the clock of the log; None of fewer than two."""
        span_us = int(self.utime[-1] - self.utime[0]) if self.utime.size > 1 else 0
        return 1e6 * (self.utime.size - 1) / span_us if span_us > 0 else None

    @property
    def repeated(self) -> int:
        """Messages that repeat a ``seq``."""
        return int(self.records.size - self.samples.size)

    def missing(self, last_seq: int) -> int:
        """How many of the samples 0 to ``last_seq`` no message is about."""
        return int(last_seq + 1 - np.count_nonzero(self.samples["seq"] <= last_seq))


@dataclass(frozen=True, eq=False)
class RunLog:
    """A log, decoded.

    Attributes:
        source: its file, for messages.
        documents: JSON bytes of those of `DOCUMENT_CHANNELS` it holds.
        channels: by name, those of `message_types.ROBOT_CHANNELS` or `SYSTEM_CHANNELS`; empty ones too.
        foreign: how many events there are on every other channel.
        incomplete_bytes: behind the last whole event, see `EventLog`.
    """

    source: str
    documents: Mapping[str, bytes]
    channels: Mapping[str, Messages]
    foreign: Mapping[str, int] = field(default_factory=dict)
    incomplete_bytes: int = 0

    def __getitem__(self, channel: str) -> Messages:
        """The messages of a channel, given without its prefix, e.g. ``"telemetry"``, of a robot or of a system."""
        own = f"{SYSTEM_PREFIX}{channel.upper()}"
        return self.channels[own if own in self.channels else f"QLPV_{channel.upper()}"]

    @property
    def is_of_system(self) -> bool:
        """Whether it is of a general system."""
        return f"{SYSTEM_PREFIX}TELEMETRY" in self.channels

    @cached_property
    def header(self) -> RunHeader:
        """How the run was made. InputError: the log does not say."""
        return validate(RunHeader, parse_strict_json(self._document(HEADER), self.source), self.source)

    @cached_property
    def artifact(self) -> Artifact:
        """The controller. InputError: missing, damaged, or not the one the messages name."""
        source = f"{self.source}: {ARTIFACT}"
        if self.is_of_system:
            raise InputError(source, "schema", "a controller of a system", "one of a robot")
        artifact = Artifact.from_document(parse_document(self._document(ARTIFACT), source), source)
        self._require_hash(artifact.name, artifact.hash)
        return artifact

    @cached_property
    def system_artifact(self) -> SystemArtifactDocument:
        """The controller of a general system. InputError: as `artifact`."""
        source = f"{self.source}: {ARTIFACT}"
        document = parse_document(self._document(ARTIFACT), source)
        content = {key: value for key, value in document.items() if key != "hash"}
        artifact = validate(SystemArtifactDocument, content, source, SAMPLING_METHODS)
        self._require_hash(artifact.name, artifact.hash)
        return artifact

    @property
    def any_artifact(self) -> Artifact | SystemArtifactDocument:
        """The controller, of either kind."""
        return self.system_artifact if self.is_of_system else self.artifact

    def _require_hash(self, name: str, digest: str) -> None:
        for channel, messages in self.channels.items():
            others = set(messages.records["artifact_hash"].tolist()) - {hash_prefix(digest)}
            if others:
                got = f"{min(others) & 0xFFFF_FFFF_FFFF_FFFF:016x}..."
                raise InputError(self.source, f"{channel}.artifact_hash", got, f"{digest[:16]}..., {name}")

    @cached_property
    def trajectory(self) -> Trajectory:
        """The reference. InputError: missing or damaged."""
        source = f"{self.source}: {TRAJECTORY}"
        return Trajectory.from_document(parse_document(self._document(TRAJECTORY), source), source)

    @cached_property
    def scenario(self) -> Scenario:
        """The experiment. InputError: missing or damaged."""
        source = f"{self.source}: {SCENARIO}"
        return Scenario.from_document(parse_strict_json(self._document(SCENARIO), source), source)

    @cached_property
    def system_scenario(self) -> SystemScenario:
        """What a general system went through. InputError: missing, damaged, or of another system."""
        source = f"{self.source}: {SCENARIO}"
        scenario = SystemScenario.from_document(parse_strict_json(self._document(SCENARIO), source), source)
        return scenario.require_names_of(self.system_artifact, source)

    @property
    def last_seq(self) -> int:
        """The last sample that any message is about, events apart; -1 if there is none."""
        sampled = (messages.samples["seq"] for name, messages in self.channels.items() if name != EVENTS)
        return max((int(seq[-1]) for seq in sampled if seq.size), default=-1)

    @property
    def duration_s(self) -> float:
        """From the first message to the last, on the clock of the log."""
        times = [messages.utime for messages in self.channels.values() if messages.utime.size]
        return 1e-6 * (max(int(t[-1]) for t in times) - min(int(t[0]) for t in times)) if times else 0.0

    def require_artifact(self, artifact: Artifact | SystemArtifactDocument) -> RunLog:
        """The log, of which it is sure that ``artifact`` was its controller; if it holds none, then it does now.

        Raises:
            InputError: it was another one.
        """
        if ARTIFACT in self.documents and self.any_artifact.hash != artifact.hash:
            own = self.any_artifact.hash
            raise InputError(self.source, "artifact.hash", f"{own[:16]}...", f"{artifact.hash[:16]}...")
        document = canonical_json(artifact.to_document())
        completed = replace(self, documents={**self.documents, ARTIFACT: document})
        assert completed.any_artifact.hash == artifact.hash
        return completed

    def _document(self, channel: str) -> bytes:
        if channel not in self.documents:
            raise InputError(self.source, channel, "no such event", "a log written by design track or design hil")
        return self.documents[channel]


def read_log(path: Path | str) -> RunLog:
    """Read the log of a run.

    Raises:
        InputError: the file cannot be read, is no LCM log, or has no event of this project.
    """
    packets: dict[str, list[Event]] = {channel: [] for channel in CHANNELS}
    documents: dict[str, bytes] = {}
    foreign: Counter[str] = Counter()
    read = read_events(path)
    for event in read:
        if event.channel in packets:
            packets[event.channel].append(event)
        elif event.channel in DOCUMENT_CHANNELS:
            documents.setdefault(event.channel, event.data)
        else:
            foreign[event.channel] += 1
    if not documents and not any(packets.values()):
        raise InputError(str(path), "channels", ", ".join(foreign) or "none", f"at least one of {', '.join(CHANNELS)}")
    of_system = any(packets[channel] for channel in SYSTEM_CHANNELS if channel != EVENTS)
    channels = {
        channel: _decode(logged_type(channel, [event.data for event in packets[channel]]), packets[channel])
        for channel in (SYSTEM_CHANNELS if of_system else ROBOT_CHANNELS)
    }
    foreign.update({channel: len(found) for channel, found in packets.items() if found and channel not in channels})
    return RunLog(str(path), documents, channels, dict(foreign), read.incomplete_bytes)


def point_to(log: Path, folder: Path = RUNS_FOLDER) -> None:
    """Keep where a log was written, for `latest_log`; where there is no place for that, nothing is kept."""
    with suppress(InputError):
        write_atomically({folder / POINTER_NAME: os.fsencode(os.path.abspath(log)) + b"\n"})


def latest_log(folder: Path = RUNS_FOLDER) -> Path:
    """The log that was written last, anywhere below a folder or where the pointer in it says.

    Raises:
        InputError: there is none.
    """
    logs = {path: path.stat().st_mtime_ns for path in folder.rglob(f"*{SUFFIX}") if path.is_file()}
    missing = ""
    with suppress(OSError):
        elsewhere = Path(os.fsdecode((folder / POINTER_NAME).read_bytes().removesuffix(b"\n")))
        missing = f", and no longer {elsewhere}"
        logs[elsewhere] = elsewhere.stat().st_mtime_ns
    if not logs:
        looked = f"no *{SUFFIX} under {os.path.abspath(folder)}{missing}"
        raise InputError("command line", LAST, looked, "a run before it, e.g. design track")
    return max(logs, key=lambda path: logs[path])


def _decode(kind: MessageType, events: list[Event]) -> Messages:
    refused: Counter[str] = Counter()
    kept: list[Event] = []
    for event in events:
        content = kind.content(event.data)
        reason = kind.refusal(content)
        if reason is None:
            kept.append(Event(event.utime, event.channel, content))
        else:
            refused[reason] += 1
    utime = np.array([event.utime for event in kept], dtype=np.int64)
    return Messages(kind, utime, kind.decode([event.data for event in kept]), dict(refused))
