"""Logs of runs in one process, from their samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.documents.canonical import canonical_json
from quasilpv.scenarios import Scenario
from quasilpv.telemetry.codes import CONTROLLER, ENDED, PLANT, RUNNING, STARTED
from quasilpv.telemetry.event_log import Event, write_events
from quasilpv.telemetry.log import ARTIFACT, HEADER, SCENARIO, TRAJECTORY, RunHeader, hash_prefix
from quasilpv.telemetry.message_types import Records, channel_type
from quasilpv.trajectories import Trajectory

Columns: TypeAlias = Mapping[str, FloatArray]
"""Quantities of a run by name, (N,) or (N, n), as the run-time side names them in its records."""

_SAME_NAME = (
    "reference_angle_rad",
    "reference_speed_rad_s",
    "reference_acceleration_rad_s2",
    "measured_angle_rad",
    "measured_speed_rad_s",
    "estimated_angle_rad",
    "estimated_speed_rad_s",
    "estimated_disturbance",
    "filtered_disturbance",
    "integral_error_rad_s",
)
_MEMBERS = {
    "QLPV_MEASUREMENT": {"angle_rad": "measured_angle_rad", "speed_rad_s": "measured_speed_rad_s"},
    "QLPV_COMMAND": {"torque_nm": "torque_applied_nm"},
    "QLPV_TELEMETRY": {name: name for name in _SAME_NAME}
    | {"commanded_torque_nm": "torque_commanded_nm", "applied_torque_nm": "torque_applied_nm"},
    "QLPV_TRUTH": {name: name for name in ("angle_rad", "speed_rad_s", "acceleration_rad_s2", "torque_nm")},
}
"""Which column each member of a message holds."""

_MEASURED = {
    "motor_angle_rad": "measured_motor_angle_rad",
    "link_angle_rad": "measured_link_angle_rad",
    "joint_torque_nm": "measured_joint_torque_nm",
}
_GEARS = {
    "QLPV_MEASUREMENT": {"angle_rad": "encoder_angle_rad"} | _MEASURED,
    "QLPV_COMMAND": {},
    "QLPV_TELEMETRY": _MEASURED,
    "QLPV_TRUTH": {name: name for name in ("motor_angle_rad", "joint_torque_nm")},
}
"""The same of columns that only robots with gears that give have."""

_MONITOR = ("membership_sum", "premise_excess", "lyapunov_rad2")


@dataclass(frozen=True, eq=False)
class RunDocuments:
    """What a log says of its run before the first message.

    Attributes:
        header: how it was made.
        artifact: the controller.
        trajectory: the reference.
        scenario: the experiment.
    """

    measurement: ClassVar[str] = "QLPV_MEASUREMENT"
    truth: ClassVar[str] = "QLPV_TRUTH"

    header: RunHeader
    artifact: Artifact
    trajectory: Trajectory
    scenario: Scenario

    def events(self, utime: int) -> Iterator[Event]:
        """The documents as events at one time."""
        yield Event(utime, HEADER, self.header.to_bytes())
        for channel, document in (
            (ARTIFACT, self.artifact.to_document()),
            (TRAJECTORY, self.trajectory.to_document()),
            (SCENARIO, self.scenario.to_document()),
        ):
            yield Event(utime, channel, canonical_json(document))

    def truth_records(self, seq: npt.NDArray[np.int64], columns: Columns, session: int) -> Records:
        """The messages about the truth, from the columns of the plant's record."""
        return messages(self.truth, self.artifact, seq, columns, session=session)


def write_run(path: Path, documents: RunDocuments, columns: Columns) -> Path:
    """Write the log of a run in this process; its clock is that of the samples, k T, so equal runs give equal files.

    Such a run has no fail-safe and no times: its state is always "running", what these would say is 0.

    Args:
        path: of the log.
        documents: of the run.
        columns: of `_runtime.run_closed_loop`.

    Raises:
        InputError: the file cannot be written.
    """
    artifact, seq = documents.artifact, np.arange(columns["time_s"].size)
    known = {**columns, "torque_nm": columns["torque_applied_nm"]}
    streams = {channel: messages(channel, artifact, seq, known) for channel in _MEMBERS}
    telemetry = streams["QLPV_TELEMETRY"]
    if "available" in columns:
        for records in (streams["QLPV_MEASUREMENT"], telemetry):
            records["available"] = columns["available"]
    for records in (streams["QLPV_COMMAND"], telemetry):
        records["flags"] = columns["flags"]
        records["state"] = RUNNING
    for name in _MONITOR:
        telemetry[name] = columns[name]
    premise = _premises(artifact, columns["measured_angle_rad"])
    telemetry["premises"] = premise.shape[1]
    telemetry["premise"][:, : premise.shape[1]] = premise
    return write_events(path, _in_order(documents, streams))


def messages(
    channel: str, artifact: Artifact, seq: npt.NDArray[np.int64], columns: Columns, *, session: int = 0
) -> Records:
    """Messages of a channel, one per sample, with what the columns say of them.

    Args:
        channel: of those that come once per sample.
        artifact: the controller.
        seq: (N,) numbers of the samples.
        columns: what the messages are about; `QLPV_TRUTH` takes the plant's ``torque_nm``, and is NaN where a robot
            has no motors of their own.
        session: of the run.
    """
    records = channel_type(channel).new(seq.size)
    records["utime"] = np.rint(1e6 * seq * artifact.sample_period_s)
    introduce(records, artifact.sample_period_s)
    records["seq"], records["session"], records["joints"] = seq, session, artifact.joints
    records["artifact_hash"] = hash_prefix(artifact.hash)
    if channel == "QLPV_TRUTH":
        for member in _GEARS[channel]:
            records[member][:, : artifact.joints] = np.nan
    held = _MEMBERS[channel] | {member: column for member, column in _GEARS[channel].items() if column in columns}
    for member, column in held.items():
        records[member][:, : artifact.joints] = columns[column].reshape(seq.size, artifact.joints)
    return records


def introduce(records: Records, sample_period_s: float) -> None:
    """Say how the sender runs, where messages say so: in lock-step, at the rate of its artifact; in one process nobody
    has a name."""
    if "period_ns" in (records.dtype.names or ()):
        records["period_ns"] = round(1e9 * sample_period_s)


def columns_of(channel: str, records: Records, joints: int) -> dict[str, FloatArray]:
    """The columns that messages of a channel hold, (N, n): the inverse of `messages`, without those of gears.

    Args:
        channel: of those that come once per sample.
        records: (N,) its messages.
        joints: n.
    """
    return {column: np.array(records[member][:, :joints]) for member, column in _MEMBERS[channel].items()}


def _in_order(documents: RunDocuments, streams: Mapping[str, Records]) -> Iterator[Event]:
    artifact = documents.artifact
    yield from run_events(documents.events(0), artifact.hash, artifact.sample_period_s, streams)


def run_events(
    documents: Iterator[Event], artifact_hash: str, sample_period_s: float, streams: Mapping[str, Records]
) -> Iterator[Event]:
    """A log of a run in one process: its documents, both sides' start, the messages sample by sample, both ends.

    Args:
        documents: of the run.
        artifact_hash: of the controller.
        sample_period_s: T.
        streams: by channel one message per sample.
    """
    yield from documents
    times = next(iter(streams.values()))["utime"].tolist()
    for source in (CONTROLLER, PLANT):
        yield run_event(artifact_hash, sample_period_s, source=source, code=STARTED, utime=0, seq=0)
    packets = [channel_type(channel).encode(records) for channel, records in streams.items()]
    for utime, *sample in zip(times, *packets, strict=True):
        for channel, packet in zip(streams, sample, strict=True):
            yield Event(utime, channel, packet)
    for source in (PLANT, CONTROLLER):
        yield run_event(artifact_hash, sample_period_s, source=source, code=ENDED, utime=times[-1], seq=len(times) - 1)


def run_event(
    artifact_hash: str, sample_period_s: float, *, source: int, code: int, utime: int, seq: int, detail: int = 0
) -> Event:
    """One event of a run in one process."""
    kind = channel_type("QLPV_EVENT")
    records = kind.new(1)
    members = {"utime": utime, "seq": seq, "artifact_hash": hash_prefix(artifact_hash), "source": source, "code": code}
    for name, value in members.items():
        records[name] = value
    records["detail"][0, 0] = detail
    introduce(records, sample_period_s)
    return Event(utime, "QLPV_EVENT", kind.encode(records)[0])


def _premises(artifact: Artifact, angle: FloatArray) -> FloatArray:
    """The premises of every sample as the step reads them: of the measured angles, clamped to their box."""
    runtime = _runtime.Artifact.parse(canonical_json(artifact.to_document()), artifact.name)
    lower, upper = artifact.law.premise_box
    values = np.array([runtime.premises(row) for row in angle.reshape(-1, artifact.joints)])
    clamped: FloatArray = np.clip(values.reshape(len(values), len(lower)), lower, upper)
    return clamped
