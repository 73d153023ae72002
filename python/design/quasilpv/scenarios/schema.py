"""The documents of a scenario: what the simulator runs, true plant included (``docs/reference/formats.md``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from quasilpv.defaults import ENCODER_BITS
from quasilpv.documents.canonical import (
    MAX_SAFE_INTEGER,
    Document,
    member_path,
    normalise,
    parse_strict_json,
    require_bounded,
)
from quasilpv.documents.mechanism import MECHANISM_KINDS
from quasilpv.documents.plants import Plant, TreePlant
from quasilpv.documents.strict_model import LARGEST_NUMBER, FieldError, NonNegative, Positive, StrictModel, validate
from quasilpv.errors import InputError
from quasilpv.files import read_bytes, write_readable_json

Tolerance = Annotated[float, Field(ge=1.0 / LARGEST_NUMBER, le=0.1)]
Duration = Annotated[float, Field(ge=1.0 / LARGEST_NUMBER, le=86400)]
Delay = Annotated[float, Field(ge=0, le=10)]
Vector = tuple[float, ...]

NOISE_SEED = 20220315
"""Seed of the speed noise in every scenario of the registry: fixed, so that two runs see the same noise."""

VELOCITY_NOISE_RAD_S = 0.05


class IdaIntegrator(StrictModel):
    """SUNDIALS IDA (variable-order BDF) with its error tolerances."""

    kind: Literal["ida"] = "ida"
    relative_tolerance: Tolerance = 1e-8
    absolute_tolerance: Tolerance = 1e-10


class Rk4Integrator(StrictModel):
    """The classical Runge-Kutta method with equal steps."""

    kind: Literal["rk4"] = "rk4"
    steps_per_sample: int = Field(default=4, ge=1, le=1_000_000)


class MujocoIntegrator(StrictModel):
    """MuJoCo instead of the equations of this project, for robots in space: its Runge-Kutta method with equal steps.

    It runs in the process of `quasilpv.experiments.track`; the executables refuse it.
    """

    kind: Literal["mujoco"] = "mujoco"
    steps_per_sample: int = Field(default=4, ge=1, le=1_000_000)


class SineTorque(StrictModel):
    """One term ``amplitude_nm * sin(frequency_rad_s * t + phase_rad)`` on one joint."""

    joint: int = Field(ge=0)
    amplitude_nm: float
    frequency_rad_s: float
    phase_rad: float = 0.0


class Sensors(StrictModel):
    """Encoder resolution (0 bits: exact), standard deviation of the speed noise, its seed, and the filter behind it.

    Attributes:
        link_encoder_bits: of encoders on the links, where motors have encoders too; None: as the others.
    """

    encoder_bits: int = Field(default=ENCODER_BITS, ge=0, le=32)
    velocity_noise_rad_s: NonNegative = VELOCITY_NOISE_RAD_S
    seed: int = Field(default=NOISE_SEED, ge=0, le=MAX_SAFE_INTEGER)
    velocity_filter_time_constant_s: NonNegative = 0.0
    link_encoder_bits: int | None = Field(default=None, ge=0, le=32)


class InitialState(StrictModel):
    """Joint angles and speeds of the plant at t = 0."""

    angle_rad: Vector
    speed_rad_s: Vector


Integrator = Annotated[IdaIntegrator | Rk4Integrator | MujocoIntegrator, Field(discriminator="kind")]

TAGS = (*MECHANISM_KINDS, "ida", "rk4", "mujoco")
"""The kinds that tell the cases of a union apart."""


OPTIONAL: Mapping[str, object] = {
    "torque_limit_nm": None,
    "sensors.velocity_filter_time_constant_s": 0.0,
    "sensors.link_encoder_bits": None,
    "plant.lag_s": 0.0,
    "plant.torque_sensor": False,
    "plant.torque_loop": None,
    "plant.tool": None,
}
"""Members a scenario file may leave out, as files written before they were there do; and what that says."""

OPTIONAL_OF_JOINTS: Mapping[str, object] = {"stick_slip": None, "torque_noise_nm": 0.0, "torque_quantum_nm": 0.0}
"""The same of each joint of a plant."""


def sine_torques(*terms: tuple[float, float]) -> tuple[SineTorque, ...]:
    """External torques of one sine per joint, (amplitude in N m, frequency in rad/s) each."""
    return tuple(
        SineTorque(joint=joint, amplitude_nm=amplitude, frequency_rad_s=frequency)
        for joint, (amplitude, frequency) in enumerate(terms)
    )


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
        if isinstance(self.integrator, MujocoIntegrator) and not isinstance(self.plant, TreePlant):
            raise FieldError("integrator.kind", "mujoco", f"ida or rk4 with a plant of kind {self.plant.kind}")
        if isinstance(self.integrator, MujocoIntegrator) and isinstance(self.plant, TreePlant):
            if self.plant.lag_s:
                raise FieldError("integrator.kind", "mujoco", "ida or rk4 with drives that lag")
            if any(joint.stick_slip is not None for joint in self.plant.chain):
                raise FieldError("integrator.kind", "mujoco", "ida or rk4 with joints that stick")
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
        for path, unsaid in OPTIONAL.items():
            *place, name = path.split(".")
            holder = document[place[0]] if place else document
            if name in holder and holder[name] == unsaid:
                del holder[name]
        for joint in document["plant"].get("joints", ()):
            for name, unsaid in OPTIONAL_OF_JOINTS.items():
                if name in joint and joint[name] == unsaid:
                    del joint[name]
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
