"""The law `dob-torque`: its document, and what is claimed of it, checked from its data and witness alone.

The gains and the design inertia are the doubles of the vertex tables, taken as the rationals they are; the Lyapunov
matrices and multipliers are the witness. Nothing is solved for: ``Y_i = K_i P`` and ``W_i = Q L_i`` hold by
definition. Blocks are n x n, He(X) = X + X'. With weights ``w_i(z) >= 0`` that sum to 1, ``M(z) = sum w_i M_i`` and
gains alike (SI, signs of Dehak 2022, Theorem IV.11 in reduced form):

* feedback, ``xi = (e, e', int e)``: ``E(z) xi' = (A + B K(z)) xi + B d``, ``E_i = diag(I, M_i, I)``,
  ``A = [[0, I, 0], [0, 0, 0], [I, 0, 0]]``, ``B = [0; I; 0]``, ``C = [I, 0, 0]``. Claims, with ``V = xi' P^-1 xi``:
  ``P > 0`` and, as double sums over i, j,

      [He((A + B K_i) P E_j') + 2 alpha E_i P E_j',  B,  E_i P C';  *, -gamma I, 0;  *, *, -I] < 0
      [-rho E_i P E_j',  (A + B K_i) P;  *, -rho P] < 0

  that is: every solution decays like exp(-alpha t), ``|e|^2 <= gamma |d|^2`` in L2, frozen poles lie in |s| < rho.
* observer, ``eps = (theta, w, d, d') - estimate``: ``eps' = (A - L(z) C) eps + G v + H d'' - nu L(z) n`` with
  ``M(z) v = D eps``, A the chain ``theta' = w``, ``d' = d'``, ``G = [0; I; 0; 0]``, ``H = [0; 0; 0; I]``,
  ``C = [I, 0, 0, 0]``, ``D = [0, 0, I, 0]``. Claims, with ``V = eps' Q eps`` and a multiplier F (F^) of the constraint
  ``c_i (eps, v) = [D, -M_i] (eps, v) = 0``: ``Q > 0`` and, for every i, with ``X_i = Q (A - L_i C)``,

      [He(X_i) + 2 alpha Q, Q G, Q H, -nu Q L_i, D';  *, 0, 0, 0, 0;  *, *, -gamma I, 0, 0;  *, *, *, -gamma I, 0;
       *, *, *, *, -I] + He([F; 0; 0; 0] [c_i, 0, 0, 0]) < 0
      [-rho Q, 0, X_i';  *, 0, G' Q;  *, *, -rho Q] + He([F^; 0] [c_i, 0]) < 0

  that is: the error decays like exp(-alpha t), ``|D eps|^2 <= gamma (|d''|^2 + |n|^2)`` in L2, poles as above.

A law with a premultiplication beta is one of ``beta(z) (M theta'' - u_joint) = beta(z) d_joint``: M_i above is then
``beta_i M``, M the constant inertia of the table, and ``beta(z)`` is invertible because ``He(beta_i) > 0``.

A double sum ``sum_ij w_i w_j X_ij < 0`` is claimed through ``X_ii < 0`` and ``2/(N-1) X_ii + X_ij + X_ji < 0`` for
all ordered i != j (Tuan et al. 2001, Theorem 2.2).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Literal

from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.double_sum import double_sum, he
from quasilpv.certificate.exact.matrices import identity, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate, grid_gate, premises_at
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.laws.torque_envelope import PolytopicEnvelope, torque_envelope_claims
from quasilpv.certificate.reading import Rows, Shipped, WitnessDocument
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.documents.law import OptionalMemberLaw
from quasilpv.documents.strict_model import Positive
from quasilpv.documents.tables import PolytopeTable
from quasilpv.loops.torque_law import TorqueLaw


class DobTorqueLaw(OptionalMemberLaw):
    """Tracking in torque coordinates with a disturbance observer and scheduled gains (Dehak 2022, Theorem IV.11).

    ``feedback`` holds [Kp Kd KI], n x 3n, acting on x - x_r; ``observer`` holds [L1; L2; L3; L4], 4n x n. With
    ``premultiplication`` beta, n x n, they belong to beta(z) times the equations of motion.
    """

    DISTURBANCE = "torque"

    optional: ClassVar[Mapping[str, str]] = {"premultiplication": "a block polytope"}

    kind: Literal["dob-torque"]
    inertia: PolytopeTable
    feedback: PolytopeTable
    observer: PolytopeTable
    filter_time_constant_s: Positive
    premultiplication: PolytopeTable | None = None

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        self.feedback.require_gains("law.feedback", joints, 3 * joints, self.inertia)
        self.observer.require_gains("law.observer", 4 * joints, joints, self.inertia)
        if self.premultiplication is not None:
            self.premultiplication.require_gains("law.premultiplication", joints, joints, self.inertia)

    def tables(self) -> dict[str, PolytopeTable]:
        """All tables by name."""
        tables = {"inertia": self.inertia, "feedback": self.feedback, "observer": self.observer}
        if self.premultiplication is not None:
            tables |= {"premultiplication": self.premultiplication}
        return tables


class FeedbackWitness(WitnessDocument):
    """SI; ``gamma`` is the squared L2 gain."""

    decay_per_s: float
    disk_rad_s: float
    gamma: float
    P: Rows


class Multipliers(WitnessDocument):
    """F and F^ of the module's formulas, 5n x n."""

    bounded_real: Rows
    pole_disk: Rows


class ObserverWitness(WitnessDocument):
    """Likewise."""

    decay_per_s: float
    disk_rad_s: float
    gamma: float
    noise: float
    Q: Rows
    multipliers: Multipliers


class DobTorqueWitness(WitnessDocument):
    """What the claims need beside the law."""

    feedback: FeedbackWitness
    observer: ObserverWitness
    envelope: PolytopicEnvelope | None = None


def claims(shipped: Shipped[DobTorqueLaw]) -> Iterator[Claim]:
    """What a `dob-torque` artifact claims.

    Raises:
        InputError, ValueError: the witness is not of the documented form, or the tables do not share one schedule.
    """
    law, witness = shipped.law, shipped.witness(DobTorqueWitness)
    tables = {name: VertexTable.of(table) for name, table in law.tables().items()}
    inertia, feedback, observer, *factors = tables.values()
    if not inertia.schedule == feedback.schedule == observer.schedule:
        raise ValueError("the three tables differ in box, centre or blocks")
    vertices = inertia.vertices()
    for factor in factors:
        vertices, invertible = _premultiplied(inertia, factor)
        yield from invertible
    yield from _feedback_claims(vertices, feedback.vertices(), witness.feedback)
    yield from _observer_claims(vertices, observer.vertices(), witness.observer)
    for name, table in tables.items():
        yield from table.collapse_claim(name)
    if witness.envelope is not None:
        gains = feedback.vertices(), observer.vertices()
        yield from torque_envelope_claims(shipped, witness.envelope, vertices, *gains)


def freeze(shipped: Shipped[DobTorqueLaw], angles: FloatArray) -> TorqueLaw:
    """The law at B configurations, (B, n), its premises clamped to their box."""
    premises = premises_at(shipped, angles)
    return TorqueLaw(
        sample_period_s=shipped.artifact.sample_period_s,
        filter_time_constant_s=shipped.law.filter_time_constant_s,
        **{name: VertexTable.of(table).evaluate(premises) for name, table in shipped.law.tables().items()},
    )


def gate(shipped: Shipped[DobTorqueLaw], delay_samples: fmpq) -> GridGate:
    """A grid: with matrix gains the loop of n joints does not decouple."""
    return grid_gate(shipped, delay_samples, freeze)


def _premultiplied(inertia: VertexTable, factor: VertexTable) -> tuple[tuple[fmpq_mat, ...], tuple[Claim, ...]]:
    """The vertices beta_i M, and the claims that beta is invertible."""
    first, *others = inertia.vertices()
    if factor.schedule != inertia.schedule or any(first != M for M in others):
        raise ValueError("a premultiplication has the schedule of the inertia, which is the same at every vertex")
    betas = factor.vertices()
    claims = (Claim.positive(f"premultiplication: invertible {i}", he(beta)) for i, beta in enumerate(betas))
    return tuple(beta * first for beta in betas), tuple(claims)


def _feedback_claims(
    inertia: Sequence[fmpq_mat], gains: Sequence[fmpq_mat], witness: FeedbackWitness
) -> Iterator[Claim]:
    n = inertia[0].nrows()
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none], [none, none, none], [one, none, none]])
    B, C = stack([[none], [one], [none]]), stack([[one, none, none]])
    alpha, rho, gamma = map(rational, (witness.decay_per_s, witness.disk_rad_s, witness.gamma))
    P = matrix(witness.P)
    E = [stack([[one, none, none], [none, M, none], [none, none, one]]) for M in inertia]
    closed = [(A + B * K) * P for K in gains]

    def bounded_real(i: int, j: int) -> fmpq_mat:
        decreasing = he(closed[i] * E[j].transpose()) + 2 * alpha * E[i] * P * E[j].transpose()
        error = E[i] * P * C.transpose()
        return symmetric([[decreasing, B, error], [None, -gamma * one, none], [None, None, -one]])

    def pole_disk(i: int, j: int) -> fmpq_mat:
        return symmetric([[-rho * E[i] * P * E[j].transpose(), closed[i]], [None, -rho * P]])

    yield Claim.positive("feedback: decay rate", matrix([[alpha]]))
    yield Claim.positive("feedback: P", P)
    yield from double_sum("feedback: bounded real", bounded_real, len(inertia))
    yield from double_sum("feedback: pole disk", pole_disk, len(inertia))


def _observer_claims(
    inertia: Sequence[fmpq_mat], gains: Sequence[fmpq_mat], witness: ObserverWitness
) -> Iterator[Claim]:
    n = inertia[0].nrows()
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none, none], [none] * 4, [none, none, none, one], [none] * 4])
    G, H = stack([[none], [one], [none], [none]]), stack([[none], [none], [none], [one]])
    C, D = stack([[one, none, none, none]]), stack([[none, none, one, none]])
    alpha, rho, gamma, nu = map(rational, (witness.decay_per_s, witness.disk_rad_s, witness.gamma, witness.noise))
    Q = matrix(witness.Q)
    F, F_disk = matrix(witness.multipliers.bounded_real), matrix(witness.multipliers.pole_disk)

    yield Claim.positive("observer: decay rate", matrix([[alpha]]))
    yield Claim.positive("observer: Q", Q)
    for i, (M, L) in enumerate(zip(inertia, gains, strict=True)):
        X = Q * (A - L * C)
        constraint = stack([[D, -M]])
        top = symmetric([[he(X) + 2 * alpha * Q, Q * G], [None, none]]) + he(F * constraint)
        inputs = stack([[Q * H, -nu * Q * L], [none, none]])
        output = stack([[D.transpose()], [none]])
        gains_bound = symmetric([[-gamma * one, none], [None, -gamma * one]])
        bounded_real = symmetric([[top, inputs, output], [None, gains_bound, zero(2 * n, n)], [None, None, -one]])
        yield Claim.positive(f"observer: bounded real {i}", -bounded_real)
        top = symmetric([[-rho * Q, zero(4 * n, n)], [None, none]]) + he(F_disk * constraint)
        across = stack([[X.transpose()], [G.transpose() * Q]])
        yield Claim.positive(f"observer: pole disk {i}", -symmetric([[top, across], [None, -rho * Q]]))


LAW = LawKind(DobTorqueLaw, (claims, check_design_model), gate)
