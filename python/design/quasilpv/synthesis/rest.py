"""The rule of rest, for laws that integrate: where Coulomb friction is stated, small errors are left alone.

An integral goes on while a joint sticks, until the joint breaks away and goes too far: the arm hunts. Within a dead
zone it waits. Each design says what waits, and how much more than this its joints need.
"""

from __future__ import annotations

from math import pi

from quasilpv.arrays import FloatArray
from quasilpv.synthesis.specification import Specification
from quasilpv.systems.robots.spatial_robot import SpatialRobot

COUNTS = 3
"""Of the encoder."""


def dead_zone_rad(robot: SpatialRobot, specification: Specification) -> float:
    """Three counts of the encoder where friction is stated; 0, none, elsewhere."""
    return COUNTS * 2.0 * pi / 2.0**specification.encoder_bits if robot.rubs else 0.0


def dead_zone_members(
    robot: SpatialRobot, specification: Specification, more_rad: FloatArray | None = None
) -> dict[str, list[float]]:
    """The member ``dead_zone_rad`` of a law that may have none; nothing where no friction is stated.

    Args:
        robot: whose joints rub, or not.
        specification: its encoders.
        more_rad: beyond the counts, per joint, (n,).
    """
    counts = dead_zone_rad(robot, specification)
    if counts == 0.0:
        return {}
    more = [0.0] * len(robot.joints) if more_rad is None else more_rad.tolist()
    rubs = [joint.friction_coulomb_nm > 0.0 for joint in robot.joints]
    return {"dead_zone_rad": [counts + own if sticks else 0.0 for sticks, own in zip(rubs, more, strict=True)]}
