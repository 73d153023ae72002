"""The closed loop of a designed law, rebuilt from the system alone: what every design condition is judged by.

Nothing here knows how an inequality was written. ``V = x_d' P^-1 x_d`` is differentiated along
``E(z) x' = A(z) x + B(z) u``, ``u = K x_e``, with the algebraic states eliminated, in double arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Condition, Feedback, Options, Statement
from quasilpv.lmi import Problem
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import Decision, decide
from quasilpv.polytopes import polytopic_model
from quasilpv.systems.catalogue import system
from quasilpv.systems.descriptor.system import DescriptorSystem


def stated(
    condition: Condition, name: str, options: Options, representation: str = "", **parameters: float
) -> tuple[DescriptorSystem, Statement]:
    """A condition for a system of the catalogue, in the published representation unless another is named."""
    model = polytopic_model(system(name, **parameters), representation or condition.representation)
    return model.system, condition.build(model, options)


def decided(problem: Problem) -> Decision:
    """The verdict on a problem."""
    return decide(CompiledProblem.of(problem))


def reduced_loop(plant: DescriptorSystem, z: FloatArray, gain: FloatArray | None) -> FloatArray:
    """G with ``x_d' = G x_d`` for ``u = K x`` (n columns) or ``u = K (x_d, x_d', x_a)`` (n + q columns)."""
    E, A, B, _ = plant.evaluate(z)
    q, n = plant.differential, plant.order
    on_speed = np.zeros((len(plant.inputs), q))
    on_state = np.zeros((len(plant.inputs), n)) if gain is None else gain
    if gain is not None and gain.shape[1] == n + q:
        on_state, on_speed = np.hstack([gain[:, :q], gain[:, 2 * q :]]), gain[:, q : 2 * q]
    closed = A + B @ on_state
    unknown = np.hstack([-E[:, :q] + B @ on_speed, closed[:, q:]])  # of x_d' and x_a
    return -np.linalg.solve(unknown, closed[:, :q])[:q]


def worst_rate(plant: DescriptorSystem, feedback: Feedback, rng: np.random.Generator, samples: int = 200) -> float:
    """Largest eigenvalue of dV/dt relative to V over random premises of the box, corners included: at most -2 alpha."""
    root = np.linalg.cholesky(feedback.lyapunov)
    worst = -np.inf
    for z in premises(plant, rng, samples):
        loop = np.linalg.solve(root, reduced_loop(plant, z, feedback.gain(z) if feedback.gain else None) @ root)
        worst = max(worst, float(np.linalg.eigvalsh(loop + loop.T)[-1]))
    return worst


def worst_root(plant: DescriptorSystem, feedback: Feedback, rng: np.random.Generator, samples: int = 100) -> float:
    """Largest real part of the finite generalized eigenvalues of ``(A + B K, E)`` for feedbacks of x."""
    worst = -np.inf
    for z in premises(plant, rng, samples):
        E, A, B, _ = plant.evaluate(z)
        closed = A if feedback.gain is None else A + B @ feedback.gain(z)
        values = scipy.linalg.eigvals(closed, E)
        finite = np.sort(np.where(np.isfinite(values), np.abs(values), np.inf))[: plant.differential]
        kept = [value for value in values if np.abs(value) <= finite[-1]]
        worst = max(worst, *(value.real for value in kept))
    return worst


def premises(plant: DescriptorSystem, rng: np.random.Generator, samples: int) -> FloatArray:
    """Random points of the box, half of them with every premise at a bound."""
    inside = rng.uniform(plant.lower, plant.upper, (samples // 2, len(plant.premises)))
    corners = np.where(rng.random((samples - samples // 2, len(plant.premises))) < 0.5, plant.lower, plant.upper)
    return np.vstack([inside, corners])


def limit(holds: Callable[[float], bool], inside: float, outside: float, tolerance: float) -> float:
    """Last point known to hold when `inside` holds and `outside` does not, by bisection."""
    while abs(outside - inside) > tolerance:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside
