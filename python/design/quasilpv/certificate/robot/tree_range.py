"""The needed range of a robot in space, re-proved from an artifact alone: one small inequality per joint and side.

The witness holds the two bounds and the storages of `quasilpv.certificate.exact.chain`, as doubles; the proof is about
these doubles and about those of robot, payload set and design inertia. Samples beside it say how much a better proof
could still gain; nothing rests on them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from flint import fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.chain import ChainProof, prove_chain
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.certificate.exact.rationals import to_floats
from quasilpv.certificate.reading import Rows, WitnessDocument
from quasilpv.certificate.robot.climbing import climbed
from quasilpv.certificate.robot.range import NeededRange, Place
from quasilpv.certificate.robot.tree import TreeData, TreeInertia

Side: TypeAlias = Literal["lowest", "highest"]


class SideWitness(WitnessDocument):
    """A bound and what proves it: z_1 as a 1 x 1 matrix, then the storages Z_2 .. Z_(n-1)."""

    bound: float
    storages: tuple[Rows, ...]


class ChainWitness(WitnessDocument):
    """Both bounds of ``M_t / M_n``, and how long the design took for them."""

    lowest: SideWitness
    highest: SideWitness
    seconds_to_find: float | None = None


class TreeWitness(WitnessDocument):
    """The part of a witness that is about the inertia of a robot in space."""

    chain: ChainWitness


@dataclass(frozen=True)
class SideProof:
    """One bound and what became of it."""

    bound: fmpq
    proof: ChainProof


class TreePair:
    """The true and the design inertia of one robot in space.

    Args:
        data: as shipped.
    """

    def __init__(self, data: TreeData) -> None:
        """Keep the data; numbers for samples are made when they are asked for."""
        self.data = data

    def prove(self, side: Side, witness: SideWitness) -> SideProof:
        """Decide one side with the bound and the storages of its witness.

        Raises:
            ValueError: the storages are not as many as the chain needs.
        """
        bound = rational(witness.bound)
        form = self.data.form_below(bound) if side == "lowest" else self.data.form_above(bound)
        storages = [matrix(storage) for storage in witness.storages]
        return SideProof(bound, prove_chain(self.data.joints, form, storages))

    # ---- samples, in double arithmetic -------------------------------------------------------------------------------

    def ratios(self, q: FloatArray, side: Side) -> FloatArray:
        """Extreme eigenvalue of ``M_n^-1 M_t`` of one side's robots at coordinates (N, n), (N,)."""
        jacobians = self._jacobians(q)
        inverse = np.linalg.inv(np.linalg.cholesky(self._inertia(jacobians, *self._numbers(self.data.design))))
        sign = 1.0 if side == "highest" else -1.0
        rotors = self.rotors * (1.0 + sign * to_floats(matrix([self.data.rotor_tolerance]))[0])
        values = []
        for links in self._links(jacobians, side):
            loaded = links + np.diag(rotors)
            eigenvalues = np.linalg.eigvalsh(inverse @ loaded @ np.swapaxes(inverse, -1, -2))
            values.append(eigenvalues[:, -1] if side == "highest" else eigenvalues[:, 0])
        return np.asarray(np.max(values, axis=0) if side == "highest" else np.min(values, axis=0))

    def links_at(self, q: FloatArray, side: Side) -> FloatArray:
        """M of one side's robots without their rotors, at coordinates (N, n): by corner of the load, (C, N, n, n)."""
        return self._links(self._jacobians(q), side)

    def design_inertia_at(self, q: FloatArray) -> FloatArray:
        """M_n at coordinates (N, n), (N, n, n)."""
        return self._inertia(self._jacobians(q), *self._numbers(self.data.design))

    @property
    def rotors(self) -> FloatArray:
        """Of the nominal robot, (n,)."""
        return self._numbers(self.data.nominal)[1]

    def _links(self, jacobians: FloatArray, side: Side) -> FloatArray:
        bodies, rotors = self._numbers(self.data.nominal)
        sign = 1.0 if side == "highest" else -1.0
        bodies = bodies * (1.0 + sign * float(to_floats(matrix([[self.data.link_tolerance]]))[0, 0]))
        empty, last = self._inertia(jacobians, bodies, np.zeros_like(rotors)), jacobians[-1]
        loads = [to_floats(corner) for corner in self.data.corners] if side == "highest" else [np.zeros((6, 6))]
        return np.array([empty + np.swapaxes(last, -1, -2) @ load @ last for load in loads])

    @cached_property
    def sampled(self) -> tuple[Place, Place]:
        """Places of the smallest and the largest ratio found by random postures and climbing from the best of them."""
        return self._climbed("lowest"), self._climbed("highest")

    def nearest_place(self, ratio: float) -> Place:
        """The end of the sampled range that is nearer to a ratio."""
        return min(self.sampled, key=lambda place: abs(place.inertia_ratio - ratio))

    def _climbed(self, side: Side) -> Place:
        sign = 1.0 if side == "highest" else -1.0
        q, value = climbed(lambda postures: sign * self.ratios(postures, side), *self._box)
        fraction = 1.0 if side == "highest" else 0.0
        return Place(tuple(float(x) for x in q), fraction, sign * value)

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        """Limits; a turn where every angle occurs."""
        lower, upper = (np.array([getattr(joint, side) for joint in self.data.joints]) for side in ("lower", "upper"))
        full = np.array([joint.turns for joint in self.data.joints]) & (upper - lower >= 2.0 * np.pi)
        return np.where(full, -np.pi, lower), np.where(full, np.pi, upper)

    def _jacobians(self, q: FloatArray) -> FloatArray:
        """J_k, (n, N, 6, n), from the charts' own frames: ``v_k = X_k v_(k-1) + S_k w_k``."""
        n = len(self.data.joints)
        before = np.zeros((len(q), 6, n))
        bodies = []
        for k, joint in enumerate(self.data.joints):
            fixed = _motion(np.array(joint.rotation), np.array(joint.translation))
            K = _cross(np.array(joint.axis))
            moved = np.zeros((len(q), 6, 6))
            if joint.turns:
                sine, cosine = np.sin(q[:, k])[:, None, None], np.cos(q[:, k])[:, None, None]
                moved[:, :3, :3] = moved[:, 3:, 3:] = np.eye(3) - sine * K + (1.0 - cosine) * (K @ K)
            else:
                moved[:] = np.eye(6)
                moved[:, :3, 3:] = -q[:, k, None, None] * K
            before = moved @ fixed @ before
            before[:, :, k] += to_floats(joint.twist)[:, 0]
            bodies.append(before)
        return np.array(bodies)

    def _inertia(self, jacobians: FloatArray, bodies: FloatArray, rotors: FloatArray) -> FloatArray:
        total = np.einsum("knia,kij,knjb->nab", jacobians, bodies, jacobians, optimize=True)
        return np.asarray(total + np.diag(rotors))

    def _numbers(self, inertia: TreeInertia) -> tuple[FloatArray, FloatArray]:
        return np.array([to_floats(body) for body in inertia.bodies]), to_floats(matrix([inertia.rotors]))[0]


@dataclass(frozen=True)
class TreeRange:
    """The outcome: the range if both sides are proved, and how long the exact check took."""

    needed: NeededRange | None
    sides: tuple[SideProof, SideProof]
    sampled: tuple[float, float]
    seconds_to_check: float


def tree_range(pair: TreePair, witness: ChainWitness) -> TreeRange:
    """Prove both sides of the needed range from the witness of an artifact.

    Args:
        pair: the inertias.
        witness: its member ``chain``.

    Raises:
        ValueError: the storages are not as many as the chain needs.
    """
    began = time.perf_counter()
    lowest, highest = pair.prove("lowest", witness.lowest), pair.prove("highest", witness.highest)
    seconds = time.perf_counter() - began
    low, high = pair.sampled
    needed = None
    if lowest.proof.holds and highest.proof.holds:
        needed = NeededRange(lowest.bound, highest.bound, low, high, lowest.proof.cells + highest.proof.cells)
    return TreeRange(needed, (lowest, highest), (low.inertia_ratio, high.inertia_ratio), seconds)


def _motion(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    return np.block([[rotation.T, -rotation.T @ _cross(translation)], [np.zeros((3, 3)), rotation.T]])


def _cross(vector: FloatArray) -> FloatArray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
