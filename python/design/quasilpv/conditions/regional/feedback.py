"""A feedback and the region in which it is proved: Theorem I.2 inside a box of states, with limited inputs.

A quasi-LPV condition holds while the state stays in the box over which the premises are bounded; nothing in it says
that it does. Here the law ``u = K(z) x_d``, ``K(z) = sum_j w_j(z) K_j``, ``K_j = M_j P^-1``, comes with the ellipsoid
``x_d' P^-1 x_d <= 1`` that no solution leaves and inside which every bound holds. With the extended form
(`quasilpv.conditions.forms.extended`), P = P_11 and ``P_e = [P 0; W Z]``,

    decay        sum_ij w_i w_j He((A_i + alpha E_o) P_e + B_i [M_j 0]) < 0
    states       P_kk < b_k^2                                               |x_k| < b_k
    inputs       sum_j w_j [u_k^2, M_jk; *, P] > 0                          |u_k| < u_max,k
    algebraic    sum_j w_j [P, (A_21 P + A_22 Y + B_2 M_j)', Y' c; *, He(A_22 Z_2), Z_2' c; *, *, b^2] > 0  |c' x_a| < b
    speed        sum_j w_j [b P, (A P + B M_j)', 0; *, b He(E G), b G'; *, *, b P] > 0    |E^-1 (A + B K)|_P < b

The speed (printed for a regular system; of a singular one with the multiplier of the algebraic states too) bounds the
norm of the closed loop in the norm of the Lyapunov function, ``|x|_P^2 = x' P^-1 x``: what sampling has to be fast for.
Its inequality comes from ``E P E' >= E G + G' E' - G' P^-1 G``.

Algebraic states: with ``x_d = P xi`` and ``x_a = Y xi + eta``, ``A_22 eta = -(A_21 P + A_22 Y + B_2 M) xi``, and
``[P, -R', Y' c; -R, ...]`` is what is left of ``b^2 xi' P xi - (c' x_a)^2`` after eta is eliminated with the multiplier
Z_2 (a projection, as of (I.25)).

Source: the ellipsoids of Boyd, El Ghaoui, Feron and Balakrishnan 1994, sections 5.2 and 7.2, for descriptor systems.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from quasilpv.conditions.condition import is_single_sum, shared_gains, single_sum_blocks, vertex_sum
from quasilpv.conditions.forms.blocks import single_sum
from quasilpv.conditions.forms.extended import extended_inputs, extended_lyapunov, extended_states, on_differential
from quasilpv.conditions.forms.slack import Slack
from quasilpv.lmi import Expression, Problem, Variable, block, zeros
from quasilpv.lmi.expressions import Operand, as_expression
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix


@dataclass(frozen=True)
class RegionalLimits:
    """What has to hold inside the region; infinite for what is not limited.

    Attributes:
        decay_rate: alpha with ``V' <= -2 alpha V``, 1/s.
        states: b_k of every state, differential ones first, (n,).
        inputs: u_max, (m,).
        speed: b, 1/s.
    """

    decay_rate: float
    states: tuple[float, ...]
    inputs: tuple[float, ...]
    speed: float = float("inf")


@dataclass(frozen=True, eq=False)
class RegionalStatement:
    """The inequalities, and their unknowns by what they are.

    Attributes:
        problem: without objective.
        P, W, Z: of the extended Lyapunov matrix.
        M: of every vertex; vertices that differ in unknown premises only share theirs.
        slacks: by the inequalities they belong to: ``"decay"``, ``"input k"``, ``"algebraic k"``, ``"speed"``.
        multipliers: further unknowns, by name.
    """

    problem: Problem
    P: Variable
    W: Variable
    Z: Variable
    M: tuple[Variable, ...]
    slacks: dict[str, tuple[Variable, ...]]
    multipliers: dict[str, Variable]

    @property
    def further(self) -> dict[str, Variable]:
        """All unknowns but P and the M_j by name, slack numbered."""
        slacks = {f"{name} slack {k}": T for name, own in self.slacks.items() for k, T in enumerate(own)}
        return {"W": self.W, "Z": self.Z, **self.multipliers, **slacks}


def regional_statement(model: PolytopicModel, limits: RegionalLimits) -> RegionalStatement:
    """State it.

    Args:
        model: of the system.
        limits: what has to hold.
    """
    q, n = model.differential, model.order
    P, W, Z = Variable("P", q, symmetric=True), Variable("W", n, q), Variable("Z", n)
    M = shared_gains(model, q, "M")
    own = RegionalStatement(Problem(), P, W, Z, M, {}, {})
    own.problem.positive("P", P)
    _decay(own, model, limits.decay_rate)
    for k, bound in enumerate(limits.states):
        if np.isinf(bound):
            continue
        if k < q:
            chosen = _row(k, q)
            own.problem.positive(f"state {k}", _number(Fraction(bound) ** 2) - chosen @ P @ chosen.T)
        else:
            _algebraic(own, model, k - q, Fraction(bound))
    require_inputs(own, model, limits.inputs)
    if np.isfinite(limits.speed):
        _speed(own, model, Fraction(limits.speed))
    return own


def _decay(own: RegionalStatement, model: PolytopicModel, decay_rate: float) -> None:
    q, n = model.differential, model.order
    A, B = extended_states(model, decay_rate), extended_inputs(model)
    lyapunov = extended_lyapunov(own.P, own.W, own.Z)

    def entry(i: int, j: int) -> Expression:
        return as_expression(A[i] @ lyapunov + B[i] @ on_differential(own.M[j], q, n))

    own.slacks["decay"] = _vertex_sum(own.problem, "decay", entry, model)


def require_inputs(
    own: RegionalStatement, model: PolytopicModel, limits: Sequence[float], share: Variable | None = None
) -> None:
    """Require ``u_k^2 < share u_max,k^2`` in the region, of every input with a finite limit.

    Args:
        own: receives the inequalities.
        model: as in `regional_statement`.
        limits: u_max, (m,).
        share: 1 x 1; None stands for 1.
    """
    blocks = single_sum_blocks(model, Slack.THESIS)
    for k, bound in enumerate(limits):
        if np.isinf(bound):
            continue
        square = _number(Fraction(bound) ** 2)
        corner = as_expression(square) if share is None else share * square
        chosen = _row(k, model.inputs)

        def entry(j: int, corner: Expression = corner, chosen: ExactMatrix = chosen) -> Expression:
            return -block([[corner, chosen @ own.M[j]], [None, as_expression(own.P)]])

        own.slacks[f"input {k}"] = single_sum(own.problem, f"input {k}", entry, model.vertex_count, blocks)


def _algebraic(own: RegionalStatement, model: PolytopicModel, k: int, bound: Fraction) -> None:
    q, n = model.differential, model.order
    a = n - q
    Y, Z2 = Variable(f"Y {k}", a, q), Variable(f"Z2 {k}", a)
    own.multipliers.update({f"Y {k}": Y, f"Z2 {k}": Z2})
    chosen = _row(k, a)
    A21 = model.vertices(lambda E, A, B: A[q:, :q])
    A22 = model.vertices(lambda E, A, B: A[q:, q:])
    B2 = model.vertices(lambda E, A, B: B[q:])

    def entry(i: int, j: int) -> Expression:
        rest = A21[i] @ own.P + A22[i] @ Y + B2[i] @ own.M[j]
        return -block(
            [
                [as_expression(own.P), None, None],
                [-rest, (A22[i] @ Z2) * -2, None],
                [chosen @ Y, chosen @ Z2, _number(bound**2)],
            ]
        )

    own.slacks[f"algebraic {k}"] = _vertex_sum(own.problem, f"algebraic {k}", entry, model)


def _speed(own: RegionalStatement, model: PolytopicModel, bound: Fraction) -> None:
    q, n = model.differential, model.order
    a = n - q
    G = Variable("G", q)
    own.multipliers["G"] = G
    if a:
        own.multipliers.update({"Y speed": Variable("Y speed", a, q), "Z2 speed": Variable("Z2 speed", a)})
    E = model.vertices(lambda E, A, B: E[:q, :q])

    def entry(i: int, j: int) -> Expression:
        drift = model.A[i][:, :q] @ own.P + model.B[i] @ own.M[j]
        rows: list[list[Operand | None]] = [
            [own.P * bound, None, None],
            [_rows(drift, 0, q), (E[i] @ G) * (2 * bound), None],
            [zeros(q, q), G * bound, own.P * bound],
        ]
        if not a:
            return -block(rows)
        Y, Z2 = own.multipliers["Y speed"], own.multipliers["Z2 speed"]
        A12, A22 = model.A[i][:q, q:], model.A[i][q:, q:]
        rows[1][0] = _rows(drift, 0, q) + A12 @ Y
        rest = _rows(drift, q, n) + A22 @ Y
        wide = [[*row, None] for row in rows]
        return -block([*wide, [-rest, (A12 @ Z2).T, zeros(a, q), (A22 @ Z2) * -2]])

    own.slacks["speed"] = _vertex_sum(own.problem, "speed", entry, model)


def _rows(matrix: Expression, start: int, stop: int) -> Expression:
    chosen = np.zeros((stop - start, matrix.shape[0]), dtype=int).astype(object)
    chosen[np.arange(stop - start), np.arange(start, stop)] = 1
    return as_expression(chosen @ matrix)


def _vertex_sum(
    problem: Problem, name: str, entry: Callable[[int, int], Expression], model: PolytopicModel
) -> tuple[Variable, ...]:
    return vertex_sum(problem, name, entry, model, Slack.THESIS, single=is_single_sum(model, Slack.THESIS))


def _row(k: int, size: int) -> ExactMatrix:
    row = np.zeros((1, size), dtype=int).astype(object)
    row[0, k] = 1
    return row


def _number(value: Fraction) -> ExactMatrix:
    return np.array([[value]], dtype=object)
