"""Print how much arms hunt at rest: tools/robots-rest [--law NAME]... [--seconds S].

A joint that sticks, and an integral that goes on where it sticks, make a cycle: the joint waits, breaks away and goes
too far. The UR5 with rigid joints, and with gears that give, moves every joint by 0.2 rad and rests, with 5 kg that no
controller is told of; 1 kHz, 20-bit encoders, half a sample of delay, SUNDIALS IDA, friction as it is stated (Coulomb
2 % of the torque limits), smoothed or sticking up to 1 and 1.8 times Coulomb's torque. Printed is the peak to peak of
the joint that hunts most in the last eight of 16 s of rest, since cycles last seconds: of each law as it ships, and of
those that a rule binds with their integral on; then the mean error of the joint that rests farthest off.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import checked_artifact
from quasilpv.scenarios import TrackingExperiment
from quasilpv.synthesis import DEFAULT_CONTROLLER, DesignRequest, specification_for, synthesise
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.joint_drive import ElasticDrive, EncoderSide
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.ur5 import ur5
from quasilpv.trajectories import Trajectory

DELAY_S = 5e-4
BREAKAWAY = (0.0, 1.0, 1.8)
"""Over Coulomb's torque; 0: smoothed."""

START_RAD = (0.3, -1.2, 1.4, -0.8, 0.5, 0.2)
BY_RAD = 0.2
MOVE_S = 1.0
REST_S = 16.0
WATCHED_S = 8.0

ROTORS_KG_M2 = (0.6, 0.6, 0.6, 0.13, 0.13, 0.13)
STIFFNESS_NM_RAD = (3e4, 3e4, 2e4, 6e3, 6e3, 6e3)
DAMPING_S = 1.5e-4
SHIPPED, INTEGRATING = "shipped", "integral on"
BASELINES = ("pd-tuned", "pid-tuned", "ctc-tuned", "ctc-dob-tuned")
WITHOUT_INTEGRAL = {"pd-tuned"}
"""Which have nothing that a rule could bind."""


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        law: what held the arm.
        rule: `SHIPPED` or `INTEGRATING`.
        breakaway: over Coulomb's torque; 0: smoothed.
        peak_to_peak_urad: of the joints' angles at rest, per joint.
        error_urad: largest mean error at rest.
    """

    law: str
    rule: str
    breakaway: float
    peak_to_peak_urad: tuple[float, ...]
    error_urad: float

    @property
    def worst_urad(self) -> float:
        """Of the joint that hunts most."""
        return max(self.peak_to_peak_urad)


def elastic_ur5(side: EncoderSide) -> SpatialRobot:
    """The UR5 with the rotors and gears of harmonic drives: numbers of no product."""
    robot = ur5()
    joints = tuple(
        replace(
            joint,
            rotor_inertia_kg_m2=rotor,
            drive=ElasticDrive((pull / 2.0, pull * 2.0), DAMPING_S, side, torque_sensor=False, torque_loop=False),
        )
        for joint, rotor, pull in zip(robot.joints, ROTORS_KG_M2, STIFFNESS_NM_RAD, strict=True)
    )
    chain = (replace(j, rotor_inertia_kg_m2=b) for j, b in zip(robot.tree.joints, ROTORS_KG_M2, strict=True))
    return replace(robot, id="ur5-elastic", joints=joints, tree=replace(robot.tree, joints=tuple(chain)))


def without_friction(robot: SpatialRobot) -> SpatialRobot:
    """The robot of which nobody states Coulomb friction, so that no rule applies."""
    return replace(robot, joints=tuple(replace(joint, friction_coulomb_nm=0.0) for joint in robot.joints))


LAWS: Mapping[str, tuple[str, SpatialRobot]] = {
    **{law: (law, ur5()) for law in (DEFAULT_CONTROLLER, "dob-moving")},
    "motor-pid": ("motor-pid", elastic_ur5("motor")),
    "motor-pid, both sides": ("motor-pid", elastic_ur5("both")),
    "link-damped": ("link-damped", elastic_ur5("both")),
    "link-dob": ("link-dob", elastic_ur5("link")),
    **{law: (law, ur5()) for law in BASELINES},
}
"""Laws by what rows call them, and the arms they are for."""


def designs(name: str) -> dict[str, Artifact]:
    """A law by the rule that ships, and with its integral on."""
    law, robot = LAWS[name]
    shipped = synthesise(DesignRequest(robot, law, specification_for(robot, law)))
    made = {SHIPPED: checked_artifact(shipped)}
    if law not in WITHOUT_INTEGRAL:
        made[INTEGRATING] = checked_artifact(integrating(law, robot, shipped))
    return made


def integrating(law: str, robot: SpatialRobot, shipped: TrackingDesign) -> TrackingDesign:
    """The same law without its rule: without its dead zone, or as for an arm that does not rub."""
    zone = shipped.law.get("dead_zone_rad")
    if zone is not None:
        none = 0.0 if isinstance(zone, float) else [0.0] * len(zone)
        return replace(shipped, law={**shipped.law, "dead_zone_rad": none})
    smooth = without_friction(robot)
    return synthesise(DesignRequest(smooth, law, specification_for(smooth, law)))


def move_and_rest(seconds: float) -> Trajectory:
    """Every joint by `BY_RAD`, with the least jerk; then rest."""
    start = np.array(START_RAD)
    move = Trajectory.through([start, start + BY_RAD], [0.0, MOVE_S], "move-and-rest")
    still = np.zeros_like(move.coefficients)
    still[0, :, 0] = start + BY_RAD
    return replace(
        move,
        knots_s=np.array([0.0, MOVE_S, MOVE_S + seconds]),
        coefficients=np.concatenate([move.coefficients, still]),
    )


def at_rest(run: Run) -> tuple[tuple[float, ...], float]:
    """Peak to peak of every joint, and the largest mean error, urad, in the last `WATCHED_S`."""
    watched = run.time_s > run.time_s[-1] - WATCHED_S
    angle = run.true_angle_rad[watched]
    error = np.abs((angle - run.reference_angle_rad[watched]).mean(axis=0)).max()
    return tuple((1e6 * np.ptp(angle, axis=0)).tolist()), float(1e6 * error)


def rows(name: str, breakaway: Sequence[float] = BREAKAWAY, seconds: float = REST_S) -> Iterator[Row]:
    """The runs of one law."""
    _, smooth = LAWS[name]
    for rule, artifact in designs(name).items():
        for ratio in breakaway:
            robot = smooth.sticking(ratio) if ratio else smooth
            experiment = TrackingExperiment("move-and-rest", robot, move_and_rest(seconds))
            with tempfile.TemporaryDirectory() as folder:
                setup = RunSetup(experiment, artifact, transport_delay_s=DELAY_S, log=False)
                yield Row(name, rule, ratio, *at_rest(track(setup, Path(folder)).run))


def table(found: Sequence[Row]) -> Iterator[str]:
    """In Markdown, a row per law and rule, a column per friction: what hunts most / what rests farthest off."""
    ratios = sorted({row.breakaway for row in found})
    names = ["smooth" if not ratio else f"break-away {ratio:g} c" for ratio in ratios]
    yield "| law | rule | " + " | ".join(names) + " |"
    yield "|" + "---|" * (2 + len(ratios))
    cells = {(row.law, row.rule, row.breakaway): f"{row.worst_urad:.3g} / {row.error_urad:.3g}" for row in found}
    for law, rule in dict.fromkeys((row.law, row.rule) for row in found):
        yield f"| `{law}` | {rule} | " + " | ".join(cells[law, rule, ratio] for ratio in ratios) + " |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--law", action="append", choices=list(LAWS), help="may be repeated; default: all")
    parser.add_argument("--seconds", type=float, default=REST_S, help=f"of rest, at least {WATCHED_S:g}")
    asked = parser.parse_args()
    if not math.isfinite(asked.seconds) or asked.seconds < WATCHED_S:
        parser.error(f"--seconds: got {asked.seconds:g}, expected at least {WATCHED_S:g}")
    found = []
    for law in asked.law or LAWS:
        for row in rows(law, seconds=asked.seconds):
            found.append(row)
            print(
                f"{row.law}, {row.rule}, {row.breakaway:g}: {row.worst_urad:.3g} / {row.error_urad:.3g} urad",
                flush=True,
            )
    print(*table(found), sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
