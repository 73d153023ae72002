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
from quasilpv.certificate.exact.chain import ChainForm, ChainJoint, prove_chain
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.synthesis.chain_range import inertia_pairing
from quasilpv.synthesis.chain_storages import InertiaPairing, Side, find_storages
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.systems.robots.tree import KinematicTree

SAMPLES = 2000
SEED = 20220315


@dataclass(frozen=True)
class InertiaRange:
    """What is known of ``M_n^-1 M_t``.

    Attributes:
        needed_range: (c1, c2), proved in exact arithmetic; None if no proof was found.
        sampled_range: smallest and largest ratio over random postures: what a proof cannot beat.
        seconds_to_find, seconds_to_check: of the storages, and of the exact check.
        cells: intervals the check took.
    """

    needed_range: tuple[float, float] | None
    sampled_range: tuple[float, float]
    seconds_to_find: float
    seconds_to_check: float
    cells: int


def proved_inertia_range(robot: SpatialRobot, design: KinematicTree | None = None) -> InertiaRange:
    """Prove the range of inertias of a robot.

    Args:
        robot: with its payload and uncertainties.
        design: whose inertia is M_n; the robot with half its payload if not given.
    """
    nominal = robot.loaded(0.5) if design is None else design
    sides: dict[Side, Sequence[KinematicTree]] = {"lowest": [robot.lightest()], "highest": robot.heaviest()}
    bounds: list[float | None] = []
    find, check, cells = 0.0, 0.0, 0
    for side, true in sides.items():
        began = time.perf_counter()
        pairing = inertia_pairing(nominal, true)
        found = find_storages(pairing, side)
        find += time.perf_counter() - began
        if found is None:
            bounds.append(None)
            continue
        began = time.perf_counter()
        proof = prove_chain(
            [_exact_joint(nominal, k) for k in range(nominal.order)],
            _form(pairing, side, found.bound),
            [matrix(storage.tolist()) for storage in found.matrices],
        )
        check += time.perf_counter() - began
        cells += proof.cells
        bounds.append(found.bound if proof.holds else None)
    lowest, highest = bounds
    needed = None if lowest is None or highest is None else (lowest, highest)
    return InertiaRange(needed, _sampled(nominal, sides), find, check, cells)


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


def _sampled(design: KinematicTree, sides: dict[Side, Sequence[KinematicTree]]) -> tuple[float, float]:
    """Extreme ratios over random postures, corners of the limits among them."""
    rng = np.random.default_rng(SEED)
    lower, upper = (
        np.array([max(-np.pi, j.lower) if j.is_full_circle else j.lower for j in design.joints]),
        np.array([min(np.pi, j.upper) if j.is_full_circle else j.upper for j in design.joints]),
    )
    postures = rng.uniform(lower, upper, (SAMPLES, design.order))
    corners = np.where(rng.uniform(size=postures.shape) < 0.5, lower, upper)
    postures[: SAMPLES // 10] = corners[: SAMPLES // 10]
    inverse = np.linalg.inv(np.linalg.cholesky(design.inertia(postures)))

    def ratios(robots: Sequence[KinematicTree]) -> FloatArray:
        return np.array(
            [np.linalg.eigvalsh(inverse @ robot.inertia(postures) @ inverse.transpose(0, 2, 1)) for robot in robots]
        )

    return float(ratios(sides["lowest"]).min()), float(ratios(sides["highest"]).max())
