"""The document of a run of a general system: what `qlpv-simulator` runs (``docs/reference/formats.md``)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from quasilpv.documents.canonical import MAX_SAFE_INTEGER, Document, normalise, require_bounded
from quasilpv.documents.strict_model import NonNegative, Number, StrictModel, validate
from quasilpv.documents.system_artifact import Signal, SystemArtifactDocument
from quasilpv.errors import InputError, one_of
from quasilpv.files import write_readable_json
from quasilpv.scenarios.schema import NOISE_SEED, TAGS, IdaIntegrator, Rk4Integrator

SCHEMA = "quasilpv.system_scenario"
MOST_SAMPLES = 10_000_000

Sizes = dict[str, NonNegative]
Values = dict[str, Number]


class SystemSensors(StrictModel):
    """Per state: the standard deviation of white noise, and the step to which the sum is rounded; 0: none."""

    noise: Sizes
    quantum: Sizes
    seed: int = Field(default=NOISE_SEED, ge=0, le=MAX_SAFE_INTEGER)


class _Acting(StrictModel):
    """Of a disturbance: what it is added to, an input or the rate of a differential state, and while it acts."""

    signal: str
    begin_s: NonNegative = 0.0
    end_s: NonNegative | None = None


class ConstantDisturbance(_Acting):
    """A constant, with a beginning a step."""

    kind: Literal["constant"] = "constant"
    value: Number


class SineDisturbance(_Acting):
    """``amplitude * sin(frequency_rad_s * t + phase_rad)``."""

    kind: Literal["sine"] = "sine"
    amplitude: Number
    frequency_rad_s: Number
    phase_rad: Number = 0.0


class NoiseDisturbance(_Acting):
    """White Gaussian noise of this standard deviation, held over every sample."""

    kind: Literal["noise"] = "noise"
    deviation: NonNegative
    seed: int = Field(default=NOISE_SEED, ge=0, le=MAX_SAFE_INTEGER)


SystemDisturbance = Annotated[ConstantDisturbance | SineDisturbance | NoiseDisturbance, Field(discriminator="kind")]
KINDS = ("constant", "sine", "noise")
MOST_TERMS = 1000


class SystemScenario(StrictModel):
    """One run of a general system: every state, parameter and sensor by name, signals with their trim."""

    schema_: Literal["quasilpv.system_scenario"] = Field(alias="schema", default="quasilpv.system_scenario")
    schema_version: Literal[1] = 1
    name: Annotated[str, Field(min_length=1)]
    samples: int = Field(ge=1, le=MOST_SAMPLES)
    start: Values
    parameters: Values
    integrator: Annotated[IdaIntegrator | Rk4Integrator, Field(discriminator="kind")]
    delay_s: NonNegative
    sensors: SystemSensors
    disturbances: Annotated[tuple[SystemDisturbance, ...], Field(max_length=MOST_TERMS)] = ()

    @property
    def has_exact_sensors(self) -> bool:
        """Whether the law is told the states as they are."""
        return not any((*self.sensors.noise.values(), *self.sensors.quantum.values()))

    @property
    def is_nominal(self) -> bool:
        """Whether it is what proofs are of: exact sensors and no disturbance."""
        return self.has_exact_sensors and not self.disturbances

    def to_document(self) -> Document:
        """Return the scenario as a normalised JSON tree; one without disturbances as before there were any."""
        document: Document = normalise(self.model_dump(mode="json", by_alias=True), self.name)
        if not self.disturbances:
            del document["disturbances"]
        return document

    @classmethod
    def from_document(cls, document: Mapping[str, object], source: str = "scenario") -> SystemScenario:
        """Return the scenario of a JSON tree. InputError: a rule of the format is broken."""
        require_bounded(document, source)
        return validate(cls, document, source, tags=(*TAGS, *KINDS))

    def require_names_of(self, artifact: SystemArtifactDocument, source: str) -> SystemScenario:
        """The scenario, if it is one of this system. InputError: names of signals differ."""
        for field, values, signals in (
            ("start", self.start, artifact.states),
            ("parameters", self.parameters, artifact.parameters),
            ("sensors.noise", self.sensors.noise, artifact.states),
            ("sensors.quantum", self.sensors.quantum, artifact.states),
        ):
            names = [signal.name for signal in signals]
            if sorted(values) != sorted(names):
                raise InputError(source, field, ", ".join(values) or "nothing", ", ".join(names) or "nothing")
        disturbed = disturbed_signals(artifact)
        for i, term in enumerate(self.disturbances):
            if term.signal not in disturbed:
                expected = one_of(disturbed, term.signal)
                raise InputError(source, f"disturbances[{i}].signal", term.signal, expected)
        return self


def disturbed_signals(artifact: SystemArtifactDocument) -> list[str]:
    """The names of what a disturbance can be added to: inputs, and states by their rate."""
    return [signal.name for signal in (*artifact.states[: artifact.model.differential], *artifact.inputs)]


def write_system_scenario(path: Path, scenario: SystemScenario) -> Path:
    """Write a scenario file, indented for people. InputError: it cannot be written."""
    write_readable_json(path, scenario.to_document())
    return path


def values_by_name(
    signals: tuple[Signal, ...], given: Mapping[str, float], otherwise: list[float], source: str, field: str
) -> Values:
    """A value for every signal, as given or otherwise.

    Raises:
        InputError: a name is of no signal.
    """
    names = [signal.name for signal in signals]
    for name in given:
        if name not in names:
            raise InputError(source, field, name, one_of(names, name) if names else "nothing: it has none")
    return {name: float(given.get(name, value)) for name, value in zip(names, otherwise, strict=True)}
