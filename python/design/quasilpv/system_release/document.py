"""The artifact of a design of a general system: its numbers as they are shipped."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np
import sympy as sp

from quasilpv import __version__
from quasilpv.arrays import FloatArray
from quasilpv.artifact.compilation import compile_program
from quasilpv.artifact.plant_program import plant_document
from quasilpv.documents.canonical import document_hash
from quasilpv.documents.programs import Program
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import (
    DISTURBANCE,
    PERFORMANCE,
    SAMPLING_METHODS,
    SCHEMA,
    SCHEMA_VERSION,
    ObserverDocument,
    SamplingDocument,
    SystemArtifactDocument,
)
from quasilpv.synthesis.regional.feedback import RegionalDesign
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.systems.descriptor.premise import AffineMatrix, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem


def artifact_of(
    design: RegionalDesign,
    sampling: SamplingDocument | None = None,
    verification: dict[str, Any] | None = None,
    observer: ObserverDocument | None = None,
) -> SystemArtifactDocument:
    """The artifact of a design.

    Args:
        design: what was found.
        sampling: how its period is proved; None: it is not.
        verification: what a checker found.
        observer: of the states that are not measured.

    Raises:
        InputError: an expression has no program.
    """
    system, request = design.model.system, design.request
    signals = _signals(request)
    numbers = {symbol: ("signal", k) for k, symbol in enumerate(_symbols(system))}
    premises = tuple(premise.expression for premise in system.premises)
    centre = design.model.polytope.centre
    told = [
        sp.Float(centre[p]) if premise.kind is PremiseKind.UNKNOWN else premise.expression
        for p, premise in enumerate(system.premises)
    ]
    units = design.units
    performance = {DISTURBANCE: request.disturbance, PERFORMANCE: request.performance}
    document = {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "name": f"{system.name}-{1.0 / request.sample_period_s:.0f}hz",
        "creator": {"tool": "quasilpv", "version": __version__},
        "design_hash": document_hash(_inputs(request)),
        "sample_period_s": request.sample_period_s,
        "signals": signals,
        "model": {
            "differential": system.differential,
            "names": [premise.name for premise in system.premises],
            "lower": system.lower.tolist(),
            "upper": system.upper.tolist(),
            "premises": _compiled(premises, numbers),
            **{name: _affine(matrix) for name, matrix in (("E", system.E), ("A", system.A), ("B", system.B))},
        },
        "law": {
            "kind": "regional-feedback",
            "gain": design.model.polytope.to_document(design.gains),
            "schedule": _compiled(tuple(told), numbers),
            "premise_fault_s": request.premise_fault_s,
        },
        "region": {
            "lyapunov": _symmetric(design.lyapunov),
            "decay_rate_per_s": design.decay_rate,
            "speed_per_s": request.speed,
        },
        "observer": None if observer is None else observer.model_dump(mode="json"),
        "plant": plant_document(system, _symbols(system)),
        "witness": {
            "units": [units.T.tolist(), units.S.tolist(), units.D.tolist(), [units.c]],
            **{name: value.tolist() for name, value in design.witness.items()},
            **{name: [list(request.sizes(own))] for name, own in performance.items() if own},
        },
        "sampling": None if sampling is None else sampling.model_dump(mode="json"),
        "verification": verification,
    }
    return validate(SystemArtifactDocument, document, system.name, SAMPLING_METHODS)


def _symmetric(P: FloatArray) -> list[list[float]]:
    full: list[list[float]] = (0.5 * (P + P.T)).tolist()
    return full


def _symbols(system: DescriptorSystem) -> tuple[sp.Symbol, ...]:
    """Of the signals: states, inputs, parameters."""
    inputs = tuple(sp.Symbol(name, real=True) for name in system.inputs)
    return (*system.state, *inputs, *system.parameters)


def _signals(request: RegionalRequest) -> list[dict[str, Any]]:
    system = request.system
    n, m = system.order, len(system.inputs)
    trim = system.trim or (0.0,) * (n + m)
    unknown = {
        symbol
        for premise in system.premises
        if premise.kind is PremiseKind.UNKNOWN
        for symbol in premise.expression.free_symbols
    }

    def signal(name: str, role: str, bounds: tuple[float, float], value: float, known: bool = True) -> dict[str, Any]:
        low, high = (bound if isfinite(bound) else None for bound in map(float, bounds))
        unit = system.units.get(name, "1")
        return {"name": name, "role": role, "unit": unit, "low": low, "high": high, "trim": value, "known": known}

    everything = (-np.inf, np.inf)
    states = [
        signal(symbol.name, "state", system.domain.get(symbol, everything), trim[k])
        for k, symbol in enumerate(system.state)
    ]
    inputs = [
        signal(name, "input", (-bound, bound), trim[n + k])
        for k, (name, bound) in enumerate(zip(system.inputs, request.limits_of_inputs, strict=True))
    ]
    parameters = [
        signal(symbol.name, "parameter", system.domain[symbol], 0.0, symbol not in unknown)
        for symbol in system.parameters
    ]
    return states + inputs + parameters


def _compiled(expressions: tuple[sp.Expr, ...], numbers: Mapping[sp.Symbol, tuple[str, int]]) -> dict[str, Any]:
    program: Program = compile_program(expressions, numbers)
    return program.model_dump(mode="json")


def _affine(matrix: AffineMatrix) -> dict[str, Any]:
    return {"constant": matrix.constant.tolist(), "coefficients": matrix.coefficients.tolist()}


def _inputs(request: RegionalRequest) -> dict[str, Any]:
    """What the design was asked for, as a document."""
    return {
        "system": request.system.name,
        "objective": request.objective,
        "decay_rate": request.decay_rate,
        "input_limits": dict(request.input_limits),
        "rate_hz": request.rate_hz,
        "speed": request.speed,
        "share": request.share,
        **({"disturbance": dict(request.disturbance)} if request.disturbance else {}),
        **({"performance": dict(request.performance)} if request.performance else {}),
        **({"measured": list(request.measured)} if request.measured else {}),
        **({"start_estimate": dict(request.start_estimate)} if request.start_estimate else {}),
    }
