"""The artifact of a general system: a feedback, the region it is proved in, and the plant from the same equations.

``docs/reference/formats.md`` states the members. Signals are numbered: the states, differential ones first, the inputs,
the parameters, and in programs of the plant the rates of the states after them. Values are deviations from the trim.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from quasilpv.arrays import FloatArray
from quasilpv.documents.artifact import LONGEST_PERIOD_S, SHORTEST_PERIOD_S, Creator, Name, Sha256
from quasilpv.documents.canonical import Document
from quasilpv.documents.hashed import HashedDocument
from quasilpv.documents.programs import MAX_SIGNALS, Program
from quasilpv.documents.strict_model import FieldError, NonNegative, Number, Positive, StrictModel
from quasilpv.documents.tables import Matrix, PolytopeTable, Vector, require_lyapunov, require_shape, require_size

SCHEMA = "quasilpv.system_artifact"
SCHEMA_VERSION = 2
"""Of what is written; version 1 is read, too."""

PREMISE_FAULT_S = 1.0
"""For so long a premise may be outside its box where nothing else is said, as in version 1."""

MAX_STATES = 32
MAX_INPUTS = 7

DISTURBANCE, PERFORMANCE, L2_GAIN = "disturbance", "performance", "l2 gain"
"""Members of the witness of a design for an L2 gain: sizes of every state and input that count as 1, and the gain."""

BALANCE = "balance"
"""Factor of the sizes in the inequality of the gain."""

Rows = tuple[tuple[float, ...], ...]
Role = Literal["state", "input", "parameter"]


class Signal(StrictModel):
    """One named signal.

    ``low`` and ``high`` bound its deviation from ``trim``, null where nothing bounds it: of a state the domain, of an
    input its limits, of a parameter its interval. ``known`` is false for a parameter that the law is not told.
    """

    name: Name
    role: Role
    unit: str
    low: Number | None
    high: Number | None
    trim: Number
    known: bool

    @model_validator(mode="after")
    def _check_interval(self) -> Self:
        if self.low is not None and self.high is not None and not self.low <= self.high:
            raise FieldError("high", self.high, f"at least low = {self.low}")
        if self.role == "parameter" and (self.low is None or self.high is None):
            raise FieldError("low", "null", "an interval of the parameter")
        return self


class AffineDocument(StrictModel):
    """A matrix affine in the premises: ``X(z) = constant + sum_p z_p coefficients[p]``."""

    constant: Matrix
    coefficients: tuple[Matrix, ...]

    def require(self, field: str, premises: int, rows: int, columns: int) -> None:
        """Raise ``FieldError`` unless it has these sizes."""
        require_size(f"{field}.coefficients", self.coefficients, premises)
        for name, matrix in (
            ("constant", self.constant),
            *((f"coefficients[{i}]", m) for i, m in enumerate(self.coefficients)),
        ):
            require_shape(f"{field}.{name}", matrix, rows, columns)

    def evaluate(self, z: FloatArray) -> FloatArray:
        """X at premise vectors z, (p,) or (p, samples): (rows, columns) or (samples, rows, columns)."""
        slopes = np.array(self.coefficients).reshape(len(z), *np.shape(self.constant))
        return np.asarray(np.array(self.constant) + np.tensordot(z.T, slopes, axes=1))


class ModelDocument(StrictModel):
    """``E(z) x' = A(z) x + B(z) u``: ``premises`` computes z from the signals; the first states are differential."""

    differential: int = Field(ge=1, le=MAX_STATES)
    names: tuple[Name, ...]
    lower: Vector
    upper: Vector
    premises: Program
    E: AffineDocument
    A: AffineDocument
    B: AffineDocument


class RegionalFeedback(StrictModel):
    """``u = K(z) x_d``, z clamped to its box, then u limited."""

    kind: Literal["regional-feedback"]
    gain: PolytopeTable
    schedule: Program
    """As ``premises`` of the model, the centre of the box for what the law is not told."""
    premise_fault_s: NonNegative | None = PREMISE_FAULT_S
    """Policy where a premise is outside its box: clamped, and after so long a fault; 0: at once, None: never."""


class RegionDocument(StrictModel):
    """``x_d' P^-1 x_d <= 1``: no solution leaves it, and inside it every bound of the signals holds."""

    lyapunov: Matrix
    decay_rate_per_s: NonNegative
    speed_per_s: Positive | None
    """Bound of the closed loop in the norm of the region; null if none was asked for."""


class PlantDocument(StrictModel):
    """``F(x', x, u, p) = 0`` from the equations: residual, and per row the partial derivatives by x' and by x."""

    residual: Program
    jacobian: tuple[Program, ...]


class EulerSampling(StrictModel):
    """The sampling period is proved by Euler's bound: the loop's speed, and how fast the slope of the plant grows."""

    method: Literal["euler"]
    speed_per_s: NonNegative
    lipschitz_per_s: NonNegative
    longest_period_s: Positive


class LinearisedSampling(StrictModel):
    """The sampling period is proved by the loop linearised at every sample: growth and curvature of the plant."""

    method: Literal["linearised"]
    growth_per_s: NonNegative
    curvature_per_s: NonNegative
    longest_period_s: Positive


class ObserverSampling(StrictModel):
    """The sampling period is proved together with an observer, by Euler's bound of both.

    b, J, d, mu and theta of `quasilpv.certificate.systems.observed`.
    """

    method: Literal["observer"]
    speed_per_s: NonNegative
    lipschitz_per_s: NonNegative
    mismatch_per_s: NonNegative
    error_contraction: NonNegative
    contraction: NonNegative


SAMPLING_METHODS = ("euler", "linearised", "observer")
SamplingDocument = Annotated[EulerSampling | LinearisedSampling | ObserverSampling, Field(discriminator="method")]


class ObserverDocument(StrictModel):
    """The law reads some states only; the others it estimates.

    With y the measured states, h the prediction and xi = y where it is measured, h elsewhere: ``u = K(z) xi`` and
    ``h+ = h + T E_1^-1 (A xi + B u) + L (y - C h)``, E, A and B those of the model at z = ``law.schedule`` of xi,
    algebraic states eliminated. What is proved holds while ``|x|_P + nu |x - h|_Q <= 1``, ``|y|_P^2 = y' P^-1 y``.
    """

    measured: tuple[Name, ...]
    gain: Matrix
    """L, (q, measured)."""
    lyapunov: Matrix
    """Q, (q, q)."""
    weight: Positive
    """nu."""
    start: Vector
    """Of h, (q,), deviations; where a state is measured, its first measurement takes its place."""


class SystemArtifactDocument(HashedDocument):
    """One controller of a general system, immutable."""

    schema_: Literal["quasilpv.system_artifact"] = Field(alias="schema")
    schema_version: Literal[1, 2]
    name: Name
    creator: Creator
    design_hash: Sha256
    sample_period_s: float = Field(ge=SHORTEST_PERIOD_S, le=LONGEST_PERIOD_S)
    signals: Annotated[tuple[Signal, ...], Field(min_length=1, max_length=MAX_SIGNALS)]
    model: ModelDocument
    law: RegionalFeedback
    region: RegionDocument
    observer: ObserverDocument | None = None
    """Since version 2; null: the law reads all differential states."""
    plant: PlantDocument
    witness: dict[str, Rows]
    sampling: SamplingDocument | None
    verification: dict[str, object] | None

    def of(self, role: Role) -> tuple[Signal, ...]:
        """Its signals of one role, in order."""
        return tuple(signal for signal in self.signals if signal.role == role)

    @property
    def states(self) -> tuple[Signal, ...]:
        """Its states, differential ones first."""
        return self.of("state")

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Its inputs."""
        return self.of("input")

    @property
    def parameters(self) -> tuple[Signal, ...]:
        """Its parameters."""
        return self.of("parameter")

    @property
    def measured(self) -> tuple[bool, ...]:
        """Of every state, whether the law is told it; of an algebraic one it is, unless there is an observer."""
        if self.observer is None:
            return (True,) * len(self.states)
        return tuple(signal.name in self.observer.measured for signal in self.states)

    @property
    def l2_gain(self) -> tuple[float, float] | None:
        """The gain, and the energy of a disturbance from rest (its square, integrated, s) within the region."""
        if L2_GAIN not in self.witness:
            return None
        [[gain]], [[balance]], time = self.witness[L2_GAIN], self.witness[BALANCE], self.witness["units"][3][0]
        return gain, balance**2 * time / gain

    def content(self) -> Document:
        """Return the artifact as a JSON tree without its hash, in the version it was written in."""
        content = super().content()
        if self.schema_version == 1:
            del content["law"]["premise_fault_s"], content["observer"]
        return content

    def __repr__(self) -> str:
        """What it is, in a few lines."""
        states, inputs = (", ".join(signal.name for signal in own) for own in (self.states, self.inputs))
        rate = f"{1.0 / self.sample_period_s:g} Hz"
        return f"SystemArtifact({self.name!r}, {inputs} from {states}, {rate}\n  hash={self.hash})"

    def __str__(self) -> str:
        """The same."""
        return repr(self)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        said = "premise_fault_s" in self.law.model_fields_set
        if said != (self.schema_version > 1):
            expected = "this member" if self.schema_version > 1 else "no such member in version 1"
            raise FieldError("law.premise_fault_s", self.law.premise_fault_s if said else "nothing", expected)
        roles = [signal.role for signal in self.signals]
        if roles != sorted(roles, key=("state", "input", "parameter").index):
            raise FieldError("signals", roles, "states first, then inputs, then parameters")
        names = [signal.name for signal in self.signals]
        if len(set(names)) != len(names):
            raise FieldError("signals", names, "names of their own")
        n, m, r, q = len(self.states), len(self.inputs), len(self.model.names), self.model.differential
        if not (1 <= n <= MAX_STATES and 1 <= m <= MAX_INPUTS):
            raise FieldError("signals", f"{n} states and {m} inputs", f"1 to {MAX_STATES} and 1 to {MAX_INPUTS}")
        if q > n:
            raise FieldError("model.differential", q, f"at most {n}, the states there are")
        for field in ("lower", "upper"):
            require_size(f"model.{field}", getattr(self.model, field), r)
        for field, columns in (("E", n), ("A", n), ("B", m)):
            getattr(self.model, field).require(f"model.{field}", r, n, columns)
        self.law.gain.require_shape("law.gain", m, q)
        if self.law.gain.lower != self.model.lower or self.law.gain.upper != self.model.upper:
            raise FieldError("law.gain", "another box", "that of the model's premises")
        require_lyapunov("region.lyapunov", self.region.lyapunov, q)
        self._check_observer(q)
        self._check_programs(n, m, r)
        return self

    def _check_observer(self, q: int) -> None:
        if self.schema_version == 1 and "observer" in self.model_fields_set:
            raise FieldError("observer", "a member", "none before version 2")
        if self.schema_version > 1 and "observer" not in self.model_fields_set:
            raise FieldError("observer", "nothing", "an observer, or null")
        proved_with_one = isinstance(self.sampling, ObserverSampling)
        if self.sampling is not None and proved_with_one != (self.observer is not None):
            expected = "observer" if self.observer is not None else "euler or linearised: there is no observer"
            raise FieldError("sampling.method", self.sampling.method, expected)
        if self.observer is None:
            return
        own, names = self.observer, [signal.name for signal in self.states[:q]]
        if list(own.measured) != [name for name in names if name in own.measured] or not 0 < len(own.measured) < q:
            raise FieldError("observer.measured", list(own.measured), f"some, in this order, of {', '.join(names)}")
        read = {step[1] for step in self.model.premises.code if step[0] == "signal"}
        algebraic = [self.signals[k].name for k in sorted(read) if q <= k < len(self.states)]
        if algebraic:
            raise FieldError("observer", "one", f"null: premises depend on the algebraic state {algebraic[0]}")
        require_shape("observer.gain", own.gain, q, len(own.measured))
        require_lyapunov("observer.lyapunov", own.lyapunov, q)
        require_size("observer.start", own.start, q)

    def _check_programs(self, n: int, m: int, r: int) -> None:
        signals = len(self.signals)
        require_size("plant.jacobian", self.plant.jacobian, n)
        rows = [(f"plant.jacobian[{i}]", row, 2 * n, signals + n) for i, row in enumerate(self.plant.jacobian)]
        for field, program, outputs, readable in (
            ("model.premises", self.model.premises, r, signals),
            ("law.schedule", self.law.schedule, r, signals),
            ("plant.residual", self.plant.residual, n, signals + n),
            *rows,
        ):
            if program.outputs != outputs:
                raise FieldError(f"{field}.outputs", program.outputs, str(outputs))
            for variable, highest in program.inputs().items():
                if variable != "signal" or highest >= readable:
                    raise FieldError(f"{field}.code", f"{variable} {highest}", f"signals below {readable} only")
