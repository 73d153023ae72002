"""A robot in space as designs, scenarios and figures know a mechanism: its chain, and the friction of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.drawing import Drawing
from quasilpv.systems.robots.joint_drive import EncoderSide
from quasilpv.systems.robots.tree import KinematicTree

COULOMB_SPEED_RAD_S = 0.01
"""Speed w0 in the smoothed Coulomb friction ``c tanh(w / w0)`` of simulated joints."""


@dataclass(frozen=True, eq=False)
class TreeMechanism(Drawing):
    """A chain of bodies, and what rubs at its joints.

    Attributes:
        tree: the chain; its tool is what paths are for.
        friction_viscous_nm_s: torque per speed, (n,).
        friction_coulomb_nm: torque against the direction of motion, (n,).
        lag_s: time constant of simulated drives.
    """

    tree: KinematicTree
    friction_viscous_nm_s: tuple[float, ...]
    friction_coulomb_nm: tuple[float, ...]
    lag_s: float = 0.0

    @property
    def name(self) -> str:
        """Of the chain."""
        return self.tree.name

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.tree.order

    def inertia(self, theta: ArrayLike) -> FloatArray:
        """M, (n, n), kg m^2."""
        return self.tree.inertia(theta)

    def gravity(self, theta: ArrayLike) -> FloatArray:
        """G, (n,), N m."""
        return self.tree.gravity(theta)

    def inverse_dynamics(self, theta: ArrayLike, omega: ArrayLike, acceleration: ArrayLike) -> FloatArray:
        """The torque of a motion, friction included, (n,), N m."""
        w = np.asarray(omega, dtype=float)
        coulomb = np.array(self.friction_coulomb_nm) * np.tanh(w / COULOMB_SPEED_RAD_S)
        rubbing = np.array(self.friction_viscous_nm_s) * w + coulomb
        return np.asarray(self.tree.inverse_dynamics(theta, omega, acceleration) + rubbing)

    def forward_kinematics(self, theta: ArrayLike) -> FloatArray:
        """Place of the tool in the base, (3,), m."""
        return self.tree.tool_pose(theta).translation_m

    def skeleton(self, theta: ArrayLike) -> FloatArray:
        """The arm as one line: base, joints, tool, (n + 2) x 3, m: what a drawing shows."""
        return np.vstack([np.zeros(3), *(origin for _, origin in self.tree.frames(theta))])

    def tool_path(self, angles: FloatArray) -> FloatArray:
        """See `Drawing`."""
        return np.array([self.forward_kinematics(row) for row in angles])

    def parameters_document(self) -> dict[str, Any]:
        """The chain as JSON-able data, a mechanism of kind ``tree``."""
        return self.tree.parameters_document()

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file."""
        document = self.parameters_document()
        rubbing = zip(document["joints"], self.friction_viscous_nm_s, self.friction_coulomb_nm, strict=True)
        joints = [
            {
                **joint,
                "friction_viscous_nm_s": viscous,
                "friction_coulomb_nm": coulomb,
                "coulomb_speed_rad_s": COULOMB_SPEED_RAD_S,
            }
            for joint, viscous, coulomb in rubbing
        ]
        lag = {"lag_s": self.lag_s} if self.lag_s > 0.0 else {}
        tool = self.tree.tool
        place = {"rotation": tool.rotation.tolist(), "translation_m": tool.translation_m.tolist()}
        return {**document, **lag, "label": label, "joints": joints, "tool": place}


@dataclass(frozen=True, eq=False)
class ElasticMechanism(TreeMechanism):
    """The same with gears that give, in simulations; friction is the motors'.

    Attributes:
        stiffness_nm_rad, damping_nm_s: of the gears, (n,).
        encoder_side: what the encoders sit on.
        torque_sensor: whether the torque in the joints is measured.
    """

    stiffness_nm_rad: tuple[float, ...] = ()
    damping_nm_s: tuple[float, ...] = ()
    encoder_side: EncoderSide = "motor"
    torque_sensor: bool = False

    def plant_document(self, label: str) -> dict[str, Any]:
        """See `TreeMechanism`."""
        document = super().plant_document(label)
        gears = zip(document["joints"], self.stiffness_nm_rad, self.damping_nm_s, strict=True)
        joints = [{**joint, "stiffness_nm_rad": pull, "damping_nm_s": drag} for joint, pull, drag in gears]
        measured = {"encoder_side": self.encoder_side} | ({"torque_sensor": True} if self.torque_sensor else {})
        return {**document, "kind": "elastic-tree", **measured, "joints": joints}
