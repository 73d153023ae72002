"""The UR5 of Universal Robots, from published parameters; its description files are in `quasilpv.descriptions.ur5`.

Sources:

* Kinematics (Denavit-Hartenberg, standard), masses and centres of mass: Universal Robots, "Parameters for calculations
  of kinematics and dynamics" (support article 45257; the UR5 of the CB3 series).
* Torque and speed limits: UR5 user manual, CB3: joints of size 3 deliver 150 N m, of size 1 28 N m, all turn by up to
  360 degrees either way at up to 180 degrees a second; 5 kg of payload.
* Moments of inertia of the links: solid cylinders of the links' masses and about their sizes. (The article calls them
  negligible for this size and leaves them out.)
* Rotors, reflected to the joint: 0.1 kg m^2 each, as the armature of the UR5e in MuJoCo Menagerie. Nobody
  publishes them.
* Friction, of the simulated plant only: 2 % of the torque limits as Coulomb friction, and a viscous part. A choice of
  this project.
* The load: every body of up to 5 kg within a cube of 10 cm, its centre of mass within 3 cm of a point 5 cm in front of
  the flange.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.spatial_robot import PayloadBody, SpatialJoint, SpatialRobot
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint

NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
DH_A_M = (0.0, -0.425, -0.39225, 0.0, 0.0, 0.0)
DH_D_M = (0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823)
DH_ALPHA_RAD = (pi / 2.0, 0.0, 0.0, pi / 2.0, -pi / 2.0, 0.0)
MASS_KG = (3.7, 8.393, 2.33, 1.219, 1.219, 0.1879)
COM_M = (
    (0.0, -0.02561, 0.00193),
    (0.2125, 0.0, 0.11336),
    (0.15, 0.0, 0.0265),
    (0.0, -0.0018, 0.01634),
    (0.0, 0.0018, 0.01634),
    (0.0, 0.0, -0.001159),
)
"""In the Denavit-Hartenberg frame behind the link."""

CYLINDERS = (
    (1, 0.06, 0.18),
    (0, 0.054, 0.425),
    (0, 0.045, 0.392),
    (1, 0.045, 0.12),
    (1, 0.045, 0.12),
    (2, 0.037, 0.03),
)
"""Axis in that frame (0 is x), radius and length, m."""

TORQUE_NM = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)
ROTOR_INERTIA_KG_M2 = 0.1
VISCOUS_NM_S = (2.0, 2.0, 2.0, 0.5, 0.5, 0.5)
COULOMB_NM = (3.0, 3.0, 3.0, 0.56, 0.56, 0.56)
LONGEST_DELAY_S = 5e-4
MOTION_SPEED_RAD_S = 1.0
"""Largest speed of a joint that `dob-moving` is proved for, over the whole range of all joints."""

LOAD = PayloadBody(5.0, ((-0.03, 0.03), (-0.03, 0.03), (0.02, 0.08)), (0.01, 0.01, 0.01))


@lru_cache(maxsize=1)
def ur5() -> SpatialRobot:
    """The robot, its angles those of the Denavit-Hartenberg convention: stretched along -x at zero."""
    joints, before = [], Placement.identity()
    for k, name in enumerate(NAMES):
        end = _link_end(k)
        body = SpatialInertia.about_com(MASS_KG[k], COM_M[k], _cylinder(k)).seen_from(end)
        axis, turn = np.array([0.0, 0.0, 1.0]), 2.0 * pi
        joints.append(TreeJoint(name, JointKind.REVOLUTE, before, axis, body, ROTOR_INERTIA_KG_M2, -turn, turn))
        before = end
    return SpatialRobot(
        id="ur5",
        tree=KinematicTree("ur5", tuple(joints), before, np.array([0.0, 0.0, -9.81])),
        joints=tuple(_stated(k) for k in range(len(NAMES))),
        payload=LOAD,
        link_uncertainty=0.0,
        delay_s=(0.0, LONGEST_DELAY_S),
        lag_s=(0.0, 0.0),
        source="quasilpv.systems.robots.ur5",
        summary="UR5 of Universal Robots, 6 joints in space, an unknown load of up to 5 kg",
    )


def _link_end(k: int) -> Placement:
    """Where the next joint is: ``Trans_z(d) Trans_x(a) Rot_x(alpha)``."""
    return Placement(Placement.turned((1.0, 0.0, 0.0), DH_ALPHA_RAD[k]).rotation, np.array([DH_A_M[k], 0.0, DH_D_M[k]]))


def _cylinder(k: int) -> FloatArray:
    """Moment of inertia of a solid cylinder about its centre of mass."""
    axis, radius, length = CYLINDERS[k]
    across = MASS_KG[k] * (3.0 * radius**2 + length**2) / 12.0
    moments = np.full(3, across)
    moments[axis] = MASS_KG[k] * radius**2 / 2.0
    return np.diag(moments)


def _stated(k: int) -> SpatialJoint:
    return SpatialJoint(
        name=NAMES[k],
        angle_rad=(-2.0 * pi, 2.0 * pi),
        speed_rad_s=pi,
        torque_nm=TORQUE_NM[k],
        slew_nm_per_s=1e6,
        rotor_inertia_kg_m2=ROTOR_INERTIA_KG_M2,
        rotor_tolerance=0.0,
        encoder_bits=20,
        friction_viscous_nm_s=VISCOUS_NM_S[k],
        friction_coulomb_nm=COULOMB_NM[k],
        motion_speed_rad_s=MOTION_SPEED_RAD_S,
    )
