"""Print how well arms with elastic gears follow a circle, class by class: tools/elastic-tracking [--robot NAME]...

UR5 with 5 kg and Panda with 3 kg that no controller is told of, unless its row says so; gears, rotors and friction are
numbers of no product. Tool on a circle of 0.3 m diameter in 4 s, 1 kHz, 20-bit encoders, half a sample of delay,
SUNDIALS IDA. Laws are designed for gears within a factor of 2 of the middle; true gears are softer, in the middle or
stiffer by that factor. Torque sensors that err have noise of 0.2 % of the torque limit, rms per sample, and count in
0.1 % of it. What is measured is the tool behind the gears.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from robots_tracking import DELAY_S, panda, panda_circle

from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import checked_artifact, to_artifact
from quasilpv.scenarios import TrackingExperiment, tracking_experiment
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.acceleration.tree_law import design_inertia
from quasilpv.synthesis.elastic.arms import links_of
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.joint_drive import ElasticDrive, EncoderSide
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.ur5 import ur5

DAMPING_S = 1.5e-4
UNCERTAINTY = 2.0
NOISE, RESOLUTION = 2e-3, 1e-3
ERRING = "torque sensors err"
GRAVITY_ALONE = 1e-6
STIFF_NM_RAD = 1e12

GEARS: dict[str, tuple[tuple[float, float], ...]] = {
    "UR5": ((0.6, 3e4),) * 2 + ((0.6, 2e4),) + ((0.13, 6e3),) * 3,
    "Panda": ((0.6, 2e4),) * 4 + ((0.2, 8e3),) * 3,
}
"""Rotor inertia, kg m^2, and stiffness, N m/rad, of every joint."""

FACTORS = (1.0, 0.5, 2.0)
COLUMNS = ("robot", "class", "law", "stability", "true gears", "rms tool, um", "max tool, um")


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        robot, arm_class, law, evidence: what ran.
        factor: on the stiffness of the true gears.
        rms_um, max_um: of the tool's distance from where it should be.
    """

    robot: str
    arm_class: str
    law: str
    evidence: str
    factor: float
    rms_um: float
    max_um: float

    def cells(self) -> list[str]:
        """As text."""
        numbers = [f"x {self.factor:g}", f"{self.rms_um:.3g}", f"{self.max_um:.3g}"]
        return [self.robot, self.arm_class, self.law, self.evidence, *numbers]


def elastic(
    robot: SpatialRobot, name: str, side: EncoderSide, spread: tuple[float, float], torque_loop: bool = False
) -> SpatialRobot:
    """An arm with the gears of the table; their stiffness within these factors of the middle."""
    joints = tuple(
        replace(
            joint,
            rotor_inertia_kg_m2=rotor,
            drive=ElasticDrive((spread[0] * pull, spread[1] * pull), DAMPING_S, side, torque_loop, torque_loop),
        )
        for joint, (rotor, pull) in zip(robot.joints, GEARS[name], strict=True)
    )
    chain = tuple(
        replace(own, rotor_inertia_kg_m2=rotor) for own, (rotor, _) in zip(robot.tree.joints, GEARS[name], strict=True)
    )
    return replace(robot, joints=joints, tree=replace(robot.tree, joints=chain))


def rigid(name: str) -> tuple[SpatialRobot, TrackingExperiment]:
    """The arm without gears, and what it follows."""
    robot = ur5() if name == "UR5" else panda()
    return robot, tracking_experiment("ur5-circle") if name == "UR5" else panda_circle(robot)


def with_sensors_that_err(robot: SpatialRobot) -> SpatialRobot:
    """The arm with noise and resolution of its torque sensors, in shares of the joints' torque limits."""
    joints = tuple(
        replace(
            joint,
            drive=replace(
                joint.drive,
                torque_noise_nm=NOISE * joint.torque_nm,
                torque_resolution_nm=RESOLUTION * joint.torque_nm,
            ),
        )
        for joint in robot.joints
        if joint.drive is not None
    )
    return replace(robot, joints=joints)


def industry(design: TrackingDesign) -> TrackingDesign:
    """The same PID of the motors with gravity alone fed forward: no inverse dynamics, reference or correction."""
    robot = design.robot
    assert isinstance(robot, SpatialRobot)
    links = replace(robot, tree=links_of(robot.tree))
    none: dict[str, Any] = {"stiffness_nm_rad": [STIFF_NM_RAD] * len(links.joints), "correction_bandwidth_rad_s": 0.0}
    return replace(design, law={**design.law, **none, **design_inertia(links, GRAVITY_ALONE)}, witness=None)


def told(design: TrackingDesign) -> TrackingDesign:
    """The same law with the load of the run in its model, and without correction."""
    robot = design.robot
    assert isinstance(robot, SpatialRobot)
    assert robot.payload is not None
    tree = links_of(robot.tree).carrying(robot.payload.farthest(1.0))
    known = design_inertia(replace(robot, tree=tree, payload=None), 1.0)
    law = {name: member for name, member in design.law.items() if name != "gravity_load"}
    return replace(design, law={**law, **known, "correction_bandwidth_rad_s": 0.0}, witness=None)


def rows(name: str) -> Iterator[Row]:
    """Runs of one arm."""
    robot, experiment = rigid(name)
    wide = (1.0 / UNCERTAINTY, UNCERTAINTY)
    asked: list[tuple[EncoderSide, bool, str]] = [
        ("motor", False, "motor-pid"),
        ("both", False, "motor-pid"),
        ("both", False, "link-damped"),
        ("link", False, "link-dob"),
        ("both", True, "dob-acceleration"),
    ]
    for side, loop, controller in asked:
        design = synthesise(DesignRequest.of(elastic(robot, name, side, wide, loop), controller))
        artifact = checked_artifact(design)
        made = {controller: (artifact, str(design.report["evidence"]))}
        if side == "motor":
            made["PID and gravity"] = (to_artifact(industry(design)), "not looked at")
            made["motor-pid, load known"] = (to_artifact(told(design)), "not looked at")
        if loop:
            made[f"{controller}, {ERRING}"] = made[controller]
        for label, (law, evidence) in made.items():
            for factor in FACTORS:
                true = elastic(robot, name, side, (factor, factor), loop)
                true = with_sensors_that_err(true) if label.endswith(ERRING) else true
                with tempfile.TemporaryDirectory() as folder:
                    setup = RunSetup(experiment.by(true), law, transport_delay_s=DELAY_S, log=False)
                    found = track(setup, Path(folder)).metrics
                yield Row(
                    name, str(true.arm_class), label, evidence, factor, 1e6 * found.rms_tool_m, 1e6 * found.max_tool_m
                )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", action="append", choices=list(GEARS), help="may be repeated; default: both")
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for name in parser.parse_args().robot or list(GEARS):
        for row in rows(name):
            print("| " + " | ".join(row.cells()) + " |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
