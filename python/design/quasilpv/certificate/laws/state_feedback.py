"""The law `state-feedback`: its document, and what is claimed of it, checked from its data and witness alone.

With E_i, A_i, B and the slack of `laws.stabilising`, V = x' P^-1 x with ``P > 0`` and

    Phi_i = [0, I; A_i, -E_i] [P, 0; P_21, P_22] + [alpha P, 0; B K_i P, 0]

(the closed loop E x' = (A + B K) x in the redundant state (x, x'); Dehak 2022, Theorem I.2). Linear in the vertices
because B is constant.

With the condition III.9, whose claim is about every payload (Dehak 2022, Theorem III.9: what the payload changes is
unknown to the law), ``He((A_i + B K_i) P E_f') + 2 alpha E_f P E_f' < 0`` for every vertex i and for the robot's own
descriptor ``E_f = diag(I, M_f)`` at payload fractions f = 0 and 1. M has no premise and is affine in f, and the left
side is convex in E, so it holds between.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.double_sum import he
from quasilpv.certificate.exact.matrices import identity, matrix, stack, zero
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate, grid_gate
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.laws.stabilising import FeedbackWitness, Model, SlackWitness, at_rest, schedule_at
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.data import inertia_data
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.certificate.robot.inertia import true_inertia
from quasilpv.certificate.robot.stabilised_model import (
    equations_of_motion_claim,
    payload_claim,
    premise_box_claims,
)
from quasilpv.documents.law import ScheduledLaw
from quasilpv.documents.tables import PolytopeTable
from quasilpv.loops.state_law import StateLaw


class StateFeedbackLaw(ScheduledLaw):
    """Scheduled state feedback (Dehak 2022, Theorem I.2 and (III.25)): ``Gamma = K(z) (y - r, w - r')``.

    ``gain`` holds K, n x 2n, over the premises of the program ``schedule``.
    """

    scheduled = "gain"

    kind: Literal["state-feedback"]
    gain: PolytopeTable

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        self.gain.require_shape("law.gain", joints, 2 * joints)


ROBUST = "III.9"
"""The condition whose claim is about every payload."""


class Condition(WitnessDocument):
    """Which inequalities are claimed."""

    condition: str


class Stated(WitnessDocument):
    """The part of the witness that says so."""

    feedback: Condition


class RedundantWitness(SlackWitness):
    """Of condition I.2."""

    P: Rows
    P21: Rows
    P22: Rows


class StateFeedbackWitness(WitnessDocument):
    """What the claims of condition I.2 need beside the law."""

    feedback: RedundantWitness


class RobustFeedbackWitness(FeedbackWitness):
    """Of condition III.9."""

    P: Rows


class RobustWitness(WitnessDocument):
    """What the claims of condition III.9 need beside the law."""

    feedback: RobustFeedbackWitness


def claims(shipped: Shipped[StateFeedbackLaw]) -> Iterator[Claim]:
    """What a `state-feedback` artifact claims.

    Raises:
        InputError, ValueError: tables or witness are not of the documented form.
    """
    table = VertexTable.of(shipped.law.gain)
    robust = shipped.witness(Stated).feedback.condition == ROBUST
    yield from (_robust_claims if robust else _redundant_claims)(shipped, table)


def _redundant_claims(shipped: Shipped[StateFeedbackLaw], table: VertexTable) -> Iterator[Claim]:
    """The claims of condition I.2."""
    witness = shipped.witness(StateFeedbackWitness).feedback
    model = Model.of(shipped, witness, table)
    P, lower_left, lower_right = map(matrix, (witness.P, witness.P21, witness.P22))
    size = P.nrows()
    none = zero(size, size)
    multiplier = stack([[P, none], [lower_left, lower_right]])

    def phi(E: fmpq_mat, A: fmpq_mat, K: fmpq_mat) -> fmpq_mat:
        return stack([[none, identity(size)], [A, -E]]) * multiplier + stack(
            [[model.decay * P, none], [model.B * K * P, none]]
        )

    yield Claim.positive("feedback: P", P)
    yield from model.decrease(phi, table.vertices(), witness)
    yield from premise_box_claims(shipped, table)
    yield equations_of_motion_claim(shipped, model.E, model.A)
    yield from table.collapse_claim("gain")


def _robust_claims(shipped: Shipped[StateFeedbackLaw], table: VertexTable) -> Iterator[Claim]:
    """The claims of condition III.9 about a `state-feedback` law."""
    witness = shipped.witness(RobustWitness).feedback
    model, P = Model.of(shipped, witness, table), matrix(witness.P)
    inertia = true_inertia(inertia_data(shipped))
    n = len(inertia)
    if n > 1 or inertia[0][0].degree() > 1:
        raise ValueError("the inertia is affine in the payload and has no premise")
    descriptors = [stack([[identity(n), zero(n, n)], [zero(n, n), matrix([[inertia[0][0](fmpq(f))]])]]) for f in (0, 1)]
    closed = [A + model.B * K for A, K in zip(model.A.vertices(), table.vertices(), strict=True)]
    yield Claim.positive("feedback: decay rate", matrix([[model.decay]]))
    yield Claim.positive("feedback: P", P)
    for i, loop in enumerate(closed):
        for f, E in enumerate(descriptors):
            decrease = -he(loop * P * E) - 2 * model.decay * E * P * E
            yield Claim.positive(f"feedback: decrease {i}, payload {f}", decrease)
    yield from premise_box_claims(shipped, table)
    yield equations_of_motion_claim(shipped, model.E, model.A)
    yield payload_claim(shipped)
    yield from table.collapse_claim("gain")


def freeze(shipped: Shipped[StateFeedbackLaw], angles: FloatArray) -> StateLaw:
    """The law at rest at B configurations, (B, n)."""
    return at_rest(shipped, VertexTable.of(shipped.law.gain).evaluate(schedule_at(shipped, angles)))


def gate(shipped: Shipped[StateFeedbackLaw], delay_samples: fmpq) -> GridGate:
    """A grid: with matrix gains the loop of n joints does not decouple."""
    return grid_gate(shipped, delay_samples, freeze)


LAW = LawKind(StateFeedbackLaw, (claims, check_design_model), gate)
