"""Storages for the chain certificate: found by semidefinite programming on sampled coordinates, worth what the exact
check says of them.

The inequalities of `quasilpv.certificate.exact.chain` are affine in the storages and in the bound c. So

1. the best bound on a few coordinates per joint is a semidefinite program;
2. with the bound relaxed by a little, the storages are chosen with the largest common margin;
3. where a denser sample finds an inequality violated, its coordinate is added, and 2 (or 1) is repeated.

A fixed sample alone often fails the exact check; a solver that ends "AlmostSolved" often passes it. Only the check
counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.synthesis.chain_blocks import Block, coordinates_of, rounded, symmetric_basis, twist_scales
from quasilpv.synthesis.storage_program import StorageProgram
from quasilpv.systems.robots.tree import KinematicTree

Side: TypeAlias = Literal["lowest", "highest"]

ANGLES_PER_TURN = 16
DENSE_ANGLES = 400
SPARE = 0.003
"""How far beyond the best bound of the samples the proof is asked for, relative."""

ROUNDS = 8
FINE_ANGLES = 21
"""Between the neighbours of a place of the dense sample where little is left: the least may lie beside it."""


@dataclass(frozen=True, eq=False)
class InertiaPairing:
    """A design inertia and the set of true ones, of one kinematic chain.

    Attributes:
        tree: the chain; its inertias are not looked at.
        design: M_n by its bodies' matrices (n, 6, 6) and rotor inertias (n,).
        true: for every body the matrices its true inertia is a convex combination of, each (count, 6, 6): the vertices
            that matter for the side in question.
        true_rotors: (n,).
    """

    tree: KinematicTree
    design: FloatArray
    design_rotors: FloatArray
    true: Sequence[FloatArray]
    true_rotors: FloatArray


@dataclass(frozen=True, eq=False)
class Storages:
    """What was found.

    Attributes:
        bound: c.
        matrices: z_1 as 1 x 1, then Z_2 .. Z_(n-1).
        margin: smallest scaled eigenvalue over the dense sample.
        rounds: of adding coordinates.
    """

    bound: float
    matrices: tuple[FloatArray, ...]
    margin: float
    rounds: int


class ChainProgram(StorageProgram):
    """The inequalities of one side on a growing sample of coordinates.

    Args:
        pairing: the inertias.
        side: "highest" for ``c M_n - M_t > 0``, "lowest" for ``M_t - c M_n > 0``.
    """

    def __init__(self, pairing: InertiaPairing, side: Side) -> None:
        """Choose the first coordinates and the scales."""
        self.pairing, self.side = pairing, side
        self._sign = 1.0 if side == "highest" else -1.0
        self._joints = pairing.tree.joints
        n = len(self._joints)
        super().__init__([1 if k == 0 else 6 for k in range(n - 1)])
        # A design inertia of rotors alone has no bodies to scale twists by.
        self._bodies = pairing.design if pairing.design.any() else np.array([body[0] for body in pairing.true])
        self._scales = twist_scales(self._joints, self._bodies)
        self._samples = [coordinates_of(joint.lower, joint.upper, ANGLES_PER_TURN) for joint in self._joints]

    # ---- the inequalities ------------------------------------------------------------------------------------------

    def blocks(self, k: int, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The inequality of joint k (from 0) at coordinates (N,), for every choice of the body.

        Returns:
            Its part without unknowns (count N, s, s) and its derivatives with respect to all unknowns, (count N, u, s,
            s); unknowns are c, then the scaled upper triangles of the storages. Scaled to about unit diagonal.
        """
        joint, pairing = self._joints[k], self.pairing
        S = joint.twist[:, None]
        if k == 0:
            T = np.broadcast_to(S, (1, 6, 1))
        else:
            X = joint.motion_matrices(coordinates)
            before = (
                self._joints[0].twist[:, None] / np.sqrt(self._first_inertia())
                if k == 1
                else np.diag(self._scales[k - 1])
            )
            T = np.concatenate([X @ before, np.broadcast_to(S, (len(X), 6, 1))], axis=2)
        size = T.shape[2]
        unit = self._own_inertia(k) ** -0.5
        T = np.concatenate([T[:, :, :-1], T[:, :, -1:] * unit], axis=2)
        Tt = T.transpose(0, 2, 1)
        rotor = np.zeros((size, size))
        rotor[-1, -1] = unit**2
        design = Tt @ pairing.design[k] @ T + rotor * pairing.design_rotors[k]
        true = np.concatenate([Tt @ body @ T + rotor * pairing.true_rotors[k] for body in pairing.true[k]])
        copies = len(pairing.true[k])
        slope = np.zeros((len(T), self.unknowns, size, size))
        slope[:, 0] = self._sign * design
        if k > 0:
            basis = symmetric_basis(self._sizes[k - 1])
            slope[:, self._places(k - 1), : size - 1, : size - 1] = -basis
        if k < len(self._sizes):
            if k == 0:
                slope[:, self._places(0), 0, 0] = self._first_inertia() * unit**2
            else:
                inverse = np.diag(1.0 / self._scales[k])
                own = inverse @ T
                slope[:, self._places(k)] = np.einsum("nai,uab,nbj->nuij", own, symmetric_basis(6), own, optimize=True)
        return -self._sign * true, np.concatenate([slope] * copies)

    def _first_inertia(self) -> float:
        S = self._joints[0].twist
        return float(S @ self._bodies[0] @ S + self.pairing.design_rotors[0]) or 1.0

    def _own_inertia(self, k: int) -> float:
        S = self._joints[k].twist
        return float(S @ np.diag(self._scales[k] ** -2) @ S + self.pairing.design_rotors[k])

    # ---- the programs ----------------------------------------------------------------------------------------------

    def _stacked(self) -> list[Block]:
        return [self.blocks(k, self._samples[k]) for k in range(len(self._joints))]

    def best_bound(self) -> float | None:
        """The best c on the samples; None if the solver has no answer."""
        return self.first_unknown(self._sign)

    def add_violators(self, bound: float, unknowns: FloatArray, margin: float) -> float:
        """Add the coordinates at which an inequality holds by less than half the margin, looked for densely.

        Returns:
            The smallest eigenvalue found.
        """
        smallest = np.inf
        point = np.concatenate([[bound], unknowns])
        for k in range(1, len(self._joints)):
            dense = coordinates_of(self._joints[k].lower, self._joints[k].upper, DENSE_ANGLES)
            lowest = self._lowest(k, dense, point)
            inner = np.r_[np.inf, lowest, np.inf]
            beside = np.r_[dense[0], dense, dense[-1]]
            for at in np.flatnonzero((lowest < margin) & (lowest <= inner[:-2]) & (lowest <= inner[2:])):
                fine = np.append(np.linspace(beside[at], beside[at + 2], FINE_ANGLES), dense[at])
                values = self._lowest(k, fine, point)
                smallest = min(smallest, float(values.min()))
                if values.min() < 0.5 * margin:
                    self._samples[k] = np.unique(np.append(self._samples[k], fine[values.argmin()]))
            smallest = min(smallest, float(lowest.min()))
        return smallest

    def _lowest(self, k: int, coordinates: FloatArray, point: FloatArray) -> FloatArray:
        """The smallest eigenvalue of joint k's inequality at coordinates (N,), over the choices of its body."""
        F, G = self.blocks(k, coordinates)
        lowest = np.linalg.eigvalsh(F + np.einsum("u,nuij->nij", point, G))[:, 0]
        return np.asarray(lowest.reshape(len(self.pairing.true[k]), len(coordinates)).min(axis=0))

    def storages(self, unknowns: FloatArray) -> tuple[FloatArray, ...]:
        """Matrices in their own units, rounded to short binary numbers."""
        matrices = []
        for k, size in enumerate(self._sizes):
            part = unknowns[self._places(k).start - 1 : self._places(k).stop - 1]
            scaled = np.einsum("u,uij->ij", part, symmetric_basis(size))
            unit = np.array(self._first_inertia()) if k == 0 else 1.0 / np.outer(self._scales[k], self._scales[k])
            matrices.append(rounded(scaled, unit))
        return tuple(matrices)


def find_storages(pairing: InertiaPairing, side: Side, spare: float = SPARE) -> Storages | None:
    """Storages and bound of one side.

    Args:
        pairing: the inertias.
        side: of the range of ``M_n^-1 M_t``.
        spare: relative distance of the bound from the best one of the samples.

    Returns:
        None if the solver has no answer, or the rounds do not end.
    """
    program = ChainProgram(pairing, side)
    outwards = 1.0 + spare if side == "highest" else 1.0 - spare
    best = program.best_bound()
    for round_number in range(ROUNDS):
        if best is None:
            return None
        bound = best * outwards
        found = program.widest(bound)
        if found is None:
            return None
        unknowns, margin = found
        if margin <= 0.0:
            best = program.best_bound()
            continue
        smallest = program.add_violators(bound, unknowns, margin)
        if smallest > 0.0:
            return Storages(bound, program.storages(unknowns), smallest, round_number + 1)
        best = program.best_bound()
    return None
