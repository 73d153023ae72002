"""Observer of a mechanism from its joint angles, its inertia and velocity torque scheduled with the estimated speeds.

    theta^' = w^ + L_1 (y - theta^),
    w^'     = M(y)^-1 (Gamma - N(y, w^) w^ - G(y)) + L_2 (y - theta^)

with y = theta measured. The error ``e = (theta - theta^, w - w^)`` obeys ``e_1' = e_2 - L_1 e_1``,
``e_2' = p - L_2 e_1`` with ``|p|_M <= gamma |e_2|_M`` in the norm of the kinetic energy, gamma proved over the
operating domain (`VelocityClasses.energy`): condition `estimated-observer` with a class that is affine in the inertia
premises.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Options, Statement
from quasilpv.conditions.forms.mismatch import weighted_lipschitz
from quasilpv.conditions.theorems.estimated_observer import statement
from quasilpv.errors import InfeasibleError
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import BlockPolytope, PolytopicModel
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.registry import Robot


@dataclass(frozen=True, eq=False)
class SpeedObserver:
    """Gains with a proof.

    Attributes:
        gain: from the inertia premises to ``L = [L_1; L_2]``, (2n, n), 1/s and 1/s^2.
        lyapunov: Q of ``V = e'Q e``, (2n, 2n).
        decay_per_s: proved rate of ``sqrt(V)``.
        mismatch_per_s: gamma the proof allows for.
    """

    gain: Callable[[FloatArray], FloatArray]
    lyapunov: FloatArray
    decay_per_s: float
    mismatch_per_s: float


def speed_observer(robot: Robot, mismatch_per_s: float, decay_per_s: float, sample_period_s: float) -> SpeedObserver:
    """Gains whose inequalities hold in exact arithmetic.

    Args:
        robot: nominal model and operating domain.
        mismatch_per_s: gamma of the module.
        decay_per_s: alpha.
        sample_period_s: h, which bounds the poles: ``|1 + h s| < exp(-alpha h)``.

    Raises:
        InfeasibleError: none were found.
    """
    options = Options(decay_rate=decay_per_s, sample_period_s=sample_period_s, common=True)
    problem = observer_statement(robot, mismatch_per_s, options)
    decision = decide(CompiledProblem.of(problem.problem))
    if not decision.feasible:
        raise InfeasibleError(
            f"{robot.id}: no observer with decay rate {decay_per_s:g} 1/s at {sample_period_s:g} s for a mismatch of"
            f" {mismatch_per_s:g} 1/s: {decision.outcome.value}"
        )
    found = problem.feedback(decision.values)
    per_sample = found.observer
    if per_sample is None:
        raise TypeError("the condition gives an observer")

    def gain(z: FloatArray) -> FloatArray:
        return np.asarray(per_sample(z) / sample_period_s)

    lyapunov = np.asarray(np.linalg.inv(found.lyapunov))
    return SpeedObserver(gain, lyapunov, decay_per_s, mismatch_per_s)


def observer_statement(robot: Robot, mismatch_per_s: float, options: Options) -> Statement:
    """The inequalities of `speed_observer` on the box of the inertia premises."""
    n, premises = robot.model.joints, robot.model.inertia_premises(robot.domain)
    one, none = np.eye(n), np.zeros((n, n))

    def constant(matrix: FloatArray) -> AffineMatrix:
        return AffineMatrix(matrix, np.zeros((len(premises), *matrix.shape)))

    symbolic = robot.model.symbolic
    intervals = robot.domain.angle_rad + robot.domain.speed_rad_s
    system = DescriptorSystem(
        name=f"{robot.id}, error of the observer",
        state=symbolic.theta + symbolic.omega,
        inputs=tuple(f"acceleration_{joint}" for joint in range(1, n + 1)),
        premises=premises,
        E=constant(np.eye(2 * n)),
        A=constant(np.block([[none, one], [none, none]])),
        B=constant(np.vstack([none, one])),
        C=constant(np.hstack([one, none])),
        domain=dict(zip(symbolic.theta + symbolic.omega, intervals, strict=True)),
    )
    polytope = BlockPolytope.takagi_sugeno([p.lower for p in premises], [p.upper for p in premises])
    affine = robot.model.inertia_affine()
    inertia = polytope.vertices(affine.constant, affine.coefficients)
    rows, columns = np.vstack([none, one]), np.hstack([none, one])
    classes = [weighted_lipschitz(rows, columns, (M + M.T) / 2.0, mismatch_per_s) for M in inertia]
    return statement(PolytopicModel(system, polytope), classes, options)
