"""How far the true inertia of a robot in motion is from the design inertia, as one disc for all postures and payloads.

``X = M_t^-1 M_n`` is not symmetric and its eigenvectors move with the posture. A shape Y, found by the inequalities of
`quasilpv.conditions.tracking.inertia_disc`, makes every X that occurs a small deviation from ``c I``. Numerical, on a
grid of postures and payloads: the proof is the business of the certificate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.tracking.inertia_disc import disc_problem
from quasilpv.errors import InfeasibleError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.loops.loop_grid import configurations
from quasilpv.synthesis.acceleration.inertia_range import design_inertia
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.systems.robots.registry import Robot

POSTURES = 400
PAYLOAD_FRACTIONS = 5
BISECTIONS = 10
WORST_ADDED = 6
ROUNDS = 12
ENOUGH = 1.005
SPARE = 1.01
"""Factor on the radius: room for postures between those of the grid, and for the proof."""


@dataclass(frozen=True, eq=False)
class InertiaDisc:
    """``(X - c I) Y (X - c I)' <= r^2 Y`` for every ``X = M_t^-1 M_n`` that occurs, joint coordinates.

    Attributes:
        centre: c.
        radius: r.
        shape: Y, (n, n).
    """

    centre: float
    radius: float
    shape: FloatArray

    def scaled(self, scale: float) -> InertiaDisc:
        """The disc of a design inertia multiplied by ``scale``."""
        return InertiaDisc(self.centre * scale, self.radius * scale, self.shape)

    def to_document(self) -> dict[str, Any]:
        """JSON-able, a member of the witness."""
        return {"centre": self.centre, "radius": self.radius, "shape": self.shape.tolist()}


def needed_disc(robot: Robot, scheduled: Schedule | None = None) -> InertiaDisc:
    """A small disc for the nominal inertia, or what a schedule by some of its premises makes of it, as design inertia.

    The centre is the middle of the eigenvalues. The shape comes from the inequalities at a few X, to which those that
    violate them most are added until the radius they need is nearly that of all.

    Raises:
        InfeasibleError: no shape was found for which the radius is less than the centre.
    """
    X = _quotients(robot, scheduled)
    eigenvalues = np.linalg.eigvals(X).real
    centre = float(eigenvalues.min() + eigenvalues.max()) / 2.0
    least = float(eigenvalues.max() - eigenvalues.min()) / 2.0
    shape = np.eye(X.shape[-1])
    chosen: list[int] = []
    best: InertiaDisc | None = None
    for _ in range(ROUNDS):
        radii = _radii(X, centre, shape)
        radius = float(radii.max())
        if best is None or radius < best.radius:
            best = InertiaDisc(centre, radius, shape)
        if chosen and radius <= ENOUGH * max(least, float(radii[chosen].max())):
            break
        chosen += [int(i) for i in np.argsort(radii)[-WORST_ADDED:] if i not in chosen]
        shape = _shape(X[chosen], centre, (least, best.radius), shape)
    if best is None or SPARE * best.radius >= centre:
        raise InfeasibleError(f"{robot.id}: no shape brings M_t^-1 M_n near a multiple of the identity while it moves")
    return InertiaDisc(centre, SPARE * best.radius, best.shape)


def _quotients(robot: Robot, scheduled: Schedule | None) -> FloatArray:
    """``M_t^-1 M_n`` at a grid of postures and payloads, (N, n, n)."""
    postures = configurations(robot.domain.angle_rad, POSTURES, every_joint=not robot.model.turns_as_one)
    design = design_inertia(robot, postures, scheduled)
    found = []
    for fraction in np.linspace(0.0, 1.0, PAYLOAD_FRACTIONS):
        plant = robot.with_payload_fraction(float(fraction))
        found.append(np.linalg.solve(np.array([plant.inertia(theta) for theta in postures]), design))
    return np.concatenate(found)


def _radii(X: FloatArray, centre: float, shape: FloatArray) -> FloatArray:
    """The radius each X needs: the norm of ``T (X - c I) T^-1``."""
    factor = np.linalg.cholesky(shape)
    deviation = X - centre * np.eye(X.shape[-1])
    return np.asarray(np.linalg.norm(np.linalg.solve(factor, deviation @ factor), ord=2, axis=(1, 2)))


def _shape(X: FloatArray, centre: float, radii: tuple[float, float], otherwise: FloatArray) -> FloatArray:
    """The shape of nearly the least radius for these X, its trace n; ``otherwise`` if none is better than the largest.

    Args:
        X: (N, n, n).
        centre: c.
        radii: bounds of the radius, bisected.
        otherwise: see above.
    """
    low, high = radii
    shape = otherwise
    for _ in range(BISECTIONS):
        radius = np.sqrt(max(low, 1e-9) * high)
        problem, Y = disc_problem(X, centre, float(radius))
        decision = decide(CompiledProblem.of(problem))
        if decision.feasible:
            high, found = radius, decision.values[Y]
            shape = found * (len(found) / np.trace(found))
        else:
            low = radius
    return shape
