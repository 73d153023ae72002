"""Which inertias a robot can have, over all its postures and loads, relative to a design inertia: proved.

    c1 M_n(q) < M_t(q) < c2 M_n(q)    for every q in the limits of the joints and every true robot

with one chain certificate (`quasilpv.certificate.exact.chain`) for each side.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.chain import ChainForm, ChainJoint, ChainProof, prove_chain
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.robot.climbing import climbed
from quasilpv.synthesis.chain_range import inertia_pairing
from quasilpv.synthesis.chain_storages import InertiaPairing, Side, find_storages
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree


@dataclass(frozen=True, eq=False)
class RangeSide:
    """One side of the range: what was found, which has to be proved.

    Attributes:
        side: ``"lowest"`` or ``"highest"``.
        bound: of the ratio; None if the solver found none.
        sampled: extreme ratio found by random postures and climbing: what a proof cannot beat.
        seconds_to_find: of the storages.
    """

    side: Side
    pairing: InertiaPairing
    storages: tuple[FloatArray, ...]
    bound: float | None
    sampled: float
    seconds_to_find: float

    def prove(self, bound: float) -> ChainProof:
        """Decide a bound in exact arithmetic, with the storages that were found."""
        return prove_chain(
            [_exact_joint(self.pairing.tree, k) for k in range(self.pairing.tree.order)],
            _form(self.pairing, self.side, bound),
            [matrix(storage.tolist()) for storage in self.storages],
        )


@dataclass(frozen=True)
class InertiaRange:
    """What is known of ``M_n^-1 M_t``.

    Attributes:
        needed_range: (c1, c2), proved in exact arithmetic; None if no proof was found.
        sampled_range: smallest and largest ratio found by random postures and climbing: what a proof cannot beat.
        seconds_to_find, seconds_to_check: of the storages, and of the exact check.
        cells: intervals the check took.
    """

    needed_range: tuple[float, float] | None
    sampled_range: tuple[float, float]
    seconds_to_find: float
    seconds_to_check: float
    cells: int


def range_sides(robot: SpatialRobot, design: KinematicTree | None = None) -> tuple[RangeSide, RangeSide]:
    """Search for both sides of the range of a robot: the lowest, and the highest.

    Args:
        robot: with its payload and uncertainties.
        design: whose inertia is M_n; the robot with half its payload if not given.
    """
    nominal = robot.loaded(0.5) if design is None else design
    return _searched(nominal, [robot.lightest()], "lowest"), _searched(nominal, robot.heaviest(), "highest")


def proved_inertia_range(robot: SpatialRobot, design: KinematicTree | None = None) -> InertiaRange:
    """Prove the range of inertias of a robot; arguments as of `range_sides`."""
    sides = range_sides(robot, design)
    bounds: list[float] = []
    began, cells = time.perf_counter(), 0
    for side in sides:
        if side.bound is not None:
            proof = side.prove(side.bound)
            cells += proof.cells
            bounds += [side.bound] if proof.holds else []
    check = time.perf_counter() - began
    needed = (bounds[0], bounds[1]) if len(bounds) == 2 else None
    sampled, find = (sides[0].sampled, sides[1].sampled), sum(side.seconds_to_find for side in sides)
    return InertiaRange(needed, sampled, find, check, cells)


def _searched(design: KinematicTree, true: Sequence[KinematicTree], side: Side) -> RangeSide:
    pairing = inertia_pairing(design, true)
    began = time.perf_counter()
    found = find_storages(pairing, side)
    seconds = time.perf_counter() - began
    bound, storages = (None, ()) if found is None else (found.bound, tuple(found.matrices))
    return RangeSide(side, pairing, storages, bound, _sampled(design, true, side), seconds)


def _form(pairing: InertiaPairing, side: Side, bound: float) -> ChainForm:
    """``c M_n - M_t`` or ``M_t - c M_n``, exactly."""
    sign, c = (1 if side == "highest" else -1), rational(bound)
    bodies = [
        [(matrix(design.tolist()) * c - matrix(body.tolist())) * sign for body in true]
        for design, true in zip(pairing.design, pairing.true, strict=True)
    ]
    rotors = [
        (rational(float(design)) * c - rational(float(true))) * sign
        for design, true in zip(pairing.design_rotors, pairing.true_rotors, strict=True)
    ]
    return ChainForm(bodies, rotors)


def _exact_joint(tree: KinematicTree, k: int) -> ChainJoint:
    joint = tree.joints[k]
    return ChainJoint(
        turns=joint.turns,
        rotation=joint.placement.rotation.tolist(),
        translation=joint.placement.translation_m.tolist(),
        axis=joint.axis.tolist(),
        lower=joint.lower,
        upper=joint.upper,
    )


def _sampled(design: KinematicTree, true: Sequence[KinematicTree], side: Side) -> float:
    """Extreme ratio over random postures, and over what is reached from the best of them by climbing."""
    sign, at = (1.0, -1) if side == "highest" else (-1.0, 0)
    lower, upper = (
        np.array([max(-np.pi, j.lower) if j.is_full_circle else j.lower for j in design.joints]),
        np.array([min(np.pi, j.upper) if j.is_full_circle else j.upper for j in design.joints]),
    )

    def value(postures: FloatArray) -> FloatArray:
        inverse = np.linalg.inv(np.linalg.cholesky(design.inertia(postures)))
        return np.asarray(
            np.max(
                [
                    sign * np.linalg.eigvalsh(inverse @ robot.inertia(postures) @ inverse.transpose(0, 2, 1))[:, at]
                    for robot in true
                ],
                axis=0,
            )
        )

    return sign * climbed(value, lower, upper)[1]
