"""Extended compensation (I.53) in closed loop, on the exact model: simulation only.

``u = K(z) (x_d, x_d', x_a)`` feeds back the derivative of the state it drives. On a robot that is the acceleration of
the instant at which the torque is decided, which no sensor gives: an accelerometer measures what the torque before
caused, and the loop u -> x_d' -> u closes within one sample. There is therefore no law kind, no artifact and no
controller for it. Here the loop is solved at every instant together with the model,

    [E_d - B K_s, -(A_a + B K_a)] (x_d', x_a) = (A_d + B K_d) x_d

with E_d, A_d the columns of x_d, A_a those of x_a and K = [K_d, K_s, K_a]: what one would see with an ideal sensor and
no sampling. Source: Dehak 2022, (I.53) and Remark I.7; Cardim et al. 2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Feedback, Options
from quasilpv.conditions.theorems import i53
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.polytopes.representation import polytopic_model
from quasilpv.systems.descriptor.system import DescriptorSystem

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-9, 1e-11
SINGULAR = 1e-12
"""Reciprocal condition number below which the loop through the derivative has no solution."""


@dataclass(frozen=True, eq=False)
class ExtendedRun:
    """A motion under extended compensation at N instants.

    Attributes:
        time_s: (N,).
        state: x_d, (N, q).
        derivative: x_d', (N, q).
        algebraic: x_a, (N, n - q).
        input: u, (N, m).
        lyapunov: ``V = x_d' P^-1 x_d``, (N,).
    """

    time_s: FloatArray
    state: FloatArray
    derivative: FloatArray
    algebraic: FloatArray
    input: FloatArray
    lyapunov: FloatArray


def extended_feedback(system: DescriptorSystem, decay_per_s: float) -> Feedback:
    """Gains of condition I.53 in the representation it was published with.

    Args:
        system: to be stabilised.
        decay_per_s: alpha >= 0; V decreases at least like ``exp(-2 alpha t)``.

    Raises:
        InfeasibleError: there is no verified solution.
    """
    model = polytopic_model(system, i53.CONDITION.representation)
    statement = i53.CONDITION.build(model, Options(decay_rate=decay_per_s))
    solution = statement.problem.solve_inside(0.1)
    if not solution.verified:
        raise InfeasibleError(f"{system.name}: no verified solution of I.53 with decay rate {decay_per_s:g} 1/s")
    return statement.feedback(solution.values)


def simulate_extended(
    system: DescriptorSystem, feedback: Feedback, start: npt.ArrayLike, time_s: npt.ArrayLike
) -> ExtendedRun:
    """Integrate the closed loop of the exact model.

    Args:
        system: its premises are functions of the differential states.
        feedback: K(z), (m, n + q), and P.
        start: x_d at the first instant, (q,).
        time_s: instants to report, ascending, (N,).

    Raises:
        InputError: start is not of that size, a premise depends on an algebraic state or on an unknown, the feedback is
            no extended one, or the loop through the derivative is singular on the way.
    """
    loop, instants = _Loop(system, feedback), np.asarray(time_s, dtype=float)
    state = np.asarray(start, dtype=float)
    if state.shape != (system.differential,):
        raise InputError(system.name, "start", f"shape {state.shape}", f"({system.differential},)")
    motion = solve_ivp(
        lambda _, x: loop.solve(x)[0],
        (instants[0], instants[-1]),
        state,
        t_eval=instants,
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
    )
    states = motion.y.T
    derivative, algebraic, inputs = (np.array(column) for column in zip(*map(loop.solve, states), strict=True))
    lyapunov = np.einsum("ki,ki->k", states, np.linalg.solve(feedback.lyapunov, states.T).T)
    return ExtendedRun(instants, states, derivative, algebraic, inputs, lyapunov)


class _Loop:
    """The equations of one instant."""

    def __init__(self, system: DescriptorSystem, feedback: Feedback) -> None:
        """Refuse what cannot be evaluated from x_d alone."""
        known = set(system.state[: system.differential])
        for premise in system.premises:
            if not premise.expression.free_symbols <= known:
                raise InputError(system.name, f"premise {premise.name}", premise.expression, "of differential states")
        self._system, self._gain = system, feedback.gain
        columns = system.order + system.differential
        shape = None if self._gain is None else self._gain(system.lower).shape
        if shape != (len(system.inputs), columns):
            raise InputError(system.name, "gain", f"shape {shape}", f"({len(system.inputs)}, {columns}), of (I.53)")

    def solve(self, x_d: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x_d', x_a and u at a state."""
        system, q, n = self._system, self._system.differential, self._system.order
        z = system.premise_values(np.concatenate([x_d, np.zeros(n - q)]))
        E, A, B, _ = system.evaluate(z)
        assert self._gain is not None
        K = self._gain(z)
        unknown = np.hstack([E[:, :q] - B @ K[:, q : 2 * q], -(A[:, q:] + B @ K[:, 2 * q :])])
        if 1.0 / np.linalg.cond(unknown) < SINGULAR:
            raise InputError(system.name, "loop", f"singular at x_d = {x_d.tolist()}", "a regular loop through x_d'")
        solved: FloatArray = np.asarray(np.linalg.solve(unknown, (A[:, :q] + B @ K[:, :q]) @ x_d))
        derivative, algebraic = solved[:q], solved[q:]
        return derivative, algebraic, np.asarray(K @ np.concatenate([x_d, derivative, algebraic]))
