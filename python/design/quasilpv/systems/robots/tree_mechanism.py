"""A robot in space as designs, scenarios and figures know a mechanism: its chain, and the friction of its joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.arrays import FloatArray
from quasilpv.systems.robots.drawing import Drawing
from quasilpv.systems.robots.joint_drive import EncoderSide
from quasilpv.systems.robots.tree import KinematicTree

COULOMB_SPEED_RAD_S = 0.01
"""Speed w0 in the Coulomb friction ``c tanh(w / w0)`` of simulated joints; Stribeck speed of those that stick."""
PRESLIDING_RAD = 5e-6
"""How far simulated joints that stick give before they break away: about a count of an encoder of 20 bits."""

TORQUE_LOOP_GAIN = 4.0
"""Of simulated drives that control the torque in their joints: the link feels a rotor so many times smaller."""


@dataclass(frozen=True, eq=False)
class TreeMechanism(Drawing):
    """A chain of bodies, and what rubs at its joints.

    Attributes:
        tree: the chain; its tool is what paths are for.
        friction_viscous_nm_s: torque per speed, (n,).
        friction_coulomb_nm: torque against the direction of motion, (n,).
        lag_s: time constant of simulated drives.
        breakaway_nm: torque up to which simulated joints stick, (n,), each at least its Coulomb friction, or 0 for one
            that does not; empty: none does.
    """

    tree: KinematicTree
    friction_viscous_nm_s: tuple[float, ...]
    friction_coulomb_nm: tuple[float, ...]
    lag_s: float = 0.0
    breakaway_nm: tuple[float, ...] = ()

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
        for joint, breakaway, inertia in zip(joints, self.breakaway_nm, self._held_inertia(), strict=False):
            if breakaway > 0.0:
                joint["stick_slip"] = stick_slip(breakaway, float(inertia))
        lag = {"lag_s": self.lag_s} if self.lag_s > 0.0 else {}
        tool = self.tree.tool
        place = {"rotation": tool.rotation.tolist(), "translation_m": tool.translation_m.tolist()}
        return {**document, **lag, "label": label, "joints": joints, "tool": place}

    def _held_inertia(self) -> FloatArray:
        """What friction holds, per joint, (n,)."""
        return np.diag(self.tree.inertia(np.zeros(self.joints)))


def stick_slip(breakaway_nm: float, inertia_kg_m2: float) -> dict[str, float]:
    """How a simulated joint sticks: it gives by `PRESLIDING_RAD`, and swings there with half of the critical damping.

    Args:
        breakaway_nm: torque up to which it sticks.
        inertia_kg_m2: what swings.
    """
    return {
        "breakaway_nm": breakaway_nm,
        "stribeck_speed_rad_s": COULOMB_SPEED_RAD_S,
        "presliding_rad": PRESLIDING_RAD,
        "presliding_damping_nm_s": math.sqrt(breakaway_nm / PRESLIDING_RAD * inertia_kg_m2),
    }


@dataclass(frozen=True, eq=False)
class ElasticMechanism(TreeMechanism):
    """The same with gears that give, in simulations; friction is the motors'.

    Attributes:
        stiffness_nm_rad, damping_nm_s: of the gears, (n,).
        encoder_side: what the encoders sit on.
        torque_sensor: whether the torque in the joints is measured.
        torque_noise_nm, torque_quantum_nm: of its sensors, (n,) where there are some.
        torque_gain: of drives that control it, which then lag by ``lag_s``; 1: they do not.
    """

    stiffness_nm_rad: tuple[float, ...] = ()
    damping_nm_s: tuple[float, ...] = ()
    encoder_side: EncoderSide = "motor"
    torque_sensor: bool = False
    torque_gain: float = 1.0
    torque_noise_nm: tuple[float, ...] = ()
    torque_quantum_nm: tuple[float, ...] = ()

    def plant_document(self, label: str) -> dict[str, Any]:
        """See `TreeMechanism`."""
        document = super().plant_document(label)
        gears = zip(document["joints"], self.stiffness_nm_rad, self.damping_nm_s, strict=True)
        joints = [{**joint, "stiffness_nm_rad": pull, "damping_nm_s": drag} for joint, pull, drag in gears]
        lag_s = document.pop("lag_s", 0.0)
        about: dict[str, Any] = {"kind": "elastic-tree", "encoder_side": self.encoder_side}
        if self.torque_sensor:
            about["torque_sensor"] = True
            for joint, noise, quantum in zip(joints, self.torque_noise_nm, self.torque_quantum_nm, strict=True):
                joint.update({"torque_noise_nm": noise} if noise > 0.0 else {})
                joint.update({"torque_quantum_nm": quantum} if quantum > 0.0 else {})
        if self.torque_gain > 1.0 or lag_s > 0.0:
            about["torque_loop"] = {"gain": self.torque_gain, "lag_s": lag_s}
        return {**document, **about, "joints": joints}

    def _held_inertia(self) -> FloatArray:
        """The rotors."""
        return self.tree.rotor_inertias
