"""Fault F27 at the real executables: a robot in space that leaves the angles or speeds its proof assumes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import write_artifact
from quasilpv.artifact.schema import Artifact
from quasilpv.scenarios import Sensors, build_scenario, write_scenario
from quasilpv.trajectories import Trajectory
from quasilpv.trajectories.document import write_trajectory
from reference.tree_artifacts import small_robot, tree_artifact
from two_processes import Experiment, finish

LAW: dict[str, Any] = {
    "kind": "dob-acceleration",
    "feedback": {"kp": -2500.0, "kd": -90.0, "ki": 0.0},
    "observer": [0.7, 300.0, 5e4, 3e6],
    "filter_time_constant_s": 8e-4,
    "disturbance_compensation": True,
}
LIMITS = {"angle_rad": [[-0.5, 0.5]] * 3, "speed_rad_s": [0.8] * 3}
OUTSIDE_PROOF = 1 << 9


@pytest.fixture
def experiment(tmp_path: Path) -> Iterator[Experiment]:
    made = Experiment(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.communicate()


def write(experiment: Experiment, domain: list[list[float]], limits: dict[str, Any] | None, goal: float) -> None:
    """A run of 1 s of the second joint, from rest to the goal; the others stand still."""
    robot = small_robot()
    law = LAW if limits is None else {**LAW, "motion_limits": limits}
    content = tree_artifact(robot.tree, law).content()
    artifact = Artifact.from_document({**content, "domain": {**content["domain"], "angle_rad": domain}})
    trajectory = Trajectory.through([[0.0, 0.0, 0.0], [0.0, goal, 0.0]], [0.0, 1.0])
    sensors = Sensors(encoder_bits=20, velocity_noise_rad_s=0.0)
    write_artifact(experiment.folder, artifact)
    write_trajectory(experiment.folder / "trajectory.json", trajectory)
    write_scenario(
        experiment.folder / "scenario.json", build_scenario(robot, trajectory, plant="nominal", sensors=sensors)
    )


@pytest.mark.parametrize(
    ("domain", "limits", "goal"),
    [
        ([[-0.3, 0.3]] * 3, None, 0.4),  # an angle beyond the domain, where no law here claims anything of speeds
        ([[-2.0, 2.0]] * 3, LIMITS, 0.6),  # one beyond the box of the motions
        ([[-2.0, 2.0]] * 3, LIMITS, 0.45),  # a speed of 0.84 rad/s half way, at angles that are all inside
    ],
)
def test_F27_when_the_reference_leaves_the_limits_of_the_proof_expect_both_processes_to_end_with_its_name(
    experiment: Experiment, domain: list[list[float]], limits: dict[str, Any] | None, goal: float
) -> None:
    write(experiment, domain, limits, goal)
    controller = experiment.start(experiment.controller_command("--exit-on-fault"))
    plant = experiment.start(experiment.simulator_command())
    code, report, errors = finish(controller)
    finish(plant)
    assert code == 3
    assert report["fault_cause"] == "outside the limits of the proof"
    assert report["flags"] & OUTSIDE_PROOF
    assert "outside the limits of the proof" in errors
    record = experiment.columns("controller.csv")
    first = int(np.flatnonzero(record["state"] == 4)[0])
    outside = record["flags"].astype(int) & OUTSIDE_PROOF != 0
    assert list(outside[first - 20 : first + 1]) == [False, *[True] * 20]


def test_when_a_run_keeps_to_the_limits_of_the_proof_expect_no_flag(experiment: Experiment) -> None:
    write(experiment, [[-2.0, 2.0]] * 3, LIMITS, 0.4)  # at most 0.75 rad/s
    controller = experiment.start(experiment.controller_command("--exit-on-fault"))
    plant = experiment.start(experiment.simulator_command())
    code, report, _ = finish(controller)
    assert (code, finish(plant)[0]) == (0, 0)
    assert report["flags"] & OUTSIDE_PROOF == 0
