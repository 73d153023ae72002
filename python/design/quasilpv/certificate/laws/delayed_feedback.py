"""The law `delayed-feedback`: its document, and what is claimed of it, checked from its data and witness alone.

With E_i, A_i and B of `laws.stabilising`, V = x' P(varpi)^-1 x: with ``D_k = (P_k - P_0) / tau``, ``P_k > 0``, for all
i <= j <= l, k and m

    mean over the permutations (a, b, c) of (i, j, l) of
        He((A_a + alpha E_a) P_k E_b' + B F_bkm) - E_a (D_c - D_m) E_b'  < 0

(Dehak 2022, Theorem II.8; ``dP/dt = sum_cm w_c(z) w_m(z_d) (P_c - P_m) / tau``), and in the limit tau -> 0 with the D_k
of the witness and one P.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement, permutations, product
from typing import Literal

import numpy as np
from flint import fmpq, fmpq_mat
from pydantic import Field

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.double_sum import he
from quasilpv.certificate.exact.matrices import is_symmetric, matrix, rational, zero
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate, grid_gate, inertia_at
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.laws.stabilising import FeedbackWitness, Model, at_rest, schedule_at
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.certificate.robot.stabilised_model import (
    linearisation_claim,
    premise_box_claims,
)
from quasilpv.documents.law import ScheduledLaw
from quasilpv.documents.strict_model import FieldError
from quasilpv.documents.tables import Matrix, PolytopeTable, require_shape
from quasilpv.loops.state_law import StateLaw, descriptor_gain

MIN_WINDOW_SAMPLES = 5
"""A shorter moving window has no mean to speak of; 0 stands for its limit."""

MAX_WINDOW_SAMPLES = 4096
MAX_DELAYED_VERTICES = 16


class DelayedFeedbackLaw(ScheduledLaw):
    """Feedback with a moving window (Dehak 2022, II.49 and II.69): ``Gamma = F diag(I, M)^-1 P(varpi)^-1 x``.

    ``lyapunov`` holds P, 2n x 2n, over the premises of the program ``schedule``; ``numerators`` the F_jkm, n x 2n, m
    fastest; ``window_samples`` is tau/T, or 0 for the limit of a short window; without ``descriptor`` diag(I, M) is
    left out.
    """

    scheduled = "lyapunov"

    kind: Literal["delayed-feedback"]
    lyapunov: PolytopeTable
    numerators: tuple[Matrix, ...]
    window_samples: int = Field(ge=0, le=MAX_WINDOW_SAMPLES)
    descriptor: bool

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        self.lyapunov.require_lyapunov("law.lyapunov", 2 * joints)
        count = self.lyapunov.vertex_count
        if count > MAX_DELAYED_VERTICES:
            raise FieldError("law.lyapunov", f"{count} vertices", f"at most {MAX_DELAYED_VERTICES}")
        if len(self.numerators) != count**3:
            expected = f"{count**3}, the cube of the number of vertices"
            raise FieldError("law.numerators", f"{len(self.numerators)} matrices", expected)
        for i, numerator in enumerate(self.numerators):
            require_shape(f"law.numerators[{i}]", numerator, joints, 2 * joints)
        if 0 < self.window_samples < MIN_WINDOW_SAMPLES:
            expected = f"0 (the limit of a short window) or at least {MIN_WINDOW_SAMPLES} sample periods"
            raise FieldError("law.window_samples", self.window_samples, expected)


class RatesWitness(FeedbackWitness):
    """And, in the limit of a short window, D_k."""

    D: tuple[Rows, ...] | None = None


class DelayedFeedbackWitness(WitnessDocument):
    """What the claims need beside the law."""

    feedback: RatesWitness


def claims(shipped: Shipped[DelayedFeedbackLaw]) -> Iterator[Claim]:
    """What a `delayed-feedback` artifact with the descriptor claims.

    Raises:
        InputError, ValueError: tables or witness are not of the documented form, or there is no descriptor.
    """
    law, witness = shipped.law, shipped.witness(DelayedFeedbackWitness).feedback
    table = VertexTable.of(law.lyapunov)
    model = Model.of(shipped, witness, table)
    if not law.descriptor:
        raise ValueError("only laws with the descriptor are checked")
    P, numerators = table.vertices(), [matrix(F) for F in law.numerators]
    for k, vertex in enumerate(P):
        yield Claim.positive(f"feedback: P {k}", vertex)
    yield from _delayed_claims(model, P, numerators, _rates(shipped, table, witness))
    yield from premise_box_claims(shipped, table)
    yield linearisation_claim(shipped, model.E, model.A)


def _rates(shipped: Shipped[DelayedFeedbackLaw], table: VertexTable, witness: RatesWitness) -> list[fmpq_mat]:
    """D_k with ``dP/dt = sum_cm w_c w_m (D_c - D_m)``: fixed by P_k and tau, or by the witness in the limit."""
    samples = shipped.law.window_samples
    P = table.vertices()
    if samples:
        window = samples * rational(shipped.artifact.sample_period_s)
        return [(Pk - P[0]) / window for Pk in P]
    if any(Pk != P[0] for Pk in P):
        raise ValueError("in the limit of a short window all vertices of P are equal")
    return [matrix(D) for D in witness.D or ()]


def _delayed_claims(
    model: Model, P: Sequence[fmpq_mat], numerators: Sequence[fmpq_mat], D: Sequence[fmpq_mat]
) -> Iterator[Claim]:
    E, A = model.E.vertices(), model.A.vertices()
    count = len(E)
    if len(numerators) != count**3 or len(D) != count or not all(map(is_symmetric, D)):
        raise ValueError(f"{count} vertices need {count**3} gains and {count} symmetric D")
    yield Claim.positive("feedback: decay rate", matrix([[model.decay]]))
    for place in combinations_with_replacement(range(count), 3):
        orders = sorted(set(permutations(place)))
        for k, m in product(range(count), repeat=2):
            total = zero(E[0].nrows(), E[0].nrows())
            for a, b, c in orders:
                drift = (A[a] + model.decay * E[a]) * P[k] * E[b].transpose()
                gain = model.B * numerators[(b * count + k) * count + m]
                moving = E[a] * (D[c] - D[m]) * E[b].transpose()
                total += he(drift + gain) - he(moving) / 2
            yield Claim.positive(f"feedback: decrease {place} {k} {m}", -total)


def freeze(shipped: Shipped[DelayedFeedbackLaw], angles: FloatArray) -> StateLaw:
    """The law at rest at B configurations, (B, n), its window filled with them."""
    law, premises = shipped.law, schedule_at(shipped, angles)
    table = VertexTable.of(law.lyapunov)
    weights, P = table.weights(premises), table.evaluate(premises)
    count = weights.shape[1]
    cube = np.array(law.numerators, dtype=float).reshape(count, count, count, *np.shape(law.numerators[0]))
    numerator = np.einsum("zj,zk,zm,jkmab->zab", weights, weights, weights, cube)
    if law.descriptor:
        return at_rest(shipped, descriptor_gain(numerator, inertia_at(shipped, angles), P))
    return at_rest(shipped, np.asarray(np.linalg.solve(P, numerator.swapaxes(1, 2)).swapaxes(1, 2)))


def gate(shipped: Shipped[DelayedFeedbackLaw], delay_samples: fmpq) -> GridGate:
    """A grid: with matrix gains the loop of n joints does not decouple."""
    return grid_gate(shipped, delay_samples, freeze)


LAW = LawKind(DelayedFeedbackLaw, (claims, check_design_model), gate)
