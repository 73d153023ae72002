"""The needed range of a planar serial arm by one small inequality per joint, from the storages of its witness.

Branch and bound over postures doubles its work with every joint; a chain certificate (`exact.chain`) adds to it. The
arm is the chain of its links in a vertical plane of space, x to the right, z up, every axis along -y. A twist in the
plane stays in it, so what the form says of the other three directions does not matter: there it is the identity, and
storages are zero.

* True robots: mass, first moment and moment of inertia of a link are cubic in the payload fraction, so every robot is a
  convex combination of four, whose links are the Bernstein coefficients there. Each of these has storages of its own.
* The design inertia is the artifact's table, the arm's own times s up to rounding. With every entry of the difference,
  in absolute angles, at most e in the sum of its row, ``W' (M_n - s M) W`` lies within ``e |W|^2``, and W_k is the
  angular velocity of link k: the form pays for it from the link's moment of inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import comb

from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.certificate.exact.chain import ChainForm, ChainJoint, ChainProof, prove_chain
from quasilpv.certificate.exact.matrices import identity, magnitude, matrix, rational, zero
from quasilpv.certificate.reading import Rows, WitnessDocument
from quasilpv.certificate.robot.inertia import DesignInertia, InertiaData, design_inertia
from quasilpv.certificate.robot.range import InertiaPair, NeededRange, Side, extreme_place
from quasilpv.certificate.robot.serial_arm import SerialArmData
from quasilpv.errors import InputError

IN_PLANE = (0, 2, 4)
"""Velocity along x and z, angular velocity about y, of a twist (linear; angular)."""

DEGREE = 3
"""Of a link's parameters in the payload fraction."""


class PlanarSide(WitnessDocument):
    """A bound, and for each of the four robots what proves it: z_1 as a 1 x 1 matrix, then storages 3 x 3."""

    bound: float
    storages: tuple[tuple[Rows, ...], ...]


class PlanarBounds(WitnessDocument):
    """Both bounds of ``M_t / M_n``, and how long the design took for them."""

    lowest: PlanarSide
    highest: PlanarSide
    seconds_to_find: float | None = None


class PlanarWitness(WitnessDocument):
    """The part of a witness that is about the inertia of a planar arm."""

    chain: PlanarBounds | None = None


class PlanarChain:
    """A planar arm as a chain, exactly.

    Args:
        data: true and design inertia, as shipped.

    Raises:
        InputError: the robot is no serial arm.
    """

    def __init__(self, data: InertiaData) -> None:
        """Keep the data."""
        if not isinstance(data.mechanism, SerialArmData):
            raise InputError("artifact", "witness.chain", "storages", "none: the robot is no serial arm")
        self._data, self._arm = data, data.mechanism

    @cached_property
    def joints(self) -> tuple[ChainJoint, ...]:
        """One per link, at its end towards the base."""
        upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        lengths = [0.0, *(link.length_m for link in self._arm.document.links[:-1])]
        return tuple(
            ChainJoint(True, upright, [0.0, 0.0, -length], [0.0, -1.0, 0.0], lower, upper)
            for length, (lower, upper) in zip(lengths, self._data.angle_rad, strict=True)
        )

    def prove(self, side: Side, witness: PlanarSide) -> ChainProof:
        """Decide one side with the bound and the storages of its witness: the first proof that fails, or all cells.

        Raises:
            ValueError: the storages are not as many, or as large, as the chains need.
        """
        forms = self._forms(side, rational(witness.bound))
        if len(forms) != len(witness.storages):
            raise ValueError(f"{len(witness.storages)} chains of storages for {len(forms)} robots")
        cells = 0
        for form, shipped in zip(forms, witness.storages, strict=True):
            first, *others = (matrix(storage) for storage in shipped)
            proof = prove_chain(self.joints, form, [first, *(_in_space(storage) for storage in others)])
            if not proof.holds:
                return proof
            cells += proof.cells
        return ChainProof(True, cells)

    def _forms(self, side: Side, bound: fmpq) -> list[ChainForm]:
        """``bound M_n - M_t`` for a highest ratio, ``M_t - bound M_n`` for a lowest, less what rounding may take."""
        sign = fmpq(1 if side == "highest" else -1)
        taken = bound * self._rounding
        nominal = self._bodies([1.0] * self._data.joints, [1.0] * self._data.joints)
        loaded = self._bodies(self._data.mass_scale, self._data.com_scale)
        forms = []
        for true in loaded:
            bodies = []
            for design, body in zip(nominal[0], true, strict=True):
                form = (design * (bound * self._scale) - body) * sign
                form[2, 2] -= taken
                bodies.append([_in_space(form) + _across()])
            forms.append(ChainForm(bodies, [fmpq(0)] * self._data.joints))
        return forms

    def _bodies(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> list[list[fmpq_mat]]:
        """Robots by Bernstein coefficient in the payload fraction: of every link its inertia about its joint, 3 x 3."""
        links, _ = self._arm.loaded(mass_scale, com_scale)
        by_link = [
            [
                _body(*values)
                for values in zip(*map(_bernstein, (link.mass, link.first_moment, link.inertia)), strict=True)
            ]
            for link in links
        ]
        return [list(robot) for robot in zip(*by_link, strict=True)]

    @cached_property
    def _scale(self) -> fmpq:
        """s, from the first entry of both."""
        scale: fmpq = self._design.constant[0, 0] / self._nominal[0][0][0]
        return scale

    @cached_property
    def _rounding(self) -> fmpq:
        """e: the largest sum of a row of a bound on all entries of M_n - s M in absolute angles."""
        n, s, D = self._data.joints, self._scale, self._nominal
        own = zero(n, n)
        for k in range(n):
            own[k, k] = s * D[k][k][0]
        total = magnitude(self._design.constant - own) + self._design.rest
        for pair in self._data.pairs:
            i, j = pair
            own = zero(n, n)
            own[i, j] = own[j, i] = s * D[i][j][0]
            total += magnitude(self._design.slopes.get(pair, zero(n, n)) - own)
        return max((sum((total[i, j] for j in range(n)), fmpq(0)) for i in range(n)), default=fmpq(0))

    @cached_property
    def _design(self) -> DesignInertia:
        return design_inertia(self._data)

    @cached_property
    def _nominal(self) -> list[list[fmpq_poly]]:
        ones = [1.0] * self._data.joints
        return self._arm.inertia(ones, ones)


def planar_range(inertia: InertiaPair, witness: PlanarBounds) -> NeededRange | None:
    """Prove both bounds of the witness; None if one does not hold.

    Raises:
        InputError: the robot is no serial arm.
        ValueError: the storages are not as many, or as large, as the chain needs.
    """
    chain = PlanarChain(inertia.data)
    lowest, highest = chain.prove("lowest", witness.lowest), chain.prove("highest", witness.highest)
    if not (lowest.holds and highest.holds):
        return None
    low, high = extreme_place(inertia, "lowest"), extreme_place(inertia, "highest")
    bounds = rational(witness.lowest.bound), rational(witness.highest.bound)
    return NeededRange(*bounds, low, high, lowest.cells + highest.cells)


def _bernstein(polynomial: fmpq_poly) -> list[fmpq]:
    """Bernstein coefficients of degree `DEGREE` on [0, 1]."""
    return [
        sum((polynomial[i] * fmpq(comb(j, i), comb(DEGREE, i)) for i in range(j + 1)), fmpq(0))
        for j in range(DEGREE + 1)
    ]


def _body(mass: fmpq, first_moment: fmpq, inertia: fmpq) -> fmpq_mat:
    """Inertia of a link that hangs from its joint in the coordinates `IN_PLANE`: ``|v + W x c|^2`` and so on."""
    return matrix([[mass, 0, -first_moment], [0, mass, 0], [-first_moment, 0, inertia]])


def _in_space(planar: fmpq_mat) -> fmpq_mat:
    """A matrix of the plane among the six coordinates of space. ValueError: it is not 3 x 3."""
    if (planar.nrows(), planar.ncols()) != (3, 3):
        raise ValueError(f"a storage of a planar arm is 3 x 3, not {planar.nrows()} x {planar.ncols()}")
    space = zero(6, 6)
    for a, i in enumerate(IN_PLANE):
        for b, j in enumerate(IN_PLANE):
            space[i, j] = planar[a, b]
    return space


def _across() -> fmpq_mat:
    """The identity across the plane."""
    across = identity(6)
    for i in IN_PLANE:
        across[i, i] = fmpq(0)
    return across
