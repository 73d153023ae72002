"""Gains as data: vertex matrices, what is needed to put them together, and how they change with the units.

Every gain is a function of the premise vector z that is an object of arrays: it can be stored, sent and inspected.
`Units` of `quasilpv.polytopes.units`: a gain found for the system in other units is brought back exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.polytopes.units import Units
from quasilpv.systems.descriptor.premise import AffineMatrix


class Gain(Protocol):
    """A gain that depends on the premises."""

    @property
    def vertices(self) -> FloatArray:
        """The matrices it is put together of, the last two axes those of a matrix."""

    def __call__(self, z: FloatArray) -> FloatArray:
        """The gain at a premise vector z, (r,)."""

    def in_old_units(self, units: Units) -> Gain:
        """The gain for the system whose description in `units` this one is for."""


@dataclass(frozen=True, eq=False)
class PolytopicGain:
    """``K(z) = sum_i w_i(z) K_i``.

    Attributes:
        polytope: of the premises it depends on.
        vertices: the K_i, (N, m, columns); columns for x or for ``(x_d, x_d', x_a)``.
        places: of its premises among those of the system; None for all, in order.
    """

    polytope: BlockPolytope
    vertices: FloatArray
    places: tuple[int, ...] | None = None

    def __call__(self, z: FloatArray) -> FloatArray:
        """K at a premise vector."""
        return np.asarray(self.polytope.evaluate(self.vertices, _at(z, self.places)))

    def in_old_units(self, units: Units) -> PolytopicGain:
        """``S K^ T^-1``."""
        T = units.T if self.vertices.shape[-1] == len(units.state) else units.T_extended
        return replace(self, vertices=units.S[:, None] * self.vertices / T)


@dataclass(frozen=True, eq=False)
class DescriptorGain:
    """``K(z) = sum_i w_i(z) F_i E(z)^-T P^-1``.

    Attributes:
        polytope: of the premises.
        vertices: the F_i, (N, m, n).
        E: of the system.
        lyapunov: P, (n, n).
    """

    polytope: BlockPolytope
    vertices: FloatArray
    E: AffineMatrix
    lyapunov: FloatArray

    def __call__(self, z: FloatArray) -> FloatArray:
        """K at a premise vector."""
        right = descriptor_right(self.E, self.lyapunov, z)
        return np.asarray(self.polytope.evaluate(self.vertices, z) @ right)

    def in_old_units(self, units: Units) -> DescriptorGain:
        """``F = c S F^ D^-1``."""
        return DescriptorGain(
            self.polytope,
            descriptor_vertices(self.vertices, units),
            old_descriptor(self.E, units),
            units.T[:, None] * self.lyapunov * units.T,
        )


@dataclass(frozen=True, eq=False)
class TwoSetsGain:
    """``K(z) = sum_jk h_j(z) v_k(z) K_jk`` with two sets of rules.

    Attributes:
        first, second: their polytopes.
        places: of the premises of each among those of the system.
        vertices: the K_jk, (rules, rules, m, n).
    """

    first: BlockPolytope
    second: BlockPolytope
    places: tuple[tuple[int, ...], tuple[int, ...]]
    vertices: FloatArray

    def __call__(self, z: FloatArray) -> FloatArray:
        """K at a premise vector."""
        h, v = (own.weights(_at(z, places)) for own, places in zip((self.first, self.second), self.places, strict=True))
        return np.asarray(np.einsum("j,k,jkmn->mn", h, v, self.vertices))

    def in_old_units(self, units: Units) -> TwoSetsGain:
        """``S K^ T^-1``."""
        return replace(self, vertices=units.S[:, None] * self.vertices / units.T)


@dataclass(frozen=True, eq=False)
class ObserverGain:
    """``L(z) = h H(z)^-T Y(z)`` with ``H(z) = sum_i w_i(z) H_i`` and Y alike.

    Attributes:
        polytope: of the premises it depends on.
        multipliers: the H_i, (N, n, n).
        vertices: the Y_i, (N, n, outputs).
        sample_period_s: h.
        places: of its premises among those of the system; None for all, in order.
    """

    polytope: BlockPolytope
    multipliers: FloatArray
    vertices: FloatArray
    sample_period_s: float
    places: tuple[int, ...] | None = None

    def __call__(self, z: FloatArray) -> FloatArray:
        """L at a premise vector."""
        known = _at(z, self.places)
        H, Y = (self.polytope.evaluate(vertices, known) for vertices in (self.multipliers, self.vertices))
        return np.asarray(self.sample_period_s * np.linalg.solve(H.T, Y))

    def in_old_units(self, units: Units) -> ObserverGain:
        """``L = c D^-1 L^ Y^-1`` with ``H = D H^ T^-1``, ``Y = T^-1 Y^ Y^-1`` and ``h = c h^``."""
        return replace(
            self,
            multipliers=units.D[:, None] * self.multipliers / units.T,
            vertices=self.vertices / units.T[:, None] / units.Y,
            sample_period_s=self.sample_period_s * units.c,
        )


@dataclass(frozen=True, eq=False)
class DelayedFeedback:
    """A law with memory: it knows the mean of the weights over the last tau seconds, and those tau seconds ago.

    ``u = F P(varpi)^-1 x_d``, or ``u = F E(z)^-T P(varpi)^-1 x`` with a descriptor matrix; F is a sum over the weights
    of z now, the mean weights (with a window), and those of z then.

    Attributes:
        polytope: of the premises.
        vertices: the F, (N, [N,] N, m, columns).
        constant: P, (q, q).
        moving: the D_k with ``P(varpi) = P + tau sum_k varpi_k D_k``, (N, q, q).
        window_s: tau; None in the limit of a short window.
        E: of the system, of a law that holds its inverse.
        order: n.
    """

    polytope: BlockPolytope
    vertices: FloatArray
    constant: FloatArray
    moving: FloatArray
    window_s: float | None
    E: AffineMatrix | None
    order: int

    def lyapunov(self, varpi: FloatArray) -> FloatArray:
        """P with ``V = x_d' P^-1 x_d`` at mean weights (N,)."""
        if self.window_s is None:
            return self.constant
        return np.asarray(self.constant + self.window_s * np.tensordot(varpi, self.moving, axes=1))

    def gain(self, z: FloatArray, varpi: FloatArray, z_delayed: FloatArray) -> FloatArray:
        """K with ``u = K x`` from z now, the mean weights and z tau seconds ago."""
        window = [] if self.window_s is None else [varpi]
        F = self.vertices
        for own in (self.polytope.weights(z), *window, self.polytope.weights(z_delayed)):
            F = np.tensordot(own, F, axes=1)
        P = self.lyapunov(varpi)
        return np.asarray(F @ (on_state(P, self.order) if self.E is None else descriptor_right(self.E, P, z)))

    def in_old_units(self, units: Units) -> DelayedFeedback:
        """``P = T P^ T``, ``tau = c tau^``; F as in `DescriptorGain`, or ``S F^ T``."""
        T = units.T_differential
        if self.E is None:
            vertices, E = units.S[:, None] * self.vertices * T, None
        else:
            vertices, E = descriptor_vertices(self.vertices, units), old_descriptor(self.E, units)
        return replace(
            self,
            vertices=vertices,
            constant=T[:, None] * self.constant * T,
            moving=T[:, None] * self.moving * T / units.c,
            window_s=None if self.window_s is None else self.window_s * units.c,
            E=E,
        )


@dataclass(frozen=True, eq=False)
class MemorylessGain:
    """The law without memory that follows from one with: ``K(z) = K(z, varpi*, z)``, all mean weights varpi* equal."""

    delayed: DelayedFeedback

    @property
    def vertices(self) -> FloatArray:
        """Those of the law with memory."""
        return self.delayed.vertices

    def __call__(self, z: FloatArray) -> FloatArray:
        """K at a premise vector."""
        count = self.delayed.polytope.vertex_count
        return self.delayed.gain(z, np.full(count, 1.0 / count), z)

    def in_old_units(self, units: Units) -> MemorylessGain:
        """That of the law with memory."""
        return MemorylessGain(self.delayed.in_old_units(units))


def on_state(lyapunov: FloatArray, order: int) -> FloatArray:
    """``[P^-1 0]``, (q, n): what a gain on ``P^-1 x_d`` is multiplied with to act on x."""
    inverse = np.linalg.inv(lyapunov)
    return np.hstack([inverse, np.zeros((len(inverse), order - len(inverse)))])


def descriptor_right(E: AffineMatrix, lyapunov: FloatArray, z: FloatArray) -> FloatArray:
    """``E(z)^-T P^-1``, (n, n)."""
    return np.asarray(np.linalg.solve(E.evaluate(z).T, np.linalg.inv(lyapunov)))


def descriptor_vertices(vertices: FloatArray, units: Units) -> FloatArray:
    """``c S F^ D^-1``: ``K = S F^ E^^-T P^^-1 T^-1`` with ``E^^-T = c D^-1 E^-T T^-1``, ``P^^-1 = T P^-1 T``."""
    return np.asarray(units.c * units.S[:, None] * vertices / units.D)


def old_descriptor(E: AffineMatrix, units: Units) -> AffineMatrix:
    """``c D^-1 E^ T^-1``."""
    left, right = units.c / units.D[:, None], 1.0 / units.T
    return AffineMatrix(left * E.constant * right, left * E.coefficients * right)


def _at(z: FloatArray, places: tuple[int, ...] | None) -> FloatArray:
    return np.asarray(z) if places is None else np.asarray(z)[list(places)]
