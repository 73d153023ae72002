"""The law `descriptor-feedback`: its document, and what is claimed of it, checked from its data and witness alone.

With E_i, A_i, B and the slack of `laws.stabilising`, V = x' P^-1 x with ``P > 0`` and

    Phi_i = [(A_i + alpha E_i) L + B F_i, (A_i + alpha E_i) R; P E_i' - L, -R]

Multiplied by [I, A + alpha E] from the left and its transpose from the right, the claim is
``He((A + alpha E) P E' + B F) < 0``: x' P^-1 x decreases under F E^-T P^-1 x (Dehak 2022, Theorem II.6, common L and
R).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import matrix, stack
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate, grid_gate, inertia_at
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.laws.stabilising import Model, SlackWitness, at_rest, schedule_at
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.certificate.robot.stabilised_model import (
    equations_of_motion_claim,
    premise_box_claims,
)
from quasilpv.documents.law import ScheduledLaw
from quasilpv.documents.tables import Matrix, PolytopeTable, require_lyapunov
from quasilpv.loops.state_law import StateLaw, descriptor_gain


class DescriptorFeedbackLaw(ScheduledLaw):
    """Descriptor feedback (Dehak 2022, II.38): ``Gamma = F(z) diag(I, M)^-1 P^-1 (y - r, w - r')``.

    ``numerator`` holds F, n x 2n, over the premises of the program ``schedule``; ``lyapunov`` is P, 2n x 2n.
    """

    scheduled = "numerator"

    kind: Literal["descriptor-feedback"]
    numerator: PolytopeTable
    lyapunov: Matrix

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        self.numerator.require_shape("law.numerator", joints, 2 * joints)
        require_lyapunov("law.lyapunov", self.lyapunov, 2 * joints)


class FactorWitness(SlackWitness):
    """The factors L and R."""

    L: Rows
    R: Rows


class DescriptorFeedbackWitness(WitnessDocument):
    """What the claims need beside the law."""

    feedback: FactorWitness


def claims(shipped: Shipped[DescriptorFeedbackLaw]) -> Iterator[Claim]:
    """What a `descriptor-feedback` artifact claims.

    Raises:
        InputError, ValueError: tables or witness are not of the documented form.
    """
    table, witness = VertexTable.of(shipped.law.numerator), shipped.witness(DescriptorFeedbackWitness).feedback
    model = Model.of(shipped, witness, table)
    P, L, R = map(matrix, (shipped.law.lyapunov, witness.L, witness.R))

    def phi(E: fmpq_mat, A: fmpq_mat, F: fmpq_mat) -> fmpq_mat:
        drift = A + model.decay * E
        return stack([[drift * L + model.B * F, drift * R], [P * E.transpose() - L, -R]])

    yield Claim.positive("feedback: P", P)
    yield from model.decrease(phi, table.vertices(), witness)
    yield from premise_box_claims(shipped, table)
    yield equations_of_motion_claim(shipped, model.E, model.A)
    yield from table.collapse_claim("numerator")


def freeze(shipped: Shipped[DescriptorFeedbackLaw], angles: FloatArray) -> StateLaw:
    """The law at rest at B configurations, (B, n)."""
    numerator = VertexTable.of(shipped.law.numerator).evaluate(schedule_at(shipped, angles))
    P = np.array(shipped.law.lyapunov, dtype=float)
    return at_rest(shipped, descriptor_gain(numerator, inertia_at(shipped, angles), P))


def gate(shipped: Shipped[DescriptorFeedbackLaw], delay_samples: fmpq) -> GridGate:
    """A grid: with matrix gains the loop of n joints does not decouple."""
    return grid_gate(shipped, delay_samples, freeze)


LAW = LawKind(DescriptorFeedbackLaw, (claims, check_design_model), gate)
