"""Arms with gears that give, for tests: numbers of no product."""

from dataclasses import replace

from quasilpv.systems.robots.joint_drive import ElasticDrive, EncoderSide
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.ur5 import ur5

ROTORS = (0.6, 0.6, 0.6, 0.13, 0.13, 0.13)
STIFFNESS = (3e4, 3e4, 2e4, 6e3, 6e3, 6e3)


def elastic_ur5(
    *, side: EncoderSide = "motor", uncertainty: float = 1.0, damping_s: float = 1.5e-4, torque_loop: bool = False
) -> SpatialRobot:
    """The UR5 with harmonic drives: stiffness within a factor of the middle, damping over stiffness."""
    robot = ur5()
    joints = tuple(
        replace(
            joint,
            rotor_inertia_kg_m2=rotor,
            drive=ElasticDrive((pull / uncertainty, pull * uncertainty), damping_s, side, torque_loop, torque_loop),
        )
        for joint, rotor, pull in zip(robot.joints, ROTORS, STIFFNESS, strict=True)
    )
    chain = tuple(replace(own, rotor_inertia_kg_m2=rotor) for own, rotor in zip(robot.tree.joints, ROTORS, strict=True))
    return replace(robot, id="ur5-elastic", joints=joints, tree=replace(robot.tree, joints=chain))
