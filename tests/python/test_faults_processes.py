"""Faults F7 and F11 to F17 with the real processes: missing privileges and routes, stops, kills, restarts, failures."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
import subprocess
import time
from types import ModuleType

import lcm
import numpy as np
import pytest

from quasilpv.artifact import write_artifact
from quasilpv.release import release
from quasilpv.scenarios import SineTorque, build_scenario, write_scenario
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import rest
from quasilpv.trajectories.document import write_trajectory
from two_processes import SAMPLES, Experiment, finish, wait_for_commands, without_privileges

pytest_plugins = ["two_processes"]

REPEATS = [*range(3), *(pytest.param(run, marks=pytest.mark.full) for run in range(3, 20))]
HOLD_S = 0.02
"""The plant's watchdog lets a torque act for so long without a command; the controller waits as long in silence."""
SAFE_S = 0.05
"""From the fault to the safe torque."""
SCHEDULER_SLACK_S = 0.2
"""What a busy machine may add to a time of the monotonic clock."""
STALLS = 10
"""So often a busy machine may stop both processes for longer than the watchdogs allow."""
REAL_TIME = ("--mode", "realtime", "--priority", "50")
"""With the privileges of real time where they are granted: fewer stalls."""


def require_held_then_braked(plant: dict[str, np.ndarray], last: int) -> None:
    """From the command of sample `last` on: that torque for 20 ms of plant time, then the opposite of motion."""
    start_ns, delay_ns = (np.rint(plant[name] * 1e9).astype(int) for name in ("time_s", "command_delay_s"))
    held_until_ns = start_ns[last] + delay_ns[last] + round(HOLD_S * 1e9)
    for k in range(last + 1, len(plant["seq"])):
        if delay_ns[k] >= 0:
            return
        if start_ns[k] + start_ns[1] <= held_until_ns:
            np.testing.assert_array_equal(plant["torque_nm"][k], plant["torque_nm"][last])
        elif start_ns[k] >= held_until_ns:
            assert np.all(plant["torque_nm"][k] * plant["speed_rad_s"][k] <= 0.0)


def test_F7_when_the_controller_sleeps_expect_its_torque_held_and_then_the_brake(experiment: Experiment) -> None:
    experiment.set_duration(1.0)
    controller = experiment.start(experiment.controller_command(*REAL_TIME))
    plant = experiment.start(experiment.simulator_command(*REAL_TIME))
    wait_for_commands(experiment)
    controller.send_signal(signal.SIGSTOP)
    time.sleep(0.2)
    controller.send_signal(signal.SIGCONT)
    _, report, _ = finish(plant)
    columns = experiment.columns("plant.csv")
    commanded = np.flatnonzero(columns["command_delay_s"] >= 0.0)
    gap = int(np.argmax(np.diff(commanded)))
    assert np.diff(commanded)[gap] > HOLD_S / 1e-3
    assert report["watchdog_samples"] > 0
    require_held_then_braked(columns, int(commanded[gap]))
    assert finish(controller)[1]["fault_cause"] in ("measurement lost", "plant silent")


@pytest.mark.parametrize("run", REPEATS)
def test_F16_when_the_controller_is_killed_expect_the_plant_braked_by_its_watchdog(
    experiment: Experiment, run: int
) -> None:
    experiment.set_duration(0.6)
    controller = experiment.start(experiment.controller_command(*REAL_TIME))
    plant = experiment.start(experiment.simulator_command(*REAL_TIME))
    wait_for_commands(experiment, 20 + run)
    controller.kill()
    code, report, errors = finish(plant)
    assert code == 3
    assert "watchdog" in errors
    assert report["watchdog_samples"] > 0
    columns = experiment.columns("plant.csv")
    last = int(np.flatnonzero(columns["command_delay_s"] >= 0.0)[-1])
    require_held_then_braked(columns, last)
    assert len(columns["seq"]) - 1 - last > HOLD_S / 1e-3


@pytest.mark.parametrize("run", REPEATS)
def test_F16_when_the_simulator_is_killed_expect_the_safe_torque_within_the_watchdog_time(
    experiment: Experiment, message_types: ModuleType, run: int
) -> None:
    experiment.set_duration(3600.0)
    commands = []
    wire = lcm.LCM(experiment.url)
    hearing = wire.subscribe("QLPV_COMMAND", lambda _, data: commands.append(message_types.command_v2.decode(data)))
    hearing.set_queue_capacity(0)
    for _ in range(STALLS):
        while wire.handle_timeout(20):
            pass
        commands.clear()
        experiment.session += 1
        controller = experiment.start(experiment.controller_command(*REAL_TIME, "--exit-on-fault"))
        plant = experiment.start(experiment.simulator_command(*REAL_TIME))
        while controller.poll() is None and len(commands) < 50 + 7 * run:
            wire.handle_timeout(100)
        plant.kill()
        if len(commands) >= 50 + 7 * run and commands[-1].state != 4:
            break
    while controller.poll() is None:
        wire.handle_timeout(20)
    code, report, errors = finish(controller)
    assert code == 3
    assert (report["end"], report["state"], report["fault_cause"]) == ("fault", "fault", "plant silent")
    assert errors.splitlines()[-1].startswith("qlpv-controller: fault stop: plant silent")
    while wire.handle_timeout(50):
        pass
    faulty = [command.state == 4 for command in commands]
    first = faulty.index(True)
    assert all(faulty[first:])
    silence_s = (commands[first].utime - commands[first - 1].utime) * 1e-6
    assert HOLD_S - 1e-3 <= silence_s <= HOLD_S + SCHEDULER_SLACK_S
    safe = next(command for command in commands[first:] if not any(command.torque_nm))
    assert (safe.utime - commands[first].utime) * 1e-6 <= SAFE_S + SCHEDULER_SLACK_S
    assert safe.seq - commands[first].seq <= SAFE_S / 1e-3
    assert len(report["post_mortem"]["seq"]) == 50
    assert report["post_mortem"]["seq"][-1] == commands[first].seq
    assert np.all(experiment.columns("controller.csv")["torque_applied_nm"][-1] == 0.0)


@pytest.mark.parametrize("run", REPEATS)
def test_F11_when_the_controller_is_killed_and_started_again_expect_a_gentle_restart_or_a_refusal_by_name(
    experiment: Experiment, run: int
) -> None:
    runtime = pytest.importorskip("quasilpv._runtime")
    experiment.set_duration(3600.0)
    first = experiment.start(experiment.controller_command(*REAL_TIME))
    plant = experiment.start(experiment.simulator_command(*REAL_TIME))
    wait_for_commands(experiment, 200 + 20 * run)
    first.kill()
    first.communicate()
    second = experiment.start(experiment.controller_command(*REAL_TIME, "--silence-s", "5"))
    if second.poll() is None:
        with contextlib.suppress(AssertionError):  # a controller that does not start commands nothing
            wait_for_commands(experiment, 150, limit_s=5.0)
    plant.terminate()
    finish(plant)
    code, report, errors = finish(second)
    if report["end"] == "start refused":  # nobody controlled the arm for longer than its domain allows
        assert code == 3
        assert "start refused: angle_rad[" in errors
        assert report["commands"] == 0
        return
    columns = experiment.columns("controller.csv")
    assert columns["seq"][0] > 200
    artifact = runtime.Artifact.load(str(experiment.folder / "artifact.json"))
    trajectory = runtime.Trajectory.load(str(experiment.folder / "trajectory.json"))
    angle = columns["measured_angle_rad"][0]
    _, _, acceleration = trajectory.evaluate(columns["seq"][0] * 1e-3)
    own = artifact.inertia(artifact.premises(angle)) @ acceleration + artifact.gravity(angle)
    limit = np.array([1500.0, 1200.0, 700.0])
    np.testing.assert_array_less(np.abs(columns["torque_applied_nm"][0] - own), 0.05 * limit)
    assert np.any(np.diff(columns["torque_applied_nm"], axis=0) != 0.0)


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_F13_when_real_time_is_required_but_not_permitted_expect_exit_4_and_one_line(
    experiment: Experiment, side: str
) -> None:
    command = getattr(experiment, f"{side}_command")("--priority", "50", "--require-rt")
    code, _, errors = experiment.run(without_privileges(command))
    assert code == 4
    assert len(errors.splitlines()) == 1


def test_F13_when_real_time_is_not_permitted_expect_one_warning_and_telemetry_that_says_so(
    experiment: Experiment, message_types: ModuleType
) -> None:
    flags = []
    wire = lcm.LCM(experiment.url)
    wire.subscribe("QLPV_TELEMETRY", lambda _, data: flags.append(message_types.telemetry_v2.decode(data).realtime))
    controller = experiment.start(without_privileges(experiment.controller_command("--priority", "50")))
    assert experiment.run(experiment.simulator_command())[0] == 0
    code, report, errors = finish(controller)
    assert (code, report["rt"]) == (0, False)
    assert len(errors.splitlines()) == 1
    assert "warning" in errors
    while wire.handle_timeout(50):
        pass
    assert flags
    assert not any(flags)


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_F14_when_there_is_no_multicast_route_expect_exit_5_and_the_command_that_helps(
    experiment: Experiment, side: str
) -> None:
    isolated = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--user", "--net"]
    if subprocess.run([*isolated, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("network namespaces are not permitted here")
    code, _, errors = experiment.run([*isolated, *getattr(experiment, f"{side}_command")()])
    assert code == 5
    assert len(errors.splitlines()) == 1
    assert "ip route add" in errors


def test_F15_when_the_disk_is_full_and_the_listener_stuck_expect_the_same_run_and_the_lost_rows_counted(
    experiment: Experiment,
) -> None:
    controller = experiment.start(experiment.controller_command())
    assert experiment.run(experiment.simulator_command())[0] == 0
    assert finish(controller)[0] == 0
    undisturbed = (experiment.folder / "plant.csv").read_bytes()

    stuck = lcm.LCM(experiment.url)  # subscribes, and never takes anything out of its socket
    stuck.subscribe("QLPV_TELEMETRY", lambda *_: None)
    full = ["bash", "-c", 'ulimit -f 16; exec "$@"', "-"]  # no file holds more than 16 KiB
    controller = experiment.start([*full, *experiment.controller_command()])
    assert experiment.run(experiment.simulator_command())[0] == 0
    code, report, _ = finish(controller)
    assert code == 0
    assert (experiment.folder / "plant.csv").read_bytes() == undisturbed
    assert report["telemetry"]["record_drops"] > 0
    assert report["telemetry"]["published"] == SAMPLES


@pytest.mark.parametrize("request_stop", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_F16_when_the_controller_is_asked_to_stop_expect_safe_torque_record_and_exit_0(
    experiment: Experiment, request_stop: signal.Signals
) -> None:
    experiment.set_duration(3600.0)
    controller = experiment.start(experiment.controller_command())
    plant = experiment.start(experiment.simulator_command())
    wait_for_commands(experiment)
    controller.send_signal(request_stop)
    code, report, _ = finish(controller)
    assert code == 0
    assert (report["end"], report["fault_cause"], report["post_mortem"]) == ("stopped", "stop requested", None)
    torque = experiment.columns("controller.csv")["torque_applied_nm"]
    assert np.all(torque[-1] == 0.0)
    assert np.any(torque[0] != 0.0)
    plant_code, plant_report, errors = finish(plant)
    assert (plant_code, plant_report["end"]) == (3, "controller ended")
    assert len(errors.splitlines()) == 1


def test_F16_when_the_simulator_is_asked_to_stop_expect_both_to_end_with_0_and_their_records(
    experiment: Experiment,
) -> None:
    experiment.set_duration(3600.0)
    controller = experiment.start(experiment.controller_command())
    plant = experiment.start(experiment.simulator_command())
    wait_for_commands(experiment)
    plant.send_signal(signal.SIGTERM)
    plant_code, report, _ = finish(plant)
    assert (plant_code, report["end"]) == (0, "stopped")
    assert finish(controller)[0] == 0
    assert len(experiment.columns("plant.csv")["seq"]) == report["samples"] > 0


def test_F17_when_the_plant_cannot_be_integrated_expect_exit_6_with_flag_time_and_no_repeated_state(
    experiment: Experiment,
) -> None:
    path = experiment.folder / "scenario.json"
    document = json.loads(path.read_text())
    document["external_torque"] = [{"joint": 0, "amplitude_nm": 1e12, "frequency_rad_s": 50.0, "phase_rad": 0.0}]
    path.write_text(json.dumps(document))
    experiment.start(experiment.controller_command())
    code, _, errors = experiment.run(experiment.simulator_command())
    assert code == 6
    assert len(errors.splitlines()) == 1
    assert "IDA_" in errors
    assert " t = " in errors
    seq = np.atleast_1d(experiment.columns("plant.csv")["seq"])
    np.testing.assert_array_equal(seq, np.arange(len(seq)))


def test_F17_when_a_five_bar_is_pushed_through_its_singularity_expect_exit_6_and_when(
    experiment: Experiment,
) -> None:
    five_bar = robot("fivebar")
    trajectory = rest("rest", 2, 2.0)
    scenario = build_scenario(
        five_bar,
        trajectory,
        external_torque=(
            SineTorque(joint=0, amplitude_nm=200.0, frequency_rad_s=1.0, phase_rad=math.pi / 2),
            SineTorque(joint=1, amplitude_nm=200.0, frequency_rad_s=1.0, phase_rad=-math.pi / 2),
        ),
        initial_angle_rad=(-0.8, 0.8),
    )
    write_artifact(experiment.folder, release(DesignRequest.of("fivebar", "ctc-dob", Specification())).artifact)
    write_trajectory(experiment.folder / "trajectory.json", trajectory)
    write_scenario(experiment.folder / "scenario.json", scenario)
    experiment.start(experiment.controller_command())
    code, _, errors = experiment.run(experiment.simulator_command())
    assert code == 6
    assert re.search(r"(IDA_\w+|singular configuration) at t = ", errors)
