"""From a design to the artifact that is shipped: programs compiled, claims checked, evidence attached, one object.

The only room that knows both how a law is designed and how an artifact is written. Nothing leaves it whose claims are
not proved or that fails its robust gate, unless that is asked for; then the artifact says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from flint import fmpq

from quasilpv import __version__
from quasilpv.artifact import Artifact, Program
from quasilpv.artifact.compilation import compile_program
from quasilpv.certificate import LAWS, Evidence, gate, verify
from quasilpv.documents.canonical import document_hash
from quasilpv.documents.robot import ARTIFACT_VERSION
from quasilpv.errors import ClaimError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis import DesignRequest, synthesise
from quasilpv.synthesis.actuator_demand import MotionsOf, no_motions, unmet_demands
from quasilpv.synthesis.baselines.printed import reference_speeds
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import AnyRobot, Robot

NEEDED_OF_CLAIMS = Evidence.ENCLOSED
"""Every claim of a released artifact is proved; a sampled one does not suffice."""

VERIFICATION_VERSION = 2
"""Of the member ``verification``; 1, which had no number, did not tell kinds of evidence apart."""


@dataclass(frozen=True)
class Release:
    """An artifact and the numbers behind it.

    Attributes:
        artifact: what the run-time side loads; its `verification` holds the evidence.
        report: numbers for people, JSON-able (empty for baselines).
    """

    artifact: Artifact
    report: Mapping[str, Any]


def release(
    request: DesignRequest,
    *,
    motions_of: MotionsOf = no_motions,
    allow_unverified: bool = False,
    progress: Progress = no_progress,
) -> Release:
    """Design a controller, check what it claims, and put it into an artifact.

    Args:
        request: what is asked for.
        motions_of: what a robot is asked for; its limits must deliver them.
        allow_unverified: release a design whose claims do not hold, that fails its gate or whose limits cannot deliver
            what it needs, marked as such.
        progress: called with (points done, points in all).

    Raises:
        InputError: unknown controller, or a law that cannot do without compensation.
        InfeasibleError: no design meets the specification.
        ClaimError: a claim does not hold, the robust gate is not passed, or the limits are too tight.
    """
    design = synthesise(request, progress=progress)
    return Release(checked_artifact(design, allow_unverified, motions_of), design.report)


def checked_artifact(
    design: TrackingDesign, allow_unverified: bool = False, motions_of: MotionsOf = no_motions
) -> Artifact:
    """The artifact of a design, its claims and its robust gate decided on the very numbers that are shipped.

    Args:
        design: of a law; the baselines make no claim and have no gate.
        allow_unverified: do not refuse, but write ``"released_unverified": true`` into the artifact.
        motions_of: what a robot is asked for; its limits must deliver them.

    Raises:
        ClaimError: a claim does not hold or is not proved, the robust gate is not passed, or torque or slew limits
            cannot deliver what the design needs.
    """
    artifact = to_artifact(design)
    content, law = artifact.content(), LAWS[artifact.law.kind]
    failures = list(unmet_demands(design, motions_of))
    if not law.claims_of(artifact):
        _refuse(content["name"], failures, allow_unverified)
        return Artifact.from_document({**content, **_released_unverified(failures, content["verification"])})
    verdict = verify(artifact, artifact.name)
    samples = float(design.inputs["specification"]["delay_samples"])
    found = gate(artifact, artifact.name, fmpq(*samples.as_integer_ratio()))
    failures += [f"{claim.name}: does not hold ({claim.evidence})" for claim in verdict.claims if not claim.holds]
    for claim in verdict.weaker_than(NEEDED_OF_CLAIMS):
        failures.append(f"{claim.name}: {claim.evidence}, {NEEDED_OF_CLAIMS} evidence is needed")
    if not found.passed:
        failures.append(found.why_not_passed())
    elif not found.evidence.is_at_least(law.gate_evidence):
        failures.append(f"robust gate: {found.evidence}, {law.gate_evidence} evidence is needed")
    _refuse(content["name"], failures, allow_unverified)
    evidence = {
        **(content["verification"] or {}),
        "schema_version": VERIFICATION_VERSION,
        "needed_evidence": {"claims": NEEDED_OF_CLAIMS.value, "gate": law.gate_evidence.value},
        "certificate": verdict.findings(),
        "gate": found.to_document(),
    }
    return Artifact.from_document({**content, "verification": evidence, **_released_unverified(failures, evidence)})


def _refuse(name: str, failures: Sequence[str], allow_unverified: bool) -> None:
    """Refuse a design with failures, unless it is wanted all the same."""
    if failures and not allow_unverified:
        more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
        raise ClaimError(f"{name}: not released: {failures[0]}{more}")


def _released_unverified(failures: Sequence[str], evidence: Mapping[str, Any] | None) -> dict[str, Any]:
    """The member `verification` of an artifact that is released in spite of failures; nothing without any."""
    return {"verification": {**(evidence or {}), "released_unverified": True}} if failures else {}


def design_inputs(robot_model: AnyRobot, inputs: Mapping[str, Any]) -> dict[str, Any]:
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
    """Compile a design's expressions and assemble its artifact, unchecked (`checked_artifact` is what is released)."""
    source = design.robot
    rate = 1.0 / design.sample_period_s
    return Artifact.from_document(
        {
            "schema": "quasilpv.artifact",
            "schema_version": ARTIFACT_VERSION,
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
    if not isinstance(design.robot, Robot):
        return {}  # a robot in space computes what its laws need by itself
    symbolic = design.robot.model.symbolic
    inputs: dict[sp.Symbol, tuple[str, int]] = {}
    for name, symbols in (
        ("angle", symbolic.theta),
        ("speed", symbolic.omega),
        ("reference_speed", reference_speeds(design.robot)),
    ):
        inputs.update({symbol: (name, joint) for joint, symbol in enumerate(symbols)})
    return {name: compile_program(expressions, inputs) for name, expressions in design.expressions.items()}
