"""General systems with controller and plant as two processes over LCM: identity, faults, sensors, what is refused."""

from __future__ import annotations

import csv
import json
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import lcm
import numpy as np
import pytest

from quasilpv import _runtime
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.cli.app import run
from quasilpv.documents.canonical import canonical_json
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import ClaimError, InputError
from quasilpv.experiments.processes import Talk
from quasilpv.experiments.system_hil import require_identical, run_system_over_lcm
from quasilpv.experiments.system_run import SystemExperiment, scenario_of, simulate, simulate_scenario
from quasilpv.scenarios import write_system_scenario
from quasilpv.scenarios.system_schema import (
    ConstantDisturbance,
    NoiseDisturbance,
    SineDisturbance,
    SystemScenario,
)
from quasilpv.telemetry.message_types import channel_type
from quasilpv.telemetry.system_recording import COMMAND, MEASUREMENT, system_messages
from reference.released_systems import changed, released
from two_processes import LIMIT_S, executable

PUSHED = (
    ConstantDisturbance(signal="u", value=3.0, begin_s=0.1003, end_s=0.2),
    SineDisturbance(signal="w", amplitude=0.2, frequency_rad_s=12.0),
    NoiseDisturbance(signal="v", deviation=0.5),
)
NOISY = {"noise": {"v": 0.1, "i": 0.2}, "quantisation": {"v": 0.01}}


@pytest.fixture(autouse=True)
def _programs() -> None:
    executable("qlpv-controller")
    executable("qlpv-simulator")


@pytest.fixture
def artifact_path(tmp_path: Path) -> Path:
    return write_system_artifact(tmp_path / "made", released("dc-bus"))[0]


@pytest.mark.parametrize(
    ("name", "experiment"),
    [
        ("dc-bus", SystemExperiment({"v": 8.0}, {"P": 500.0}, delay_s=0.0002, **NOISY)),
        ("cart-pole", SystemExperiment({"th": 0.1}, {}, 0.5, rk4_steps=4, disturbances=PUSHED)),
    ],
)
def test_in_lock_step_two_processes_give_the_samples_of_one_bit_for_bit(
    name: str, experiment: SystemExperiment, tmp_path: Path
) -> None:
    artifact = released(name)
    scenario = scenario_of(artifact, experiment, "test")
    over_lcm = run_system_over_lcm(artifact, scenario, tmp_path, Talk("lockstep"))
    alone = simulate_scenario(artifact, scenario, "test")
    require_identical(over_lcm.run, alone)
    assert over_lcm.stop is None
    assert over_lcm.simulator["samples"] == over_lcm.controller["steps"] == scenario.samples
    assert over_lcm.controller["telemetry"]["published"] == scenario.samples
    other = simulate(artifact, SystemExperiment({"v": 8.0} if name == "dc-bus" else {"th": 0.1001}, {}, 0.01), "test")
    with pytest.raises(ClaimError, match="identical"):
        require_identical(over_lcm.run, other)


def test_a_state_that_leaves_its_domain_ends_both_runs_at_the_same_sample(tmp_path: Path) -> None:
    artifact = released("cart-pole")
    weak = changed(
        artifact,
        signals=[
            {**signal, "low": -0.5, "high": 0.5} if signal["role"] == "input" else signal
            for signal in artifact.content()["signals"]
        ],
    )
    scenario = scenario_of(weak, SystemExperiment({"th": 0.5}, {}, 5.0), "test")
    over_lcm = run_system_over_lcm(weak, scenario, tmp_path, Talk("lockstep"))
    alone = simulate_scenario(weak, scenario, "test")
    require_identical(over_lcm.run, alone)
    assert alone.exit is not None
    assert over_lcm.run.exit == alone.exit
    assert over_lcm.stop is None
    assert not over_lcm.run.stayed
    name = alone.exit[1]
    signal = next(signal for signal in weak.states if signal.name == name)
    last = alone.state[-1, [s.name for s in weak.states].index(name)] - signal.trim
    assert not (signal.low or -np.inf) <= last <= (signal.high or np.inf)


def test_noise_has_the_stated_deviation_and_equal_seeds_give_equal_runs() -> None:
    artifact = released("dc-bus")
    runs = [simulate(artifact, SystemExperiment({"v": 8.0}, {}, 0.5, seed=seed, **NOISY), "test") for seed in (1, 1, 2)]
    assert runs[0].first_difference(runs[1]) is None
    assert runs[0].first_difference(runs[2]) is not None
    names = [signal.name for signal in artifact.states]
    error = runs[0].measured - runs[0].state
    v, i = error[:, names.index("v")], error[:, names.index("i")]
    assert v.std() == pytest.approx(np.hypot(0.1, 0.01 / np.sqrt(12.0)), rel=0.1)  # 1000 samples: 4.5 deviations
    assert i.std() == pytest.approx(0.2, rel=0.1)
    steps = runs[0].measured[:, names.index("v")] / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    exact = simulate(artifact, SystemExperiment({"v": 8.0}, {}, 0.5), "test")
    np.testing.assert_array_equal(exact.measured, exact.state)
    np.testing.assert_allclose(exact.level, exact.measured_level, rtol=1e-9, atol=1e-15)


# ---- the programs ---------------------------------------------------------------------------------------------------


def start(folder: Path, program: str, *options: str, port: int) -> subprocess.Popen[str]:
    command = [executable(program), "--artifact", str(folder / "artifact.json"), "--session", "7", "--json"]
    command += ["--url", f"udpm://239.255.76.67:{port}?ttl=0", *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.fixture
def port() -> int:
    return 49152 + int(np.random.default_rng().integers(16384))


def test_a_controller_whose_plant_is_missing_and_one_of_a_robot_say_so_in_a_line(
    artifact_path: Path, port: int
) -> None:
    for options, code, word in (
        (("--timeout-s", "0.2"), 5, "no measurement of session 7"),
        (("--trajectory", "x.json"), 2, "trajectory"),
        (("--safe-action", "gravity"), 2, "safe-action"),
    ):
        process = start(artifact_path.parent, "qlpv-controller", *options, port=port)
        _, said = process.communicate(timeout=LIMIT_S)
        assert (process.returncode, said.count("\n")) == (code, 1)
        assert word in said


def test_a_scenario_of_another_system_is_refused_by_name(artifact_path: Path, port: int, tmp_path: Path) -> None:
    scenario = scenario_of(released("cart-pole"), SystemExperiment({}, {}, 0.1), "test")
    path = write_system_scenario(tmp_path / "other.json", scenario)
    process = start(artifact_path.parent, "qlpv-simulator", "--scenario", str(path), port=port)
    _, said = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 2
    assert "other.json: start.i" in said
    with pytest.raises(InputError, match="start"):
        scenario.require_names_of(released("dc-bus"), "test")
    assert SystemScenario.from_document(json.loads(canonical_json(scenario.to_document()))) == scenario


def test_a_controller_of_another_artifact_and_its_plant_do_not_hear_each_other(
    artifact_path: Path, port: int, tmp_path: Path
) -> None:
    other = changed(released("dc-bus"), name="other")
    write_system_artifact(tmp_path / "other", other)
    path = write_system_scenario(tmp_path / "s.json", scenario_of(other, SystemExperiment({}, {}, 0.01), "test"))
    # Both are there for a while together, however late a busy machine starts the second.
    controller = start(artifact_path.parent, "qlpv-controller", "--timeout-s", "2", port=port)
    plant = start(tmp_path / "other", "qlpv-simulator", "--scenario", str(path), "--timeout-s", "2", port=port)
    (_, heard), (_, said) = (process.communicate(timeout=LIMIT_S) for process in (controller, plant))
    assert (controller.returncode, plant.returncode) == (5, 5)
    assert "about another artifact" in heard  # the plant speaks first; the controller answers none of it
    assert "no command of session 7" in said


def test_a_plant_that_is_left_alone_in_real_time_goes_to_its_trim_input(
    artifact_path: Path, port: int, tmp_path: Path
) -> None:
    artifact = released("dc-bus")
    path = write_system_scenario(tmp_path / "s.json", scenario_of(artifact, SystemExperiment({"v": 2.0}, {}, 4.0), "t"))
    paced = ("--mode", "realtime")
    controller = start(artifact_path.parent, "qlpv-controller", *paced, "--silence-s", "5", port=port)
    record = tmp_path / "plant.csv"
    options = ("--scenario", str(path), "--hold-s", "0.02", "--timeout-s", "1", "--record", str(record))
    plant = start(artifact_path.parent, "qlpv-simulator", *paced, *options, port=port)
    try:
        controller.communicate(timeout=0.7)
    except subprocess.TimeoutExpired:
        controller.kill()
        controller.communicate()
    report, said = plant.communicate(timeout=LIMIT_S)
    assert plant.returncode == 3
    assert "controller silent" in said
    assert json.loads(report)["watchdog_samples"] > 0
    with record.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["command_delay_s"]) == -1.0
    assert float(rows[-1]["input.u"]) == artifact.inputs[0].trim


# ---- a plant that is not ours ----------------------------------------------------------------------------------------


class SignalsPlant:
    """The plant's side of the wire in Python: says anything, hears the commands that answer it."""

    def __init__(self, artifact: SystemArtifactDocument, port: int) -> None:
        self._artifact = artifact
        self._commands: list[np.void] = []
        self._wire = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
        self._wire.subscribe(COMMAND, self._hear)

    def _hear(self, _: str, data: bytes) -> None:
        kind = channel_type(COMMAND)
        assert kind.refusal(data) is None
        self._commands.append(kind.decode([data])[0])

    def send(self, seq: int, states: Sequence[float], **members: int) -> None:
        told = np.array([[*states, *[0.0] * len(self._artifact.parameters)]])
        records = system_messages(MEASUREMENT, self._artifact, np.array([seq]), {"told": told}, session=7)
        records["sender"] = 12345
        for name, value in members.items():
            records[name] = value
        self._wire.publish(MEASUREMENT, channel_type(MEASUREMENT).encode(records)[0])

    def answer(self, seq: int, states: Sequence[float]) -> np.void:
        """The command for this measurement, which is repeated until it is answered."""
        deadline = time.monotonic() + LIMIT_S
        while time.monotonic() < deadline:
            self.send(seq, states)
            self._wire.handle_timeout(50)
            found = [command for command in self._commands if command["seq"] == seq]
            if found:
                self._commands.clear()
                return found[-1]
        raise AssertionError(f"no command for sample {seq}")

    def hears_nothing_within(self, milliseconds: int) -> bool:
        self._commands.clear()
        self._wire.handle_timeout(milliseconds)
        return not self._commands


def test_when_measurements_are_not_numbers_expect_the_input_held_then_the_trim_and_a_way_back(
    artifact_path: Path, port: int
) -> None:
    artifact = released("dc-bus")
    n, [u] = len(artifact.states), artifact.inputs
    good, bad = [0.0] * n, [0.0] * n
    good[[signal.name for signal in artifact.states].index("v")] = 2.0
    bad[0] = float("nan")
    controller = start(artifact_path.parent, "qlpv-controller", port=port)
    try:
        plant = SignalsPlant(artifact, port)
        own = _runtime.SystemController(_runtime.SystemArtifact.load(str(artifact_path)))
        first = plant.answer(0, good)
        assert first["input"][0] == own.step(good, [0.0] * len(artifact.parameters))["input"][0] != u.trim
        for wrong in ({"session": 8}, {"artifact_hash": 1}, {"signals": n}):
            plant.send(1, good, **wrong)
        assert plant.hears_nothing_within(200)
        for seq in range(1, 20):
            command = plant.answer(seq, bad)
            assert (command["state"], command["input"][0], command["flags"]) == (3, first["input"][0], 1)
        assert plant.answer(20, bad)["state"] == 4
        settled = 21 + int(0.05 / artifact.sample_period_s)
        for seq in range(21, settled):
            last = plant.answer(seq, good)
        assert (last["state"], last["input"][0]) == (4, u.trim)
        operator = [executable("qlpv-controller"), "--reset-fault", "--artifact", str(artifact_path), "--session", "7"]
        with subprocess.Popen([*operator, "--url", f"udpm://239.255.76.67:{port}?ttl=0", "--timeout-s", "20"]) as reset:
            for seq in range(settled, settled + 2000):
                if plant.answer(seq, good)["state"] != 4:
                    break
            again = plant.answer(seq + 1, good)
            plant.answer(seq + 2, good)  # the operator may have missed one
            reset.wait(timeout=LIMIT_S)
        assert reset.returncode == 0
        assert (again["state"], again["input"][0]) == (2, first["input"][0])
    finally:
        controller.terminate()
        report, _ = controller.communicate(timeout=LIMIT_S)
    told = json.loads(report)
    assert (told["end"], told["faults"], told["resets"]) == ("stopped", 1, 1)  # after the stop there was no sample
    assert told["predicted_steps"] == 20
    assert told["link"]["wrong_session"] == 1
    assert told["link"]["wrong_artifact"] == 2


# ---- the verb -------------------------------------------------------------------------------------------------------


def test_the_verb_runs_both_ways_and_says_so(
    artifact_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(artifact_path.parent)
    assert run(["hil", str(artifact_path), "--start", "v=8", "--noise", "v=0.1", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["identical_to_in_process"] is True
    assert answer["exact_sensors"] is False
    assert answer["fault"] is None
    assert run(["hil", str(artifact_path), "--start", "v=8"]) == 0
    assert "identical to the run in process" in capsys.readouterr().out


def test_in_real_time_the_verb_ends_near_the_run_in_process(
    artifact_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(artifact_path.parent)
    # A busy machine may stop either process for longer than the watchdogs' 20 ms.
    late = ["--silence-s", "5", "--hold-s", "5"]
    assert run(["hil", str(artifact_path), "--start", "v=4", "--real-time", *late, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["mode"] == "realtime"
    assert answer["simulator_report"]["end"] == "completed"
    assert answer["final_level"] < 0.1 * answer["level_at_start"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--start", "y=1"], "start: got y, expected one of i, v, j"),
        (["--parameter", "R=1"], "parameter: got R"),
        (["--noise", "q=1"], "noise: got q"),
        (["--noise", "v=nan"], "--noise: got v=nan"),
        (["--noise", "v=-1"], "noise v: got -1"),
        (["--noise", "v"], "NAME=VALUE"),
        (["--noise", "v=1", "--noise", "v=2"], "v twice"),
        (["--quantisation", "u=1"], "quantisation: got u"),
        (["--quantisation", "v=-0.1"], "quantisation v: got -0.1"),
        (["--quantisation", "v=inf"], "--quantisation: got v=inf"),
        (["--seed", "-1"], "--seed: got -1"),
        (["--seed", "1.5"], "--seed"),
        (["--delay", "1"], "delay: got 1 s"),
        (["--delay", "-1"], "delay: got -1 s"),
        (["--duration", "0"], "duration: got 0 s"),
        (["--rk4", "-1"], "--rk4: got -1"),
    ],
)
def test_a_wrong_option_of_either_verb_is_one_line_and_exit_code_2(
    arguments: list[str], words: str, artifact_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for verb in ("simulate", "hil"):
        assert run([verb, str(artifact_path), *arguments]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert words in said


def test_options_of_the_other_kind_are_refused_by_name(artifact_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (
        [str(artifact_path), "--controller", "pid"],
        [str(artifact_path), "--artifact", str(artifact_path)],
        [str(artifact_path), "--rate-hz", "1000"],
        [str(artifact_path), "--encoder-bits", "12"],
        [str(artifact_path), "--plant", "nominal"],
        [str(artifact_path), "--priority", "3"],
        ["serial-square", "--start", "v=8"],
        ["serial-square", "--noise", "v=8"],
        ["serial-square", "--seed", "8"],
    ):
        assert run(["hil", *arguments]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert arguments[1] in said
