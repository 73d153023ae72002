"""Gains of `robust`: Theorem III.9 for the disc of Example III.12, whose moment of inertia the law does not know.

The descriptor model keeps the contact force as algebraic state, ``x = (x_1, x_2, x_3, lambda)``; the uncertainty delta
of the inertia is a premise that the gain does not see, ``u = F(z_1) V^-1 (x_1, x_2)`` with ``z_1 = x_1^2`` (III.25). In
joint coordinates, ``(x_1, x_2) = r (theta, omega)``: K = r F V^-1 and P = V / r^2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quasilpv.certificate.laws.state_feedback import StateFeedbackLaw
from quasilpv.conditions.condition import Options
from quasilpv.conditions.theorems import iii9
from quasilpv.errors import InfeasibleError
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.representation import polytopic_model
from quasilpv.synthesis.stabilising.gains import Candidate, Solver, least_gain
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.premise import Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.registry import Robot
from quasilpv.systems.robots.rolling_disc import RollingDisc


def robust_solver(robot: Robot) -> Solver:
    """The solver for a disc and its set of inertias.

    Raises:
        InfeasibleError: the robot is another one.
    """
    disc, extreme = robot.model, robot.with_payload_fraction(1.0)
    if not isinstance(disc, RollingDisc) or not isinstance(extreme, RollingDisc):
        raise InfeasibleError(f"{robot.id}: no robust design: Theorem III.9 is applied to the rolling disc only")
    radius, largest_delta = disc.radius_m, extreme.inertia_uncertainty_per_kg

    def solve(model: PolytopicModel, decay: float, rate: float) -> Candidate | None:
        """The model is the shipped one, with premise theta^2; the theorem is applied to the disc's descriptor model."""
        uncertain = descriptor_model(disc, largest_delta, model.system.premises[0])
        statement = iii9.CONDITION.build(
            polytopic_model(uncertain, iii9.CONDITION.representation), Options(decay_rate=decay)
        )
        unknowns = statement.problem.variables
        V = [variable.expression for variable in unknowns if variable.name.startswith("V")]
        gains = [variable for variable in unknowns if variable.name.startswith("F")]
        solution = least_gain(statement.problem, gains, [sum(V[1:], V[0]) * (1.0 / len(V))], rate)
        if solution is None:
            return None
        feedback = statement.feedback(solution.values)
        assert feedback.gain is not None
        premises = [np.array([radius**2 * bound, 0.0]) for bound in model.system.premises[0].bounds]
        K = np.stack([radius * feedback.gain(z)[:, :2] for z in premises])
        return Candidate(
            law={"kind": StateFeedbackLaw.tag(), "gain": model.polytope.to_document(K)},
            witness={"P": (feedback.lyapunov / radius**2).tolist()},
            gain_limit=solution.objective,
            gain=lambda weights, inertia: np.asarray(np.tensordot(weights, K, axes=1)),
        )

    return solve


def descriptor_model(disc: RollingDisc, largest_delta: float, premise: Premise) -> DescriptorSystem:
    """The disc of the catalogue over the box of a premise theta^2.

    Args:
        disc: nominal.
        largest_delta: delta is in [0, largest_delta], 1/kg.
        premise: theta^2 with its bounds, rad^2.
    """
    bounds = (disc.radius_m**2 * premise.lower, disc.radius_m**2 * premise.upper)
    model = system(
        "spring-disc",
        M=disc.mass_kg,
        c=largest_delta,
        x1_max=float(np.sqrt(bounds[1])),
        k1=disc.stiffness_n_m,
        k2=disc.cubic_stiffness_n_m3,
        damping=disc.damping_n_s_m,
        r=disc.radius_m,
        J=disc.inertia_kg_m2,
    )
    position, delta = model.premises
    return replace(model, premises=(replace(position, bounds=bounds), delta))
