"""Exact check of the gains of `dob-torque`, from the artifact's data and witness alone.

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
from typing import Any

from flint import fmpq_mat

from quasilpv.certificate.claims import Claim
from quasilpv.certificate.double_sum import double_sum, he
from quasilpv.certificate.exact_matrices import identity, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.torque_envelope import check_torque_envelope
from quasilpv.certificate.vertex_tables import VertexTable

TABLES = ("inertia", "feedback", "observer")


def check_dob_torque(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `dob-torque` artifact, given as its document.

    Raises:
        KeyError, TypeError, ValueError: the tables or the witness are not of the documented form, or the tables do not
            share one schedule.
    """
    law, witness = document["law"], document["witness"]
    tables = {name: VertexTable.parse(law[name]) for name in TABLES}
    inertia, feedback, observer = tables.values()
    if not inertia.schedule == feedback.schedule == observer.schedule:
        raise ValueError("the three tables differ in box, centre or blocks")
    claims: tuple[Claim, ...] = ()
    vertices = inertia.vertices()
    if "premultiplication" in law:
        tables["premultiplication"] = VertexTable.parse(law["premultiplication"])
        vertices, claims = _premultiplied(inertia, tables["premultiplication"])
    return (
        *claims,
        *_feedback_claims(vertices, feedback.vertices(), witness["feedback"]),
        *_observer_claims(vertices, observer.vertices(), witness["observer"]),
        *(claim for name, table in tables.items() for claim in table.collapse_claim(name)),
        *check_torque_envelope(document, vertices, feedback.vertices(), observer.vertices()),
    )


def _premultiplied(inertia: VertexTable, factor: VertexTable) -> tuple[tuple[fmpq_mat, ...], tuple[Claim, ...]]:
    """The vertices beta_i M, and the claims that beta is invertible."""
    first, *others = inertia.vertices()
    if factor.schedule != inertia.schedule or any(first != M for M in others):
        raise ValueError("a premultiplication has the schedule of the inertia, which is the same at every vertex")
    betas = factor.vertices()
    claims = (Claim.positive(f"premultiplication: invertible {i}", he(beta)) for i, beta in enumerate(betas))
    return tuple(beta * first for beta in betas), tuple(claims)


def _feedback_claims(
    inertia: Sequence[fmpq_mat], gains: Sequence[fmpq_mat], witness: Mapping[str, Any]
) -> Iterator[Claim]:
    n = inertia[0].nrows()
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none], [none, none, none], [one, none, none]])
    B, C = stack([[none], [one], [none]]), stack([[one, none, none]])
    alpha, rho, gamma = (rational(witness[name]) for name in ("decay_per_s", "disk_rad_s", "gamma"))
    P = matrix(witness["P"])
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
    inertia: Sequence[fmpq_mat], gains: Sequence[fmpq_mat], witness: Mapping[str, Any]
) -> Iterator[Claim]:
    n = inertia[0].nrows()
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none, none], [none] * 4, [none, none, none, one], [none] * 4])
    G, H = stack([[none], [one], [none], [none]]), stack([[none], [none], [none], [one]])
    C, D = stack([[one, none, none, none]]), stack([[none, none, one, none]])
    alpha, rho, gamma, nu = (rational(witness[name]) for name in ("decay_per_s", "disk_rad_s", "gamma", "noise"))
    Q = matrix(witness["Q"])
    F, F_disk = (matrix(witness["multipliers"][name]) for name in ("bounded_real", "pole_disk"))

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
