"""What a description file says, whatever its format: all bodies and joints, before a chain is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError, one_of
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint

BASE = -1
"""Index of the body that does not move."""


@dataclass(frozen=True, eq=False)
class DescribedJoint:
    """A joint and the body behind it, in the file's words.

    Attributes:
        name: of the joint.
        body: name of the link or body it carries, for messages.
        parent: index of the joint before; `BASE` for none.
        kind: how it moves; None for a kind that no chain can have.
        written_kind: the file's word for it.
        placement, axis: as in `TreeJoint`.
        inertia: of the body and of what is fixed to it, about the joint's frame.
        lower, upper: limits, infinite where the file has none.
        speed, torque: largest ones, in rad/s and N m (m/s, N); None where the file says nothing or nothing usable.
        rotor_inertia_kg_m2: None where the file says nothing.
        damping_nm_s, friction_nm: None where the file says nothing; never used unless the user says so, because files
            keep there what a simulator's own actuators need.
        follows: name of the joint it copies (mimic), None for a joint of its own.
    """

    name: str
    body: str
    parent: int
    kind: JointKind | None
    written_kind: str
    placement: Placement
    axis: FloatArray
    inertia: SpatialInertia
    lower: float = -inf
    upper: float = inf
    speed: float | None = None
    torque: float | None = None
    rotor_inertia_kg_m2: float | None = None
    damping_nm_s: float | None = None
    friction_nm: float | None = None
    follows: str | None = None

    def motion(self, coordinate: float) -> Placement:
        """Placement of the body's frame in the frame of the joint before."""
        if self.kind is JointKind.PRISMATIC:
            return self.placement.then(Placement(np.eye(3), self.axis * coordinate))
        return self.placement.then(Placement.turned(self.axis, coordinate))


@dataclass(frozen=True, eq=False)
class DescribedTree:
    """A description.

    Attributes:
        source: the file, for messages.
        name: what the file calls the robot.
        joints: every joint after its parent.
        frames: for every link (or body, or site) the joint it moves with (`BASE` for none) and its placement there.
        gravity_m_s2: in the axes of the base.
    """

    source: str
    name: str
    joints: tuple[DescribedJoint, ...]
    frames: Mapping[str, tuple[int, Placement]]
    gravity_m_s2: FloatArray

    @property
    def tips(self) -> tuple[str, ...]:
        """Frames that a chain can end at, those of the last joints first named last in the file."""
        parents = {joint.parent for joint in self.joints}
        last = [k for k in range(len(self.joints)) if k not in parents]
        return tuple(name for name, (k, _) in self.frames.items() if k in last)

    def tip(self, name: str | None) -> str:
        """The frame a chain ends at.

        Args:
            name: as the user said; None if there is only one way to choose.

        Raises:
            InputError: there is no such frame, or none was named and the description has several branches.
        """
        if name is not None:
            if name not in self.frames:
                raise InputError(self.source, "tip_link", name, one_of(self.frames, name))
            return name
        moving = {self.frames[tip][0] for tip in self.tips}
        if len(moving) != 1:
            ends = ", ".join(self.tips[:12]) or "none"
            raise InputError(self.source, "tip_link", "nothing", f"the link to control, one of the ends: {ends}")
        return self.tips[-1]

    def moving(self, tip: str, locked: Mapping[str, float]) -> tuple[DescribedJoint, ...]:
        """The joints on the way from the base to a frame that are not held.

        Args:
            tip: a frame.
            locked: coordinates of joints that are held, by name.

        Raises:
            InputError: a locked joint does not exist, a joint copies another one, or is of a kind that no chain can
                have.
        """
        names = [joint.name for joint in self.joints]
        for name, value in locked.items():
            if name not in names:
                raise InputError(self.source, f"locked.{name}", name, one_of(names, name))
            if not isfinite(value):
                raise InputError(self.source, f"locked.{name}", value, "a finite number, rad or m")
        on_way = [self.joints[k] for k in self.way(tip) if self.joints[k].name not in locked]
        for joint in on_way:
            self._require_drivable(joint)
        return tuple(on_way)

    def way(self, tip: str) -> list[int]:
        """Indices of the joints from the base to a frame, in this order."""
        k, _ = self.frames[tip]
        way = []
        while k != BASE:
            way.append(k)
            k = self.joints[k].parent
        return way[::-1]

    def _require_drivable(self, joint: DescribedJoint) -> None:
        field_name = f"joint {joint.name}"
        if joint.follows is not None:
            expected = f"a joint of its own, or held: locked.{joint.name} = a coordinate"
            raise InputError(self.source, field_name, f"a copy of {joint.follows}", expected)
        if joint.kind is None:
            expected = "revolute, continuous or prismatic, or a chain that does not need it"
            raise InputError(self.source, field_name, f"a {joint.written_kind} joint", expected)

    def chain(
        self, tip: str, locked: Mapping[str, float], limits: Mapping[str, tuple[float, float]] | None = None
    ) -> KinematicTree:
        """The joints from the base to a frame, all other bodies merged into the ones that carry them.

        Args:
            tip: a frame.
            locked: coordinates of joints that are held, by name.
            limits: intervals of the coordinates that replace those of the file, by name.

        Returns:
            The chain; its rotor inertias are those of the file, 0 where it has none.

        Raises:
            InputError: a joint behind a moving body is neither on the way to the tip nor locked, limits are missing, or
                `moving` refuses a joint.
        """
        self.moving(tip, locked)
        return _ChainOf(self, tip, locked, limits or {}).chain()

    def places(
        self, tip: str, locked: Mapping[str, float], limits: Mapping[str, tuple[float, float]]
    ) -> dict[str, tuple[int, Placement]]:
        """For every frame the joint of the chain it moves with (`BASE` for none), and its placement there.

        Args:
            tip, locked, limits: as for `chain`.

        Raises:
            InputError: as for `chain`.
        """
        merged = _ChainOf(self, tip, locked, limits)
        merged.chain()
        moving = [k for k in range(len(self.joints)) if merged.carried_by[k] == k]
        found = {}
        for name, (k, place) in self.frames.items():
            carrier, where = (BASE, place) if k == BASE else (merged.carried_by[k], merged.inside[k].then(place))
            found[name] = (BASE if carrier == BASE else moving.index(carrier), where)
        return found


@dataclass
class _ChainOf:
    """Merging of bodies: where every body is in the frame of the moving body that carries it."""

    described: DescribedTree
    tip: str
    locked: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]
    carried_by: list[int] = field(default_factory=list)
    inside: list[Placement] = field(default_factory=list)

    def chain(self) -> KinematicTree:
        """The chain; see `DescribedTree.chain`."""
        joints = self.described.joints
        on_way = set(self.described.way(self.tip))
        inertias: dict[int, SpatialInertia] = {}
        for k, joint in enumerate(joints):
            below = (BASE, Placement.identity()) if joint.parent == BASE else self._of(joint.parent)
            if k in on_way and joint.name not in self.locked:
                self._put(k, Placement.identity())
                inertias[k] = joint.inertia
                continue
            carrier, where = below
            if carrier != BASE and joint.name not in self.locked:
                expected = f"on the way to {self.tip}, or held: locked.{joint.name} = a coordinate"
                raise InputError(self.described.source, f"joint {joint.name}", "a joint that moves aside", expected)
            place = where.then(joint.motion(self.locked.get(joint.name, 0.0)))
            self._put(carrier, place)
            if carrier != BASE:
                inertias[carrier] = inertias[carrier].plus(joint.inertia.seen_from(place))
        moving = [k for k in range(len(joints)) if self.carried_by[k] == k]
        return self._assembled(moving, inertias)

    def _of(self, k: int) -> tuple[int, Placement]:
        return self.carried_by[k], self.inside[k]

    def _put(self, carrier: int, place: Placement) -> None:
        self.carried_by.append(carrier)
        self.inside.append(place)

    def _assembled(self, moving: list[int], inertias: Mapping[int, SpatialInertia]) -> KinematicTree:
        chain = []
        for k in moving:
            joint = self.described.joints[k]
            lower, upper = self.limits.get(joint.name, (joint.lower, joint.upper))
            before = Placement.identity() if joint.parent == BASE else self.inside[joint.parent]
            assert joint.kind is not None
            chain.append(
                TreeJoint(
                    name=joint.name,
                    kind=joint.kind,
                    placement=before.then(joint.placement),
                    axis=joint.axis,
                    inertia=inertias[k],
                    rotor_inertia_kg_m2=joint.rotor_inertia_kg_m2 or 0.0,
                    lower=lower,
                    upper=upper,
                )
            )
        at, place = self.described.frames[self.tip]
        tool = self.inside[at].then(place) if at != BASE else place
        return KinematicTree(self.described.name, tuple(chain), tool, self.described.gravity_m_s2)
