"""Scenarios: an experiment the simulator can run, true plant included (``docs/reference/formats.md``).

The registry holds the tracking experiments of Dehak (2022, III.3.3, IV.5.1 and IV.5.2): the tool of the 3-DoF arm
follows a square or three quarters of a circle while sinusoidal torques (III.53) act on the joints, that of the five-bar
robot a spiral under those of (IV.77), of which the print gives the second frequency as 5 t or 50 t; on the nominal
robot or with the payload of chapter IV. Encoders have 20 bits; the measured speed, which only the baseline laws read,
carries white noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from quasilpv.artifact.canonical import (
    MAX_SAFE_INTEGER,
    Document,
    member_path,
    normalise,
    parse_strict_json,
    require_bounded,
)
from quasilpv.artifact.programs import MAX_JOINTS
from quasilpv.artifact.strict_model import LARGEST_NUMBER, FieldError, NonNegative, Positive, StrictModel, validate
from quasilpv.defaults import ENCODER_BITS
from quasilpv.errors import InputError, one_of
from quasilpv.files import read_bytes, write_readable_json
from quasilpv.synthesis.actuator_demand import Motion
from quasilpv.systems.arm_parameters import OperatingDomain
from quasilpv.systems.registry import Robot
from quasilpv.trajectories import Trajectory, fivebar_spiral, rest, serial_circle, serial_square
from quasilpv.trajectories.planned import Kinematics

Tolerance = Annotated[float, Field(ge=1.0 / LARGEST_NUMBER, le=0.1)]
Duration = Annotated[float, Field(ge=1.0 / LARGEST_NUMBER, le=86400)]
Delay = Annotated[float, Field(ge=0, le=10)]
Vector = tuple[float, ...]

NOISE_SEED = 20220315
"""Seed of the speed noise in every scenario of the registry: fixed, so that two runs see the same noise."""

VELOCITY_NOISE_RAD_S = 0.05


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


class SerialArmPlant(StrictModel):
    """A planar serial arm that hangs at theta = 0."""

    kind: Literal["serial-arm"]
    label: str
    gravity_m_s2: float
    links: Annotated[tuple[LinkParameters, ...], Field(min_length=1, max_length=MAX_JOINTS)]

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return len(self.links)


class FiveBarPlant(StrictModel):
    """A planar five-bar: two equal legs, each an active link on the motor axis and a passive one to the tool.

    Attributes:
        active: link that a motor drives; its friction is that of the motor axis.
        passive: link from the elbow to the tool; its friction is that of the elbow.
        spring_nm_rad: stiffness of the torsion springs on the motor axis, relaxed at ``spring_rest_rad``.
        formulation: ``index1``, or ``ggl`` for the stabilised index-2 form.
        baumgarte_per_s: rate at which constraint errors decay in the form of index 1.
    """

    kind: Literal["five-bar"] = "five-bar"
    label: str
    gravity_m_s2: float
    active: LinkParameters
    passive: LinkParameters
    spring_nm_rad: NonNegative = 0.0
    spring_rest_rad: tuple[float, float] = (0.0, 0.0)
    formulation: Literal["index1", "ggl"] = "index1"
    baumgarte_per_s: NonNegative = 50.0

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return 2


class SpringDiscPlant(StrictModel):
    """A disc that rolls without slipping, held by a damper and a hardening spring; its joint is its own rotation."""

    kind: Literal["spring-disc"] = "spring-disc"
    label: str
    mass_kg: Positive
    radius_m: Positive
    inertia_kg_m2: Positive
    inertia_uncertainty_per_kg: NonNegative
    stiffness_n_m: NonNegative
    cubic_stiffness_n_m3: NonNegative
    damping_n_s_m: NonNegative

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return 1


Row = tuple[float, float, float]


class TreeJoint(StrictModel):
    """One joint of a robot in space and the body it carries; the inertia is about the joint's frame.

    Attributes:
        rotation, translation_m: of the joint's frame at coordinate 0 in the frame before; rows of the rotation.
        rotor_inertia_kg_m2: reflected to the joint.
        coulomb_speed_rad_s: speed w0 in the friction torque ``viscous w + coulomb tanh(w / w0)``.
    """

    name: str
    kind: Literal["revolute", "continuous", "prismatic"]
    rotation: tuple[Row, Row, Row]
    translation_m: Row
    axis: Row
    mass_kg: NonNegative
    first_moment_kg_m: Row
    rotational_kg_m2: tuple[Row, Row, Row]
    rotor_inertia_kg_m2: NonNegative
    friction_viscous_nm_s: NonNegative
    friction_coulomb_nm: NonNegative
    coulomb_speed_rad_s: Positive


class TreePlant(StrictModel):
    """A robot in space, its payload merged into its last body; gravity in the axes of the base."""

    kind: Literal["tree"] = "tree"
    label: str
    gravity_m_s2: Row
    # Whether rotations are rotations and bodies have positive energy, the simulator decides.
    chain: Annotated[tuple[TreeJoint, ...], Field(min_length=1, max_length=MAX_JOINTS, alias="joints")]

    @property
    def joints(self) -> int:
        """Actuated and measured joints."""
        return len(self.chain)


class IdaIntegrator(StrictModel):
    """SUNDIALS IDA (variable-order BDF) with its error tolerances."""

    kind: Literal["ida"] = "ida"
    relative_tolerance: Tolerance = 1e-8
    absolute_tolerance: Tolerance = 1e-10


class Rk4Integrator(StrictModel):
    """The classical Runge-Kutta method with equal steps."""

    kind: Literal["rk4"] = "rk4"
    steps_per_sample: int = Field(default=4, ge=1, le=1_000_000)


class SineTorque(StrictModel):
    """One term ``amplitude_nm * sin(frequency_rad_s * t + phase_rad)`` on one joint."""

    joint: int = Field(ge=0)
    amplitude_nm: float
    frequency_rad_s: float
    phase_rad: float = 0.0


class Sensors(StrictModel):
    """Encoder resolution (0 bits: exact), standard deviation of the speed noise, its seed, and the filter behind it."""

    encoder_bits: int = Field(default=ENCODER_BITS, ge=0, le=32)
    velocity_noise_rad_s: NonNegative = VELOCITY_NOISE_RAD_S
    seed: int = Field(default=NOISE_SEED, ge=0, le=MAX_SAFE_INTEGER)
    velocity_filter_time_constant_s: NonNegative = 0.0


class InitialState(StrictModel):
    """Joint angles and speeds of the plant at t = 0."""

    angle_rad: Vector
    speed_rad_s: Vector


Plant = Annotated[SerialArmPlant | FiveBarPlant | SpringDiscPlant | TreePlant, Field(discriminator="kind")]
Integrator = Annotated[IdaIntegrator | Rk4Integrator, Field(discriminator="kind")]

TAGS = ("serial-arm", "five-bar", "spring-disc", "tree", "ida", "rk4")
"""The kinds that tell the cases of a union apart."""


OPTIONAL = frozenset({"torque_limit_nm", "sensors.velocity_filter_time_constant_s"})
"""Members a scenario file may leave out, as files written before they were there do."""


def sine_torques(*terms: tuple[float, float]) -> tuple[SineTorque, ...]:
    """External torques of one sine per joint, (amplitude in N m, frequency in rad/s) each."""
    return tuple(
        SineTorque(joint=joint, amplitude_nm=amplitude, frequency_rad_s=frequency)
        for joint, (amplitude, frequency) in enumerate(terms)
    )


EXTERNAL_TORQUE = sine_torques((450.0, 15.0), (375.0, 15.0), (300.0, 15.0))
"""The disturbance of Dehak 2022 (III.53): joint torques, added to the control torque as they are."""


class Scenario(StrictModel):
    """One experiment, immutable and consistent."""

    schema_: Literal["quasilpv.scenario"] = Field(alias="schema")
    schema_version: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    duration_s: Duration
    plant: Plant
    integrator: Integrator
    external_torque: Annotated[tuple[SineTorque, ...], Field(max_length=1000)]
    sensors: Sensors
    transport_delay_s: Delay
    torque_limit_nm: tuple[Positive, ...] | None = None
    initial: InitialState

    def __repr__(self) -> str:
        """What is simulated, in a line; `to_document` has all of it."""
        return f"Scenario({self.name!r}, {self.plant.kind}, {self.plant.label!r}, {self.duration_s:g} s)"

    def __str__(self) -> str:
        """The same."""
        return repr(self)

    @model_validator(mode="after")
    def _check_joints(self) -> Self:
        joints = self.plant.joints
        if self.torque_limit_nm is not None and len(self.torque_limit_nm) != joints:
            raise FieldError("torque_limit_nm", f"{len(self.torque_limit_nm)} entries", str(joints))
        for field in ("angle_rad", "speed_rad_s"):
            if len(getattr(self.initial, field)) != joints:
                raise FieldError(f"initial.{field}", f"{len(getattr(self.initial, field))} entries", str(joints))
        for i, term in enumerate(self.external_torque):
            if term.joint >= joints:
                raise FieldError(f"external_torque[{i}].joint", term.joint, f"a joint index below {joints}")
        return self

    def to_document(self) -> Document:
        """Return the scenario as a normalised JSON tree; members of `OPTIONAL` that say nothing are left out."""
        document: Document = normalise(self.model_dump(mode="json", by_alias=True), self.name)
        if self.torque_limit_nm is None:
            del document["torque_limit_nm"]
        if not self.sensors.velocity_filter_time_constant_s:
            del document["sensors"]["velocity_filter_time_constant_s"]
        return document

    @classmethod
    def from_document(cls, document: Mapping[str, object], source: str = "scenario") -> Scenario:
        """Return the scenario of a JSON tree, in which all members but `OPTIONAL` are present, defaults too.

        Raises:
            InputError: a rule of the format is broken; the message names the field.
        """
        require_bounded(document, source)
        scenario = validate(cls, document, source, tags=TAGS)
        for path in _missing_members(document, scenario.to_document(), ""):
            raise InputError(source, path, "nothing", "this member")
        return scenario


def _missing_members(given: object, complete: object, path: str) -> Iterator[str]:
    if isinstance(given, Mapping) and isinstance(complete, Mapping):
        for key, member in complete.items():
            if key in given:
                yield from _missing_members(given[key], member, member_path(path, key))
            else:
                yield member_path(path, key)
    elif isinstance(given, Sequence) and isinstance(complete, list):
        for i, (item, whole) in enumerate(zip(given, complete, strict=True)):
            yield from _missing_members(item, whole, f"{path}[{i}]")


@dataclass(frozen=True)
class TrackingTask:
    """An entry of the registry: a robot by name and the reference it tracks.

    Attributes:
        id: its name.
        summary: one line for a listing.
        robot: id of a robot.
        trajectory: from the robot and its operating domain to the reference.
        external_torque: sines on the joints.
        initial_angle_rad: angles of the plant at t = 0; None to start on the reference.
        initial_speed_rad_s: its speeds then; None for rest. Only with angles.
    """

    id: str
    summary: str
    robot: str
    trajectory: Callable[[Kinematics, OperatingDomain | None], Trajectory]
    external_torque: tuple[SineTorque, ...] = ()
    initial_angle_rad: Vector | None = None
    initial_speed_rad_s: Vector | None = None


def _serial(name: str, summary: str, trajectory: Callable[..., Trajectory]) -> TrackingTask:
    """A path of the 3-DoF arm under (III.53)."""
    return TrackingTask(name, summary, "arm3", trajectory, EXTERNAL_TORQUE)


def _stabilisation(name: str, summary: str, robot_id: str, joints: int) -> TrackingTask:
    """From rest with the first joint at 22.5 degrees (Dehak 2022, fig. I.2), the reference being theta = 0 for 5 s."""
    start = (math.pi / 8.0,) + (0.0,) * (joints - 1)
    return TrackingTask(name, summary, robot_id, lambda _, __: rest(name, joints, 5.0), (), start)


def _spiral(name: str, disturbance: str, *terms: tuple[float, float]) -> TrackingTask:
    """The spiral of the five-bar robot under one reading of (IV.77), or a stronger disturbance."""
    summary = f"the five-bar robot draws a spiral in 5 s, disturbed by {disturbance}"
    return TrackingTask(name, summary, "fivebar", fivebar_spiral, sine_torques(*terms))


def tracking_tasks() -> tuple[TrackingTask, ...]:
    """Return all tracking experiments, in a fixed order."""
    return (
        _serial("serial-square", "the 3-DoF arm draws a square of 0.4 m in 3 s", serial_square),
        _serial("serial-circle", "the 3-DoF arm draws 3/4 of a circle of 0.2 m in 3 s", serial_circle),
        _spiral("fivebar-spiral", "15 N m at 50 and 5 rad/s", (15.0, 50.0), (15.0, 5.0)),
        _spiral("fivebar-spiral-fast", "15 N m at 50 rad/s on both joints", (15.0, 50.0), (15.0, 50.0)),
        _spiral("fivebar-spiral-strong", "100 N m at 50 rad/s on both joints", (100.0, 50.0), (100.0, 50.0)),
        _stabilisation("stabilise-arm2", "the hanging 2-DoF arm comes to rest from 22.5 degrees", "arm2", 2),
        _stabilisation("stabilise-arm2-upright", "the same around its upper equilibrium", "arm2-upright", 2),
        _stabilisation("stabilise-arm3", "the light 3-DoF arm comes to rest from 22.5 degrees", "arm3-light", 3),
        TrackingTask(
            "stabilise-spring-disc",
            "the disc comes to rest from x_1 = -5 m, x_2 = 10 m/s (Dehak 2022, fig. III.4)",
            "spring-disc",
            lambda _, __: rest("stabilise-spring-disc", 1, 10.0),
            (),
            initial_angle_rad=(-2.5,),
            initial_speed_rad_s=(5.0,),
        ),
    )


def tracking_task(name: str) -> TrackingTask:
    """Return the tracking experiment of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = {task.id: task for task in tracking_tasks()}
    if name not in known:
        raise InputError("scenarios", "scenario", name, one_of(known, name))
    return known[name]


def motions_of(robot: Robot, sample_period_s: float = 0.02) -> tuple[Motion, ...]:
    """What the registered experiments ask of a robot: their references and the peaks of their external torques."""
    motions = []
    for task in tracking_tasks():
        if task.robot != robot.id:
            continue
        trajectory = task.trajectory(robot.model, robot.domain)
        reference = trajectory.evaluate(np.arange(0.0, trajectory.duration_s, sample_period_s))
        peak, rate = np.zeros((2, robot.model.joints))
        for term in task.external_torque:
            peak[term.joint] += abs(term.amplitude_nm)
            rate[term.joint] += abs(term.amplitude_nm * term.frequency_rad_s)
        motions.append(
            Motion(task.id, reference.angle, reference.speed, reference.acceleration, peak, rate, sample_period_s)
        )
    return tuple(motions)


def build_scenario(
    robot: Robot,
    trajectory: Trajectory,
    *,
    plant: Literal["nominal", "perturbed"] = "perturbed",
    sensors: Sensors | None = None,
    integrator: IdaIntegrator | Rk4Integrator | None = None,
    external_torque: tuple[SineTorque, ...] = (),
    transport_delay_s: float = 0.0,
    initial_angle_rad: Vector | None = None,
    initial_speed_rad_s: Vector | None = None,
    torque_limit_nm: Vector | None = None,
) -> Scenario:
    """Return the experiment in which ``robot`` tracks ``trajectory``.

    Args:
        robot: what the controller was designed for.
        trajectory: the reference; gives the name, the duration and the state at t = 0.
        plant: the true plant, the nominal robot or the robot with its full payload (moments of inertia about the
            centres of mass unchanged).
        sensors: default ``Sensors()``.
        integrator: default ``IdaIntegrator()``.
        external_torque: sines on the joints; default: none.
        transport_delay_s: time from a sample to the moment its torque acts.
        initial_angle_rad: start at these angles; default: on the reference, moving with it.
        initial_speed_rad_s: start there with these speeds; default: at rest.
        torque_limit_nm: largest torques the actuators deliver, whatever is commanded; default: no limit.

    Raises:
        InputError: robot and trajectory do not fit, or a value is out of range.
    """
    if robot.model.joints != trajectory.joints:
        raise InputError(trajectory.name, "joints", trajectory.joints, f"{robot.model.joints}, as {robot.id} has")
    arm = robot.with_payload_fraction(1.0 if plant == "perturbed" else 0.0)
    start = trajectory.evaluate(0.0)
    initial = {"angle_rad": start.angle.tolist(), "speed_rad_s": start.speed.tolist()}
    if initial_angle_rad is not None:
        speed = initial_speed_rad_s or (0.0,) * robot.model.joints
        initial = {"angle_rad": list(initial_angle_rad), "speed_rad_s": list(speed)}
    document = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": trajectory.name,
        "duration_s": trajectory.duration_s,
        "plant": arm.plant_document(plant),
        "integrator": (integrator or IdaIntegrator()).model_dump(mode="json"),
        "external_torque": [term.model_dump(mode="json") for term in external_torque],
        "sensors": (sensors or Sensors()).model_dump(mode="json"),
        "transport_delay_s": transport_delay_s,
        "torque_limit_nm": None if torque_limit_nm is None else list(torque_limit_nm),
        "initial": initial,
    }
    return Scenario.from_document(document, trajectory.name)


def write_scenario(path: Path | str, scenario: Scenario) -> Path:
    """Write a scenario file, indented for people.

    Raises:
        InputError: the file cannot be written; nothing half-written is left behind.
    """
    path = Path(path)
    write_readable_json(path, scenario.to_document())
    return path


def read_scenario(path: Path | str) -> Scenario:
    """Read a scenario file.

    Raises:
        InputError: the file is missing, not strict JSON, or not a valid scenario.
    """
    source = str(path)
    return Scenario.from_document(parse_strict_json(read_bytes(path), source), source)
