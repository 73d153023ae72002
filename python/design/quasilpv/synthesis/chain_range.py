"""Bounds of a robot's inertia over all postures and loads, relative to a design inertia, with what proves them.

    c1 M_n(q) < M_t(q) < c2 M_n(q)

What is found here is worth what `quasilpv.certificate.robot.tree_range` says of it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.synthesis.chain_storages import InertiaPairing, Side, find_storages
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree

TRIVIAL_SPARE = 1e-6
"""Of a lower bound that needs no storage, relative."""


@dataclass(frozen=True, eq=False)
class ChainSide:
    """A bound and the storages of its proof."""

    bound: float
    storages: tuple[FloatArray, ...]

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {"bound": self.bound, "storages": [storage.tolist() for storage in self.storages]}


@dataclass(frozen=True, eq=False)
class ChainRange:
    """Both sides, relative to the design inertia they were found for."""

    lowest: ChainSide
    highest: ChainSide
    seconds_to_find: float

    def for_scaled_design(self, scale: float) -> dict[str, Any]:
        """The witness for s times that design inertia: ``c M_n = (c / s) (s M_n)``, so storages stay as they are."""
        sides = {"lowest": self.lowest, "highest": self.highest}
        return {
            **{name: {**side.to_document(), "bound": side.bound / scale} for name, side in sides.items()},
            "seconds_to_find": self.seconds_to_find,
        }


def find_range(robot: SpatialRobot, design: KinematicTree) -> ChainRange:
    """Find bounds and storages for all robots of a set.

    Args:
        robot: with its payload and tolerances.
        design: whose inertia is M_n; the same chain.

    Raises:
        InfeasibleError: the solver has no answer.
    """
    began = time.perf_counter()
    lightest, heaviest = robot.lightest(), robot.heaviest()
    lowest = _without_storages(design, lightest) or _found(inertia_pairing(design, [lightest]), "lowest")
    highest = _found(inertia_pairing(design, heaviest), "highest")
    if lowest is None or highest is None:
        raise InfeasibleError(f"{robot.id}: no bounds of the inertia were found: the solver has no answer")
    return ChainRange(lowest, highest, time.perf_counter() - began)


def inertia_pairing(design: KinematicTree, true: Sequence[KinematicTree]) -> InertiaPairing:
    """The inertias as matrices; robots that differ in their last body only are one set."""
    bodies = [
        np.unique(np.array([robot.joints[k].inertia.matrix for robot in true]), axis=0) for k in range(design.order)
    ]
    assert all(len(body) == 1 for body in bodies[:-1])
    own = np.array([joint.inertia.matrix for joint in design.joints])
    return InertiaPairing(design, own, design.rotor_inertias, bodies, true[0].rotor_inertias)


def _found(pairing: InertiaPairing, side: Side) -> ChainSide | None:
    found = find_storages(pairing, side)
    return None if found is None else ChainSide(found.bound, found.matrices)


def _without_storages(design: KinematicTree, lightest: KinematicTree) -> ChainSide | None:
    """The bound by bodies, if every link and every rotor of the true robot has its own share of the design's.

    With ``I_t >= c I_n`` and ``r_t > c r_n`` the form is a sum of squares that vanish together only at rest, so that
    storages of zero prove it; and where all shares are the same no larger bound holds.
    """
    shares = []
    for own, true in zip(design.joints, lightest.joints, strict=True):
        matrix = own.inertia.matrix
        if own.rotor_inertia_kg_m2 <= 0.0 or np.linalg.eigvalsh(matrix)[0] <= 0.0:
            return None
        half = np.linalg.inv(np.linalg.cholesky(matrix))
        shares += [float(np.linalg.eigvalsh(half @ true.inertia.matrix @ half.T)[0])]
        shares += [true.rotor_inertia_kg_m2 / own.rotor_inertia_kg_m2]
    if min(shares) < max(shares) * (1.0 - TRIVIAL_SPARE):
        return None
    sizes = [1, *[6] * (design.order - 2)][: design.order - 1]
    return ChainSide(min(shares) * (1.0 - TRIVIAL_SPARE), tuple(np.zeros((size, size)) for size in sizes))
