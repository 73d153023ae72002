"""The true plants of scenarios: mechanisms with a label and with what only a simulation needs."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from quasilpv.documents.mechanism import FiveBarLinks, MechanismDocument, Row, Rows, SerialLinks, SpringDisc, TreeJoint
from quasilpv.documents.payloads import TreePayloads
from quasilpv.documents.programs import MAX_JOINTS
from quasilpv.documents.strict_model import FieldError, NonNegative, Positive, StrictModel


class _Labelled(StrictModel):
    """What every plant has."""

    label: str


class SerialArmPlant(SerialLinks, _Labelled):
    """A planar serial arm that hangs at theta = 0."""


class FiveBarPlant(FiveBarLinks, _Labelled):
    """A planar five-bar, assembled with its tool on the far side of the elbows.

    Attributes:
        spring_nm_rad: stiffness of the torsion springs on the motor axis, relaxed at ``spring_rest_rad``.
        formulation: ``index1``, or ``ggl`` for the stabilised index-2 form.
        baumgarte_per_s: rate at which constraint errors decay in the form of index 1.
    """

    spring_nm_rad: NonNegative = 0.0
    spring_rest_rad: tuple[float, float] = (0.0, 0.0)
    formulation: Literal["index1", "ggl"] = "index1"
    baumgarte_per_s: NonNegative = 50.0


class SpringDiscPlant(SpringDisc, _Labelled):
    """A rolling disc with a moment of inertia of its own: 1/J_delta = 1/J + delta / r^2."""

    inertia_uncertainty_per_kg: NonNegative


class StickSlip(StrictModel):
    """How a joint sticks at rest and slips; the equations are with `JointFriction` of the simulator.

    Attributes:
        breakaway_nm: torque up to which it sticks, at least the Coulomb friction, at which it slides.
        stribeck_speed_rad_s: speed at which friction has fallen from there to Coulomb's by 1 - 1/e.
        presliding_rad: how far the joint gives before it breaks away.
        presliding_damping_nm_s: damping of that.
    """

    breakaway_nm: Positive
    stribeck_speed_rad_s: Positive
    presliding_rad: Positive
    presliding_damping_nm_s: NonNegative


class RubbingJoint(TreeJoint):
    """A joint with friction.

    Attributes:
        coulomb_speed_rad_s: speed w0 in the friction torque ``viscous w + coulomb tanh(w / w0)``.
        stick_slip: in the place of that smoothed Coulomb friction; None: smoothed.
    """

    friction_viscous_nm_s: NonNegative
    friction_coulomb_nm: NonNegative
    coulomb_speed_rad_s: Positive
    stick_slip: StickSlip | None = None

    @model_validator(mode="after")
    def _check_stick_slip(self) -> Self:
        if self.stick_slip is None:
            return self
        if self.friction_coulomb_nm == 0.0:
            raise FieldError("friction_coulomb_nm", 0, "more than 0 with stick_slip")
        if self.stick_slip.breakaway_nm < self.friction_coulomb_nm:
            raise FieldError("stick_slip.breakaway_nm", self.stick_slip.breakaway_nm, "at least friction_coulomb_nm")
        return self


class ToolFrame(StrictModel):
    """Where a robot in space has its tool, in the frame of its last joint: rows of the rotation, and the place."""

    rotation: Rows
    translation_m: Row


class TreePlant(MechanismDocument, _Labelled):
    """A robot in space, its payload merged into its last body; gravity in the axes of the base.

    Attributes:
        lag_s: time constant with which the drives follow their commands, the same for all joints.
        tool: for errors and figures; None (not in files of old): the last joint.
    """

    PAYLOADS = TreePayloads

    kind: Literal["tree"] = "tree"
    gravity_m_s2: Row
    lag_s: NonNegative = 0.0
    # Whether rotations are rotations and bodies have positive energy, the simulator decides.
    chain: Annotated[tuple[RubbingJoint, ...], Field(min_length=1, max_length=MAX_JOINTS, alias="joints")]
    tool: ToolFrame | None = None

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return len(self.chain)


class ElasticJoint(RubbingJoint):
    """A joint whose gear gives: spring and damper between motor and link; friction is the motor's.

    Attributes:
        stiffness_nm_rad, damping_nm_s: of the gear.
        rotor_inertia_kg_m2: of the motor, reflected to the joint.
        torque_noise_nm: standard deviation of what the torque sensor adds in every sample.
        torque_quantum_nm: the sensor says multiples of this; 0: of nothing.
    """

    rotor_inertia_kg_m2: Positive
    stiffness_nm_rad: Positive
    damping_nm_s: NonNegative
    torque_noise_nm: NonNegative = 0.0
    torque_quantum_nm: NonNegative = 0.0


class TorqueLoop(StrictModel):
    """Drives that control the torque in their joints: see `TorqueLoop` of the simulator.

    Attributes:
        gain: by which the rotor that the link feels is smaller than the motor's; 1: no loop.
        lag_s: time constant with which the motor's torque follows; 0: an ideal drive.
    """

    gain: Annotated[float, Field(ge=1)]
    lag_s: NonNegative


class ElasticTreePlant(MechanismDocument, _Labelled):
    """A robot in space with elastic joints: motors and links move on their own.

    Attributes:
        encoder_side: what the encoders sit on; of both, the angle of a reading is the motor's.
        torque_sensor: whether the torque in the joints is measured.
        torque_loop: of all drives; None: their torques are their commands.
        tool: as of a `TreePlant`.
    """

    PAYLOADS = TreePayloads

    kind: Literal["elastic-tree"] = "elastic-tree"
    gravity_m_s2: Row
    encoder_side: Literal["motor", "link", "both"]
    torque_sensor: bool = False
    torque_loop: TorqueLoop | None = None
    chain: Annotated[tuple[ElasticJoint, ...], Field(min_length=1, max_length=MAX_JOINTS, alias="joints")]
    tool: ToolFrame | None = None

    @model_validator(mode="after")
    def _check_torque_sensors(self) -> Self:
        for k, joint in enumerate(self.chain):
            for name in ("torque_noise_nm", "torque_quantum_nm"):
                if getattr(joint, name) > 0.0 and not self.torque_sensor:
                    raise FieldError(f"joints[{k}].{name}", getattr(joint, name), "0 without torque_sensor")
        return self

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return len(self.chain)


Plant: TypeAlias = Annotated[
    SerialArmPlant | FiveBarPlant | SpringDiscPlant | TreePlant | ElasticTreePlant, Field(discriminator="kind")
]
"""Any robot a scenario can move."""
