"""A robot in space as an artifact ships it, in exact numbers: its chain, all true robots, and the design inertia.

The true robots are

    bodies   (1 - x) I_k <= I_k,t <= (1 + x) I_k,    rotors likewise with a tolerance of their own each,
    load     from nothing to the largest mass, its centre of mass in a box, its moment of inertia about it bounded.

Kinetic energy grows with each of these, and is convex in the centre of mass of the load: the empty robot at the lower
ends bounds all of them from below, the eight robots at the upper ends with the load at the corners of its box bound
them from above (each vertex on its own suffices for the convex combinations).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.chain import ChainForm, ChainJoint
from quasilpv.certificate.exact.matrices import identity, matrix, rational, stack, trace, zero
from quasilpv.certificate.reading import Shipped
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.payloads import Load, TreePayloads
from quasilpv.errors import InputError


@dataclass(frozen=True)
class TreeInertia:
    """Bodies and rotors of a chain.

    Attributes:
        bodies: 6 x 6 about the frames of their joints, n.
        rotors: n.
        gravity: in the axes of the base, three numbers.
    """

    bodies: tuple[fmpq_mat, ...]
    rotors: tuple[fmpq, ...]
    gravity: tuple[fmpq, ...]

    @classmethod
    def of(cls, tree: Tree) -> TreeInertia:
        """From its document."""
        return cls(
            tuple(
                body_matrix(rational(j.mass_kg), column(j.first_moment_kg_m), matrix(j.rotational_kg_m2))
                for j in tree.chain
            ),
            tuple(rational(j.rotor_inertia_kg_m2) for j in tree.chain),
            tuple(rational(x) for x in tree.gravity_m_s2),
        )


@dataclass(frozen=True)
class TreeData:
    """What the gate of a robot in space works on.

    Attributes:
        joints: of the chain, with the operating domain as limits.
        nominal: the robot without load.
        design: the inertia of the law.
        link_tolerance: x.
        rotor_tolerance: of each joint.
        corners: the largest load at the corners of its box, 6 x 6 about the last joint's frame; zero for no load.
        load: as the artifact states it, or None.
    """

    joints: tuple[ChainJoint, ...]
    nominal: TreeInertia
    design: TreeInertia
    link_tolerance: fmpq
    rotor_tolerance: tuple[fmpq, ...]
    corners: tuple[fmpq_mat, ...]
    load: Load | None

    @classmethod
    def of(cls, shipped: Shipped[Any]) -> TreeData:
        """From an artifact.

        Raises:
            InputError: its robot is none in space, its law has another design inertia than a tree, or one that moves
                otherwise than the robot.
        """
        robot, inertia, payloads, source = shipped.mechanism, shipped.law.inertia, shipped.payloads, shipped.source
        if not isinstance(robot, Tree) or not isinstance(payloads, TreePayloads):
            raise InputError(source, "robot.parameters.kind", robot.kind, "tree here")
        if not isinstance(inertia, Tree):
            raise InputError(source, "law.inertia", "a table", "a tree, as the robot is one")
        for field in ("kind", "rotation", "translation_m", "axis"):
            for k, (own, design) in enumerate(zip(robot.chain, inertia.chain, strict=True)):
                if getattr(own, field) != getattr(design, field):
                    got, expected = getattr(design, field), f"{getattr(own, field)}, that of the robot"
                    raise InputError(source, f"law.inertia.joints[{k}].{field}", got, expected)
        return cls(
            joints=chain_of(robot, shipped.artifact.domain.angle_rad),
            nominal=_apparent(TreeInertia.of(robot), payloads.torque_gain),
            design=TreeInertia.of(inertia),
            link_tolerance=rational(payloads.link_tolerance),
            rotor_tolerance=tuple(rational(x) for x in payloads.rotor_tolerance),
            corners=(zero(6, 6),) if payloads.load is None else _corners(payloads.load),
            load=payloads.load,
        )

    def form_below(self, bound: fmpq) -> ChainForm:
        """``M_t - bound M_n`` for the lightest robot."""
        low = 1 - self.link_tolerance
        bodies = [[own * low - d * bound] for own, d in zip(self.nominal.bodies, self.design.bodies, strict=True)]
        return ChainForm(bodies, self._rotors(-1, bound, 1))

    def form_above(self, bound: fmpq) -> ChainForm:
        """``bound M_n - M_t`` for the heaviest robots."""
        high = 1 + self.link_tolerance
        bodies = [[d * bound - own * high] for own, d in zip(self.nominal.bodies, self.design.bodies, strict=True)]
        bodies[-1] = [bodies[-1][0] - corner for corner in self.corners]
        return ChainForm(bodies, self._rotors(1, bound, -1))

    def _rotors(self, tolerance: int, bound: fmpq, sign: int) -> list[fmpq]:
        return [
            (own * (1 + tolerance * x) - bound * design) * sign
            for own, x, design in zip(self.nominal.rotors, self.rotor_tolerance, self.design.rotors, strict=True)
        ]


def _apparent(robot: TreeInertia, torque_gain: float | None) -> TreeInertia:
    """What links feel: of the rotors what drives leave that control the torques in the joints."""
    if torque_gain is None:
        return robot
    return replace(robot, rotors=tuple(rotor / rational(torque_gain) for rotor in robot.rotors))


def central_load(load: Load, share: fmpq) -> fmpq_mat:
    """A share of the largest load in the middle of its box, 6 x 6 about the last joint's frame."""
    middle = [(rational(low) + rational(high)) / 2 for low, high in load.com_box_m]
    return _placed(load, middle) * share


def body_matrix(mass: fmpq, first_moment: fmpq_mat, rotational: fmpq_mat) -> fmpq_mat:
    """Inertia of a body, 6 x 6, for twists (linear; angular)."""
    H = cross(first_moment)
    return stack([[identity(3) * mass, H * fmpq(-1)], [H, rotational]])


def column(values: Sequence[Any]) -> fmpq_mat:
    """A vector of three."""
    return matrix([[x] for x in values])


def cross(vector: fmpq_mat) -> fmpq_mat:
    """``[a]`` with ``[a] b = a x b``."""
    x, y, z = vector.entries()
    return matrix([[fmpq(0), -z, y], [z, fmpq(0), -x], [-y, x, fmpq(0)]])


def chain_of(tree: Tree, angle_rad: Sequence[Sequence[float]]) -> tuple[ChainJoint, ...]:
    """The joints of a robot, with these intervals as limits."""
    return tuple(
        ChainJoint(
            turns=joint.turns,
            rotation=joint.rotation,
            translation=joint.translation_m,
            axis=joint.axis,
            lower=float(low),
            upper=float(high),
        )
        for joint, (low, high) in zip(tree.chain, angle_rad, strict=True)
    )


def _corners(load: Load) -> tuple[fmpq_mat, ...]:
    places = dict.fromkeys(product(*load.com_box_m))
    return tuple(_placed(load, [rational(x) for x in place]) for place in places)


def _placed(load: Load, com: Sequence[fmpq]) -> fmpq_mat:
    """The largest load with its centre of mass at a place of the load's frame."""
    m, R = rational(load.mass_kg), matrix(load.rotation)
    at = R * column(com) + column(load.translation_m)
    moments = [rational(x) for x in load.inertia_kg_m2]
    about_com = R * matrix([[moments[i] if i == j else fmpq(0) for j in range(3)] for i in range(3)]) * R.transpose()
    steiner = (identity(3) * trace(at.transpose() * at) - at * at.transpose()) * m
    return body_matrix(m, at * m, about_com + steiner)
