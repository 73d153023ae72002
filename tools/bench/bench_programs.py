"""The compiled benchmark programs, and the experiments they are given."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from bench_report import REPETITIONS, ROOT

from quasilpv.artifact import write_artifact
from quasilpv.documents.mechanism import LinkParameters
from quasilpv.documents.plants import FiveBarPlant
from quasilpv.errors import InputError, QuasilpvError
from quasilpv.experiments.designs import kept_design
from quasilpv.scenarios import (
    IdaIntegrator,
    InitialState,
    Scenario,
    Sensors,
    SineTorque,
    build_scenario,
    write_scenario,
)
from quasilpv.scenarios.registry import tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import any_robot, robot
from quasilpv.trajectories import serial_square
from quasilpv.trajectories.document import write_trajectory

ROBOT = "arm3"
ACCELERATION_RAD_S2 = (-20.0, 20.0)
DEFAULT_FOLDER = ROOT / "build" / "release" / "tools" / "bench"


class ProgramError(QuasilpvError):
    """A benchmark program failed; the message is its own."""


def run_program(name: str, *arguments: Path | str | int) -> Any:
    """Run a compiled benchmark program of ``$QUASILPV_BIN`` or ``build/release/tools/bench``.

    Returns:
        The JSON document it prints.

    Raises:
        InputError: it has not been built.
        ProgramError: it failed.
    """
    program = Path(os.environ.get("QUASILPV_BIN", DEFAULT_FOLDER)) / name
    if not program.is_file():
        expected = "a program: run tools/lib/build.sh --with-tests, or set QUASILPV_BIN to the folder that holds it"
        raise InputError("tools/bench", name, f"nothing at {program}", expected)
    return run_path(program, *arguments)


def run_path(program: Path, *arguments: Path | str | int) -> Any:
    """Run a program that prints one JSON document. Errors as `run_program`."""
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        message = " ".join(done.stderr.split()) or f"exit code {done.returncode}"
        raise ProgramError(f"{program.name}: {message}")
    return json.loads(done.stdout)


Documents: TypeAlias = list[Any]
"""What the runs of one program printed, in the order of time."""


def run_in_turns(runs: Mapping[str, Callable[[], Any]], *, quick: bool) -> dict[str, Documents]:
    """Run every program, then every program again: whatever the machine does meanwhile meets them all.

    Each run is a process of its own, so that what differs between processes (addresses, alignment) is in the spread.

    Args:
        runs: by name.
        quick: once each.
    """
    documents: dict[str, Documents] = {name: [] for name in runs}
    for _ in range(1 if quick else REPETITIONS):
        for name, run in runs.items():
            documents[name].append(run())
    return documents


def costs(documents: Documents, *keys: str | int, scale: float = 1.0) -> list[float]:
    """One number of every run, at a path of keys, times a scale."""
    return [scale * float(reduce(getitem, keys, document)) for document in documents]


@dataclass(frozen=True)
class Experiment:
    """Files of one experiment, in a folder of their own.

    Attributes:
        folder: where everything is written.
        trajectory: the square in joint space.
        scenario: the perturbed plant under the external torque, with the default sensors.
    """

    folder: Path
    trajectory: Path
    scenario: Path
    robot: str = ROBOT

    @classmethod
    def write(cls, folder: Path) -> Experiment:
        """Write trajectory and scenario of the arm into a folder."""
        arm = robot(ROBOT)
        square = serial_square(arm.model, arm.domain)
        return cls(
            folder,
            write_trajectory(folder / "trajectory.json", square),
            write_scenario(folder / "scenario.json", build_scenario(arm, square)),
        )

    @classmethod
    def in_space(cls, folder: Path) -> Experiment:
        """The same of the circle of the UR5 with its full load."""
        folder.mkdir(exist_ok=True)
        circle = tracking_experiment("ur5-circle")
        scenario = build_scenario(circle.robot, circle.trajectory)
        return cls(
            folder,
            write_trajectory(folder / "trajectory.json", circle.trajectory),
            write_scenario(folder / "scenario.json", scenario),
            circle.robot.id,
        )

    @property
    def inputs(self) -> tuple[Path, Path]:
        """Trajectory and scenario, as the programs take them."""
        return self.trajectory, self.scenario

    def artifact(self, controller: str) -> Path:
        """Write the artifact of a controller at its default specification; a design made before is reused."""
        specification = Specification() if self.robot == ROBOT else None
        request = DesignRequest.of(self.robot, controller, specification)
        design = kept_design(request, folder=ROOT / "out" / "cache")
        return write_artifact(self.folder / controller, design)[0]

    def states(self, count: int) -> Path:
        """Write random motions within the domain of the robot: what inverse dynamics is evaluated at."""
        domain = any_robot(self.robot).domain
        random = np.random.default_rng(0)
        boxes = {
            "angle": domain.angle_rad,
            "speed": domain.speed_rad_s,
            "acceleration": (ACCELERATION_RAD_S2,) * domain.joints,
        }
        rows = [
            {name: [random.uniform(low, high) for low, high in box] for name, box in boxes.items()}
            for _ in range(count)
        ]
        path = self.folder / "states.json"
        path.write_text(json.dumps(rows), encoding="utf-8")
        return path


def five_bar_scenario(folder: Path) -> Path:
    """Write the scenario of the five-bar of Dehak 2022 (IV.5.2) with passive links of 0.2 m, under a sine torque.

    Unequal links, because with equal ones the constraint is linear in the angles, the easiest one to integrate.
    """
    active = LinkParameters(length_m=0.165, mass_kg=0.0825, com_m=0.0825, inertia_kg_m2=0.0011, friction_nm_s=0.0)
    passive = active.model_copy(update={"length_m": 0.2, "inertia_kg_m2": 0.0007})
    scenario = Scenario(
        schema="quasilpv.scenario",
        schema_version=1,
        name="five-bar",
        duration_s=3.0,
        plant=FiveBarPlant(label="unequal links", gravity_m_s2=9.81, active=active, passive=passive),
        integrator=IdaIntegrator(),
        external_torque=(SineTorque(joint=0, amplitude_nm=15.0, frequency_rad_s=50.0),),
        sensors=Sensors(encoder_bits=0, velocity_noise_rad_s=0.0),
        transport_delay_s=0.0,
        initial=InitialState(angle_rad=(-0.8, 0.8), speed_rad_s=(0.0, 0.0)),
    )
    return write_scenario(folder / "five-bar.json", scenario)
