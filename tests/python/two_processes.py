"""Both executables as processes of a test: files, commands, fixtures, and a plant written in Python.

A test module loads the fixtures with ``pytest_plugins = ["two_processes"]``.
"""

from __future__ import annotations

import csv
import json
import os
import secrets
import shutil
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import lcm
import numpy as np
import pytest

from quasilpv.artifact import read_artifact, write_artifact
from quasilpv.release import release
from quasilpv.scenarios import EXTERNAL_TORQUE, build_scenario, read_scenario, write_scenario
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.trajectories import serial_square
from quasilpv.trajectories.document import write_trajectory

ROOT = Path(__file__).parents[2]
SAMPLES = 300
LIMIT_S = 60.0
"""No process of these tests may live longer, whatever happens."""


def executable(name: str) -> str:
    """Path of a built executable: in $QUASILPV_BIN, beside the interpreter, in the release build, or on PATH."""
    folders = [os.environ.get("QUASILPV_BIN", ""), str(Path(sys.executable).parent)]
    folders += [str(path.parent) for path in sorted(ROOT.glob(f"build/release/cpp/*/{name}"))]
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

    def reset_command(self, *options: str) -> list[str]:
        command = [executable("qlpv-controller"), "--reset-fault", "--artifact", str(self.folder / "artifact.json")]
        return [*command, "--url", self.url, "--session", str(self.session), *options]

    def _command(self, program: str, document: str, record: str, *options: str) -> list[str]:
        command = [executable(program), "--artifact", str(self.folder / "artifact.json"), "--url", self.url]
        command += [f"--{document}", str(self.folder / f"{document}.json"), "--record", str(self.folder / record)]
        return [*command, "--session", str(self.session), "--json", *options]

    def start(self, command: list[str], **variables: str) -> subprocess.Popen[str]:
        environment = {**os.environ, **variables}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        self.processes.append(process)
        return process

    def run(self, command: list[str], **variables: str) -> tuple[int, dict[str, Any], str]:
        return finish(self.start(command, **variables))

    def set_duration(self, seconds: float) -> None:
        path = self.folder / "scenario.json"
        write_scenario(path, read_scenario(path).model_copy(update={"duration_s": seconds}))

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


def wait_for_commands(experiment: Experiment, count: int = 20, limit_s: float = LIMIT_S) -> None:
    """Until some commands were on the wire."""
    listener = lcm.LCM(experiment.url)
    heard: list[bytes] = []
    listener.subscribe("QLPV_COMMAND", lambda _, data: heard.append(data))
    deadline = time.monotonic() + limit_s
    while len(heard) < count and time.monotonic() < deadline:
        listener.handle_timeout(100)
    assert len(heard) >= count


def without_privileges(command: list[str]) -> list[str]:
    """The command without the right to real-time scheduling, also when the tests run as root."""
    limited = ["prlimit", "--rtprio=0:0", "--memlock=0:0", *command]
    drop = ["setpriv", "--bounding-set=-sys_nice,-ipc_lock", "--inh-caps=-sys_nice,-ipc_lock"]
    return [*drop, *limited] if os.geteuid() == 0 else limited


class WirePlant:
    """The plant's side of the wire in Python: sends any measurement, returns the command that answers it."""

    def __init__(self, experiment: Experiment, types: ModuleType) -> None:
        artifact = read_artifact(experiment.folder / "artifact.json")
        self._types = types
        self._session = experiment.session
        self._hash = int.from_bytes(bytes.fromhex(artifact.hash)[:8], "big", signed=True)
        self._joints = artifact.joints
        self._sender = 1 + secrets.randbelow(2**63 - 1)
        self._period_ns = round(1e9 * artifact.sample_period_s)
        self._commands: list[Any] = []
        self._wire = lcm.LCM(experiment.url)
        self._wire.subscribe("QLPV_COMMAND", self._hear)

    def _hear(self, _: str, data: bytes) -> None:
        command = self._types.command_v2.decode(data)
        assert command.crc == zlib.crc32(data[:-8])
        self._commands.append(command)

    def send(self, seq: int, angles: Sequence[float], speeds: Sequence[float] = (), *, session_offset: int = 0) -> None:
        message = self._types.measurement_v3()
        message.seq, message.session, message.artifact_hash = seq, self._session + session_offset, self._hash
        message.joints = self._joints
        message.sender, message.period_ns = self._sender, self._period_ns
        message.angle_rad = [*angles, *[0.0] * (7 - len(angles))]
        message.speed_rad_s = [*speeds, *[0.0] * (7 - len(speeds))]
        message.crc = zlib.crc32(message.encode()[:-8])
        self._wire.publish("QLPV_MEASUREMENT", message.encode())

    def listen(self, milliseconds: int = 1) -> None:
        self._wire.handle_timeout(milliseconds)

    def exchange(self, seq: int, angles: Sequence[float], speeds: Sequence[float] = ()) -> Any:
        """The command for this measurement, which is repeated until it is answered."""
        deadline = time.monotonic() + LIMIT_S
        while time.monotonic() < deadline:
            self.send(seq, angles, speeds)
            self.listen(50)
            answers = [command for command in self._commands if command.seq == seq]
            if answers:
                self._commands.clear()
                return answers[-1]
        raise AssertionError(f"no command for sample {seq}")


@pytest.fixture(scope="session")
def documents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Artifact, trajectory and scenario of the 3-DoF arm, every sensor imperfection on, with transport delay."""
    folder = tmp_path_factory.mktemp("hil")
    arm = robot("arm3")
    trajectory = serial_square(arm.model)
    scenario = build_scenario(arm, trajectory, external_torque=EXTERNAL_TORQUE, transport_delay_s=2e-4)
    write_artifact(folder, release(DesignRequest.of("arm3", "ctc-dob", Specification())).artifact)
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


@pytest.fixture(scope="session")
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
