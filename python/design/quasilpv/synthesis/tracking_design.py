"""What every synthesis of a tracking law returns: the law's numbers, what it evaluates, and the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.robots.registry import AnyRobot, Robot


@dataclass(frozen=True, eq=False)
class TrackingDesign:
    """A law ready to be written into an artifact.

    Attributes:
        controller: its id; several controllers may share a law kind.
        robot: what it is for.
        sample_period_s: T.
        law: the fields of that law kind, as documented with the artifact format.
        expressions: the symbolic vectors the law evaluates, by program name, in theta, omega and reference speeds.
        inputs: the design inputs, JSON-able; equal inputs give equal designs.
        report: numbers for people, JSON-able.
        witness: what an independent checker needs, JSON-able; None for laws without a certificate.
    """

    controller: str
    robot: AnyRobot
    sample_period_s: float
    law: Mapping[str, Any]
    expressions: Mapping[str, tuple[sp.Expr, ...]]
    inputs: Mapping[str, Any]
    report: Mapping[str, Any] = field(default_factory=dict)
    witness: Mapping[str, Any] | None = None


def inertia_table(robot: Robot, scale: float = 1.0) -> dict[str, Any]:
    """Block polytope of the design inertia ``M_n(z) = scale * M_nominal(z)``, one block per premise, box-centred."""
    premises = robot.model.inertia_premises(robot.domain)
    polytope = BlockPolytope.per_premise([p.lower for p in premises], [p.upper for p in premises])
    inertia = robot.model.inertia_affine()
    return polytope.to_document(polytope.vertices(scale * inertia.constant, scale * inertia.coefficients))


def premise_and_gravity(robot: Robot) -> dict[str, tuple[sp.Expr, ...]]:
    """The programs every law of this project evaluates: inertia premises z(theta) and gravity torque G(theta)."""
    premises = robot.model.inertia_premises(robot.domain)
    return {
        "premises": tuple(p.expression for p in premises),
        "gravity": tuple(robot.model.symbolic.gravity),
    }
