"""`--record` of both executables, as real processes: what it replaces, when, and what it never touches."""

from __future__ import annotations

import os
import re
import signal
import socket
import stat
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from test_authentication import key_file
from two_processes import SAMPLES, Experiment, finish

pytest_plugins = ["two_processes"]

SIDES = pytest.mark.parametrize("side", ["controller", "simulator"])
OLD = b"an old record\n"
SMALL = ["bash", "-c", 'ulimit -f 16; exec "$@"', "-"]
"""Before a command: no file of it holds more than 16 KiB, as on a disk that is nearly full."""


def command_of(experiment: Experiment, side: str, record: Path, *options: str) -> list[str]:
    command: list[str] = getattr(experiment, f"{side}_command")(*options)
    command[command.index("--record") + 1] = str(record)
    return command


def document_of(experiment: Experiment, side: str) -> Path:
    return experiment.folder / {"controller": "trajectory.json", "simulator": "scenario.json"}[side]


def place(experiment: Experiment, name: str = "record.csv") -> Path:
    """A name in a folder of its own, so that whatever is left behind is seen."""
    folder = experiment.folder / "records"
    folder.mkdir(exist_ok=True)
    return folder / name


def others(record: Path) -> list[str]:
    return [entry.name for entry in record.parent.iterdir() if entry != record]


def require_refusal(experiment: Experiment, command: list[str], got: str) -> None:
    code, report, errors = experiment.run(command)
    assert (code, report, len(errors.splitlines())) == (2, {}, 1), errors
    assert re.search(rf": record: got {got}, expected ", errors), errors


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@SIDES
def test_when_the_run_does_not_begin_expect_the_old_record_and_nothing_beside_it(
    experiment: Experiment, side: str
) -> None:
    record = place(experiment)
    record.write_bytes(OLD)
    alone = command_of(experiment, side, record, "--timeout-s", "0.2")
    bad_document = [*alone, "--key", str(experiment.folder / "missing.key")]
    for command, expected in ((alone, 5), (bad_document, 2), ([*alone, "--mode", "soon"], 2)):
        assert experiment.run(command)[0] == expected
        assert (record.read_bytes(), others(record)) == (OLD, [])
    record.unlink()
    assert experiment.run(alone)[0] == 5
    assert list(record.parent.iterdir()) == []


def test_when_the_modes_differ_expect_both_old_records(experiment: Experiment) -> None:
    records = [place(experiment, name) for name in ("controller.csv", "plant.csv")]
    for record in records:
        record.write_bytes(OLD)
    controller = experiment.start(command_of(experiment, "controller", records[0]))
    plant = experiment.start(command_of(experiment, "simulator", records[1], "--mode", "realtime"))
    assert (finish(controller)[0], finish(plant)[0]) == (2, 2)
    assert [record.read_bytes() for record in records] == [OLD, OLD]


def test_when_a_run_is_recorded_expect_old_records_replaced_whole_links_followed_modes_kept(
    experiment: Experiment,
) -> None:
    old, new = place(experiment, "old.csv"), place(experiment, "new.csv")
    old.write_bytes(b"x" * 1_000_000)
    old.chmod(0o640)
    link, dangling = experiment.folder / "link.csv", experiment.folder / "dangling.csv"
    link.symlink_to(old)
    dangling.symlink_to(os.path.relpath(new, experiment.folder))
    umask = ["bash", "-c", 'umask 027; exec "$@"', "-"]
    controller = experiment.start([*umask, *command_of(experiment, "controller", dangling)])
    assert experiment.run(command_of(experiment, "simulator", link))[0] == 0
    assert finish(controller)[0] == 0
    assert link.is_symlink()
    assert dangling.is_symlink()
    for record, mode in ((old, 0o640), (new, 0o640)):
        assert len(record.read_bytes().splitlines()) == SAMPLES + 1
        assert stat.S_IMODE(record.stat().st_mode) == mode
    assert sorted(entry.name for entry in old.parent.iterdir()) == ["new.csv", "old.csv"]


@SIDES
def test_when_the_record_is_an_input_by_any_name_expect_refusal_and_the_input_as_it_was(
    experiment: Experiment, side: str
) -> None:
    key = key_file(experiment.folder)
    for source in (experiment.folder / "artifact.json", document_of(experiment, side), key):
        before = source.read_bytes()
        hard, soft = (experiment.folder / f"{source.name}.{kind}" for kind in ("hard", "soft"))
        os.link(source, hard)
        soft.symlink_to(source)
        relative = Path(os.path.relpath(source))
        for name in (source, hard, soft, relative, source.parent / "." / ".." / source.parent.name / source.name):
            command = command_of(experiment, side, name, "--key", str(key))
            require_refusal(experiment, command, r"an input of this command \([^\n]+\)")
        assert source.read_bytes() == before


@SIDES
def test_when_the_record_is_no_regular_file_expect_refusal_and_the_thing_as_it_was(
    experiment: Experiment, side: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = place(experiment, "folder")
    folder.mkdir()
    pipe, device_link, circle, listening = (place(experiment, name) for name in ("pipe", "null", "circle", "socket"))
    os.mkfifo(pipe)
    device_link.symlink_to("/dev/null")
    circle.symlink_to(circle)
    with socket.socket(socket.AF_UNIX) as server:
        monkeypatch.chdir(folder)  # names of sockets are short
        server.bind("../socket")
    before = sorted(entry.name for entry in folder.parent.iterdir())
    targets = {
        folder: "a folder",
        folder / ".": "a folder",
        pipe: "a named pipe",
        Path("/dev/null"): "a device",
        Path("/dev/full"): "a device",
        device_link: "a device",
        circle: "Too many levels of symbolic links",
        listening: "a socket",
        folder / "missing" / "record.csv": "No such file or directory",
        document_of(experiment, side) / "record.csv": "Not a directory",
        place(experiment, "y" * 300): "File name too long",
        Path("/proc/record.csv"): r"[^\n]+",
    }
    for target, got in targets.items():
        require_refusal(experiment, command_of(experiment, side, target), got)
    assert sorted(entry.name for entry in folder.parent.iterdir()) == before
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_when_two_programs_record_into_one_file_expect_the_second_refused_and_the_first_whole(
    experiment: Experiment,
) -> None:
    record, link = place(experiment), experiment.folder / "link.csv"
    link.symlink_to(record)
    controller = experiment.start(command_of(experiment, "controller", record))
    until(lambda: len(others(record)) == 2)  # its claim and its new file
    for side, name in (("simulator", record), ("controller", link)):
        holder = rf"the output of process {controller.pid}, qlpv-controller too"
        require_refusal(experiment, command_of(experiment, side, name), holder)
    assert experiment.run(command_of(experiment, "simulator", place(experiment, "plant.csv")))[0] == 0
    assert finish(controller)[0] == 0
    assert len(record.read_bytes().splitlines()) == SAMPLES + 1
    assert others(record) == ["plant.csv"]


@SIDES
@pytest.mark.parametrize("request_stop", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_when_a_program_is_stopped_before_its_run_begins_expect_the_old_record_and_nothing_beside_it(
    experiment: Experiment, side: str, request_stop: signal.Signals
) -> None:
    record = place(experiment)
    record.write_bytes(OLD)
    process = experiment.start(command_of(experiment, side, record))
    until(lambda: len(others(record)) == 2)
    process.send_signal(request_stop)
    assert finish(process)[0] == 0
    assert (record.read_bytes(), others(record)) == (OLD, [])


def test_when_a_program_was_killed_expect_its_claim_gone_and_the_next_run_recorded(experiment: Experiment) -> None:
    record = place(experiment)
    killed = experiment.start(command_of(experiment, "controller", record))
    until(lambda: len(others(record)) == 2)
    killed.kill()
    killed.communicate()
    controller = experiment.start(command_of(experiment, "controller", record))
    assert experiment.run(experiment.simulator_command())[0] == 0
    assert finish(controller)[0] == 0
    assert len(record.read_bytes().splitlines()) == SAMPLES + 1


def test_when_the_record_does_not_fit_expect_what_does_in_whole_rows_a_line_and_the_report(
    experiment: Experiment,
) -> None:
    records = {side: place(experiment, f"{side}.csv") for side in ("controller", "simulator")}
    for record in records.values():
        record.write_bytes(OLD)
    controller = experiment.start([*SMALL, *command_of(experiment, "controller", records["controller"])])
    code, report, errors = experiment.run([*SMALL, *command_of(experiment, "simulator", records["simulator"])])
    assert (code, report["samples"], len(errors.splitlines())) == (2, SAMPLES, 1), errors
    assert f"{records['simulator']}: record: got a write error" in errors
    code, report, errors = finish(controller)
    assert (code, report["steps"], len(errors.splitlines())) == (0, SAMPLES, 1), errors
    lost = report["telemetry"]["record_drops"]
    assert f"{records['controller']}: {lost} rows of the record were lost" in errors
    for record in records.values():
        data = record.read_bytes()
        rows = data.splitlines()
        assert data.endswith(b"\n")
        assert 1 < len(rows) < SAMPLES
        assert {row.count(b",") for row in rows} == {rows[0].count(b",")}
        assert [int(row.split(b",")[0]) for row in rows[1:]] == list(range(len(rows) - 1))
    assert len(list(place(experiment).parent.iterdir())) == 2
