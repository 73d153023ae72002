"""What the verbs make of a log: where it is, what is in it, figures, conversion, and refusal of what is none."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from quasilpv.artifact import Artifact
from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult
from quasilpv.telemetry import LOG_NAME, Event, latest_log, read_log, write_events
from quasilpv.telemetry.codes import event_in_words
from quasilpv.telemetry.log import point_to
from quasilpv.telemetry.mcap_export import as_json, json_schema
from quasilpv.telemetry.message_types import channel_type
from reference.logged_run import SAMPLES, edited

pytest_plugins = ["reference.logged_run"]


@pytest.mark.parametrize(
    ("content", "word"),
    [(b"", "empty"), (b"[project]\nname", "other bytes"), (None, "No such file"), (b"\xed\xa1\xda\x01", "truncated")],
)
@pytest.mark.parametrize("action", ["info", "plot", "replay", "to-mcap"])
def test_when_a_file_is_no_log_expect_exit_2_and_one_line(
    action: str, content: bytes | None, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "file"
    if content is not None:
        path.write_bytes(content)
    assert run(["log", action, str(path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    assert str(path) in captured.err
    assert word in captured.err


def test_when_the_last_log_is_asked_for_expect_the_newest_and_without_one_a_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="LAST"):
        latest_log(tmp_path)
    old, new = tmp_path / "a" / "run.lcmlog", tmp_path / "b" / "c" / "run.lcmlog"
    for age, path in ((1, old), (0, new)):
        write_events(path, [Event(0, "QLPV_RUN", b"{}")])
        stamp = path.stat().st_mtime - age
        os.utime(path, (stamp, stamp))
    assert latest_log(tmp_path) == new


@pytest.mark.parametrize("name", [b"elsewhere", b"\xff\xfe elsewhere\n"], ids=repr)
def test_when_the_last_run_was_written_elsewhere_expect_it_found_and_once_it_is_gone_said(
    name: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = write_events(Path(os.fsdecode(name)) / "run.lcmlog", [Event(0, "QLPV_RUN", b"{}")])
    point_to(log)
    assert latest_log() == log.absolute()
    newer = write_events(Path("out") / "run.lcmlog", [Event(0, "QLPV_RUN", b"{}")])
    os.utime(newer, ns=(0, log.stat().st_mtime_ns + 1))
    assert latest_log() == newer
    newer.unlink()
    log.unlink()
    with pytest.raises(InputError, match=f"under {tmp_path}/out, and no longer ") as error:
        latest_log()
    assert "elsewhere" in str(error.value)


def test_when_a_run_is_tracked_into_another_folder_expect_it_to_be_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    elsewhere = tmp_path.with_name(f"{tmp_path.name}-elsewhere")
    assert run(["track", "stabilise-arm2", "--controller", "pid", "-o", str(elsewhere), "--json"]) == 0
    capsys.readouterr()
    assert run(["log", "info", "LAST", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["log"] == str(elsewhere / "stabilise-arm2" / "pid" / LOG_NAME)


def test_when_a_log_is_inspected_expect_counts_rates_and_the_hash(
    tracked: tuple[TrackResult, Path], logged_artifact: Artifact, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "info", str(tracked[1]), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert info["artifact_hash"] == logged_artifact.hash
    assert (info["mode"], info["scenario"], info["telemetry_drops"]) == ("in-process", "hold", 0)
    telemetry = info["channels"]["QLPV_TELEMETRY"]
    assert (telemetry["messages"], telemetry["missing"], telemetry["refused"]) == (SAMPLES, 0, 0)
    assert telemetry["rate"] == pytest.approx(1000.0)
    said = [(0, "controller started"), (0, "plant started"), (299, "plant ended"), (299, "controller ended")]
    assert [(event["seq"], event["event"]) for event in info["events"]] == said
    assert run(["log", "info", str(tracked[1])]) == 0
    assert logged_artifact.hash in capsys.readouterr().out


@pytest.mark.parametrize(
    ("source", "code", "cause", "words"),
    [
        (1, 3, 5, "controller fault: premise outside its box"),
        (1, 2, 6, "controller ended: stop requested"),
        (3, 4, 0, "operator reset"),
        (9, 0, 77, "code 9 code 0: code 77"),
    ],
)
def test_an_event_is_told_in_words(source: int, code: int, cause: int, words: str) -> None:
    (event,) = channel_type("QLPV_EVENT").new(1)
    event["source"], event["code"], event["detail"][0] = source, code, cause
    assert event_in_words(event) == words


def test_when_figures_are_drawn_from_a_log_expect_those_of_the_run(
    tracked: tuple[TrackResult, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["log", "plot", str(tracked[1]), "-o", str(tmp_path), "--json"]) == 0
    files = json.loads(capsys.readouterr().out)["figures"]
    assert {"path.png", "errors.png", "disturbance.png"} <= {Path(file).name for file in files}
    assert all(Path(file).stat().st_size > 1000 for file in files)


def test_when_a_log_is_converted_expect_an_mcap_file_with_described_messages(
    tracked: tuple[TrackResult, Path], logged_artifact: Artifact, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    assert run(["log", "to-mcap", str(tracked[1]), "-o", str(path)]) == 0
    log = read_log(tracked[1])
    with path.open("rb") as file:
        reader = make_reader(file)
        messages = [(schema, channel.topic, message) for schema, channel, message in reader.iter_messages()]
        attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
        (metadata,) = reader.iter_metadata()
    assert metadata.metadata["artifact_hash"] == logged_artifact.hash
    assert attachments["artifact.json"] == log.documents["QLPV_ARTIFACT"]
    assert {schema.encoding for schema, _, _ in messages} == {"jsonschema"}
    trees = [json.loads(message.data) for _, topic, message in messages if topic == "/telemetry"]
    assert len(trees) == SAMPLES
    assert [tree["applied_torque_nm"] for tree in trees] == log["telemetry"].records["applied_torque_nm"][
        :, :3
    ].tolist()
    assert len(trees[0]["premise"]) == logged_artifact.law.inertia.premises
    described = json.loads(next(schema.data for schema, topic, _ in messages if topic == "/telemetry"))["properties"]
    assert described.keys() == trees[0].keys()
    times = [message.log_time for _, topic, message in messages if topic == "/telemetry"]
    assert times == [1_000_000 * k for k in range(SAMPLES)]


def test_when_the_last_messages_of_a_channel_are_lost_expect_them_counted_as_missing(
    tracked: tuple[TrackResult, Path], tmp_path: Path
) -> None:
    def lose(_: int, event: Event) -> Event | None:
        late = int.from_bytes(event.data[16:24], "big") >= SAMPLES - 7
        return None if event.channel == "QLPV_TELEMETRY" and late else event

    log = read_log(edited(tracked[1], tmp_path / "lost.lcmlog", lose))
    assert log.last_seq == SAMPLES - 1
    assert [log[name].missing(log.last_seq) for name in ("measurement", "telemetry")] == [0, 7]


def test_when_a_number_is_not_finite_expect_null_in_json() -> None:
    kind = channel_type("QLPV_MEASUREMENT")
    (record,) = kind.new(1)
    record["joints"], record["angle_rad"] = 2, np.nan
    tree = as_json(kind, record)
    assert tree["angle_rad"] == [None, None]
    assert json_schema(kind)["properties"]["angle_rad"]["items"]["type"] == ["number", "null"]
