"""Which measured premises a law's inertia follows; the others are held at the middle of their interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.registry import Robot


@dataclass(frozen=True, eq=False)
class Schedule:
    """The measured premises the gains depend on, and the design inertia on their box.

    Attributes:
        premises: those scheduled; the others sit at the middle of their interval, and what they change is disturbance.
        polytope: Takagi-Sugeno representation of their box: for up to two premises no other has tighter vertices.
        inertia: vertices of the nominal inertia, (N, n, n), kg m^2.
        spread: largest eigenvalue of M_i^-1 M_j over the vertices.
        premultiplication: vertices of beta, (N, n, n), for laws of beta times the equations of motion; the inertia is
            then the same at every vertex, so that beta M is affine in the premises. None for the identity.
    """

    premises: tuple[Premise, ...]
    polytope: BlockPolytope
    inertia: FloatArray
    spread: float
    premultiplication: FloatArray | None = None

    @property
    def model_inertia(self) -> FloatArray:
        """The inertia of the inequalities: beta_i M, or M_i."""
        return self.inertia if self.premultiplication is None else self.premultiplication @ self.inertia

    def premise_values(self, robot: Robot, angles: FloatArray) -> FloatArray:
        """The scheduled premises of a robot at B configurations, (B, n) rad -> (B, p)."""
        evaluate = sp.lambdify(robot.model.symbolic.theta, [premise.expression for premise in self.premises])
        values = np.array([evaluate(*theta) for theta in angles], dtype=float)
        return values.reshape(len(angles), len(self.premises))

    def inertia_at(self, robot: Robot, angles: FloatArray) -> FloatArray:
        """The nominal inertia as the schedule sees it at B configurations, (B, n) rad -> (B, n, n) kg m^2."""
        weights = self.polytope.weights(self.polytope.saturate(self.premise_values(robot, angles))[0])
        return np.asarray(np.tensordot(weights, self.inertia, axes=1))


def schedule_of(robot: Robot, chosen: Sequence[int]) -> Schedule:
    """The schedule by some of the inertia premises of a robot.

    Args:
        robot: nominal model and operating domain.
        chosen: indices into `PlanarMechanism.inertia_premises`, ascending; none for a constant inertia.

    Returns:
        The schedule; its spread is infinite if some vertex is not positive definite.
    """
    premises, affine = robot.model.inertia_premises(robot.domain), robot.model.inertia_affine()
    middle = np.array([(p.lower + p.upper) / 2.0 for p in premises])
    middle[list(chosen)] = 0.0
    scheduled = tuple(premises[k] for k in chosen)
    polytope = BlockPolytope.takagi_sugeno([p.lower for p in scheduled], [p.upper for p in scheduled])
    vertices = polytope.vertices(affine.evaluate(middle), affine.coefficients[list(chosen)])
    vertices = (vertices + vertices.swapaxes(1, 2)) / 2.0
    if np.linalg.eigvalsh(vertices).min() <= 0.0:
        return Schedule(scheduled, polytope, vertices, math.inf)
    pairs = np.linalg.solve(vertices[:, None], vertices[None, :])
    return Schedule(scheduled, polytope, vertices, float(np.linalg.eigvals(pairs).real.max()))


@runtime_checkable
class Premultiplied(Protocol):
    """A robot by whose own matrix the source multiplies the equations of motion."""

    def premultiplication(self, domain: OperatingDomain) -> tuple[tuple[Premise, ...], AffineMatrix]:
        """Premises, and the matrix affine in them."""


def premultiplied_schedule(robot: Robot) -> Schedule:
    """The schedule of the robot's own premultiplication, with the constant inertia of its driven joints.

    Raises:
        InfeasibleError: the robot has none.
    """
    if not isinstance(robot.model, Premultiplied):
        raise InfeasibleError(f"{robot.id}: no dob-torque-premultiplied design: the robot has no premultiplication")
    source = robot.model.premultiplication(robot.domain)
    premises, beta = tuple(premise.widened() for premise in source[0]), source[1]
    polytope = BlockPolytope.takagi_sugeno([p.lower for p in premises], [p.upper for p in premises])
    vertices = polytope.vertices(beta.constant, beta.coefficients)
    inertia = np.broadcast_to(np.diag(robot.model.driven_inertia), vertices.shape)
    return Schedule(premises, polytope, np.array(inertia), 1.0, vertices)
