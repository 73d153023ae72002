"""What a robot is, as a document: one union tagged by ``kind``, shared by artifacts, scenarios and the checker.

A mechanism says what its controller is designed for; the plant of a scenario (`quasilpv.documents.plants`) is the same
mechanism with what only a simulation needs. SI units; index 0 is the joint next to the base.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from quasilpv.documents.payloads import DiscPayloads, LinkPayloads, PayloadsDocument, TreePayloads
from quasilpv.documents.programs import MAX_JOINTS
from quasilpv.documents.strict_model import FieldError, NonNegative, Positive, StrictModel

ROTATION_TOLERANCE = 1e-9
"""How far ``R R'`` may be from the identity, and the length of an axis from 1."""

ENERGY_TOLERANCE = 1e-12
"""How negative a body's smallest eigenvalue may be, relative to its largest."""

Row: TypeAlias = tuple[float, float, float]
Rows: TypeAlias = tuple[Row, Row, Row]


class MechanismDocument(StrictModel):
    """What every kind has: its tag, its number of joints, and the form of its payload set."""

    PAYLOADS: ClassVar[type[PayloadsDocument]]
    """How an artifact says which plants a design with this mechanism was gated for."""

    kind: str

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        raise TypeError(f"{type(self).__name__} does not say how many joints it has")


class LinkParameters(StrictModel):
    """One link; the moment of inertia is about its joint axis."""

    length_m: Positive
    mass_kg: Positive
    com_m: float
    inertia_kg_m2: Positive
    friction_nm_s: NonNegative

    @model_validator(mode="after")
    def _check_inertia(self) -> Self:
        least = self.mass_kg * self.com_m**2
        if self.inertia_kg_m2 < least * (1.0 - 1e-12):
            expected = f"at least mass_kg * com_m^2 = {least:.6g}, being about the joint axis"
            raise FieldError("inertia_kg_m2", self.inertia_kg_m2, expected)
        return self


class SerialLinks(MechanismDocument):
    """A planar serial arm: relative angles, gravity in its plane."""

    PAYLOADS = LinkPayloads

    kind: Literal["serial-arm"] = "serial-arm"
    gravity_m_s2: float
    links: Annotated[tuple[LinkParameters, ...], Field(min_length=1, max_length=MAX_JOINTS)]

    @property
    def joints(self) -> int:
        """One per link."""
        return len(self.links)


class SerialArm(SerialLinks):
    """A planar serial arm whose angles count from where it hangs or from where it stands upright."""

    equilibrium: Literal["hanging", "upright"]


class FiveBarLinks(MechanismDocument):
    """A planar five-bar: two equal legs, each an active link on the motor axis and a passive one to the tool.

    Attributes:
        active: link that a motor drives; its friction is that of the motor axis.
        passive: link from the elbow to the tool; its friction is that of the elbow.
    """

    PAYLOADS = LinkPayloads

    kind: Literal["five-bar"] = "five-bar"
    gravity_m_s2: float
    active: LinkParameters
    passive: LinkParameters

    @property
    def joints(self) -> int:
        """The two motors."""
        return 2


class FiveBar(FiveBarLinks):
    """A planar five-bar in one of its two assemblies: ``+`` has the tool on the far side of the elbows."""

    assembly: Literal["+", "-"]


class SpringDisc(MechanismDocument):
    """A disc that rolls without slipping, held by a damper and a hardening spring; its joint is its own rotation."""

    PAYLOADS = DiscPayloads

    kind: Literal["spring-disc"] = "spring-disc"
    mass_kg: Positive
    radius_m: Positive
    inertia_kg_m2: Positive
    stiffness_n_m: NonNegative
    cubic_stiffness_n_m3: NonNegative
    damping_n_s_m: NonNegative

    @property
    def joints(self) -> int:
        """The disc."""
        return 1


class TreeJoint(StrictModel):
    """One joint of a robot in space and the body it carries; the inertia is about the joint's frame.

    Attributes:
        rotation, translation_m: of the joint's frame at coordinate 0 in the frame before; rows of the rotation.
        axis: unit vector in the joint's frame.
        mass_kg, first_moment_kg_m, rotational_kg_m2: the body's ten parameters.
        rotor_inertia_kg_m2: reflected to the joint.
    """

    name: str
    kind: Literal["revolute", "continuous", "prismatic"]
    rotation: Rows
    translation_m: Row
    axis: Row
    mass_kg: NonNegative
    first_moment_kg_m: Row
    rotational_kg_m2: Rows
    rotor_inertia_kg_m2: NonNegative

    @property
    def turns(self) -> bool:
        """Whether the joint is a rotation."""
        return self.kind != "prismatic"

    def check(self) -> None:
        """Raise ``FieldError`` unless the frame is a frame and the body a body, as the run-time side asks it."""
        R = np.array(self.rotation)
        if np.linalg.norm(R @ R.T - np.eye(3)) > ROTATION_TOLERANCE or np.linalg.det(R) < 0.0:
            raise FieldError("rotation", "a matrix that is none", "a rotation")
        length = float(np.linalg.norm(self.axis))
        if abs(length - 1.0) > ROTATION_TOLERANCE:
            raise FieldError("axis", f"a vector of length {length:.6g}", "a unit vector")
        rotational = np.array(self.rotational_kg_m2)
        if not np.array_equal(rotational, rotational.T):
            raise FieldError("rotational_kg_m2", "a matrix that is not symmetric", "a symmetric matrix")
        x, y, z = self.first_moment_kg_m
        H = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        eigenvalues = np.linalg.eigvalsh(np.block([[self.mass_kg * np.eye(3), -H], [H, rotational]]))
        if eigenvalues[0] < -ENERGY_TOLERANCE * abs(eigenvalues[-1]):
            raise FieldError(
                "rotational_kg_m2", "a body of negative kinetic energy", "the ten parameters of a rigid body"
            )


class Tree(MechanismDocument):
    """A robot in space: a serial chain of joints in relative coordinates, gravity in the axes of the base."""

    PAYLOADS = TreePayloads

    kind: Literal["tree"] = "tree"
    gravity_m_s2: Row
    chain: Annotated[tuple[TreeJoint, ...], Field(min_length=1, max_length=MAX_JOINTS, alias="joints")]

    @property
    def joints(self) -> int:
        """One per body."""
        return len(self.chain)

    @model_validator(mode="after")
    def _check_joints(self) -> Self:
        for k, joint in enumerate(self.chain):
            try:
                joint.check()
            except FieldError as error:
                raise FieldError(f"joints[{k}].{error.field}", error.got, error.expected) from error
        return self


Mechanism: TypeAlias = Annotated[SerialArm | FiveBar | SpringDisc | Tree, Field(discriminator="kind")]
"""Any robot an artifact can be for."""

MECHANISM_KINDS = ("serial-arm", "five-bar", "spring-disc", "tree")
"""The tags; names of cases, not of members, in paths of errors."""
