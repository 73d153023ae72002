"""Print how well arms in space follow a circle: tools/robots-tracking [--robot NAME]... [--activity SHARE]...

UR5 with 5 kg and Panda with 3 kg that no controller is told of, tool on a circle of 0.3 m diameter in 4 s (the UR5 on a
square too), 1 kHz, 20-bit encoders, half a sample of delay, joint friction of 2 % of the torque limits, SUNDIALS IDA.
All controllers are tuned alike for the same torque activity; the Panda is read from the package example-robot-data.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robots_table import ROBOTS, package_folder, robot_of

from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import checked_artifact
from quasilpv.scenarios import TrackingExperiment, tracking_experiment
from quasilpv.synthesis import DEFAULT_CONTROLLER, DesignRequest, specification_for, synthesise, without_compensation
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.trajectories import SpatialPath, plan_in_space
from quasilpv.trajectories.spatial_paths import SpatialArc, SpatialSegment

BASELINES = ("pd-tuned", "pid-tuned", "ctc-tuned", "ctc-dob-tuned")
WITHOUT = f"{DEFAULT_CONTROLLER}, no compensation"
NO_COMPENSATION = (*BASELINES[:3], WITHOUT)
"""Those that do not compensate what disturbs them."""

ACTIVITIES = (0.02, 0.15)
DELAY_S = 5e-4
FRICTION_SHARE = 0.02
VISCOUS_NM_S = 0.5


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        robot, path, controller: what ran.
        activity: the torque activity it was tuned for.
        result: the run.
    """

    robot: str
    path: str
    activity: float
    controller: str
    result: TrackResult

    @property
    def rms_um(self) -> float:
        """Of the tool's distance from where it should be."""
        return 1e6 * self.result.metrics.rms_tool_m

    def cells(self) -> list[str]:
        """As text."""
        metrics = self.result.metrics
        return [
            self.robot,
            self.path,
            f"{100 * self.activity:g} %",
            self.controller,
            f"{self.rms_um:.3g}",
            f"{1e6 * metrics.max_tool_m:.3g}",
            f"{metrics.rms_torque_increment_nm:.3g}",
            f"{100 * metrics.share_at_limit:.3g}",
        ]


COLUMNS = (
    "robot",
    "path",
    "torque activity",
    "controller",
    "rms tool, um",
    "max tool, um",
    "rms increment, N m",
    "at a limit, %",
)


def panda() -> SpatialRobot:
    """The Panda of the table of robots, with friction of its joints.

    Raises:
        InputError: the package is not installed.
    """
    read = robot_of(ROBOTS["Panda"], package_folder())
    joints = tuple(
        replace(
            joint,
            encoder_bits=20,
            friction_viscous_nm_s=VISCOUS_NM_S,
            friction_coulomb_nm=FRICTION_SHARE * joint.torque_nm,
        )
        for joint in read.joints
    )
    return replace(read, id="panda", joints=joints, delay_s=(0.0, DELAY_S))


def panda_circle(robot: SpatialRobot) -> TrackingExperiment:
    """An upright circle of 0.3 m in 4 s in front of the working posture, its orientation held."""
    arc = SpatialArc(centre_by=(0.0, 0.0, 0.15), axis=(1.0, 0.0, 0.0), angle_rad=2.0 * math.pi, duration_s=4.0)
    path = SpatialPath(
        name="panda-circle", start_posture_rad=ROBOTS["Panda"].posture_rad, segments=(SpatialSegment(arc=arc),)
    )
    return TrackingExperiment(path.name, robot, plan_in_space(robot.tree, path, robot.domain))


def experiments(name: str) -> tuple[TrackingExperiment, ...]:
    """What a robot follows."""
    if name == "Panda":
        return (panda_circle(panda()),)
    return tracking_experiment("ur5-square"), tracking_experiment("ur5-circle")


def rows(name: str, activity: float, controllers: Sequence[str] = (*BASELINES, DEFAULT_CONTROLLER)) -> Iterator[Row]:
    """Runs of one robot with controllers tuned for one torque activity."""
    runs = experiments(name)
    robot = runs[0].robot
    for controller in controllers:
        asked = DesignRequest(robot, controller, specification_for(robot, controller, torque_activity=activity))
        design = synthesise(asked)
        made = {controller: checked_artifact(design)}
        if controller == DEFAULT_CONTROLLER:
            made[WITHOUT] = checked_artifact(without_compensation(design))
        for label, artifact in made.items():
            for experiment in runs:
                with tempfile.TemporaryDirectory() as folder:
                    setup = RunSetup(experiment, artifact, transport_delay_s=DELAY_S, log=False)
                    yield Row(name, experiment.name, activity, label, track(setup, Path(folder)))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", action="append", choices=["UR5", "Panda"], help="may be repeated; default: both")
    parser.add_argument("--activity", action="append", type=float, help="may be repeated; default: 0.02 and 0.15")
    asked = parser.parse_args()
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for name in asked.robot or ["UR5", "Panda"]:
        for activity in asked.activity or ACTIVITIES:
            for row in rows(name, activity):
                print("| " + " | ".join(row.cells()) + " |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
