"""The damped-spring-disc of Dehak 2022, Example III.12, as a robot with one joint: the disc itself.

Rolling without slipping, ``x_1 = r theta``, leaves one equation of the four of `spring_disc`:

    (J_delta + M r^2) theta'' + b r^2 theta' + r^2 (k_1 + k_2 r^2 theta^2) theta = u

G of `dynamics` is here the torque of the spring. What is uncertain is the moment of inertia of the disc,
``1/J_delta = 1/J + delta/r^2``: its set of plants scales J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix, Vector
from quasilpv.errors import InputError
from quasilpv.systems.robots.arm_parameters import PayloadSet
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.mechanism_symbols import SymbolicMechanism


@dataclass(frozen=True)
class RollingDisc(PlanarMechanism):
    """A disc that rolls on a line, held by a damper and a hardening spring, and driven by the torque on its axis.

    Attributes:
        name: identifier.
        mass_kg: M.
        radius_m: r.
        inertia_kg_m2: J, about the centre.
        stiffness_n_m, cubic_stiffness_n_m3: k_1 and k_2 of the spring.
        damping_n_s_m: b.
        inertia_uncertainty_per_kg: delta; 0 for the nominal disc.
    """

    name: str
    mass_kg: float
    radius_m: float
    inertia_kg_m2: float
    stiffness_n_m: float
    cubic_stiffness_n_m3: float
    damping_n_s_m: float
    inertia_uncertainty_per_kg: float = 0.0

    @property
    def joints(self) -> int:
        """The disc."""
        return 1

    @cached_property
    def absolute_map(self) -> Matrix:
        """One angle, x_1 / r."""
        return np.eye(1)

    @property
    def true_inertia_kg_m2(self) -> float:
        """J_delta."""
        return 1.0 / (1.0 / self.inertia_kg_m2 + self.inertia_uncertainty_per_kg / self.radius_m**2)

    @cached_property
    def inertia_constants(self) -> Matrix:
        """``J_delta + M r^2``, 1 x 1."""
        return np.array([[self.true_inertia_kg_m2 + self.mass_kg * self.radius_m**2]])

    @cached_property
    def gravity_constants(self) -> Vector:
        """None: it rolls on the level."""
        return np.zeros(1)

    @cached_property
    def friction_nm_s(self) -> Vector:
        """``b r^2``."""
        return np.array([self.damping_n_s_m * self.radius_m**2])

    @property
    def driven_inertia(self) -> Vector:
        """Its own."""
        return np.diag(self.inertia_constants)

    @property
    def holds_spring(self) -> bool:
        """G is the torque of its spring."""
        return True

    def gravity(self, theta: ArrayLike) -> Vector:
        """Torque of the spring, N m."""
        return np.asarray(self.gravity_stiffness(theta)[0] * np.asarray(theta, dtype=float))

    def gravity_stiffness(self, theta: ArrayLike) -> Matrix:
        """``r^2 (k_1 + k_2 r^2 theta^2)``, 1 x 1, N m/rad."""
        position = self.radius_m * self.absolute(theta)[0]
        return np.array([[self.radius_m**2 * (self.stiffness_n_m + self.cubic_stiffness_n_m3 * position**2)]])

    def energy(self, theta: ArrayLike, omega: ArrayLike) -> float:
        """Kinetic energy plus that of the spring, J."""
        position, speed = self.radius_m * self.absolute(theta)[0], self.absolute(omega)[0]
        kinetic = self.inertia_constants[0, 0] * speed**2 / 2.0
        spring = (self.stiffness_n_m + self.cubic_stiffness_n_m3 * position**2 / 2.0) * position**2 / 2.0
        return float(kinetic + spring)

    @cached_property
    def symbolic(self) -> SymbolicMechanism:
        """The same model as sympy expressions; its one premise is theta^2."""
        symbols = SymbolicMechanism.of(self)
        (theta,), r = symbols.theta, sp.Float(self.radius_m)
        stiffness = r**2 * (sp.Float(self.stiffness_n_m) + sp.Float(self.cubic_stiffness_n_m3) * r**2 * theta**2)
        return replace(
            symbols,
            gravity=sp.Matrix([stiffness * theta]),
            stiffness=sp.Matrix([sp.expand(stiffness)]),
            stiffness_premises=(theta**2,),
        )

    def forward_kinematics(self, theta: ArrayLike) -> Vector:
        """Position (X, Y) of the centre, m, from where the spring is relaxed; Y = 0."""
        return np.array([self.radius_m * self.absolute(theta)[0], 0.0])

    def inverse_kinematics(self, pose: ArrayLike) -> Vector:
        """None: it rolls on a line. InputError."""
        raise InputError(self.name, "path", np.asarray(pose).tolist(), "no path: the disc rolls on a line")

    def jacobian(self, theta: ArrayLike) -> Matrix:
        """(X', Y') per unit of speed, 2 x 1."""
        return np.array([[self.radius_m], [0.0]])

    def jacobian_rate_times_speed(self, theta: ArrayLike, omega: ArrayLike) -> Vector:
        """Zero, 2."""
        return np.zeros(2)

    def skeleton(self, theta: ArrayLike) -> Matrix:
        """The spring's end, the centre of the disc and the point of its rim at angle theta from below, 3 x 2, m."""
        angle = self.absolute(theta)[0]
        centre = self.forward_kinematics(theta)
        rim = centre - self.radius_m * np.array([np.sin(angle), np.cos(angle)])
        return np.array([[0.0, 0.0], centre, rim])

    def singularity(self, theta: ArrayLike) -> tuple[str, float]:
        """There is none: 1."""
        return "1", 1.0

    def perturbed(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> RollingDisc:
        """The disc with its moment of inertia scaled by ``mass_scale[0]``; ``com_scale`` is empty: its centre stays.

        Raises:
            InputError: not one factor, or one outside (0, 1]: delta >= 0.
        """
        if len(mass_scale) != 1 or com_scale or not 0.0 < mass_scale[0] <= 1.0:
            got = f"{list(mass_scale)} and {list(com_scale)}"
            raise InputError(self.name, "scales", got, "one factor of the moment of inertia in (0, 1]")
        delta = self.radius_m**2 * (1.0 / mass_scale[0] - 1.0) / self.inertia_kg_m2
        return replace(self, inertia_uncertainty_per_kg=self.inertia_uncertainty_per_kg + delta)

    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters of the nominal disc as a document of kind ``spring-disc``."""
        left_out = ("name", "inertia_uncertainty_per_kg")
        parameters = {name: value for name, value in asdict(self).items() if name not in left_out}
        return {"kind": "spring-disc", **parameters}

    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file."""
        delta = {"inertia_uncertainty_per_kg": self.inertia_uncertainty_per_kg}
        return {"label": label, **self.parameters_document(), **delta}


@dataclass(frozen=True)
class InertiaSet(PayloadSet):
    """Discs whose moment of inertia lies between the nominal one and a multiple of it.

    `mass_scale` is the factor of the moment of inertia at fraction 1, in (0, 1]; `com_scale` is empty.
    """

    def to_document(self) -> dict[str, Any]:
        """The ``payloads`` member of an artifact."""
        return {"inertia_scale": self.mass_scale[0], "fraction": [0.0, 1.0]}
