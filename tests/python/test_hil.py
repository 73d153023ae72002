"""Controller and plant as two real processes over LCM: identity with the in-process run, doctor, exit codes."""

from __future__ import annotations

import subprocess
from types import ModuleType

import numpy as np
import pytest

from quasilpv.scenarios import read_scenario
from two_processes import LIMIT_S, SAMPLES, Experiment, WirePlant, executable, finish, without_privileges

pytest_plugins = ["two_processes"]


def test_when_run_in_lock_step_expect_the_samples_of_the_in_process_run_bit_for_bit(experiment: Experiment) -> None:
    runtime = pytest.importorskip("quasilpv._runtime")
    controller = experiment.start(experiment.controller_command())
    plant_code, plant, _ = experiment.run(experiment.simulator_command())
    controller_code, report, _ = finish(controller)
    assert (plant_code, controller_code) == (0, 0)
    assert plant["samples"] == report["steps"] == report["telemetry"]["published"] == SAMPLES
    assert report["telemetry"]["drops"] == 0

    in_process = runtime.run_closed_loop(
        runtime.Artifact.load(str(experiment.folder / "artifact.json")),
        runtime.Trajectory.load(str(experiment.folder / "trajectory.json")),
        runtime.Scenario.load(str(experiment.folder / "scenario.json")),
    )
    over_lcm = experiment.columns("plant.csv") | experiment.columns("controller.csv")
    assert len(over_lcm["seq"]) == SAMPLES
    for name, expected in in_process.items():
        np.testing.assert_array_equal(over_lcm[name], expected, err_msg=name)
    np.testing.assert_array_equal(over_lcm["torque_nm"], in_process["torque_applied_nm"])


def test_when_run_in_real_time_expect_every_sample_and_measured_latencies(experiment: Experiment) -> None:
    # A busy machine may stop either process for longer than the 20 ms after which silence is a fault.
    controller = experiment.start(experiment.controller_command("--mode", "realtime", "--silence-s", "5"))
    _, plant, _ = experiment.run(experiment.simulator_command("--mode", "realtime", "--hold-s", "5"))
    _, report, _ = finish(controller)
    assert plant["end"] == "completed"
    assert plant["samples"] == SAMPLES
    assert plant["wakeup_ns"]["count"] == SAMPLES - 1
    assert 0 < plant["round_trip_ns"]["p50"] <= plant["round_trip_ns"]["p99"] <= plant["round_trip_ns"]["max"]
    assert 0 < report["step_ns"]["p50"] <= report["step_ns"]["max"]
    delays = experiment.columns("plant.csv")["command_delay_s"][1:]
    assert np.all((delays == -1.0) | ((delays > 0.0) & (delays <= 1e-3)))
    assert np.count_nonzero(delays == -1.0) <= plant["missed_commands"]


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_when_the_other_side_is_missing_expect_exit_5_and_one_line(experiment: Experiment, side: str) -> None:
    command = getattr(experiment, f"{side}_command")("--timeout-s", "0.2")
    code, _, errors = experiment.run(command)
    assert code == 5
    assert len(errors.splitlines()) == 1
    assert str(experiment.session) in errors


@pytest.mark.parametrize("side", ["controller", "simulator"])
@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--artifact", "missing.json"), "missing.json"),
        (("--url", "tcpq://127.0.0.1:7700"), "url"),
        (("--url", "udpm://239.255.76.67:7667?ttl=1"), "--allow-network"),
        (("--mode", "soon"), "soon"),
        (("--unknown",), "--unknown"),
        (("--record", "missing/folder/file.csv"), "missing/folder"),
        (("--require-rt",), "--priority"),
    ],
)
def test_when_the_command_line_is_wrong_expect_exit_2_and_one_line(
    experiment: Experiment, side: str, options: tuple[str, ...], word: str
) -> None:
    command = getattr(experiment, f"{side}_command")()
    if options[0] in command:
        place = command.index(options[0])
        del command[place : place + 2]
    code, report, errors = experiment.run([*command, *options])
    assert (code, report) == (2, {})
    assert len(errors.splitlines()) == 1
    assert word in errors


@pytest.mark.parametrize("program", ["qlpv-controller", "qlpv-simulator"])
def test_every_help_shows_an_example(program: str) -> None:
    result = subprocess.run(
        [executable(program), "--help"], capture_output=True, text=True, check=True, timeout=LIMIT_S
    )
    assert "Example:" in result.stdout


def test_when_a_plant_written_in_python_follows_the_documented_format_expect_it_answered(
    experiment: Experiment, message_types: ModuleType
) -> None:
    controller = experiment.start(experiment.controller_command("--timeout-s", "20"))
    start = read_scenario(experiment.folder / "scenario.json").initial.angle_rad
    command = WirePlant(experiment, message_types).exchange(0, start)
    assert (command.seq, command.session, command.joints) == (0, experiment.session, 3)
    controller.terminate()
    assert finish(controller)[0] == 0


def test_the_doctor_measures_and_advises_in_words_and_for_machines(experiment: Experiment) -> None:
    doctor = [executable("qlpv-controller"), "--doctor", "--seconds", "0.1", "--url", experiment.url]
    code, report, _ = experiment.run([*doctor, "--artifact", str(experiment.folder / "artifact.json"), "--json"])
    assert code in (0, 1)  # 1: on a busy machine it says no
    assert report["period_ns"] == 1_000_000
    for latency in ("wakeup_ns", "step_ns", "round_trip_ns"):
        assert report[latency]["count"] > 0
        assert 0 < report[latency]["p50"] <= report[latency]["max"]
    words = subprocess.run(doctor, capture_output=True, text=True, check=False, timeout=LIMIT_S).stdout
    assert "At 1000 Hz this machine " in words


def test_the_doctor_says_what_an_unprivileged_user_lacks(experiment: Experiment) -> None:
    doctor = [executable("qlpv-controller"), "--doctor", "--seconds", "0.05", "--url", experiment.url, "--json"]
    code, report, _ = experiment.run(without_privileges(doctor))
    assert code in (0, 1)  # 1 on a machine that would not hold the rate
    assert (report["fifo"], report["wakeup_fifo_ns"]) == (False, None)
    assert any("CAP_SYS_NICE" in sentence for sentence in report["advice"])
