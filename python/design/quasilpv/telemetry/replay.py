"""Replay: the controller, fed the measurements of a log in lock-step, commands what the log says it commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.telemetry.codes import FAULT, GEAR_SENSORS
from quasilpv.telemetry.log import RunLog


@dataclass(frozen=True)
class Replay:
    """What a replay showed.

    Attributes:
        samples: how many steps were taken.
        compared: on how many of them the log has a command.
        first_difference: the first sample whose command differs in any bit, in words; None if there is none.
        fault_seq: the sample at which the logged controller was in fault, where the replay ends; None if it never was.
    """

    samples: int
    compared: int
    first_difference: str | None
    fault_seq: int | None


def replay(log: RunLog) -> Replay:
    """Step the controller of a log with the logged measurements and compare the torques bit by bit.

    Measurements the log has missed are taken from telemetry, which repeats them.

    Raises:
        InputError: the log lacks a document or a sample, or was paced by the clock: then torques also depend on which
            measurements came in time and on the safe torque the controller began with, which no log holds.
    """
    if log.header.mode == "realtime":
        raise InputError(log.source, "mode", "realtime", "in-process or lockstep: only lock-step is replayed")
    if log.is_of_system:
        return _replay_system(log)
    artifact = log.artifact
    runtime = _runtime.Artifact.parse(canonical_json(artifact.to_document()), log.source)
    trajectory = _runtime.Trajectory.parse(canonical_json(log.trajectory.to_document()), log.source)
    controller, n = _runtime.Controller(runtime), artifact.joints
    measured, commands = _measured(log), {int(c["seq"]): c for c in log["command"].samples}
    compared, difference = 0, None
    for k, reading in enumerate(measured):
        command = commands.get(k)
        if command is not None and command["state"] == FAULT:  # it no longer commands what its law says
            return Replay(k, compared, difference, k)
        r = trajectory.evaluate(k * artifact.sample_period_s)
        report = controller.step(reading.angle[:n], *r, reading.speed[:n], seq=k, gears=reading.gears(n))
        if command is None:
            continue
        compared += 1
        difference = difference or _difference(k, report.torque_applied[:n], command)
    return Replay(len(measured), compared, difference, None)


def _replay_system(log: RunLog) -> Replay:
    """The same of a general system, whose measurements say what the law was told of the parameters too."""
    artifact = log.system_artifact
    runtime = _runtime.SystemArtifact.parse(canonical_json(artifact.to_document()), log.source)
    controller, n = _runtime.SystemController(runtime), len(artifact.states)
    names = [signal.name for signal in artifact.inputs]
    told, commands = _told(log), {int(c["seq"]): c for c in log["command"].samples}
    compared, difference = 0, None
    for k, value in enumerate(told):
        command = commands.get(k)
        if command is not None and command["state"] == FAULT:
            return Replay(k, compared, difference, k)
        report = controller.step(value[:n], value[n : n + len(artifact.parameters)])
        if command is None:
            continue
        compared += 1
        difference = difference or _different_input(k, report["input"], command["input"][: len(names)], names)
    return Replay(len(told), compared, difference, None)


def _told(log: RunLog) -> list[FloatArray]:
    """What a law was told in every sample from 0 to the last; where its measurement is missing, from telemetry.

    Telemetry repeats the states only; the parameters are those of any measurement, because they do not change in a run.
    """
    artifact = log.system_artifact
    n = len(artifact.states)
    measurements, telemetry = log["measurement"].samples, log["telemetry"].samples
    if not measurements.size:
        raise InputError(log.source, "measurements", "none", "at least one, in QLPV_SIGNALS_MEASUREMENT")
    found = {int(record["seq"]): np.asarray(record["value"]) for record in measurements}
    for record in telemetry:
        value = np.array(measurements[0]["value"])
        value[:n] = record["measured"][:n]
        found.setdefault(int(record["seq"]), value)
    return _complete(log, found)


def _complete(log: RunLog, found: dict[int, Any]) -> list[Any]:
    """The entries of every sample from 0 to the last. InputError: one is missing."""
    missing = sorted(set(range(max(found) + 1)) - set(found))
    if missing:
        raise InputError(log.source, "measurements", f"none of sample {missing[0]}", "every sample from 0 to the last")
    return [found[k] for k in range(max(found) + 1)]


def _different_input(k: int, given: FloatArray, logged: Any, names: list[str]) -> str | None:
    """In words, whether an input is the commanded one, bit by bit."""
    index = _first_different_bits(given, logged)
    if index is None:
        return None
    return f"sample {k}, input {names[index]}: {float(logged[index])!r} in the log, {float(given[index])!r} replayed"


def _first_different_bits(ours: FloatArray, theirs: Any) -> int | None:
    """Where two rows of numbers differ first, bit by bit: NaN equals NaN, 0 differs from -0."""
    mine, other = (np.ascontiguousarray(row, dtype=np.float64).view(np.int64) for row in (ours, theirs))
    different = np.flatnonzero(mine != other)
    return int(different[0]) if different.size else None


def _difference(k: int, torque: FloatArray, command: Any) -> str | None:
    """In words, whether a torque is the commanded one, bit by bit."""
    logged = command["torque_nm"][: torque.size]
    joint = _first_different_bits(torque, logged)
    if joint is None:
        return None
    return f"sample {k}, joint {joint + 1}: {float(logged[joint])!r} N m in the log, {float(torque[joint])!r} replayed"


@dataclass(frozen=True, eq=False)
class _Reading:
    """One message with what was measured: of its type, the members that it has."""

    record: Any
    prefix: str

    @property
    def angle(self) -> FloatArray:
        return np.asarray(self.record[f"{self.prefix}angle_rad"])

    @property
    def speed(self) -> FloatArray:
        return np.asarray(self.record[f"{self.prefix}speed_rad_s"])

    def gears(self, joints: int) -> dict[str, FloatArray]:
        """What was available of the gears' sensors; nothing in logs from before there were any."""
        if "available" not in self.record.dtype.names:
            return {}
        there = int(self.record["available"])
        return {name: np.asarray(self.record[name][:joints]) for name, bit in GEAR_SENSORS.items() if there & bit}


def _measured(log: RunLog) -> list[_Reading]:
    """What was measured in every sample from 0 to the last."""
    found = {
        int(record["seq"]): _Reading(record, prefix)
        for channel, prefix in (("telemetry", "measured_"), ("measurement", ""))
        for record in log[channel].samples
    }
    if not found:
        raise InputError(log.source, "measurements", "none", "at least one, in QLPV_MEASUREMENT or QLPV_TELEMETRY")
    return _complete(log, found)
