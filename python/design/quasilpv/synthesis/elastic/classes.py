"""Which laws an arm can have by what stands between its motors and links; a refusal says the number that breaks it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from quasilpv.errors import InputError
from quasilpv.synthesis.acceleration.tree_law import POSTURES, SEED
from quasilpv.synthesis.elastic.arms import links_of
from quasilpv.synthesis.specification import Specification
from quasilpv.systems.robots.joint_drive import ArmClass
from quasilpv.systems.robots.spatial_robot import SpatialJoint, SpatialRobot


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


@dataclass(frozen=True)
class Reach:
    """What an engineer reads before any proof: does the phase lead of the loop reach its elastic modes?

    Attributes:
        lead_window_rad_s: where the lead of a plain difference ends, ``pi / (2 (1 + d) T)`` at d samples of delay.
        proof_ends_rad_s: ``pi / T``, above which a mode without damping cannot be told from a slower one.
        modes_rad_s: by joint ``sqrt(K (1/B + 1/M))``, K the stiffest gear, M the least that its link can be.
    """

    lead_window_rad_s: float
    proof_ends_rad_s: float
    modes_rad_s: tuple[float, ...]

    @classmethod
    def of(cls, robot: SpatialRobot, specification: Specification) -> Reach:
        """Of an arm all joints of which give, by random postures.

        Raises:
            InputError: a mode is above the lead and nothing damps it.
        """
        rng = np.random.default_rng(SEED)
        low, high = np.array(robot.domain.angle_rad).T
        links = links_of(robot.lightest()).inertia(rng.uniform(low, high, (POSTURES, len(low))))
        lightest = np.linalg.inv(links).diagonal(axis1=1, axis2=2).max(axis=0)
        modes = tuple(
            sqrt(joint.drive.stiffness_nm_rad[1] * (1.0 / joint.rotor_inertia_kg_m2 + inverse))
            for joint, inverse in zip(robot.joints, lightest.tolist(), strict=True)
            if joint.drive is not None
        )
        rate = pi * specification.rate_hz
        found = cls(rate / (2.0 * (1.0 + specification.delay_samples)), rate, modes)
        for joint, mode in zip(robot.joints, modes, strict=True):
            found._require_damping(robot.source, joint, mode)
        return found

    def _require_damping(self, source: str, joint: SpatialJoint, mode_rad_s: float) -> None:
        if joint.drive is None or joint.drive.damping_least_s > 0.0 or mode_rad_s <= self.lead_window_rad_s:
            return
        expected = (
            f"more than 0: the gear rings at up to {mode_rad_s:.4g} rad/s, the phase lead of the loop ends at "
            f"{self.lead_window_rad_s:.4g} rad/s, and undamped modes above {self.proof_ends_rad_s:.4g} rad/s are "
            "beyond any proof; measured gears have 1e-4 s and more"
        )
        raise InputError(source, f"joints.{joint.name}.damping_least", 0, expected)

    def to_document(self) -> dict[str, float]:
        """JSON-able, for reports."""
        return {"lead_window_rad_s": self.lead_window_rad_s, "highest_mode_rad_s": max(self.modes_rad_s)}


def reason_of(robot: SpatialRobot) -> str:
    """Why an arm has the laws of its class, in half a line with the number that decides."""
    name, ratio, resonance = _worst_joint(robot)
    return f"above {resonance:.3g} rad/s the motor of {name} feels its rotor alone, 1/{ratio:.3g} of the arm's inertia"


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
    resonance = sqrt(joint.drive.stiffness_nm_rad[0] * (1.0 / rotor + 1.0 / link))
    return joint.name, float(diagonal[k]) / rotor, resonance
