"""Guerra, Bernal, Kruszewski and Afroun 2007, Theorem 1: fuzzy descriptor systems with two sets of rules.

The premises of A and B give vertices i, j with weights h, those of E vertices k with weights v. For a regular system,
with ``V = x' P_1^-1 x`` and ``u = sum_jk h_j v_k F_jk P_1^-1 x``,

    sum_ijk h_i h_j v_k He [alpha P_1 + P3_ij, P4_ij; A_i P_1 + B_i F_jk - E_k P3_ij, -E_k P4_ij] < 0,

and ``P_1 = P_1' > 0``, as a double sum over i, j for every k. It is Theorem I.2 (`i2`) with
``P = [P_1 0; P3(z) P4(z)]``; the second index of P3_ij is no error here, since it multiplies E_k and not A_i.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from quasilpv.conditions.condition import Condition, Feedback, Options, Statement, Values
from quasilpv.conditions.forms.blocks import double_sum
from quasilpv.conditions.gains import TwoSetsGain
from quasilpv.conditions.reliance import Reliance
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable, block
from quasilpv.polytopes import PolytopicModel
from quasilpv.polytopes.model import ExactMatrix, Vertices


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the theorem.

    Unknowns ``P_1 = P_1' > 0`` (n, n), P3_ij, P4_ij (n, n) and F_jk (m, n).

    Raises:
        InputError: the representation is not one box.
    """
    if len(model.polytope.blocks) != 1 or model.polytope.blocks[0].kind != "box":
        raise InputError("condition guerra-2007", "representation", "several blocks or a simplex", "ts")
    n, m = model.order, model.inputs
    AB, E = _distinct(model.vertices(lambda E, A, B: np.hstack([A, B]))), _distinct(model.E)
    P1 = Variable("P1", n, symmetric=True)
    rules = range(len(AB))
    P3, P4 = ({(i, j): Variable(f"{name} {i} {j}", n) for i in rules for j in rules} for name in ("P3", "P4"))
    F = {(j, k): Variable(f"F {j} {k}", m, n) for j in rules for k in range(len(E))}
    alpha = Fraction(options.decay_rate)
    problem = Problem()
    problem.positive("P1", P1)
    for k, E_k in enumerate(E):

        def entry(i: int, j: int, k: int = k, E_k: ExactMatrix = E_k) -> Expression:
            A, B = AB[i][:, :n], AB[i][:, n:]
            coupling = A @ P1 + B @ F[j, k] - E_k @ P3[i, j]
            return block([[P3[i, j] + P1 * alpha, P4[i, j]], [coupling, -(E_k @ P4[i, j])]])

        double_sum(problem, f"Upsilon {k}", entry, len(AB))

    def feedback(values: Values) -> Feedback:
        vertices = np.stack([[values[F[j, k]] for k in range(len(E))] for j in rules]) @ np.linalg.inv(values[P1])
        of_right, of_left = (
            model.premises_of(lambda E, A, B: np.hstack([A, B])),
            model.premises_of(lambda E, A, B: E),
        )
        h, v = model.polytope.restricted(of_right), model.polytope.restricted(of_left)
        gain = TwoSetsGain(h, v, (tuple(of_right), tuple(of_left)), vertices)
        return Feedback(values[P1], gain if m else None)

    return Statement(problem, feedback)


def _distinct(vertices: Vertices) -> list[ExactMatrix]:
    """Vertices without repetition, in the order of the box of the premises that matter."""
    return list({id(vertex): vertex for vertex in vertices}.values())


CONDITION = Condition(
    id="guerra-2007",
    summary="regular systems: two sets of rules, Lyapunov matrix with free lower blocks",
    reference="Guerra, Bernal, Kruszewski and Afroun 2007, Theorem 1; counts of Dehak 2022, Table II.4",
    representation="ts",
    inequalities=inequalities,
    relies_on=(
        Reliance.REGULAR,
        Reliance.NO_UNKNOWN,
        Reliance.INDEX_ONE,
        Reliance.STATE,
        Reliance.SCHEDULED,
        Reliance.DOMAIN,
    ),
)
