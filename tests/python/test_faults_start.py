"""Faults F11 and F19 to F21 at the real controller: where it starts, and which measurements it believes."""

from __future__ import annotations

import time
from types import ModuleType

import numpy as np
import pytest

from quasilpv.artifact import read_artifact
from quasilpv.scenarios import read_scenario, write_scenario
from two_processes import Experiment, WirePlant, finish

pytest_plugins = ["two_processes"]

RUNNING, DEGRADED, FAULT = 2, 3, 4
IMPLAUSIBLE = 1 << 7
TURN = 2.0 * np.pi


@pytest.fixture
def rest(experiment: Experiment) -> np.ndarray:
    """Angles at which the reference begins."""
    return np.array(read_scenario(experiment.folder / "scenario.json").initial.angle_rad)


@pytest.mark.parametrize(("joint", "turns"), [(0, 1), (1, -1), (2, 3)])
def test_F19_when_an_encoder_is_turns_off_at_the_start_expect_exit_3_one_line_and_no_command(
    experiment: Experiment, message_types: ModuleType, rest: np.ndarray, joint: int, turns: int
) -> None:
    low, high = read_artifact(experiment.folder / "artifact.json").domain.angle_rad[joint]
    off = rest.copy()
    off[joint] += turns * TURN
    controller = experiment.start(experiment.controller_command())
    plant = WirePlant(experiment, message_types)
    while controller.poll() is None:
        plant.send(0, off)
        plant.listen(20)
    code, report, errors = finish(controller)
    assert code == 3
    assert (report["end"], report["fault_cause"], report["commands"]) == ("start refused", "start refused", 0)
    (line,) = errors.splitlines()
    for part in (f"angle_rad[{joint}]", f"{off[joint]:.3f}"[:-1], f"{low:g}", f"{high:g}"):
        assert part in line


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_F19_when_the_controller_refuses_to_start_expect_the_plant_to_end_at_once_with_one_line(
    experiment: Experiment, rest: np.ndarray, mode: str
) -> None:
    path = experiment.folder / "scenario.json"
    scenario = read_scenario(path)
    turned = scenario.initial.model_copy(update={"angle_rad": tuple(rest + np.array([0.0, TURN, 0.0]))})
    write_scenario(path, scenario.model_copy(update={"initial": turned}))
    timeout_s = 40.0
    begun_s = time.monotonic()
    options = ("--mode", mode, "--timeout-s", f"{timeout_s:g}")
    controller = experiment.start(experiment.controller_command(*options))
    plant = experiment.start(experiment.simulator_command(*options))
    code, report, errors = finish(plant)
    assert time.monotonic() - begun_s < timeout_s / 2
    assert (code, report["end"], report["samples"]) == (3, "start refused by the controller", 0)
    assert [line for line in errors.splitlines() if "warning" not in line] == [errors.splitlines()[-1]]
    assert "start refused by the controller" in errors
    assert finish(controller)[0] == 3


def test_F20_when_one_measurement_is_a_turn_off_expect_it_predicted_and_when_they_last_a_fault_at_the_20th(
    experiment: Experiment, message_types: ModuleType, rest: np.ndarray
) -> None:
    off = rest + np.array([0.0, 0.0, TURN])
    controller = experiment.start(experiment.controller_command("--exit-on-fault"))
    plant = WirePlant(experiment, message_types)
    commands = [plant.exchange(seq, off if seq == 30 or seq >= 50 else rest) for seq in range(70)]
    assert [command.flags & IMPLAUSIBLE != 0 for command in commands] == [s == 30 or s >= 50 for s in range(70)]
    assert {command.state for command in commands[:30] + commands[31:50]} == {RUNNING}
    assert {command.state for command in commands[50:69]} == {commands[30].state} == {DEGRADED}
    assert commands[69].state == FAULT
    for seq in range(70, 120):
        if controller.poll() is not None or not any(plant.exchange(seq, off).torque_nm):
            break
    code, report, errors = finish(controller)
    assert code == 3
    assert (report["fault_cause"], report["predicted_steps"] >= 21) == ("measurement implausible", True)
    assert "measurement implausible" in errors


def test_F21_when_the_arm_is_faster_than_twice_the_domains_speed_expect_a_fault(
    experiment: Experiment, message_types: ModuleType, rest: np.ndarray
) -> None:
    fastest = max(np.abs(read_artifact(experiment.folder / "artifact.json").domain.speed_rad_s[0]))
    controller = experiment.start(experiment.controller_command())
    plant = WirePlant(experiment, message_types)
    for seq in range(130):
        speed = 2.5 * fastest if seq else 0.0
        command = plant.exchange(seq, rest + np.array([speed * seq * 1e-3, 0.0, 0.0]), [speed, 0.0, 0.0])
        if command.state == FAULT:
            break
    controller.terminate()
    code, report, _ = finish(controller)
    assert code == 3
    assert report["fault_cause"] in ("speed beyond the domain", "measurement implausible")
    assert report["faults"] == 1
