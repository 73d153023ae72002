"""Controller and plant as two real processes over LCM: identity with the in-process run, faults, exit codes."""

from __future__ import annotations

import csv
import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import lcm
import numpy as np
import pytest

from quasilpv.artifact import read_artifact, write_artifact
from quasilpv.release import release
from quasilpv.scenarios import build_scenario, read_scenario, write_scenario
from quasilpv.synthesis import Specification
from quasilpv.systems.registry import robot
from quasilpv.trajectories import serial_square
from quasilpv.trajectories.document import write_trajectory

ROOT = Path(__file__).parents[2]
SAMPLES = 300
LIMIT_S = 60.0
"""No process of these tests may live longer, whatever happens."""


def executable(name: str) -> str:
    """Path of a built executable: in $QUASILPV_BIN, beside the interpreter, in a build tree, or on PATH."""
    folders = [os.environ.get("QUASILPV_BIN", ""), str(Path(sys.executable).parent)]
    folders += [str(path.parent) for path in sorted(ROOT.glob(f"build/*/cpp/*/{name}"))]
    found = shutil.which(name, path=os.pathsep.join(filter(None, folders))) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not built")
    return found


@dataclass
class Experiment:
    """Files of one run, and processes with a session and a port of their own."""

    folder: Path
    session: int = field(default_factory=lambda: 1 + secrets.randbelow(2**31 - 1))
    port: int = field(default_factory=lambda: 49152 + secrets.randbelow(65536 - 49152))
    processes: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def url(self) -> str:
        return f"udpm://239.255.76.67:{self.port}?ttl=0"

    def controller_command(self, *options: str) -> list[str]:
        return self._command("qlpv-controller", "trajectory", "controller.csv", *options)

    def simulator_command(self, *options: str) -> list[str]:
        return self._command("qlpv-simulator", "scenario", "plant.csv", *options)

    def _command(self, program: str, document: str, record: str, *options: str) -> list[str]:
        command = [executable(program), "--artifact", str(self.folder / "artifact.json"), "--url", self.url]
        command += [f"--{document}", str(self.folder / f"{document}.json"), "--record", str(self.folder / record)]
        return [*command, "--session", str(self.session), "--json", *options]

    def start(self, command: list[str]) -> subprocess.Popen[str]:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def run(self, command: list[str]) -> tuple[int, dict[str, Any], str]:
        return finish(self.start(command))

    def columns(self, record: str) -> dict[str, np.ndarray]:
        """Columns of a record, `name_0`, `name_1`, ... joined to one of shape (samples, joints)."""
        with (self.folder / record).open(newline="") as file:
            header, *rows = csv.reader(file)
        table = np.array(rows, dtype=float).reshape(len(rows), len(header))
        stems = [name.rpartition("_")[0] if name.rpartition("_")[2].isdigit() else name for name in header]
        return {
            stem: table[:, [i for i, other in enumerate(stems) if other == stem]].squeeze()
            for stem in dict.fromkeys(stems)
        }


def finish(process: subprocess.Popen[str]) -> tuple[int, dict[str, Any], str]:
    """Exit code, report and stderr of a process that must end by itself."""
    output, errors = process.communicate(timeout=LIMIT_S)
    return process.returncode, json.loads(output) if output else {}, errors


@pytest.fixture(scope="module")
def documents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Artifact, trajectory and scenario of the 3-DoF arm, every sensor imperfection on, with transport delay."""
    folder = tmp_path_factory.mktemp("hil")
    arm = robot("arm3")
    trajectory = serial_square(arm.model)
    scenario = build_scenario(arm, trajectory, transport_delay_s=2e-4)
    write_artifact(folder, release("arm3", "ctc-dob", Specification()).artifact)
    write_trajectory(folder / "trajectory.json", trajectory)
    write_scenario(folder / "scenario.json", scenario.model_copy(update={"duration_s": SAMPLES * 1e-3}))
    return folder


@pytest.fixture
def experiment(documents: Path, tmp_path: Path) -> Iterator[Experiment]:
    for document in ("artifact.json", "trajectory.json", "scenario.json"):
        shutil.copy(documents / document, tmp_path)
    made = Experiment(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.communicate()


def set_duration(experiment: Experiment, seconds: float) -> None:
    path = experiment.folder / "scenario.json"
    write_scenario(path, read_scenario(path).model_copy(update={"duration_s": seconds}))


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


def wait_for_commands(experiment: Experiment, count: int = 20) -> None:
    """Until some commands were on the wire."""
    listener = lcm.LCM(experiment.url)
    heard: list[bytes] = []
    listener.subscribe("QLPV_COMMAND", lambda _, data: heard.append(data))
    deadline = time.monotonic() + LIMIT_S
    while len(heard) < count and time.monotonic() < deadline:
        listener.handle_timeout(100)
    assert len(heard) >= count


@pytest.mark.parametrize("request_stop", [signal.SIGTERM, signal.SIGINT])
def test_when_the_controller_is_asked_to_stop_expect_safe_torque_record_and_exit_0(
    experiment: Experiment, request_stop: signal.Signals
) -> None:
    set_duration(experiment, 3600.0)
    controller = experiment.start(experiment.controller_command())
    plant = experiment.start(experiment.simulator_command())
    wait_for_commands(experiment)
    controller.send_signal(request_stop)
    code, report, _ = finish(controller)
    assert code == 0
    assert (report["end"], report["fault_cause"]) == ("stopped", "stop requested")
    torque = experiment.columns("controller.csv")["torque_applied_nm"]
    assert np.all(torque[-1] == 0.0)
    assert np.any(torque[0] != 0.0)
    plant_code, plant_report, errors = finish(plant)
    assert (plant_code, plant_report["end"]) == (3, "controller ended")
    assert len(errors.splitlines()) == 1


def test_when_the_simulator_is_asked_to_stop_expect_both_to_end_with_0_and_their_records(
    experiment: Experiment,
) -> None:
    set_duration(experiment, 3600.0)
    controller = experiment.start(experiment.controller_command())
    plant = experiment.start(experiment.simulator_command())
    wait_for_commands(experiment)
    plant.send_signal(signal.SIGTERM)
    plant_code, report, _ = finish(plant)
    assert (plant_code, report["end"]) == (0, "stopped")
    assert finish(controller)[0] == 0
    assert len(experiment.columns("plant.csv")["seq"]) == report["samples"] > 0


def test_when_the_controller_is_killed_in_real_time_expect_the_plant_braked_by_its_watchdog(
    experiment: Experiment,
) -> None:
    set_duration(experiment, 1.0)
    controller = experiment.start(experiment.controller_command("--mode", "realtime"))
    plant = experiment.start(experiment.simulator_command("--mode", "realtime"))
    wait_for_commands(experiment)
    controller.kill()
    code, report, errors = finish(plant)
    assert code == 3
    assert "watchdog" in errors
    assert report["watchdog_samples"] > 0
    columns = experiment.columns("plant.csv")
    # The brake opposes the motion of every joint.
    assert np.all(columns["torque_nm"][-1] * columns["speed_rad_s"][-1] <= 0.0)


def test_when_the_simulator_is_killed_in_real_time_expect_the_controller_in_fault(experiment: Experiment) -> None:
    set_duration(experiment, 3600.0)
    controller = experiment.start(experiment.controller_command("--mode", "realtime", "--exit-on-fault"))
    plant = experiment.start(experiment.simulator_command("--mode", "realtime"))
    wait_for_commands(experiment)
    plant.kill()
    code, report, errors = finish(controller)
    assert code == 3
    assert (report["end"], report["state"], report["fault_cause"]) == ("fault", "fault", "plant silent")
    assert errors.startswith("qlpv-controller: fault stop: plant silent")
    assert np.all(experiment.columns("controller.csv")["torque_applied_nm"][-1] == 0.0)


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_when_the_other_side_is_missing_expect_exit_5_and_one_line(experiment: Experiment, side: str) -> None:
    command = getattr(experiment, f"{side}_command")("--timeout-s", "0.2")
    code, _, errors = experiment.run(command)
    assert code == 5
    assert len(errors.splitlines()) == 1
    assert str(experiment.session) in errors


def test_when_the_sessions_differ_expect_foreign_messages_counted_and_none_answered(experiment: Experiment) -> None:
    other = Experiment(experiment.folder, session=experiment.session + 1, port=experiment.port)
    controller = experiment.start(other.controller_command("--timeout-s", "1"))
    assert experiment.run(experiment.simulator_command("--timeout-s", "1"))[0] == 5
    code, report, _ = finish(controller)
    assert code == 5
    assert report["steps"] == 0
    assert report["link"]["wrong_session"] > 0


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


def without_privileges(command: list[str]) -> list[str]:
    """The command without the right to real-time scheduling, also when the tests run as root."""
    limited = ["prlimit", "--rtprio=0:0", "--memlock=0:0", *command]
    drop = ["setpriv", "--bounding-set=-sys_nice,-ipc_lock", "--inh-caps=-sys_nice,-ipc_lock"]
    return [*drop, *limited] if os.geteuid() == 0 else limited


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_when_real_time_is_required_but_not_permitted_expect_exit_4_and_one_line(
    experiment: Experiment, side: str
) -> None:
    command = getattr(experiment, f"{side}_command")("--priority", "50", "--require-rt")
    code, _, errors = experiment.run(without_privileges(command))
    assert code == 4
    assert len(errors.splitlines()) == 1


def test_when_real_time_is_not_permitted_expect_one_warning_and_a_run_that_says_so(experiment: Experiment) -> None:
    controller = experiment.start(without_privileges(experiment.controller_command("--priority", "50")))
    assert experiment.run(experiment.simulator_command())[0] == 0
    code, report, errors = finish(controller)
    assert (code, report["rt"]) == (0, False)
    assert len(errors.splitlines()) == 1
    assert "warning" in errors


@pytest.mark.parametrize("side", ["controller", "simulator"])
def test_when_there_is_no_multicast_route_expect_exit_5_and_the_command_that_helps(
    experiment: Experiment, side: str
) -> None:
    isolated = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--user", "--net"]
    if subprocess.run([*isolated, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("network namespaces are not permitted here")
    code, _, errors = experiment.run([*isolated, *getattr(experiment, f"{side}_command")()])
    assert code == 5
    assert len(errors.splitlines()) == 1
    assert "ip route add" in errors


def test_when_the_plant_cannot_be_integrated_expect_exit_6_with_the_reason_and_the_record(
    experiment: Experiment,
) -> None:
    path = experiment.folder / "scenario.json"
    document = json.loads(path.read_text())
    document["external_torque"] = [{"joint": 0, "amplitude_nm": 1e300, "frequency_rad_s": 50.0, "phase_rad": 0.0}]
    path.write_text(json.dumps(document))
    experiment.start(experiment.controller_command())
    code, _, errors = experiment.run(experiment.simulator_command())
    assert code == 6
    assert len(errors.splitlines()) == 1
    assert (experiment.folder / "plant.csv").read_text().startswith("seq,time_s,")


@pytest.fixture(scope="module")
def message_types(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The Python message types, generated from the same definitions."""
    folder = tmp_path_factory.mktemp("lcmtypes")
    generator = shutil.which("lcm-gen", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    assert generator is not None
    definitions = [str(path) for path in sorted((ROOT / "lcmtypes").glob("*.lcm"))]
    subprocess.run([generator, "-p", "--package-prefix", "wire", "--ppath", str(folder), *definitions], check=True)
    sys.path.insert(0, str(folder))
    try:
        return __import__("wire.quasilpv", fromlist=["quasilpv"])
    finally:
        sys.path.remove(str(folder))


def test_when_a_plant_written_in_python_follows_the_documented_format_expect_it_answered(
    experiment: Experiment, message_types: ModuleType
) -> None:
    controller = experiment.start(experiment.controller_command("--timeout-s", "20"))
    artifact = read_artifact(experiment.folder / "artifact.json")
    measurement = message_types.measurement_v1()
    measurement.seq = 0
    measurement.session = experiment.session
    measurement.artifact_hash = int.from_bytes(bytes.fromhex(artifact.hash)[:8], "big", signed=True)
    measurement.joints = artifact.joints
    measurement.crc = zlib.crc32(measurement.encode()[:-8])
    packets: list[bytes] = []
    wire = lcm.LCM(experiment.url)
    wire.subscribe("QLPV_COMMAND", lambda _, data: packets.append(data))
    deadline = time.monotonic() + LIMIT_S
    while not packets and time.monotonic() < deadline:
        wire.publish("QLPV_MEASUREMENT", measurement.encode())
        wire.handle_timeout(50)
    command = message_types.command_v1.decode(packets[0])
    assert (command.seq, command.session, command.joints) == (0, experiment.session, artifact.joints)
    assert command.crc == zlib.crc32(packets[0][:-8])
    controller.terminate()
    assert finish(controller)[0] == 0
