"""Which laws an arm can have by what stands between its motors and links; a refusal says the number that breaks it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quasilpv.errors import InputError
from quasilpv.synthesis.acceleration.tree_law import POSTURES, SEED
from quasilpv.systems.robots.joint_drive import ArmClass
from quasilpv.systems.robots.spatial_robot import SpatialRobot


def require_class(robot: SpatialRobot, controller: str, classes: Sequence[str], others: Sequence[str]) -> None:
    """Raise InputError unless a controller is for arms of the robot's class.

    Args:
        robot: what is designed for.
        controller: its name.
        classes: those it is for.
        others: controllers that are for the robot's class.
    """
    if robot.arm_class in classes:
        return
    instead = f"one of {', '.join(others)}" if others else "an arm of another class: no controller is for this one yet"
    if robot.arm_class is ArmClass.RIGID:
        raise InputError(robot.source, "controller", f"{controller} for rigid joints", instead)
    name, ratio, resonance = _worst_joint(robot)
    raise InputError(
        robot.source,
        "controller",
        f"{controller} for an arm that is {robot.arm_class}",
        f"{instead}; above {resonance:.3g} rad/s the motor of {name} feels its rotor alone, and a law for rigid joints "
        f"multiplies by {ratio:.3g} times as much",
    )


def _worst_joint(robot: SpatialRobot) -> tuple[str, float, float]:
    """The joint whose inertia exceeds its rotor's most, by how much, and its lowest resonance there, rad/s."""
    rng = np.random.default_rng(SEED)
    low, high = np.array(robot.domain.angle_rad).T
    diagonal = robot.tree.inertia(rng.uniform(low, high, (POSTURES, len(low)))).diagonal(axis1=1, axis2=2).max(axis=0)
    elastic = [(k, joint) for k, joint in enumerate(robot.joints) if joint.drive is not None]
    k, joint = max(elastic, key=lambda entry: float(diagonal[entry[0]]) / entry[1].rotor_inertia_kg_m2)
    assert joint.drive is not None
    rotor = joint.rotor_inertia_kg_m2
    link = max(float(diagonal[k]) - rotor, 1e-12)
    resonance = np.sqrt(joint.drive.stiffness_nm_rad[0] * (1.0 / rotor + 1.0 / link))
    return joint.name, float(diagonal[k]) / rotor, float(resonance)
