"""Faults F22 to F26 with the real processes: who is speaking, in which mode, and what a plant refuses."""

from __future__ import annotations

import math
import re
import signal
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from subprocess import Popen
from types import ModuleType
from typing import Any

import lcm
import numpy as np
import pytest

from quasilpv.artifact import read_artifact, write_artifact
from quasilpv.scenarios import SineTorque, read_scenario, write_scenario
from test_authentication import key_file
from two_processes import SAMPLES, Experiment, WirePlant, finish, wait_for_commands

pytest_plugins = ["two_processes"]

REAL_TIME = ("--mode", "realtime", "--priority", "50")
MODES = pytest.mark.parametrize("mode", [(), REAL_TIME], ids=["lockstep", "realtime"])
FAULT = 4


def beside(experiment: Experiment, command: list[str], folder: str) -> list[str]:
    """The same command with a record of its own."""
    record = command.index("--record") + 1
    (experiment.folder / folder).mkdir()
    return [*command[:record], str(experiment.folder / folder / Path(command[record]).name), *command[record + 1 :]]


def second_controller(experiment: Experiment, *options: str) -> Popen[str]:
    return experiment.start(beside(experiment, experiment.controller_command(*options), "second"))


def second_simulator(experiment: Experiment, *options: str) -> Popen[str]:
    return experiment.start(beside(experiment, experiment.simulator_command(*options), "second"))


def require_fault(process: Popen[str], reason: str) -> dict[str, Any]:
    """The process says in its last line why it stopped, with exit code 3."""
    code, report, errors = finish(process)
    assert (code, "Traceback" in errors) == (3, False), errors
    assert re.search(rf"fault stop: {reason}", errors.splitlines()[-1]), errors
    return report


def test_F22_when_two_controllers_wait_for_a_plant_expect_both_to_end_and_to_name_each_other(
    experiment: Experiment,
) -> None:
    first = experiment.start(experiment.controller_command())
    time.sleep(0.3)
    second = second_controller(experiment)
    require_fault(first, rf"second controller on this session \(process {second.pid}\)")
    require_fault(second, rf"second controller on this session \(process {first.pid}\)")


@MODES
def test_F22_when_a_second_controller_joins_a_run_expect_all_three_to_end_with_its_name(
    experiment: Experiment, mode: tuple[str, ...]
) -> None:
    experiment.set_duration(3600.0)
    first = experiment.start(experiment.controller_command(*mode))
    plant = experiment.start(experiment.simulator_command(*mode))
    wait_for_commands(experiment)
    second = second_controller(experiment, *mode)
    report = require_fault(plant, rf"second controller on this session \(process {second.pid}\)")
    assert report["link"]["second_sender"] > 0
    for controller in (first, second):
        require_fault(controller, "second controller on this session")


@MODES
def test_F22_when_a_second_plant_joins_a_run_expect_a_fault_and_the_second_one_sent_away(
    experiment: Experiment, mode: tuple[str, ...]
) -> None:
    experiment.set_duration(3600.0)
    controller = experiment.start(experiment.controller_command(*mode, "--exit-on-fault"))
    first = experiment.start(experiment.simulator_command(*mode))
    wait_for_commands(experiment)
    second = second_simulator(experiment, *mode)
    require_fault(second, rf"second plant on this session \(process {first.pid}\)")
    report = require_fault(controller, rf"second plant on this session \(process {second.pid}\)")
    assert (report["fault_cause"], report["end"]) == ("second plant on this session", "fault")
    if mode:
        first.terminate()  # under the watchdog's brake for an hour
        assert finish(first)[0] == 0
    else:
        require_fault(first, "controller ended")


@pytest.mark.parametrize("with_key", [False, True], ids=["without_key", "with_key"])
def test_F23_when_a_second_simulator_is_interrupted_expect_the_controller_to_stay_with_the_moving_arm(
    experiment: Experiment, with_key: bool
) -> None:
    experiment.set_duration(1.5)
    options = [*REAL_TIME, *(["--key", str(key_file(experiment.folder))] if with_key else [])]
    controller = experiment.start(experiment.controller_command(*options))
    first = experiment.start(experiment.simulator_command(*options))
    wait_for_commands(experiment)
    second = second_simulator(experiment, *options)
    time.sleep(0.3)
    second.send_signal(signal.SIGINT)
    finish(second)
    code, report, _ = finish(first)
    assert (report["end"], report["samples"]) == ("completed", 1500)
    assert report["missed_commands"] < 1000
    _, said, _ = finish(controller)
    assert said["end"] == "plant ended"
    assert said["last_seq"] >= 1400
    assert said["link"]["unfit_events"] >= 2
    assert code == 3 or said["state"] != "fault"


def strangers_events(experiment: Experiment, types: ModuleType) -> Iterator[bytes]:
    """Every event there is, of a sender that is not part of the run, to anyone, to nobody, and about any sample."""
    artifact = read_artifact(experiment.folder / "artifact.json")
    for source in (1, 2, 3):
        for code in (1, 2, 3, 4):
            for receiver, seq in ((0, 0), (0, 10**9), (77, 10)):
                event = types.event_v2()
                event.utime, event.seq, event.session = 10**9, seq, experiment.session
                event.artifact_hash = int.from_bytes(bytes.fromhex(artifact.hash)[:8], "big", signed=True)
                event.sender, event.receiver, event.period_ns = 99, receiver, round(1e9 * artifact.sample_period_s)
                event.source, event.code = source, code
                event.crc = zlib.crc32(event.encode()[:-8])
                yield event.encode()


def test_F23_when_a_stranger_sends_every_event_expect_the_run_bit_for_bit_and_each_counted(
    experiment: Experiment, message_types: ModuleType
) -> None:
    controller = experiment.start(experiment.controller_command())
    assert experiment.run(experiment.simulator_command())[0] == finish(controller)[0] == 0
    undisturbed = (experiment.folder / "plant.csv").read_bytes()

    events = list(strangers_events(experiment, message_types))
    wire = lcm.LCM(experiment.url)
    controller = experiment.start(experiment.controller_command())
    said: list[bytes] = []

    def disturb(_: str, __: bytes) -> None:
        if len(said) < len(events) and len(heard) >= 5:
            said.append(events[len(said)])
            wire.publish("QLPV_EVENT", said[-1])

    heard: list[bytes] = []
    wire.subscribe("QLPV_COMMAND", lambda _, data: heard.append(data))
    wire.subscribe("QLPV_COMMAND", disturb).set_queue_capacity(0)
    plant = experiment.start(experiment.simulator_command())
    while plant.poll() is None:
        wire.handle_timeout(10)
    assert len(said) == len(events)
    code, report, _ = finish(plant)
    controller_code, said_at_the_end, _ = finish(controller)
    assert (code, controller_code, report["samples"]) == (0, 0, SAMPLES)
    assert (experiment.folder / "plant.csv").read_bytes() == undisturbed
    for link in (report["link"], said_at_the_end["link"]):
        assert len(events) - 3 <= link["unfit_events"] <= len(events) + 1


@pytest.mark.parametrize("controller_mode", ["lockstep", "realtime"])
@pytest.mark.parametrize("controller_first", [True, False])
def test_F24_when_the_modes_differ_expect_both_to_end_at_once_with_one_line(
    experiment: Experiment, controller_mode: str, controller_first: bool
) -> None:
    plant_mode = "realtime" if controller_mode == "lockstep" else "lockstep"
    commands = [
        experiment.controller_command("--mode", controller_mode),
        experiment.simulator_command("--mode", plant_mode),
    ]
    started = time.monotonic()
    processes = []
    for command in commands if controller_first else commands[::-1]:
        processes.append(experiment.start(command))
        time.sleep(0.2)
    for process in processes:
        code, _, errors = finish(process)
        assert (code, len(errors.splitlines())) == (2, 1), errors
        assert re.search(r": mode: got (lockstep|realtime), expected (lockstep|realtime), the mode of the ", errors)
    assert time.monotonic() - started < 5.0


def test_F24_when_the_rates_differ_expect_both_to_end_at_once_with_one_line(experiment: Experiment) -> None:
    artifact = read_artifact(experiment.folder / "artifact.json")
    other = experiment.folder / "other"
    write_artifact(other, artifact.model_copy(update={"sample_period_s": artifact.sample_period_s / 2}))
    command = experiment.controller_command()
    command[command.index("--artifact") + 1] = str(other / "artifact.json")
    processes = [experiment.start(command), experiment.start(experiment.simulator_command())]
    for process in processes:
        code, _, errors = finish(process)
        assert (code, len(errors.splitlines())) == (2, 1), errors
        assert re.search(r"sample_period_s: got (\d+) ns, expected (?!\1)\d+ ns, the sample period of the ", errors)


class WireController:
    """A controller in Python: no torque at first, and from one sample on the one it is told."""

    def __init__(self, experiment: Experiment, types: ModuleType, first: int, torque: list[float]) -> None:
        self._types, self._first, self._torque = types, first, torque
        self._wire = lcm.LCM(experiment.url)
        self._wire.subscribe("QLPV_MEASUREMENT", self._answer)

    def _answer(self, _: str, data: bytes) -> None:
        heard, answer = self._types.measurement_v3.decode(data), self._types.command_v2()
        for member in ("utime", "seq", "session", "artifact_hash", "period_ns", "mode", "joints"):
            setattr(answer, member, getattr(heard, member))
        answer.sender, answer.receiver, answer.state = 99, heard.sender, 2
        answer.torque_nm = self._torque if heard.seq >= self._first else [0.0] * 7
        answer.crc = zlib.crc32(answer.encode()[:-8])
        self._wire.publish("QLPV_COMMAND", answer.encode())

    def listen(self) -> None:
        self._wire.handle_timeout(5)


@pytest.mark.parametrize("torque", [math.nan, -math.inf, 1e300])
def test_F25_when_a_command_is_no_torque_expect_it_refused_by_name_and_never_integrated(
    experiment: Experiment, message_types: ModuleType, torque: float
) -> None:
    controller = WireController(experiment, message_types, 100, [0.0, torque, *[0.0] * 5])
    plant = experiment.start(experiment.simulator_command("--timeout-s", "0.3"))
    while plant.poll() is None:
        controller.listen()
    report = require_fault(plant, re.escape(f"commands refused: torque_nm[1] of sample 100 is {torque:g}, beyond "))
    assert report["refused_commands"] > 0
    columns = experiment.columns("plant.csv")
    assert len(columns["seq"]) == report["samples"] == 100
    assert not np.any(columns["torque_nm"])


def test_F26_when_both_are_stopped_and_continued_expect_both_to_notice(experiment: Experiment) -> None:
    experiment.set_duration(1.2)
    controller = experiment.start(experiment.controller_command(*REAL_TIME))
    plant = experiment.start(experiment.simulator_command(*REAL_TIME))
    wait_for_commands(experiment)
    for request in (signal.SIGSTOP, signal.SIGCONT):
        for process in (plant, controller):
            process.send_signal(request)
        time.sleep(0.5)
    report = require_fault(plant, "controller in fault")
    assert report["stalls"] >= 1
    assert report["watchdog_samples"] >= 1
    said = require_fault(controller, "(plant silent|measurement lost)")
    assert said["state"] == "fault"


def test_a_plant_failure_reaches_the_exit_code_of_the_controller(experiment: Experiment) -> None:
    path = experiment.folder / "scenario.json"
    scenario = read_scenario(path)
    strong = SineTorque(joint=0, amplitude_nm=1e12, frequency_rad_s=50.0)
    write_scenario(path, scenario.model_copy(update={"external_torque": (strong,)}))
    controller = experiment.start(experiment.controller_command())
    assert experiment.run(experiment.simulator_command())[0] == 6
    code, report, errors = finish(controller)
    assert (code, report["robot_fault"]) == (6, "plant failed")
    assert re.fullmatch(r"qlpv-controller: the plant says that it failed after sample \d+\n", errors)


def test_when_another_run_is_on_the_address_expect_a_hint_that_names_its_session(experiment: Experiment) -> None:
    other = Experiment(experiment.folder, session=experiment.session + 1, port=experiment.port)
    controller = experiment.start(other.controller_command("--timeout-s", "1"))
    code, _, errors = experiment.run(experiment.simulator_command("--timeout-s", "1"))
    assert (code, len(errors.splitlines())) == (5, 1)
    code, _, said = finish(controller)
    assert (code, len(said.splitlines())) == (5, 1)
    assert f"messages of session {experiment.session} were heard on {experiment.url}: another run is there" in said


def test_F23_when_a_reset_is_about_an_earlier_fault_expect_the_later_one_to_stay(
    experiment: Experiment, message_types: ModuleType
) -> None:
    rest = read_scenario(experiment.folder / "scenario.json").initial.angle_rad
    nothing = (math.nan,) * 3
    controller = experiment.start(experiment.controller_command())
    plant = WirePlant(experiment, message_types)
    wire, resets = lcm.LCM(experiment.url), []
    wire.subscribe("QLPV_EVENT", lambda _, data: resets.append(data))
    for seq in range(60):
        command = plant.exchange(seq, rest if seq < 10 or seq >= 40 else nothing)
    assert command.state == FAULT
    reset = experiment.start(experiment.reset_command("--timeout-s", "2"))
    seq = 60
    while reset.poll() is None:
        command = plant.exchange(seq, rest)
        seq += 1
    assert finish(reset)[0] == 0
    while wire.handle_timeout(50):
        pass
    recorded = [data for data in resets if message_types.event_v2.decode(data).source == 3]
    assert recorded
    for later in range(seq, seq + 30):
        command = plant.exchange(later, nothing)
    assert command.state == FAULT
    for data in recorded:
        wire.publish("QLPV_EVENT", data)
    for later in range(seq + 30, seq + 60):
        command = plant.exchange(later, rest)
    assert command.state == FAULT
    controller.terminate()
    _, report, _ = finish(controller)
    assert report["resets"] == 1
    assert report["link"]["unfit_events"] >= len(recorded)
