"""The conditions of chapters I to III with the smallest gains: from a model and a decay rate to a law.

For a robot with one motor per joint, feasibility alone says nothing: B = [0; I] leaves the gains free to cancel
everything (`conditions.matched`). What is asked for here is a decay rate and, among the laws that have it, the
smallest gain: with ``S = diag(I, w I)`` for a rate w that weighs angles against speeds,

    minimise kappa   subject to   the condition,   P > S^2,   |M_j S^-1| < kappa   for the vertices of the numerator

so that ``|K S| < kappa`` for K = M P^-1 (and ``|K S| < kappa |E^-1|`` for the descriptor law).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray, symmetric
from quasilpv.certificate.laws.delayed_feedback import DelayedFeedbackLaw
from quasilpv.certificate.laws.descriptor_feedback import DescriptorFeedbackLaw
from quasilpv.certificate.laws.state_feedback import StateFeedbackLaw
from quasilpv.conditions.choices import Form
from quasilpv.conditions.condition import Options, Statement
from quasilpv.conditions.theorems import i2, ii6
from quasilpv.conditions.theorems.ii8_direct import delayed_design
from quasilpv.lmi import Problem, Solution, Variable, block
from quasilpv.loops.state_law import descriptor_gain
from quasilpv.polytopes import PolytopicModel

WINDOW_S = 0.05
"""Moving window of `delayed`."""

BACK_OFF = 0.1


@dataclass(frozen=True, eq=False)
class Candidate:
    """One solution: the fields of the law, what its checker needs, its gain, and the law frozen at a configuration.

    Attributes:
        law: fields of the law kind.
        witness: matrices by name.
        gain_limit: kappa.
        gain: from weights of the vertices (count,) and the design inertia (n, n) to K (n, 2n).
    """

    law: Mapping[str, Any]
    witness: Mapping[str, Any]
    gain_limit: float
    gain: Callable[[FloatArray, FloatArray], FloatArray]


Solver = Callable[[PolytopicModel, float, float], Candidate | None]
"""From the model, the decay rate and the rate w to a candidate; None if there is no verified solution."""


def _named(problem: Problem, name: str) -> Variable:
    return next(variable for variable in problem.variables if variable.name == name)


def least_gain(problem: Problem, gains: Sequence[Variable], lyapunov: Sequence[Any], rate: float) -> Solution | None:
    """Add the gain limit of the module's description, minimise it and back off; None without a verified solution.

    Args:
        problem: the condition; receives the limit.
        gains: the numerators M_j, (m, 2n).
        lyapunov: the matrices P that are bounded from below, as variables or expressions.
        rate: w, 1/s.
    """
    kappa, (inputs, size) = Variable("gain limit", 1), (gains[0].rows, gains[0].cols)
    scale = np.repeat([1.0, rate], size // 2)
    for k, P in enumerate(lyapunov):
        problem.positive(f"gain limit: P {k}", P - np.diag(scale**2))
    for j, gain in enumerate(gains):
        scaled = (gain @ np.diag(1.0 / scale)).T
        problem.positive(f"gain limit {j}", block([[kappa * np.eye(inputs), None], [scaled, kappa * np.eye(size)]]))
    problem.minimise(kappa)
    solution = problem.solve_inside(BACK_OFF)
    return solution if solution.verified else None


@dataclass(frozen=True, eq=False)
class _SingleSum:
    """A condition of one sum over the vertices, solved with least gains.

    Attributes:
        statement: the condition.
        solution: its verified solution.
        lyapunov: P, (2n, 2n).
        numerators: M_j, (count, n, 2n).
    """

    statement: Statement
    solution: Solution
    lyapunov: FloatArray
    numerators: FloatArray

    @classmethod
    def of(cls, statement: Statement, lyapunov: str, numerator: str, count: int, rate: float) -> _SingleSum | None:
        """Solve it; None without a verified solution.

        Args:
            statement: the condition.
            lyapunov: name of P.
            numerator: letter of M_j, which the index follows.
            count: of vertices.
            rate: w, 1/s.
        """
        P, M = _named(statement.problem, lyapunov), [_named(statement.problem, f"{numerator}{j}") for j in range(count)]
        solution = least_gain(statement.problem, M, [P], rate)
        if solution is None:
            return None
        return cls(statement, solution, symmetric(solution.values[P]), np.stack([solution.values[Mj] for Mj in M]))

    def witness(self, *names: str) -> dict[str, Any]:
        """The values of these unknowns and of the slack matrices, JSON-able.

        The slack is that of ``He(X) + T``; the inequalities are stated as ``X + T`` with the symmetric part of X.
        """
        values = self.solution.values
        slack = [(values[T] + values[T].T).tolist() for T in self.statement.slacks]
        return {name: values[_named(self.statement.problem, name)].tolist() for name in names} | {"slack": slack}


def solve_pdc(model: PolytopicModel, decay: float, rate: float) -> Candidate | None:
    """Theorem I.2 as a single sum with one slack matrix per block; K_j = M_j P_11^-1."""
    statement = i2.with_gains(model, Options(decay_rate=decay), single=True)
    solved = _SingleSum.of(statement, "P11", "M", model.vertex_count, rate)
    if solved is None:
        return None
    P = solved.lyapunov
    gains = np.linalg.solve(P, solved.numerators.swapaxes(1, 2)).swapaxes(1, 2)
    return Candidate(
        law={"kind": StateFeedbackLaw.tag(), "gain": model.polytope.to_document(gains)},
        witness={"P": P.tolist()} | solved.witness("P21", "P22"),
        gain_limit=solved.solution.objective,
        gain=lambda weights, inertia: np.asarray(np.tensordot(weights, gains, axes=1)),
    )


def solve_descriptor(model: PolytopicModel, decay: float, rate: float) -> Candidate | None:
    """Theorem II.6 with common L and R, a single sum with one slack matrix per block."""
    statement = ii6.CONDITION.build(model, Options(decay_rate=decay, common=True, form=Form.PUBLISHED))
    solved = _SingleSum.of(statement, "P", "F", model.vertex_count, rate)
    if solved is None:
        return None
    P, F = solved.lyapunov, solved.numerators
    return Candidate(
        law={"kind": DescriptorFeedbackLaw.tag(), "numerator": model.polytope.to_document(F), "lyapunov": P.tolist()},
        witness=solved.witness("L", "R"),
        gain_limit=solved.solution.objective,
        gain=lambda weights, inertia: descriptor_gain(np.tensordot(weights, F, axes=1), inertia, P),
    )


def solve_delayed(model: PolytopicModel, decay: float, rate: float) -> Candidate | None:
    """Theorem II.8 without multipliers, window `WINDOW_S`."""
    design = delayed_design(model, decay, WINDOW_S)
    vertices = range(model.vertex_count)
    F = list(design.F.values())
    solution = least_gain(design.problem, F, [design.lyapunov.at(k) for k in vertices], rate)
    if solution is None:
        return None
    P = np.stack([symmetric(design.lyapunov.at(k).at(solution.values).astype(float)) for k in vertices])
    numerators = np.stack([solution.values[Fj] for Fj in F])
    cube = numerators.reshape(*(len(P),) * 3, *numerators.shape[1:])

    def gain(weights: FloatArray, inertia: FloatArray) -> FloatArray:
        numerator = np.einsum("j,k,m,jkmab->ab", weights, weights, weights, cube)
        return descriptor_gain(numerator, inertia, np.tensordot(weights, P, axes=1))

    law = {
        "kind": DelayedFeedbackLaw.tag(),
        "lyapunov": model.polytope.to_document(P),
        "numerators": numerators.tolist(),
        "descriptor": True,
    }
    return Candidate(law, {"window_s": WINDOW_S}, solution.objective, gain)
