"""A shipped feedback and its region on other intervals of parameters: wider premise boxes, a new witness.

Gains and P are those of the artifact; what is looked for are the other unknowns of the inequalities. What is found is
an artifact that the checker decides like any other.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.certificate.exact.program_ranges import outputs_of, range_of
from quasilpv.certificate.systems.regional import UNITS, bound_of, domain_of, regional_claims
from quasilpv.conditions.regional.feedback import RegionalLimits, regional_statement
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import AffineDocument, SystemArtifactDocument
from quasilpv.lmi import Problem
from quasilpv.lmi.exact import to_rational
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.systems.descriptor.premise import BOX_MARGIN, AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem

Intervals = Mapping[str, tuple[float, float]]
"""Of parameters by name: deviations from their trim."""


def widened(artifact: SystemArtifactDocument, intervals: Intervals) -> SystemArtifactDocument | None:
    """The artifact with other intervals of parameters and the premise box that they need; its witness is no more one.

    Args:
        artifact: of a controller of a system.
        intervals: of some parameters.

    Returns:
        None where a premise that the law is told would leave its box, or could not be enclosed.
    """
    content = artifact.content()
    for signal in content["signals"]:
        if signal["name"] in intervals:
            signal["low"], signal["high"] = intervals[signal["name"]]
    domain = domain_of(validate(SystemArtifactDocument, content, artifact.name))
    unknown = unknown_premises(artifact)
    moved = {k for k, signal in enumerate(artifact.signals) if signal.name in intervals}
    for p, code in enumerate(outputs_of(artifact.model.premises.code)):
        if not moved & {int(op[1]) for op in code if op[0] == "signal"}:
            continue
        low, high = artifact.model.lower[p], artifact.model.upper[p]
        found = range_of(code, domain, (low, high))
        if found is None or (found != (low, high) and p not in unknown):
            return None
        spare = [
            BOX_MARGIN * (found[1] - found[0]) * float(end != old) for end, old in zip(found, (low, high), strict=True)
        ]
        for table in (content["model"], content["law"]["gain"]):
            table["lower"][p], table["upper"][p] = found[0] - spare[0], found[1] + spare[1]
    content.update(sampling=None, verification=None, witness={UNITS: content["witness"][UNITS]})
    return validate(SystemArtifactDocument, content, artifact.name)


def unknown_premises(artifact: SystemArtifactDocument) -> set[int]:
    """The premises that the law is not told: it takes the middle of their box instead."""
    pairs = zip(outputs_of(artifact.model.premises.code), outputs_of(artifact.law.schedule.code), strict=True)
    return {p for p, (code, used) in enumerate(pairs) if [tuple(op) for op in code] != [tuple(op) for op in used]}


def proved(artifact: SystemArtifactDocument, decay_rate: float, speed: float | None) -> bool:
    """Whether gains and region are proved, on the intervals and premise boxes of an artifact, whatever its witness.

    Args:
        artifact: of `widened`.
        decay_rate: to be proved, 1/s; at 0 V falls.
        speed: bound of the closed loop to be proved, 1/s; None for none.
    """
    model = _model(artifact)
    units = [np.array(row) for row in artifact.witness[UNITS]]
    T, S, c = units[0], units[1], units[3][0]
    limits = RegionalLimits(
        decay_rate=decay_rate * c,
        states=tuple(bound_of(signal) / t for signal, t in zip(artifact.states, T, strict=True)),
        inputs=tuple(bound_of(signal) / s for signal, s in zip(artifact.inputs, S, strict=True)),
        speed=inf if speed is None else speed * c,
    )
    statement = regional_statement(model, limits)
    q = artifact.model.differential
    P = _exact(artifact.region.lyapunov) / np.outer(_exact(T[:q]), _exact(T[:q]))
    gains = [vertex for block in artifact.law.gain.blocks for vertex in block.vertices]
    given = {statement.P: P}
    for M, gain in zip(statement.M, gains, strict=True):
        given[M] = (_exact(gain) / _exact(S)[:, None] * _exact(T[:q])) @ P
    problem = Problem()
    for constraint in statement.problem.constraints:
        rest = constraint.expression.given(given)
        if rest.variables:
            problem.positive(constraint.name, rest)
    solution = problem.solve_inside() if problem.constraints else None
    if solution is not None and not solution.verified:
        return False
    values = {} if solution is None else solution.values
    content = artifact.content()
    content["region"].update(decay_rate_per_s=decay_rate, speed_per_s=speed)
    further = {name: values[unknown].tolist() for name, unknown in statement.further.items() if unknown in values}
    content["witness"] = {**content["witness"], **further}
    return all(claim.holds for claim in regional_claims(validate(SystemArtifactDocument, content, artifact.name)))


def _model(artifact: SystemArtifactDocument) -> PolytopicModel:
    """The model of an artifact on its premise box, in the units of its witness."""
    T, S, D, (c,) = (np.array(row) for row in artifact.witness[UNITS])
    model, table = artifact.model, artifact.law.gain
    unknown = unknown_premises(artifact)

    def matrix(affine: AffineDocument, right: Any, factor: float = 1.0) -> AffineMatrix:
        slopes = np.array(affine.coefficients).reshape(len(model.names), *np.shape(affine.constant))
        left = factor * D[:, None]
        return AffineMatrix(left * np.array(affine.constant) * right, left * slopes * right)

    premises = tuple(
        Premise(name, sp.Symbol(name), (low, high), PremiseKind.UNKNOWN if p in unknown else PremiseKind.MEASURED)
        for p, (name, low, high) in enumerate(zip(model.names, model.lower, model.upper, strict=True))
    )
    n = len(artifact.states)
    system = DescriptorSystem(
        name=artifact.name,
        state=tuple(sp.Symbol(signal.name) for signal in artifact.states),
        inputs=tuple(signal.name for signal in artifact.inputs),
        premises=premises,
        E=matrix(model.E, T, 1.0 / c),
        A=matrix(model.A, T),
        B=matrix(model.B, S),
        C=AffineMatrix(np.eye(n), np.zeros((len(premises), n, n))),
        domain={},
    )
    blocks = [block.premises for block in table.blocks]
    polytope = BlockPolytope.grouped(table.lower, table.upper, blocks, centre=table.centre, unknown=sorted(unknown))
    return PolytopicModel(system, polytope)


def _exact(values: Any) -> Any:
    return to_rational(np.array(values, dtype=float))
