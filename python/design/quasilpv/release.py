"""From a design to the artifact that is shipped: programs compiled, evidence attached, one object.

The only room that knows both how a law is designed and how an artifact is written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from quasilpv import __version__
from quasilpv.artifact import Artifact, Program, compile_program
from quasilpv.artifact.canonical import document_hash
from quasilpv.synthesis import DEFAULT_CONTROLLER, Specification, TrackingDesign, synthesise
from quasilpv.synthesis.acceleration_design import Progress, no_progress
from quasilpv.synthesis.baselines import reference_speeds
from quasilpv.systems.registry import Robot, robot


@dataclass(frozen=True)
class Release:
    """An artifact and the numbers behind it.

    Attributes:
        artifact: what the run-time side loads.
        report: numbers for people, JSON-able (empty for baselines).
    """

    artifact: Artifact
    report: Mapping[str, Any]


def release(
    robot_id: str,
    controller: str = DEFAULT_CONTROLLER,
    specification: Specification | None = None,
    *,
    disturbance_compensation: bool = True,
    progress: Progress = no_progress,
) -> Release:
    """Design a controller and put it into an artifact.

    Args:
        robot_id: name in the registry of robots.
        controller: one of `quasilpv.synthesis.CONTROLLERS`.
        specification: what is asked for.
        disturbance_compensation: of `dob-acceleration`.
        progress: called with (points done, points in all).

    Raises:
        InputError: unknown robot or controller.
        InfeasibleError: no design meets the specification.
    """
    design = synthesise(
        robot(robot_id),
        controller,
        specification,
        disturbance_compensation=disturbance_compensation,
        progress=progress,
    )
    return Release(to_artifact(design), design.report)


def design_inputs(robot_model: Robot, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Everything a design depends on, JSON-able: its hash names the design."""
    return {
        "creator": __version__,
        "robot": {"id": robot_model.id, "parameters": robot_model.model.parameters_document()},
        "domain": robot_model.domain.to_document(),
        "limits": robot_model.limits.to_document(),
        "payloads": robot_model.payloads.to_document(),
        **inputs,
    }


def to_artifact(design: TrackingDesign) -> Artifact:
    """Compile a design's expressions and assemble its artifact."""
    source = design.robot
    rate = 1.0 / design.sample_period_s
    return Artifact.from_document(
        {
            "schema": "quasilpv.artifact",
            "schema_version": 1,
            "name": f"{source.id}-{design.controller}-{rate:g}hz",
            "creator": {"tool": "quasilpv", "version": __version__},
            "design_hash": document_hash(design_inputs(source, design.inputs)),
            "units": "SI",
            "sample_period_s": design.sample_period_s,
            "joints": source.model.joints,
            "robot": {"id": source.id, "parameters": source.model.parameters_document()},
            "payloads": source.payloads.to_document(),
            "domain": source.domain.to_document(),
            "limits": source.limits.to_document(),
            "programs": {name: program.model_dump(mode="json") for name, program in _programs(design).items()},
            "law": dict(design.law),
            "witness": None if design.witness is None else dict(design.witness),
            "verification": {"report": dict(design.report)} if design.report else None,
        }
    )


def _programs(design: TrackingDesign) -> dict[str, Program]:
    symbolic = design.robot.model.symbolic
    inputs: dict[sp.Symbol, tuple[str, int]] = {}
    for name, symbols in (
        ("angle", symbolic.theta),
        ("speed", symbolic.omega),
        ("reference_speed", reference_speeds(design.robot)),
    ):
        inputs.update({symbol: (name, joint) for joint, symbol in enumerate(symbols)})
    return {name: compile_program(expressions, inputs) for name, expressions in design.expressions.items()}
