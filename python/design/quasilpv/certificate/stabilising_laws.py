"""Exact check of the gains of the stabilising laws, from the artifact's data and witness alone.

With the vertices E_i, A_i of the witness's model over the premises of ``schedule`` (tied to the robot by
`stabilisation_model`), ``B = [0; I]``, alpha the decay rate, He(X) = X + X', and the slack of block polytopes
``T_b(i) - mean`` with one symmetric T_b per block (its weighted mean is zero):

* `state-feedback`, V = x' P^-1 x with ``P > 0``: ``He(Phi_i) + T_b(i) - mean < 0`` for every vertex i,

      Phi_i = [0, I; A_i, -E_i] [P, 0; P_21, P_22] + [alpha P, 0; B K_i P, 0]

  (the closed loop E x' = (A + B K) x in the redundant state (x, x'); Dehak 2022, Theorem I.2). Linear in the vertices
  because B is constant.
  With the condition III.9, whose claim is about every payload (Dehak 2022, Theorem III.9: what the payload changes is
  unknown to the law), ``He((A_i + B K_i) P E_f') + 2 alpha E_f P E_f' < 0`` for every vertex i and for the robot's own
  descriptor ``E_f = diag(I, M_f)`` at payload fractions f = 0 and 1. M has no premise and is affine in f, and the left
  side is convex in E, so it holds between.
* `descriptor-feedback`, V = x' P^-1 x: ``He(Phi_i) + T_b(i) - mean < 0`` for every vertex i,

      Phi_i = [(A_i + alpha E_i) L + B F_i, (A_i + alpha E_i) R; P E_i' - L, -R]

  Multiplied by [I, A + alpha E] from the left and its transpose from the right it is
  ``He((A + alpha E) P E' + B F) < 0``: x' P^-1 x decreases under F E^-T P^-1 x (Theorem II.6, common L and R).
* `delayed-feedback`, V = x' P(varpi)^-1 x: with ``D_k = (P_k - P_0) / tau``, ``P_k > 0``, for all i <= j <= l, k and m

      mean over the permutations (a, b, c) of (i, j, l) of
          He((A_a + alpha E_a) P_k E_b' + B F_bkm) - E_a (D_c - D_m) E_b'  < 0

  (Theorem II.8; ``dP/dt = sum_cm w_c(z) w_m(z_d) (P_c - P_m) / tau``), and in the limit tau -> 0 with the D_k of the
  witness and one P.

V then decreases with the rate alpha while the state is in the operating domain, in continuous time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, permutations, product
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.claims import Claim
from quasilpv.certificate.double_sum import he
from quasilpv.certificate.exact_matrices import identity, is_symmetric, matrix, rational, stack, zero
from quasilpv.certificate.gate_data import inertia_data
from quasilpv.certificate.gate_inertia import true_inertia
from quasilpv.certificate.stabilisation_model import (
    equations_of_motion_claim,
    linearisation_claim,
    payload_claim,
    premise_box_claims,
)
from quasilpv.certificate.vertex_tables import VertexTable


@dataclass(frozen=True, eq=False)
class _Model:
    """What all three checks read: vertex tables of E and A, B, and the decay rate."""

    E: VertexTable
    A: VertexTable
    B: fmpq_mat
    decay: fmpq
    witness: Mapping[str, Any]

    @classmethod
    def of(cls, document: Mapping[str, Any], table: VertexTable) -> _Model:
        """Read the witness; its tables must have the schedule of the law's own table."""
        witness = document["witness"]["feedback"]
        E, A = (VertexTable.parse(witness["model"][name]) for name in ("E", "A"))
        if not E.schedule == A.schedule == table.schedule:
            raise ValueError("the tables of the law and of the witness differ in box, centre or blocks")
        n = int(document["joints"])
        return cls(E, A, stack([[zero(n, n)], [identity(n)]]), rational(witness["decay_per_s"]), witness)

    def block_of(self) -> list[int]:
        """Block of every vertex."""
        return [b for b, block in enumerate(self.E.blocks) for _ in range(2 ** len(block))]


def check_state_feedback(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `state-feedback` artifact, given as its document.

    Raises:
        KeyError, TypeError, ValueError: tables or witness are not of the documented form.
    """
    table = VertexTable.parse(document["law"]["gain"])
    model = _Model.of(document, table)
    if model.witness["condition"] == "III.9":
        return _robust_claims(document, model, table)
    P, lower_left, lower_right = (matrix(model.witness[name]) for name in ("P", "P21", "P22"))
    size = P.nrows()
    none = zero(size, size)
    multiplier = stack([[P, none], [lower_left, lower_right]])

    def phi(E: fmpq_mat, A: fmpq_mat, K: fmpq_mat) -> fmpq_mat:
        return stack([[none, identity(size)], [A, -E]]) * multiplier + stack(
            [[model.decay * P, none], [model.B * K * P, none]]
        )

    return (
        Claim.positive("feedback: P", P),
        *_single_sum(model, phi, table.vertices()),
        *premise_box_claims(document, table),
        equations_of_motion_claim(document, model.E, model.A),
        *table.collapse_claim("gain"),
    )


def _robust_claims(document: Mapping[str, Any], model: _Model, table: VertexTable) -> tuple[Claim, ...]:
    """The claims of condition III.9 about a `state-feedback` law."""
    P = matrix(model.witness["P"])
    inertia = true_inertia(inertia_data(document))
    n = len(inertia)
    if n > 1 or inertia[0][0].degree() > 1:
        raise ValueError("the inertia is affine in the payload and has no premise")
    descriptors = [stack([[identity(n), zero(n, n)], [zero(n, n), matrix([[inertia[0][0](fmpq(f))]])]]) for f in (0, 1)]
    closed = [A + model.B * K for A, K in zip(model.A.vertices(), table.vertices(), strict=True)]
    decrease = (
        Claim.positive(f"feedback: decrease {i}, payload {f}", -he(loop * P * E) - 2 * model.decay * E * P * E)
        for i, loop in enumerate(closed)
        for f, E in enumerate(descriptors)
    )
    return (
        Claim.positive("feedback: decay rate", matrix([[model.decay]])),
        Claim.positive("feedback: P", P),
        *decrease,
        *premise_box_claims(document, table),
        equations_of_motion_claim(document, model.E, model.A),
        payload_claim(document),
        *table.collapse_claim("gain"),
    )


def check_descriptor_feedback(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `descriptor-feedback` artifact; errors as `check_state_feedback`."""
    table = VertexTable.parse(document["law"]["numerator"])
    model = _Model.of(document, table)
    P, L, R = matrix(document["law"]["lyapunov"]), matrix(model.witness["L"]), matrix(model.witness["R"])

    def phi(E: fmpq_mat, A: fmpq_mat, F: fmpq_mat) -> fmpq_mat:
        drift = A + model.decay * E
        return stack([[drift * L + model.B * F, drift * R], [P * E.transpose() - L, -R]])

    return (
        Claim.positive("feedback: P", P),
        *_single_sum(model, phi, table.vertices()),
        *premise_box_claims(document, table),
        equations_of_motion_claim(document, model.E, model.A),
        *table.collapse_claim("numerator"),
    )


def _single_sum(model: _Model, phi: Any, gains: Sequence[fmpq_mat]) -> Iterator[Claim]:
    """``He(Phi_i) + T_b(i) - mean < 0`` at every vertex; without slack in the witness T = 0."""
    slack = [matrix(T) for T in model.witness["slack"]]
    if slack and (len(slack) != len(model.E.blocks) or not all(map(is_symmetric, slack))):
        raise ValueError(f"{len(slack)} slack matrices, expected one symmetric matrix for each block")
    vertices = zip(model.E.vertices(), model.A.vertices(), gains, model.block_of(), strict=True)
    yield Claim.positive("feedback: decay rate", matrix([[model.decay]]))
    for i, (E, A, gain, b) in enumerate(vertices):
        entry = he(phi(E, A, gain))
        if slack:
            entry += slack[b] - sum(slack[1:], slack[0]) * fmpq(1, len(slack))
        yield Claim.positive(f"feedback: decrease {i}", -entry)


def check_delayed_feedback(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `delayed-feedback` artifact with the descriptor; errors as `check_state_feedback`."""
    law = document["law"]
    table = VertexTable.parse(law["lyapunov"])
    model = _Model.of(document, table)
    if not law["descriptor"]:
        raise ValueError("only laws with the descriptor are checked")
    return (
        *(Claim.positive(f"feedback: P {k}", P) for k, P in enumerate(table.vertices())),
        *_delayed_claims(model, table.vertices(), [matrix(F) for F in law["numerators"]], _rates(document, table)),
        *premise_box_claims(document, table),
        linearisation_claim(document, model.E, model.A),
    )


def _rates(document: Mapping[str, Any], table: VertexTable) -> list[fmpq_mat]:
    """D_k with ``dP/dt = sum_cm w_c w_m (D_c - D_m)``: fixed by P_k and tau, or by the witness in the limit."""
    samples = int(document["law"]["window_samples"])
    P = table.vertices()
    if samples:
        window = samples * rational(document["sample_period_s"])
        return [(Pk - P[0]) / window for Pk in P]
    if any(Pk != P[0] for Pk in P):
        raise ValueError("in the limit of a short window all vertices of P are equal")
    return [matrix(D) for D in document["witness"]["feedback"]["D"]]


def _delayed_claims(
    model: _Model, P: Sequence[fmpq_mat], numerators: Sequence[fmpq_mat], D: Sequence[fmpq_mat]
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
