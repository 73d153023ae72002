"""Faults F2 and F5 at the real controller, played by a plant written in Python; and the way out of a fault."""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np
import pytest

from quasilpv.scenarios import read_scenario
from two_processes import Experiment, WirePlant, finish

pytest_plugins = ["two_processes"]

NOTHING = (math.nan, math.nan, math.nan)
RUNNING, FAULT = 2, 4


@pytest.fixture
def rest(experiment: Experiment) -> tuple[float, ...]:
    """Angles at which the reference begins."""
    return read_scenario(experiment.folder / "scenario.json").initial.angle_rad


def test_F2_when_20_measurements_are_not_numbers_expect_safe_torque_within_50_samples_and_exit_3(
    experiment: Experiment, message_types: ModuleType, rest: tuple[float, ...]
) -> None:
    controller = experiment.start(experiment.controller_command("--exit-on-fault"))
    plant = WirePlant(experiment, message_types)
    states = [plant.exchange(seq, rest if seq < 60 else NOTHING).state for seq in range(80)]
    assert states[:60] == [RUNNING] * 60
    assert FAULT not in states[:79]
    assert states[79] == FAULT
    for seq in range(80, 80 + 50):
        command = plant.exchange(seq, rest)
        assert command.state == FAULT
        if not any(command.torque_nm):
            break
    assert not any(command.torque_nm)
    code, report, errors = finish(controller)
    assert code == 3
    assert (report["fault_cause"], report["faults"]) == ("measurement lost", 1)
    assert len(errors.splitlines()) == 1
    post_mortem = report["post_mortem"]
    assert post_mortem["cause"] == "measurement lost"
    assert post_mortem["seq"] == list(range(30, 80))
    assert post_mortem["state"][-1] == FAULT
    np.testing.assert_array_equal(post_mortem["measured_angle_rad"][0], rest)
    assert post_mortem["measured_angle_rad"][-1] == [None] * 3


@pytest.mark.parametrize("right_session", [True, False])
def test_a_latched_fault_is_left_by_a_reset_of_the_right_session_only(
    experiment: Experiment, message_types: ModuleType, rest: tuple[float, ...], right_session: bool
) -> None:
    controller = experiment.start(experiment.controller_command())
    plant = WirePlant(experiment, message_types)
    for seq in range(100):
        command = plant.exchange(seq, rest if seq < 60 or seq >= 80 else NOTHING)
    assert command.state == FAULT
    asked = Experiment(experiment.folder, session=experiment.session + (not right_session), port=experiment.port)
    reset = experiment.start(asked.reset_command("--timeout-s", "0.5"))
    seq = 100
    while reset.poll() is None:
        command = plant.exchange(seq, rest)
        seq += 1
    assert finish(reset)[0] == (0 if right_session else 5)
    assert command.state == (RUNNING if right_session else FAULT)
    assert any(command.torque_nm) == right_session
    controller.terminate()
    code, report, _ = finish(controller)
    assert report["resets"] == (1 if right_session else 0)
    assert report["link"]["wrong_session"] == 0 if right_session else report["link"]["wrong_session"] > 0
    assert code == (0 if right_session else 3)


def test_F5_when_100_foreign_messages_come_in_a_row_expect_a_latched_fault_at_the_next_good_one(
    experiment: Experiment, message_types: ModuleType, rest: tuple[float, ...]
) -> None:
    controller = experiment.start(experiment.controller_command("--exit-on-fault"))
    plant = WirePlant(experiment, message_types)
    assert plant.exchange(0, rest).state == RUNNING
    for seq in range(100):
        plant.send(seq, rest, session_offset=1)
        plant.listen()
    assert plant.exchange(1, rest).state == FAULT
    for seq in range(2, 60):
        if controller.poll() is not None or not any(plant.exchange(seq, rest).torque_nm):
            break
    code, report, _ = finish(controller)
    assert code == 3
    assert report["fault_cause"] == "foreign messages"
    assert report["link"]["wrong_session"] == 100


def test_F5_when_the_sessions_differ_expect_foreign_messages_counted_and_none_answered(experiment: Experiment) -> None:
    other = Experiment(experiment.folder, session=experiment.session + 1, port=experiment.port)
    controller = experiment.start(other.controller_command("--timeout-s", "1"))
    assert experiment.run(experiment.simulator_command("--timeout-s", "1"))[0] == 5
    code, report, _ = finish(controller)
    assert code == 5
    assert report["steps"] == 0
    assert report["link"]["wrong_session"] > 0
