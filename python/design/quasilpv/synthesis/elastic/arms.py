"""What the designs for elastic arms share: drives, links without rotors, the grid of arms, and the search on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.loops.elastic_loop import ElasticPlant
from quasilpv.progress import Progress
from quasilpv.synthesis.acceleration.tree_law import SEED
from quasilpv.systems.robots.joint_drive import ElasticDrive
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree

Choice = TypeVar("Choice")


@dataclass(frozen=True, eq=False)
class GridArm:
    """An arm at a posture, (n,)."""

    plant: ElasticPlant
    posture: FloatArray


def elastic_drives(robot: SpatialRobot, controller: str, sides: Sequence[str]) -> tuple[ElasticDrive, ...]:
    """The drives of an arm all of whose joints give.

    Args:
        robot: the arm.
        controller: what is designed, for errors.
        sides: of the encoders it can do with.

    Raises:
        InputError: a joint is rigid, or its encoders are on another side.
    """
    found = []
    for joint in robot.joints:
        if joint.drive is None:
            expected = f"a gear that gives: {controller} is for arms all of whose joints are elastic"
            raise InputError(robot.source, f"joints.{joint.name}.stiffness", "rigid", expected)
        if joint.drive.encoder_side not in sides:
            expected = f"{' or '.join(sides)}: {controller} reads them"
            raise InputError(robot.source, f"joints.{joint.name}.encoder_side", joint.drive.encoder_side, expected)
        found.append(joint.drive)
    return tuple(found)


def first_stable(
    about: str,
    choices: Sequence[Choice],
    growth_rates: Callable[[Choice], Iterable[float]],
    progress: Progress,
    where: str = "in a posture of the grid",
) -> tuple[Choice, dict[str, float]]:
    """The first choice of gains that is stable in every loop of its grid: how many loops there are, and the worst.

    Args:
        about: what is designed, for errors.
        choices: in the order in which they are tried.
        growth_rates: of all loops of a choice, 1/s.
        progress: called with (choices tried, choices in all).
        where: what the best of unstable ones grows in, for errors.

    Raises:
        InfeasibleError: none is.
    """
    worst = []
    for tried, choice in enumerate(choices):
        rates = list(growth_rates(choice))
        progress(tried + 1, len(choices))
        worst.append(max(rates))
        if worst[-1] < 0.0:
            return choice, {"loops": len(rates), "worst_growth_rate_per_s": worst[-1]}
    raise InfeasibleError(f"{about}: of {len(choices)} choices of gains the best grows by {min(worst):.3g} 1/s {where}")


def links_of(tree: KinematicTree) -> KinematicTree:
    """The chain without its rotors."""
    return replace(tree, joints=tuple(replace(joint, rotor_inertia_kg_m2=0.0) for joint in tree.joints))


def grid_arms(robot: SpatialRobot, drives: Sequence[ElasticDrive], postures: int) -> Iterator[GridArm]:
    """Postures x (lightest, heaviest) x (softest, stiffest) gears with their least damping x rotors at both ends.

    Times both ends of the lag, where the drives lag.
    """
    rng = np.random.default_rng(SEED)
    low, high = np.array(robot.domain.angle_rad).T
    angles = rng.uniform(low, high, (postures, len(low)))
    assumed = np.array([joint.rotor_inertia_kg_m2 for joint in robot.joints])
    tolerance = np.array([joint.rotor_tolerance for joint in robot.joints])
    for tree in (robot.lightest(), robot.heaviest()[0]):
        inertias = links_of(tree).inertia(angles)
        for end in (0, 1):
            stiffness = np.array([drive.stiffness_nm_rad[end] for drive in drives])
            damping = np.array([drive.damping_least_s for drive in drives]) * stiffness
            for sign in (0.0,) if not tolerance.any() else (-1.0, 1.0):
                rotors = assumed * (1.0 + sign * tolerance)
                for lag_s in dict.fromkeys(robot.lag_s):
                    for posture, links in zip(angles, inertias, strict=True):
                        yield GridArm(ElasticPlant(links, rotors, stiffness, damping, lag_s), posture)
