"""What the checks of the stabilising laws share.

With the vertices E_i, A_i of the witness's model over the premises of ``schedule`` (tied to the robot by
`robot.stabilised_model`), ``B = [0; I]``, alpha the decay rate, He(X) = X + X', and the slack of block polytopes
``T_b(i) - mean`` with one symmetric T_b per block (its weighted mean is zero), claims are

    He(Phi_i) + T_b(i) - mean < 0    for every vertex i,

Phi_i that of the law. V then decreases with the rate alpha while the state is in the operating domain, in continuous
time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.double_sum import he
from quasilpv.certificate.exact.matrices import identity, is_symmetric, matrix, rational, stack, zero
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.stabilised_model import SCHEDULE
from quasilpv.documents.tables import PolytopeTable
from quasilpv.loops.state_law import StateLaw

Phi: TypeAlias = Callable[[fmpq_mat, fmpq_mat, fmpq_mat], fmpq_mat]


class ModelDocument(WitnessDocument):
    """``E x' = A x + [0; I] u`` as tables over the schedule."""

    E: PolytopeTable
    A: PolytopeTable


class FeedbackWitness(WitnessDocument):
    """What every stabilising law states beside itself."""

    decay_per_s: float
    model: ModelDocument


class SlackWitness(FeedbackWitness):
    """And the slack, one matrix per block or none."""

    slack: tuple[Rows, ...]


@dataclass(frozen=True, eq=False)
class Model:
    """Vertex tables of E and A, B, and the decay rate."""

    E: VertexTable
    A: VertexTable
    B: fmpq_mat
    decay: fmpq

    @classmethod
    def of(cls, shipped: Shipped[Any], witness: FeedbackWitness, table: VertexTable) -> Model:
        """The model of a witness; its tables must have the schedule of the law's own table."""
        E, A = VertexTable.of(witness.model.E), VertexTable.of(witness.model.A)
        if not E.schedule == A.schedule == table.schedule:
            raise ValueError("the tables of the law and of the witness differ in box, centre or blocks")
        n = shipped.artifact.joints
        return cls(E, A, stack([[zero(n, n)], [identity(n)]]), rational(witness.decay_per_s))

    def block_of(self) -> list[int]:
        """Block of every vertex."""
        return [b for b, block in enumerate(self.E.blocks) for _ in range(2 ** len(block))]

    def decrease(self, phi: Phi, gains: Sequence[fmpq_mat], witness: SlackWitness) -> Iterator[Claim]:
        """``He(Phi_i) + T_b(i) - mean < 0`` at every vertex; without slack in the witness T = 0."""
        slack = [matrix(T) for T in witness.slack]
        if slack and (len(slack) != len(self.E.blocks) or not all(map(is_symmetric, slack))):
            raise ValueError(f"{len(slack)} slack matrices, expected one symmetric matrix for each block")
        vertices = zip(self.E.vertices(), self.A.vertices(), gains, self.block_of(), strict=True)
        yield Claim.positive("feedback: decay rate", matrix([[self.decay]]))
        for i, (E, A, gain, b) in enumerate(vertices):
            entry = he(phi(E, A, gain))
            if slack:
                entry += slack[b] - sum(slack[1:], slack[0]) * fmpq(1, len(slack))
            yield Claim.positive(f"feedback: decrease {i}", -entry)


def schedule_at(shipped: Shipped[Any], angles: FloatArray) -> FloatArray:
    """The outputs of the program ``schedule`` at rest at B configurations, (B, n): (B, p)."""
    return np.column_stack(program_values(shipped.program(SCHEDULE).code, list(angles.T), list(0.0 * angles.T)))


def at_rest(shipped: Shipped[Any], gain: FloatArray) -> StateLaw:
    """The law with this gain, (B, n, 2n), at rest at B configurations."""
    return StateLaw(shipped.artifact.sample_period_s, gain, shipped.law.velocity_filter_time_constant_s)
