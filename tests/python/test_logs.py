"""Logs of runs: what LCM reads and writes, whole or cut, and bit-identical replay."""

from __future__ import annotations

import json
import lzma
import zlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Literal

import lcm
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.experiments.hil import run_over_lcm
from quasilpv.experiments.logged import logged_result, mechanism_of
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import Sensors, TrackingExperiment, build_scenario
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import all_robots, any_robot
from quasilpv.telemetry import LOG_NAME, Event, RunLog, read_events, read_log, write_events
from quasilpv.telemetry.message_types import CHANNELS, channel_type, message_type, parse_definition
from quasilpv.telemetry.replay import replay
from quasilpv.trajectories import rest
from reference.logged_run import SAMPLES, edited, resealed
from two_processes import executable

pytest_plugins = ["two_processes", "reference.logged_run"]

DATA = Path(__file__).parents[1] / "data"
COMPARED = (
    ("measurement", ()),
    ("command", ("state",)),  # a run in one process has no fail-safe
    ("telemetry", ("state", "step_ns")),
    ("truth", ()),
)
"""Channels of a log, and what on them differs between a run over the wire and one in this process."""


@pytest.mark.parametrize("name", [name for names in CHANNELS.values() for name in names])
def test_when_a_message_is_encoded_expect_the_bytes_of_the_code_that_lcm_generates(
    name: str, message_types: ModuleType
) -> None:
    kind = message_type(name)
    generator = np.random.default_rng(0)
    records = kind.new(1)
    theirs = getattr(message_types, name)()
    for member in kind.record.names[1:-1]:
        layout = kind.record[member]
        value = generator.integers(-(2**31), 2**31, layout.shape)
        if layout.base.kind == "f":
            value = generator.normal(size=layout.shape)
        records[member] = value
        setattr(theirs, member, value.tolist())
    theirs.crc = zlib.crc32(theirs.encode()[:-8])
    (packet,) = kind.encode(records)
    assert packet == theirs.encode()
    (decoded,) = kind.decode([packet])
    for member in kind.record.names[1:]:
        assert np.array_equal(decoded[member], getattr(theirs, member))


def test_when_a_packet_is_not_exactly_a_message_expect_it_refused() -> None:
    kind = channel_type("QLPV_COMMAND")
    (packet,) = kind.encode(kind.new(1))
    assert kind.refusal(packet) is None
    assert kind.refusal(packet + b"\0") == "wrong size"
    assert kind.refusal(packet[:-1]) == "wrong size"
    assert kind.refusal(packet[:40] + b"\x01" + packet[41:]) == "wrong checksum"
    other = (1).to_bytes(8, "big") + packet[8:-8]
    assert kind.refusal(other + zlib.crc32(other).to_bytes(8, "big")) == "wrong type"


@pytest.mark.parametrize("member", ["string name;", "double values[n];", "other_v1 nested;"])
def test_when_a_definition_has_members_of_varying_size_expect_it_refused(member: str) -> None:
    with pytest.raises(ValueError, match="members"):
        parse_definition(f"struct bad_v1 {{ int64_t utime; {member} }}")


def test_when_lcm_itself_reads_a_log_expect_the_same_events(tracked: tuple[TrackResult, Path]) -> None:
    ours = list(read_events(tracked[1]))
    theirs = [Event(event.timestamp, event.channel, event.data) for event in lcm.EventLog(str(tracked[1]), "r")]
    assert ours == theirs
    assert len(ours) == 4 + 4 + 4 * SAMPLES


def test_when_lcm_itself_writes_a_log_expect_it_read(tmp_path: Path) -> None:
    path = tmp_path / "theirs.lcmlog"
    log = lcm.EventLog(str(path), "w", overwrite=True)
    log.write_event(17, "OTHER", b"abc")
    log.write_event(18, "QLPV_COMMAND", b"no command")
    log.close()
    assert list(read_events(path)) == [Event(17, "OTHER", b"abc"), Event(18, "QLPV_COMMAND", b"no command")]
    decoded = read_log(path)
    assert decoded.foreign == {"OTHER": 1}
    assert decoded["command"].refused == {"wrong size": 1}


FOUR_EVENTS = [Event(k, "QLPV_X", bytes(range(16))) for k in range(4)]
EVENT_BYTES = 50


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_events(tmp_path_factory.mktemp("four") / "four.lcmlog", FOUR_EVENTS)


@pytest.mark.parametrize("lost", [b"", bytes(1), bytes(4096)], ids=["", "a zero", "a page of zeros"])
def test_when_a_log_is_cut_anywhere_expect_every_whole_event_and_how_much_is_left_out(
    lost: bytes, four: Path, tmp_path: Path
) -> None:
    content, path = four.read_bytes(), tmp_path / "cut.lcmlog"
    assert len(content) == len(FOUR_EVENTS) * EVENT_BYTES
    for cut in range(1, len(content)):
        path.write_bytes(content[:cut] + (lost if cut % EVENT_BYTES == 0 else b""))
        if cut < EVENT_BYTES:
            with pytest.raises(InputError, match="event 0: got the end of the file"):
                read_events(path)
            continue
        log = read_events(path)
        assert list(log) == FOUR_EVENTS[: cut // EVENT_BYTES]
        assert log.incomplete_bytes == (cut % EVENT_BYTES or len(lost))


@given(place=st.integers(0, 4), junk=st.binary(min_size=1, max_size=60))
def test_when_other_bytes_are_in_a_log_expect_a_line_with_the_event(
    four: Path, tmp_path_factory: pytest.TempPathFactory, place: int, junk: bytes
) -> None:
    content, path = four.read_bytes(), tmp_path_factory.mktemp("junk") / "junk.lcmlog"
    at = place * EVENT_BYTES
    path.write_bytes(content[:at] + junk + content[at:])
    is_unwritten_space = place == len(FOUR_EVENTS) and not any(junk)
    begins_an_event = place == len(FOUR_EVENTS) and b"\xed\xa1\xda\x01".startswith(junk[:4])
    if is_unwritten_space or begins_an_event:
        assert list(read_events(path)) == FOUR_EVENTS
    else:
        # Junk that begins like an event may borrow the bytes of the next one: then it is found one event later.
        with pytest.raises(InputError, match=f"event ({place}|{place + 1})"):
            read_events(path)


@given(event=st.integers(0, 3), place=st.integers(0, 27), value=st.integers(0, 255))
def test_when_a_byte_of_the_head_of_an_event_is_another_expect_a_line_or_every_other_event(
    four: Path, tmp_path_factory: pytest.TempPathFactory, event: int, place: int, value: int
) -> None:
    content, path = bytearray(four.read_bytes()), tmp_path_factory.mktemp("head") / "head.lcmlog"
    content[event * EVENT_BYTES + place] = value
    path.write_bytes(content)
    try:
        found = list(read_events(path))
    except InputError as refused:
        message = str(refused)
    else:
        message = ""
    if message:
        assert f"event {event}" in message or f"event {event + 1}" in message
        return
    whole = event if len(found) < len(FOUR_EVENTS) else len(FOUR_EVENTS)
    assert len(found) == whole
    kept = [k for k in range(whole) if k != event]
    assert [found[k] for k in kept] == [FOUR_EVENTS[k] for k in kept]
    if whole < len(FOUR_EVENTS):  # only the last one can claim to go on beyond the end of the file
        assert event == len(FOUR_EVENTS) - 1


@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_when_a_recording_was_cut_off_expect_a_warning_and_everything_that_is_whole(
    share: float, tracked: tuple[TrackResult, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = read_log(tracked[1])
    ends = np.cumsum([28 + len(event.channel) + len(event.data) for event in read_events(tracked[1])])
    content = tracked[1].read_bytes()
    cut = int(share * len(content))
    assert cut not in ends
    (tmp_path / "cut.lcmlog").write_bytes(content[:cut])
    assert run(["log", "info", str(tmp_path / "cut.lcmlog"), "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err.startswith(f"warning: {tmp_path / 'cut.lcmlog'}: ")
    assert captured.err.count("\n") == 1
    info, kept = json.loads(captured.out), int(np.searchsorted(ends, cut, side="right"))
    assert info["incomplete_bytes"] == cut - (ends[kept - 1] if kept else 0)
    log = read_log(tmp_path / "cut.lcmlog")
    assert kept == 4 + sum(messages.records.size for messages in log.channels.values())
    for channel, messages in log.channels.items():
        expected = whole.channels[channel].records[: messages.records.size]
        assert messages.records.tobytes() == expected.tobytes()
    assert replay(log).first_difference is None


def test_when_a_run_is_read_back_from_its_log_expect_every_sample_and_number(
    tracked: tuple[TrackResult, Path], logged_artifact: Artifact
) -> None:
    result, path = tracked
    logged = logged_result(read_log(path))
    assert result.run.first_difference(logged.run) is None
    assert logged.row() == result.row()
    assert logged.title == result.title
    assert read_log(path).artifact == logged_artifact


def test_when_a_run_is_repeated_expect_the_same_log_byte_for_byte(
    tracked: tuple[TrackResult, Path], logged_artifact: Artifact, logged_experiment: TrackingExperiment, tmp_path: Path
) -> None:
    track(RunSetup(logged_experiment, logged_artifact, plant="perturbed", sensors=Sensors()), tmp_path)
    assert (tmp_path / LOG_NAME).read_bytes() == tracked[1].read_bytes()
    track(
        RunSetup(logged_experiment, logged_artifact, plant="perturbed", sensors=Sensors(), log=False),
        tmp_path / "unlogged",
    )
    assert not (tmp_path / "unlogged" / LOG_NAME).exists()


@pytest.mark.parametrize(("kind", "payload"), [("nominal", 0.0), ("perturbed", 1.0)])
@pytest.mark.parametrize("name", [entry.id for entry in all_robots()])
def test_when_a_robot_is_rebuilt_from_its_plant_document_expect_the_same_plant(
    name: str, kind: Literal["nominal", "perturbed"], payload: float
) -> None:
    entry = any_robot(name)
    plant = entry.with_payload_fraction(payload)
    scenario = build_scenario(entry, rest("still", plant.joints, 1.0), plant=kind, external_torque=())
    rebuilt = mechanism_of(scenario.plant)
    angle = np.linspace(-0.4, 0.7, plant.joints)
    np.testing.assert_array_equal(rebuilt.skeleton(angle), plant.skeleton(angle))
    np.testing.assert_allclose(rebuilt.inertia(angle), plant.inertia(angle), rtol=1e-14)
    np.testing.assert_allclose(rebuilt.gravity(angle), plant.gravity(angle), rtol=1e-14, atol=1e-14)


def test_when_a_log_is_replayed_expect_every_command_bit_for_bit(tracked: tuple[TrackResult, Path]) -> None:
    shown = replay(read_log(tracked[1]))
    assert (shown.samples, shown.compared, shown.first_difference, shown.fault_seq) == (SAMPLES, SAMPLES, None, None)


@pytest.mark.parametrize("age", [1, 2])
def test_when_a_log_is_of_an_earlier_version_of_the_messages_expect_the_same_samples_and_the_same_replay(
    age: int, tracked: tuple[TrackResult, Path], tmp_path: Path
) -> None:
    def as_then(_: int, event: Event) -> Event:
        names = CHANNELS.get(event.channel, ())
        if len(names) < 2:
            return event
        new, old = message_type(names[0]), message_type(names[min(age, len(names) - 1)])
        records = old.new(1)
        for member in old.record.names[1:-1]:
            if member != "flags" or member in new.record.names:
                records[member] = np.frombuffer(event.data, new.record)[member]
        return event._replace(data=old.encode(records)[0])

    now, before = read_log(tracked[1]), read_log(edited(tracked[1], tmp_path / "old.lcmlog", as_then))
    for channel in ("measurement", "command", "telemetry", "event", "truth"):
        old, names = before[channel], CHANNELS[f"QLPV_{channel.upper()}"]
        assert old.type.name == names[min(age, len(names) - 1)]
        assert (old.refused, old.records.size) == ({}, now[channel].records.size)
        for member in set(old.type.record.names[1:-1]) & set(now[channel].type.record.names):
            np.testing.assert_array_equal(old.records[member], now[channel].records[member])
    assert replay(before) == replay(now)
    assert logged_result(before).row() == logged_result(now).row()


def test_when_a_log_was_written_before_readings_had_gears_expect_it_read_and_replayed(tmp_path: Path) -> None:
    """Written by the version before, of an arm that holds its posture."""
    path = tmp_path / "run.lcmlog"
    path.write_bytes(lzma.decompress((DATA / "logs" / "hold-measurement-v2.lcmlog.xz").read_bytes()))
    log = read_log(path)
    types = {name: log[name].type.name for name in ("measurement", "telemetry", "truth")}
    assert types == {"measurement": "measurement_v2", "telemetry": "telemetry_v1", "truth": "truth_v1"}
    assert {name: log[name].records.size for name in types} == dict.fromkeys(types, 25)
    assert not any(messages.refused for messages in log.channels.values())
    shown = replay(log)
    assert (shown.samples, shown.compared, shown.fault_seq) == (25, 25, None)
    np.testing.assert_array_equal(logged_result(log).run.true_angle_rad, log["truth"].samples["angle_rad"][:, :3])


def test_when_one_bit_of_one_command_is_another_expect_the_replay_to_name_it(
    tracked: tuple[TrackResult, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def flip(_: int, event: Event) -> Event:
        if event.channel != "QLPV_COMMAND":
            return event
        command = np.frombuffer(event.data, channel_type("QLPV_COMMAND").record)[0]
        torque = command["torque_nm"].astype(float)
        if command["seq"] != 123:
            return event
        torque[1] = np.nextafter(torque[1], np.inf)
        return resealed(event, torque_nm=torque)

    path = edited(tracked[1], tmp_path / "flipped.lcmlog", flip)
    difference = replay(read_log(path)).first_difference
    assert difference is not None
    assert difference.startswith("sample 123, joint 2: ")
    assert run(["log", "replay", str(path)]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_when_measurements_were_missed_expect_them_from_telemetry_and_without_both_a_line(
    tracked: tuple[TrackResult, Path], tmp_path: Path
) -> None:
    def without(*channels: str) -> RunLog:
        def drop(_: int, event: Event) -> Event | None:
            if event.channel not in channels:
                return event
            record = np.frombuffer(event.data, channel_type(event.channel).record)[0]
            return None if record["seq"] == 40 else event

        return read_log(edited(tracked[1], tmp_path / "missing.lcmlog", drop))

    log = without("QLPV_MEASUREMENT")
    assert (log["measurement"].missing(log.last_seq), log["command"].missing(log.last_seq)) == (1, 0)
    assert replay(log).first_difference is None
    with pytest.raises(InputError, match="none of sample 40"):
        replay(without("QLPV_MEASUREMENT", "QLPV_TELEMETRY"))


def test_when_the_controller_was_in_fault_expect_the_replay_to_end_there(
    tracked: tuple[TrackResult, Path], tmp_path: Path
) -> None:
    def latch(_: int, event: Event) -> Event:
        is_late = event.channel == "QLPV_COMMAND" and int.from_bytes(event.data[16:24], "big") >= 50
        return resealed(event, state=4, torque_nm=0.0) if is_late else event

    shown = replay(read_log(edited(tracked[1], tmp_path / "fault.lcmlog", latch)))
    assert (shown.samples, shown.compared, shown.first_difference, shown.fault_seq) == (50, 50, None, 50)


def test_when_the_artifact_is_another_one_expect_exit_2_and_one_line(
    tracked: tuple[TrackResult, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other, _ = write_artifact(tmp_path, release(DesignRequest.of("arm3", "pid", Specification())).artifact)
    assert run(["log", "replay", str(tracked[1]), "--artifact", str(other)]) == 2
    line = capsys.readouterr().err
    assert len(line.splitlines()) == 1
    assert read_artifact(other).hash[:16] in line
    log = read_log(tracked[1])
    swapped = replace(log, documents={**log.documents, "QLPV_ARTIFACT": other.read_bytes()})
    with pytest.raises(InputError, match=r"QLPV_MEASUREMENT\.artifact_hash"):
        replay(swapped)


def test_when_two_processes_talk_expect_their_traffic_in_the_log_and_a_replay_bit_for_bit(
    tracked: tuple[TrackResult, Path],
    logged_artifact: Artifact,
    logged_experiment: TrackingExperiment,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", str(Path(executable("qlpv-simulator")).parent), prepend=":")
    executable("qlpv-controller")
    run_over_lcm(
        RunSetup(logged_experiment, logged_artifact, plant="perturbed", sensors=Sensors()), tmp_path, Talk("lockstep")
    )
    heard, made = read_log(tmp_path / LOG_NAME), read_log(tracked[1])
    for channel, own in COMPARED:
        theirs, ours = heard[channel].samples, made[channel].samples
        assert theirs.size >= 0.9 * SAMPLES  # a busy machine may lose some
        ours = ours[np.isin(ours["seq"], theirs["seq"])]
        for name in set(theirs.dtype.names) - {"utime", "session", "sender", "receiver", "crc", *own}:
            np.testing.assert_array_equal(theirs[name], ours[name], err_msg=f"{channel}.{name}")
    assert np.all(heard["telemetry"].samples["step_ns"] > 0)
    assert replay(heard).first_difference is None


def test_when_a_run_was_paced_by_the_clock_expect_no_replay_but_a_line(tracked: tuple[TrackResult, Path]) -> None:
    log = read_log(tracked[1])
    header = log.header.model_copy(update={"mode": "realtime"})
    with pytest.raises(InputError, match="realtime"):
        replay(replace(log, documents={**log.documents, "QLPV_RUN": header.to_bytes()}))
