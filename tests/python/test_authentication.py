"""Authenticated mode of both executables: one key, two keys, a key that others can read, and recorded commands."""

from __future__ import annotations

import secrets
from pathlib import Path

import lcm
import pytest

from quasilpv.telemetry.listening import listen
from quasilpv.telemetry.message_types import channel_type
from two_processes import SAMPLES, Experiment, finish

pytest_plugins = ["two_processes"]


def key_file(folder: Path, mode: int = 0o600) -> Path:
    path = folder / f"{secrets.token_hex(4)}.key"
    path.write_text(secrets.token_hex(32) + "\n")
    path.chmod(mode)
    return path


def test_with_one_key_on_both_sides_the_run_is_the_run_without_bit_for_bit(experiment: Experiment) -> None:
    records = []
    for options in ([], ["--key", str(key_file(experiment.folder))]):
        controller = experiment.start(experiment.controller_command(*options))
        code, plant, errors = experiment.run(experiment.simulator_command(*options))
        assert (code, plant["samples"]) == (0, SAMPLES), errors
        report = finish(controller)[1]
        assert report["authenticated"] is plant["authenticated"] is bool(options)
        assert report["link"]["not_authentic"] == plant["link"]["not_authentic"] == 0
        records.append((experiment.folder / "plant.csv").read_bytes())
    assert records[0] == records[1]


def test_when_the_keys_differ_expect_neither_side_to_hear_the_other_and_exit_5(experiment: Experiment) -> None:
    keys = [str(key_file(experiment.folder)) for _ in range(2)]
    options = ["--timeout-s", "1"]
    controller = experiment.start(experiment.controller_command("--key", keys[0], *options))
    code, _, errors = experiment.run(experiment.simulator_command("--key", keys[1], *options))
    assert (code, finish(controller)[0]) == (5, 5)
    assert "no command of session" in errors


@pytest.mark.parametrize("program", ["controller", "simulator"])
def test_when_others_may_read_the_key_expect_exit_2_and_one_line(experiment: Experiment, program: str) -> None:
    path = key_file(experiment.folder, mode=0o644)
    command = {"controller": experiment.controller_command, "simulator": experiment.simulator_command}[program]
    code, _, errors = experiment.run(command("--key", str(path)))
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert f"{path}: key: got mode 0644, expected mode 0600" in errors


def test_when_recorded_measurements_are_replayed_into_a_run_expect_the_same_run(experiment: Experiment) -> None:
    key = ["--key", str(key_file(experiment.folder))]
    wire = lcm.LCM(experiment.url)
    heard: list[bytes] = []
    wire.subscribe("QLPV_MEASUREMENT", lambda _, data: heard.append(data))
    controller = experiment.start(experiment.controller_command(*key))
    simulator = experiment.start(experiment.simulator_command(*key))
    replayed = 0
    while simulator.poll() is None:
        wire.handle_timeout(1)
        if replayed < 100 and len(heard) > 20 + replayed:
            wire.publish("QLPV_MEASUREMENT", heard[5])
            replayed += 1
    assert replayed
    code, plant, errors = finish(simulator)
    report = finish(controller)[1]
    assert (code, plant["samples"], report["steps"]) == (0, SAMPLES, SAMPLES), errors
    assert report["link"]["accepted"] >= SAMPLES
    assert report["link"]["old"] + report["link"]["duplicates"] >= 1


def test_a_listener_without_the_key_hears_the_messages_of_a_signed_run(experiment: Experiment) -> None:
    refusals: list[tuple[str, str | None]] = []
    wire = listen(experiment.url, lambda channel, data: refusals.append((channel, channel_type(channel).refusal(data))))
    key = ["--key", str(key_file(experiment.folder))]
    controller = experiment.start(experiment.controller_command(*key))
    simulator = experiment.start(experiment.simulator_command(*key))
    while simulator.poll() is None:
        wire.handle_timeout(10)
    assert finish(simulator)[0] == finish(controller)[0] == 0
    assert {channel for channel, _ in refusals} >= {"QLPV_MEASUREMENT", "QLPV_COMMAND", "QLPV_TELEMETRY", "QLPV_EVENT"}
    assert {reason for _, reason in refusals} == {None}
