"""Logs of runs of general systems: their documents, their messages from columns, and the columns back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.scenarios import SystemScenario
from quasilpv.telemetry.codes import LEFT_DOMAIN, PLANT, RUNNING
from quasilpv.telemetry.event_log import Event, write_events
from quasilpv.telemetry.log import ARTIFACT, HEADER, SCENARIO, RunHeader, hash_prefix
from quasilpv.telemetry.message_types import Records, channel_type
from quasilpv.telemetry.recording import Columns, introduce, run_event, run_events

CONTROLLER_NAME = "regional-feedback"

MEASUREMENT, COMMAND = "QLPV_SIGNALS_MEASUREMENT", "QLPV_SIGNALS_COMMAND"
TELEMETRY, TRUTH = "QLPV_SIGNALS_TELEMETRY", "QLPV_SIGNALS_TRUTH"

_MEMBERS = {
    MEASUREMENT: {"value": "told"},
    COMMAND: {"input": "input"},
    TELEMETRY: {"measured": "measured", "commanded": "commanded", "applied": "input", "premise": "premise"},
    TRUTH: {"state": "state", "input": "input"},
}
"""Which column each member of a message holds."""


def counts_of(artifact: SystemArtifactDocument) -> dict[str, int]:
    """How many values the members of messages hold, by the member that says so."""
    return {
        "signals": len(artifact.states) + len(artifact.parameters),
        "states": len(artifact.states),
        "inputs": len(artifact.inputs),
        "premises": len(artifact.model.names),
    }


def names_of(artifact: SystemArtifactDocument) -> dict[str, list[str]]:
    """The names of the values in each member of the messages."""
    states, inputs, parameters = (
        [signal.name for signal in own] for own in (artifact.states, artifact.inputs, artifact.parameters)
    )
    return {
        "value": [*states, *parameters],
        "measured": states,
        "state": states,
        "input": inputs,
        "commanded": inputs,
        "applied": inputs,
        "premise": list(artifact.model.names),
    }


def units_of(artifact: SystemArtifactDocument) -> dict[str, str]:
    """The units of its signals, by name; none of those that have none."""
    return {signal.name: signal.unit for signal in artifact.signals if signal.unit not in ("", "1")}


@dataclass(frozen=True, eq=False)
class SystemRunDocuments:
    """What a log says of a run of a general system before the first message.

    Attributes:
        header: how it was made.
        artifact: the controller, and the equations of the plant.
        scenario: what was run.
    """

    measurement: ClassVar[str] = MEASUREMENT
    truth: ClassVar[str] = TRUTH

    header: RunHeader
    artifact: SystemArtifactDocument
    scenario: SystemScenario

    def events(self, utime: int) -> Iterator[Event]:
        """The documents as events at one time."""
        yield Event(utime, HEADER, self.header.to_bytes())
        yield Event(utime, ARTIFACT, canonical_json(self.artifact.to_document()))
        yield Event(utime, SCENARIO, canonical_json(self.scenario.to_document()))

    def truth_records(self, seq: npt.NDArray[np.int64], columns: Columns, session: int) -> Records:
        """The messages about the truth, from the columns ``state`` and ``input``."""
        return system_messages(TRUTH, self.artifact, seq, columns, session=session)


def system_messages(
    channel: str,
    artifact: SystemArtifactDocument,
    seq: npt.NDArray[np.int64],
    columns: Columns,
    *,
    session: int = 0,
) -> Records:
    """Messages of a channel, one per sample, with what the columns say of them, (N, width) each."""
    records = channel_type(channel).new(seq.size)
    records["utime"] = np.rint(1e6 * seq * artifact.sample_period_s)
    introduce(records, artifact.sample_period_s)
    records["seq"], records["session"], records["artifact_hash"] = seq, session, hash_prefix(artifact.hash)
    for name, count in counts_of(artifact).items():
        if name in (records.dtype.names or ()):
            records[name] = count
    for member, column in _MEMBERS[channel].items():
        values = columns[column].reshape(seq.size, -1)
        records[member][:, : values.shape[1]] = values
    return records


def system_columns_of(channel: str, records: Records, artifact: SystemArtifactDocument) -> dict[str, FloatArray]:
    """The columns that messages of a channel hold: the inverse of `system_messages`."""
    names = names_of(artifact)
    return {column: np.array(records[member][:, : len(names[member])]) for member, column in _MEMBERS[channel].items()}


def write_system_run(
    path: Path,
    documents: SystemRunDocuments,
    columns: Columns,
    flags: npt.NDArray[np.int64],
    left_domain: tuple[int, int] | None,
) -> Path:
    """Write the log of a run in this process; its clock is that of the samples, so equal runs give equal files.

    Args:
        path: of the log.
        documents: of the run.
        columns: state, measured, input, commanded, premise, (N, width) each, and level, (N,).
        flags: (N,) of the steps.
        left_domain: the sample at which a state left its domain, and its index; None if none did.

    Raises:
        InputError: the file cannot be written.
    """
    artifact, seq = documents.artifact, np.arange(len(columns["state"]))
    read = np.where(artifact.measured, columns["measured"], 0.0)
    told = np.hstack([read, np.tile(_told(documents), (seq.size, 1))])
    known = {**columns, "told": told}
    streams = {channel: system_messages(channel, artifact, seq, known) for channel in _MEMBERS}
    for records in (streams[COMMAND], streams[TELEMETRY]):
        records["flags"] = flags
        records["state"] = RUNNING
    streams[TELEMETRY]["level"] = columns["level"]
    return write_events(path, _with_exit(documents, streams, left_domain))


def _with_exit(
    documents: SystemRunDocuments, streams: Mapping[str, Records], left_domain: tuple[int, int] | None
) -> Iterator[Event]:
    """The events of a run; before both sides end, the plant says which state left its domain."""
    digest, period = documents.artifact.hash, documents.artifact.sample_period_s
    events = list(run_events(documents.events(0), digest, period, streams))
    if left_domain is not None:
        seq, state = left_domain
        utime = round(1e6 * seq * period)
        said = run_event(digest, period, source=PLANT, code=LEFT_DOMAIN, utime=utime, seq=seq, detail=state)
        events.insert(-2, said)
    yield from events


def _told(documents: SystemRunDocuments) -> FloatArray:
    """What the law is told of the parameters: 0 of those it does not know."""
    given = documents.scenario.parameters
    return np.array([given[signal.name] if signal.known else 0.0 for signal in documents.artifact.parameters])
