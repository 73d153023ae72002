"""The five-bar linkage with equal links, reduced to its two driven angles: a rhombus.

If active and passive links have the same length the linkage is a rhombus, each passive link parallel to the opposite
active one: ``q_1 = theta_2`` and ``q_2 = theta_1``, exactly. The passive links then need no kinematics at all, and the
reduced dynamics of `fivebar_linkage` are those of `mechanism` with absolute angles that are the joint angles,

    S = I,   D = [c_4 + c_5, 2 c_3; 2 c_3, c_4 + c_5],   g = (c_1 + c_2, c_1 + c_2):

one measured premise, cos(theta_2 - theta_1). Lumping the passive links into the disturbance instead (M = c_4 I) costs
most of the inertia margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix, Vector
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.fivebar_linkage import FiveBarLinkage
from quasilpv.systems.robots.mechanism import PlanarMechanism


@dataclass(frozen=True)
class RhombicFiveBar(PlanarMechanism):
    """A five-bar linkage with links of one length, as a mechanism with two driven joints.

    Attributes:
        linkage: the constrained system it is reduced from.

    Raises:
        InputError: active and passive links differ in length: the reduced inertia is then not affine in one cosine.
    """

    linkage: FiveBarLinkage

    def __post_init__(self) -> None:
        """Refuse other linkages."""
        lengths = self.linkage.active.length_m, self.linkage.passive.length_m
        if lengths[0] != lengths[1]:
            got = f"{lengths[0]} and {lengths[1]} m"
            raise InputError(self.linkage.name, "length_m of active and passive links", got, "equal lengths")

    @property
    def name(self) -> str:  # type: ignore[override]
        """Identifier of the linkage."""
        return self.linkage.name

    @property
    def joints(self) -> int:
        """Two motors."""
        return 2

    @cached_property
    def absolute_map(self) -> Matrix:
        """The identity: both angles are counted from the downward vertical."""
        return np.eye(2)

    @cached_property
    def inertia_constants(self) -> Matrix:
        """D of the module's formula, kg m^2."""
        _, _, c3, c4, c5 = self.linkage.constants
        return np.array([[c4 + c5, 2 * c3], [2 * c3, c4 + c5]])

    @cached_property
    def gravity_constants(self) -> Vector:
        """Twice c_1 + c_2, N m."""
        c1, c2, *_ = self.linkage.constants
        return np.array([c1 + c2, c1 + c2])

    @cached_property
    def friction_nm_s(self) -> Vector:
        """Of the motor axes, N m s/rad."""
        return np.full(2, self.linkage.active.friction_nm_s)

    @property
    def driven_inertia(self) -> Vector:
        """Twice c_4: the active links with the masses of the passive ones at their ends (Dehak 2022, IV.5.2)."""
        return np.full(2, self.linkage.constants[3])

    def forward_kinematics(self, theta: ArrayLike) -> Vector:
        """Tool position (X, Y), m; the tool has no orientation of its own."""
        return self.linkage.tool_position(theta)

    def inverse_kinematics(self, pose: ArrayLike) -> Vector:
        """Driven angles for a tool position (X, Y). InputError: out of reach."""
        return self.linkage.driven_angles(pose)

    def jacobian(self, theta: ArrayLike) -> Matrix:
        """Tool Jacobian, 2 x 2; its determinant vanishes with sin(theta_2 - theta_1)."""
        return self.linkage.tool_jacobian(theta)

    def jacobian_rate_times_speed(self, theta: ArrayLike, omega: ArrayLike) -> Vector:
        """The velocity part of the tool acceleration, (dJ/dt) omega, 2, m/s^2."""
        return self.linkage.tool_drift(theta, omega)

    def skeleton(self, theta: ArrayLike) -> Matrix:
        """Motors, first elbow, tool, second elbow, motors: 5 x 2, m."""
        return self.linkage.skeleton(theta)

    def singularity(self, theta: ArrayLike) -> tuple[str, float]:
        """See `FiveBarLinkage.singularity`; of a rhombus all of its sines are that of theta_2 - theta_1."""
        return self.linkage.singularity(theta)

    def perturbed(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> RhombicFiveBar:
        """Masses and centres of mass of (active, passive) links scaled, inertias about the centres of mass unchanged.

        Raises:
            InputError: not two factors each, or a factor that leaves no rigid body.
        """
        return RhombicFiveBar(self.linkage.perturbed(mass_scale, com_scale))

    def premultiplication(self, domain: OperatingDomain) -> tuple[tuple[Premise, ...], AffineMatrix]:
        """``beta = [1, sin theta_1; 0, 1]`` of Dehak 2022, IV.5.2, and its premise.

        Multiplied with it from the left the constant inertia c_4 I of the active joints becomes c_4 beta.
        """
        theta_1 = self.symbolic.theta[0]
        premise = Premise.over({theta_1: domain.angle_rad[0]}, "sigma1", sp.sin(theta_1))
        return (premise,), AffineMatrix(np.eye(2), np.array([[[0.0, 1.0], [0.0, 0.0]]]))

    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters as JSON-able data, see `FiveBarLinkage.parameters_document`."""
        return self.linkage.parameters_document()

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file."""
        return self.linkage.plant_document(label)
