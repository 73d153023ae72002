"""What a ``robot.toml`` says of the drive of a joint: rigid, or a gear that gives; silence is refused, with advice.

Nothing here has a default that could make a loop unstable: a gear that nobody calls rigid is asked for its stiffness,
and one that gives is asked where its encoder sits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from quasilpv.documents.strict_model import StrictModel
from quasilpv.errors import InputError
from quasilpv.systems.robots.joint_drive import ElasticDrive, EncoderSide

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Stiffness = tuple[Positive, Positive] | Literal["rigid"]

STIFFNESS = (
    '"rigid" for a direct drive, or [lowest, highest] in N m/rad: the torsional stiffness in the data sheet of the '
    "gear (harmonic drives list K1 to K3, some 1e3 to 1e5 after the gear); with doubt, half and twice the number. "
    'Taking a harmonic drive for "rigid" is unsafe'
)
DAMPING = "least damping over stiffness, s: measured gears have 1e-4 to 3e-4, 0 where nobody knows, which is safe"
SIDE = (
    '"motor", "link" or "both": a data sheet that names no output encoder means "motor"; '
    "taking a motor encoder for one on the link is unsafe"
)
ROTOR = "more than 0 with a stiffness: the motor of a gear that gives is a mass of its own"


class DriveKeys(StrictModel):
    """The keys of a joint that are about its drive."""

    rigid: bool | None = None
    stiffness: Stiffness | None = None
    damping_least: NonNegative | None = None
    encoder_side: EncoderSide | None = None
    torque_sensor: bool = False
    torque_loop: bool = False
    torque_noise: NonNegative = 0.0
    torque_resolution: NonNegative = 0.0


def drive_of(source: str, place: str, stated: DriveKeys, rotor_inertia_kg_m2: float) -> ElasticDrive | None:
    """The drive of a joint; None for a rigid one.

    Args:
        source, place: file and joint, for errors.
        stated: its keys.
        rotor_inertia_kg_m2: as file or description say.

    Raises:
        InputError: a key that decides is missing, or contradicts another one.
    """
    stiffness = "rigid" if stated.stiffness is None and stated.rigid else stated.stiffness
    for name, got, expected in _objections(stated, stiffness, rotor_inertia_kg_m2):
        raise InputError(source, f"{place}.{name}", got, expected)
    if stiffness is None or stiffness == "rigid" or stated.damping_least is None or stated.encoder_side is None:
        return None
    return ElasticDrive(
        stiffness,
        stated.damping_least,
        stated.encoder_side,
        stated.torque_sensor,
        stated.torque_loop,
        torque_noise_nm=stated.torque_noise,
        torque_resolution_nm=stated.torque_resolution,
    )


def _objections(
    stated: DriveKeys, stiffness: Stiffness | None, rotor_inertia_kg_m2: float
) -> Iterator[tuple[str, object, str]]:
    """Key, what it says, and what is expected instead."""
    if stiffness is None:
        yield "stiffness", "nothing", STIFFNESS
    elif stated.rigid is not None and stated.rigid != (stiffness == "rigid"):
        yield "rigid", str(stated.rigid).lower(), "nothing beside a stiffness, which says it"
    elif stiffness == "rigid":
        yield from _beside_rigid(stated)
    else:
        yield from _of_gear(stated, stiffness, rotor_inertia_kg_m2)


def _beside_rigid(stated: DriveKeys) -> Iterator[tuple[str, object, str]]:
    for name in ("damping_least", "encoder_side"):
        if getattr(stated, name) is not None:
            yield name, getattr(stated, name), "nothing with a rigid joint"
    for name in ("torque_noise", "torque_resolution"):
        if getattr(stated, name) > 0.0:
            yield name, getattr(stated, name), "nothing with a rigid joint, whose sensor is not simulated"
    if stated.torque_loop:
        yield "torque_loop", "true", "false with a rigid joint, whose motor torque is the joint's"


def _of_gear(
    stated: DriveKeys, stiffness: tuple[float, float], rotor_inertia_kg_m2: float
) -> Iterator[tuple[str, object, str]]:
    if stiffness[0] > stiffness[1]:
        yield "stiffness", list(stiffness), "a lower bound that is not above the upper bound"
    if rotor_inertia_kg_m2 <= 0.0:
        yield "rotor_inertia", rotor_inertia_kg_m2, ROTOR
    if stated.damping_least is None:
        yield "damping_least", "nothing", DAMPING
    if stated.encoder_side is None:
        yield "encoder_side", "nothing", SIDE
    for name in ("torque_noise", "torque_resolution"):
        if getattr(stated, name) > 0.0 and not stated.torque_sensor:
            yield name, getattr(stated, name), "nothing without torque_sensor = true"
    if stated.torque_loop and not stated.torque_sensor:
        yield "torque_sensor", "false", "true with a torque loop, which closes over it"
    if stated.torque_loop and stated.encoder_side == "motor":
        yield "encoder_side", "motor", "link or both with a torque loop: the law needs the angle of the link"
