"""Storages for the bound of how fast an inertia changes: found on sampled coordinates, worth what the exact check says.

The inequalities of `quasilpv.certificate.exact.rate_chain` are affine in the storages and in the rate beta. So the
rounds are those of `quasilpv.synthesis.chain_storages`: the least beta on a sample, storages with the largest common
margin a little beyond, and more coordinates where a denser sample finds an inequality violated.

Everything is in units of the largest speed: u = dv/dt is measured by it, and so is beta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.synthesis.chain_blocks import (
    Block,
    coordinates_of,
    rounded,
    symmetric_basis,
    twist_scales,
)
from quasilpv.synthesis.storage_program import StorageProgram
from quasilpv.systems.robots.tree import KinematicTree

PAIR = 12
FIRST_ANGLES = (1, 81, 33)
"""Per turn, of the first joints; the inequality of the second is small, and steep."""

ANGLES_PER_TURN = 17
DENSE_ANGLES = (1, 2000, 400)
SPARE = 0.01
"""How far beyond the least rate of the samples the proof is asked for, relative."""

LEAST_RATE = 1e-3
"""In units of the largest speed: an inertia that does not change needs a rate above 0 all the same."""

ROUNDS = 10


@dataclass(frozen=True, eq=False)
class RateStorages:
    """What was found.

    Attributes:
        rate_per_s: beta.
        matrices: z_1 as 1 x 1, then Z_2 .. Z_(n-1), 12 x 12.
        margin: smallest scaled eigenvalue over the dense sample.
        rounds: of adding coordinates.
    """

    rate_per_s: float
    matrices: tuple[FloatArray, ...]
    margin: float
    rounds: int


class RateProgram(StorageProgram):
    """The inequalities on a growing sample of coordinates.

    Args:
        tree: whose inertia it is; its joints' limits are the box.
        speeds: largest speed of every joint, (n,), not all 0.
    """

    def __init__(self, tree: KinematicTree, speeds: FloatArray) -> None:
        """Choose the first coordinates and the scales."""
        self._joints = tree.joints
        n = tree.order
        self.unit = float(speeds.max())
        self._speeds = speeds / self.unit
        self._bodies = [joint.inertia.matrix for joint in tree.joints]
        self._rotors = tree.rotor_inertias
        super().__init__([1 if k == 0 else PAIR for k in range(n - 1)])
        twists = twist_scales(tree.joints, self._bodies)
        self._scales = [np.concatenate([scale, scale]) for scale in twists]
        self._own = [self._own_inertia(k, twists[k]) ** -0.5 for k in range(n)]
        self._samples = [self._coordinates(k, _nth(FIRST_ANGLES, k, ANGLES_PER_TURN)) for k in range(n)]

    def _coordinates(self, k: int, per_turn: int) -> FloatArray:
        return coordinates_of(self._joints[k].lower, self._joints[k].upper, per_turn)

    def _own_inertia(self, k: int, scale: FloatArray) -> float:
        S = self._joints[k].twist
        return float(S @ np.diag(scale**-2) @ S + self._rotors[k])

    # ---- the inequalities ------------------------------------------------------------------------------------------

    def _columns(self, k: int, coordinates: FloatArray) -> FloatArray:
        """T of joint k at both ends of its speed, scaled, (2 N, 12, size); the first joint's alone, (1, 12, 1)."""
        joint = self._joints[k]
        own = joint.twist[:, None] * self._own[k]
        if k == 0:
            return np.concatenate([own, np.zeros((6, 1))])[None]
        before = self._joints[0].twist[:, None] * self._own[0] if k == 1 else np.diag(self._scales[k - 1][:6])
        moved, turned = joint.motion_matrices(coordinates) @ before, joint.motion_slopes(coordinates) @ before
        width = before.shape[1]
        size = (2 if k > 1 else 1) * width + 1
        T = np.zeros((2, len(coordinates), PAIR, size))
        T[:, :, :6, :width], T[:, :, :6, -1:] = moved, own
        for end, sign in enumerate((1.0, -1.0)):
            T[end, :, 6:, :width] = sign * self._speeds[k] * turned
        if k > 1:
            T[:, :, 6:, width:-1] = moved
        return T.reshape(-1, PAIR, size)

    def blocks(self, k: int, coordinates: FloatArray) -> Block:
        """The inequality of joint k (from 0) at coordinates (N,) and both ends of its speed.

        Unknowns are beta, then the scaled upper triangles of the storages.
        """
        T, body, none = self._columns(k, coordinates), self._bodies[k], np.zeros((6, 6))
        Tt, size = T.transpose(0, 2, 1), T.shape[2]
        slope = np.zeros((len(T), self.unknowns, size, size))
        slope[:, 0] = Tt @ np.block([[body, none], [none, none]]) @ T
        slope[:, 0, -1, -1] += self._own[k] ** 2 * self._rotors[k]
        if k > 0:
            slope[:, self._places(k - 1), : size - 1, : size - 1] = -symmetric_basis(self._sizes[k - 1])
        if k == 0 and self._sizes:
            slope[:, self._places(0)] = 1.0
        elif k < len(self._sizes):
            own = T / self._scales[k][:, None]
            i, j = np.triu_indices(PAIR)
            products = np.einsum("nua,nub->nuab", own[:, i], own[:, j])
            twice = np.where(i == j, 0.0, 1.0)[:, None, None]
            slope[:, self._places(k)] = products + twice * products.transpose(0, 1, 3, 2)
        return Tt @ np.block([[none, -body], [-body, none]]) @ T, slope

    def _concave(self) -> list[Block]:
        """The storages' parts that belong to u, negative."""
        found = []
        for k in range(1, len(self._sizes)):
            slope = np.zeros((1, self.unknowns, 6, 6))
            slope[:, self._places(k)] = -symmetric_basis(PAIR)[:, 6:, 6:]
            found.append((np.zeros((1, 6, 6)), slope))
        return found

    # ---- the programs ----------------------------------------------------------------------------------------------

    def _stacked(self) -> list[Block]:
        return [self.blocks(k, self._samples[k]) for k in range(len(self._joints))] + self._concave()

    def least_rate(self) -> float | None:
        """The least beta on the samples; None if the solver has no answer."""
        return self.first_unknown(1.0)

    def add_violators(self, rate: float, unknowns: FloatArray, margin: float) -> float:
        """Add the coordinates of a dense sample where an inequality holds by less than half the margin.

        Returns:
            The smallest eigenvalue found.
        """
        smallest = np.inf
        point = np.concatenate([[rate], unknowns])
        for k in range(1, len(self._joints)):
            dense = self._coordinates(k, _nth(DENSE_ANGLES, k, DENSE_ANGLES[-1]))
            F, G = self.blocks(k, dense)
            lowest = np.linalg.eigvalsh(F + np.einsum("u,nuij->nij", point, G))[:, 0].reshape(2, -1).min(axis=0)
            smallest = min(smallest, float(lowest.min()))
            inner = np.r_[np.inf, lowest, np.inf]
            worst = (lowest < 0.5 * margin) & (lowest <= inner[:-2]) & (lowest <= inner[2:])
            self._samples[k] = np.unique(np.concatenate([self._samples[k], dense[worst]]))
        return smallest

    def storages(self, unknowns: FloatArray) -> tuple[FloatArray, ...]:
        """Matrices in their own units, rounded to short binary numbers where they are scaled."""
        matrices = []
        for k, size in enumerate(self._sizes):
            part = unknowns[self._places(k).start - 1 : self._places(k).stop - 1]
            scaled = rounded(np.einsum("u,uij->ij", part, symmetric_basis(size)), np.array(1.0))
            if k == 0:
                matrices.append(self.unit * scaled / self._own[0] ** 2)
                continue
            units = self._scales[k] * np.repeat([1.0, self.unit], 6)
            own = self.unit * scaled / np.outer(units, units)
            matrices.append((own + own.T) / 2.0)
        return tuple(matrices)


def find_rate(tree: KinematicTree, speeds: FloatArray, spare: float = SPARE) -> RateStorages | None:
    """A rate beta with ``dM/dt < beta M``, and its storages.

    Args:
        tree: whose inertia it is, over the limits of its joints.
        speeds: largest speed of every joint, (n,).
        spare: relative distance of the rate from the least one of the samples.

    Returns:
        None if the solver has no answer, or the rounds do not end.
    """
    program = RateProgram(tree, speeds)
    rate = program.least_rate()
    for round_number in range(ROUNDS):
        if rate is None:
            return None
        asked = max(rate * (1.0 + spare), LEAST_RATE)
        found = program.widest(asked)
        if found is None:
            return None
        unknowns, margin = found
        if margin > 0.0:
            smallest = program.add_violators(asked, unknowns, margin)
            if smallest > 0.0:
                return RateStorages(asked * program.unit, program.storages(unknowns), smallest, round_number + 1)
            if smallest > -margin:
                continue
        rate = program.least_rate()
    return None


def _nth(values: tuple[int, ...], k: int, otherwise: int) -> int:
    return values[k] if k < len(values) else otherwise
