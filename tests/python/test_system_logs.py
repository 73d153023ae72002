"""Logs of general systems: what is heard is what was made, replay, conversion, figures, what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from quasilpv.cli.app import run
from quasilpv.errors import InputError
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.system_hil import require_identical, run_system_over_lcm
from quasilpv.experiments.system_logged import logged_system_run, write_log
from quasilpv.experiments.system_run import SystemExperiment, scenario_of, simulate
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.telemetry import LOG_NAME, RunLog, read_log
from quasilpv.telemetry.mcap_export import json_schema
from quasilpv.telemetry.message_types import channel_type, message_type
from quasilpv.telemetry.replay import replay
from quasilpv.telemetry.system_recording import names_of, units_of
from reference.released_systems import released
from two_processes import executable

EXPERIMENT = SystemExperiment({"v": 8.0}, {"P": 500.0}, noise={"v": 0.1})


@pytest.fixture
def made(tmp_path: Path) -> RunLog:
    return read_log(write_log(tmp_path / "own" / LOG_NAME, simulate(released("dc-bus"), EXPERIMENT, "test")))


def test_a_run_is_read_back_from_its_log_bit_for_bit(made: RunLog) -> None:
    original = simulate(released("dc-bus"), EXPERIMENT, "test")
    read = logged_system_run(made)
    require_identical(read, original)
    assert (read.flags, read.exit, read.scenario) == (original.flags, original.exit, original.scenario)
    assert made.is_of_system
    np.testing.assert_array_equal(made["measurement"].samples["value"][:, 3], 0.0)  # P, which the law is not told
    assert made["measurement"].samples["signals"].tolist() == [4] * len(original.time_s)


def test_what_is_heard_on_the_wire_is_what_a_run_in_process_writes(made: RunLog, tmp_path: Path) -> None:
    executable("qlpv-controller")
    artifact = released("dc-bus")
    run_system_over_lcm(artifact, scenario_of(artifact, EXPERIMENT, "test"), tmp_path, Talk("lockstep"))
    heard = read_log(tmp_path / LOG_NAME)
    for channel in ("measurement", "command", "telemetry", "truth"):
        theirs, ours = heard[channel].samples, made[channel].samples
        assert theirs.size >= 0.9 * ours.size  # a busy machine may lose some
        common = np.isin(ours["seq"], theirs["seq"])
        for name in set(theirs.dtype.names or ()) - {
            "utime",
            "session",
            "sender",
            "receiver",
            "crc",
            "step_ns",
            "realtime",
            "drops",
        }:
            np.testing.assert_array_equal(theirs[name], ours[name][common], err_msg=f"{channel}.{name}")
    shown = replay(heard)
    assert shown.first_difference is None
    assert shown.compared > 0.9 * shown.samples


def test_a_replay_finds_a_changed_input_and_names_it(made: RunLog) -> None:
    shown = replay(made)
    samples = made["truth"].samples.size
    assert (shown.first_difference, shown.samples, shown.compared) == (None, samples, samples)
    records = made["command"].records.copy()
    records["input"][40, 0] = np.nextafter(records["input"][40, 0], 1e9)
    other = replace(made["command"], records=records)
    changed = replace(made, channels={**made.channels, "QLPV_SIGNALS_COMMAND": other})
    difference = replay(changed).first_difference
    assert difference is not None
    assert difference.startswith("sample 40, input u: ")


def test_messages_of_a_log_are_refused_by_length_checksum_and_type(made: RunLog) -> None:
    for channel in ("QLPV_SIGNALS_MEASUREMENT", "QLPV_SIGNALS_COMMAND", "QLPV_SIGNALS_TELEMETRY", "QLPV_SIGNALS_TRUTH"):
        kind = channel_type(channel)
        [packet] = kind.encode(kind.new(1))
        assert kind.refusal(packet) is None
        assert kind.refusal(packet[:-1]) == "wrong size"
        assert kind.refusal(packet[:20] + bytes([packet[20] ^ 1]) + packet[21:]) == "wrong checksum"
        assert made.channels[channel].refused == {}


def test_a_state_that_left_its_domain_is_named_in_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    left = simulate(released("dc-bus"), SystemExperiment({"v": 12.5}, {}), "test")
    assert left.exit == (0.0, "v")
    path = write_log(tmp_path / "out" / "left" / LOG_NAME, left)
    assert logged_system_run(read_log(path)).exit == left.exit
    assert run(["log", "info", "LAST", "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert "plant left its domain: v" in [event["event"] for event in info["events"]]
    assert info["signals"]["u"] == "input, V"


def test_the_verbs_of_logs_take_one_of_a_system(
    made: RunLog, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["log", "info", made.source]) == 0
    shown = capsys.readouterr().out
    assert "v (state, V)" in shown
    assert "QLPV_SIGNALS_TELEMETRY" in shown
    assert "QLPV_TELEMETRY" not in shown
    assert run(["log", "replay", made.source]) == 0
    assert "identical, bit for bit" in capsys.readouterr().out
    assert run(["log", "plot", made.source, "-o", "plots"]) == 0
    assert {path.name for path in Path("plots").iterdir()} == {"signals.png", "region.png"}
    assert run(["log", "to-mcap", made.source, "-o", "run.mcap"]) == 0
    with Path("run.mcap").open("rb") as file:
        messages = [
            (schema.name if schema else "", json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages(topics=["/signals_truth", "/signals_command"])
        ]
    truth = [message for name, message in messages if name == "quasilpv.signals_truth_v1"]
    assert truth[0]["state"]["v"] == 8.0
    assert set(truth[0]["state"]) == {"i", "v", "j"}
    assert set(next(message for name, message in messages if name.endswith("command_v1"))["input"]) == {"u"}


def test_units_are_those_of_the_equations_and_a_unit_of_nothing_is_refused() -> None:
    equations: dict[str, Any] = {"state": "x v", "inputs": "u", "domain": {"x": (-1, 1), "m": (1, 2)}, "unknown": "m"}
    given = {"x": "rad", "u": "N m", "m": "kg"}
    texts = ["x' = v", "m*v' = sin(x) + u"]
    assert DescriptorSystem.from_equations(texts, **equations, units=given).units == given
    for units, words in (({"y": "m"}, "units"), ({"x": ""}, "units: x"), ({"x": "m" * 33}, "1 to 32 characters")):
        with pytest.raises(InputError, match=words):
            DescriptorSystem.from_equations(texts, **equations, units=units)
    shape = json_schema(message_type("signals_truth_v1"), names_of(released("dc-bus")), units_of(released("dc-bus")))
    assert shape["properties"]["state"]["properties"]["v"]["description"] == "V"


def test_a_log_of_a_system_is_none_of_a_robot(made: RunLog) -> None:
    with pytest.raises(InputError, match="a controller of a system"):
        _ = made.artifact
    with pytest.raises(InputError, match=r"artifact\.hash"):
        made.require_artifact(released("cart-pole"))
    assert made.require_artifact(released("dc-bus")).system_artifact.hash == released("dc-bus").hash
    empty = replace(made["truth"], records=made["truth"].records[:0])
    with pytest.raises(InputError, match="QLPV_SIGNALS_TRUTH"):
        logged_system_run(replace(made, channels={**made.channels, "QLPV_SIGNALS_TRUTH": empty}))
