"""What stands between motor and link of a joint, and which class of arms an arm with such joints is.

A motor behind a gear that gives is a mass of its own: above the resonance with its link it feels its rotor alone, and a
law that multiplies by the inertia of the whole arm multiplies by too much (Spong 1987, Modeling and control of elastic
joint robots).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, TypeAlias

Interval = tuple[float, float]
EncoderSide: TypeAlias = Literal["motor", "link", "both"]

DAMPING_REACH = 10.0
"""Most over least damping of a gear."""


class ArmClass(StrEnum):
    """What laws can be for an arm."""

    RIGID = "rigid"
    TORQUE_CONTROLLED = "torque-controlled"
    MOTOR_ENCODERS = "elastic, motor encoders"
    DUAL_ENCODERS = "elastic, dual encoders"
    LINK_ENCODERS = "elastic, link encoders"


@dataclass(frozen=True)
class ElasticDrive:
    """A gear that gives.

    Attributes:
        stiffness_nm_rad: K lies in this interval.
        damping_least_s: least damping over stiffness, D >= eta K.
        encoder_side: where the angle is measured.
        torque_sensor: whether the torque in the joint is measured.
        torque_loop: whether the drive controls that torque itself.
        torque_noise_nm: standard deviation of what the sensor adds in every sample.
        torque_resolution_nm: of the sensor; 0: not known, taken to be none.
    """

    stiffness_nm_rad: Interval
    damping_least_s: float
    encoder_side: EncoderSide
    torque_sensor: bool
    torque_loop: bool
    torque_noise_nm: float = 0.0
    torque_resolution_nm: float = 0.0

    @property
    def damping_s(self) -> Interval:
        """Least and most damping over stiffness that a design is for: people state the least."""
        return self.damping_least_s, DAMPING_REACH * self.damping_least_s

    @property
    def arm_class(self) -> ArmClass:
        """Of an arm all joints of which are like this one."""
        if self.torque_loop:
            return ArmClass.TORQUE_CONTROLLED
        sides = {
            "motor": ArmClass.MOTOR_ENCODERS,
            "both": ArmClass.DUAL_ENCODERS,
            "link": ArmClass.LINK_ENCODERS,
        }
        return sides[self.encoder_side]


def arm_class(drives: Sequence[ElasticDrive | None]) -> ArmClass:
    """The class of an arm by its joints' drives (None: rigid): what the joint that gives most allows.

    A torque-controlled joint among rigid ones makes a torque-controlled arm; a joint that gives and has no torque loop
    decides alone, the one that measures least first.
    """
    found = {ArmClass.RIGID if drive is None else drive.arm_class for drive in drives}
    order = (
        ArmClass.MOTOR_ENCODERS,
        ArmClass.LINK_ENCODERS,
        ArmClass.DUAL_ENCODERS,
        ArmClass.TORQUE_CONTROLLED,
    )
    return next((kind for kind in order if kind in found), ArmClass.RIGID)
