"""Exact check of the gains of `hinf-tracking`, from the artifact's data and witness alone.

The gain is ``K(z) = Y(z) E(z)^-T P^-1`` with ``E = diag(I, M, I)`` and the doubles of Y, M and P as the rationals they
are: nothing is solved for. With ``xi = (e, e', int e)``, blocks of n x n, He(X) = X + X', the error obeys

    E(z) xi' = (A + B K(z)) xi + B (d - sum_k delta_k b_k c_k' xi)

with ``A = [[0, I, 0], [0, 0, 0], [I, 0, 0]]``, ``B = [0; I; 0]``, ``C = [I, 0, 0]``, and unknown ``|delta_k| <= r_k``
that stand for Coriolis torque, gravity and friction: n (n + 1) terms, whose bounds are computed here, from the links,
the payload set and the domain of speeds in the artifact (`unknown_terms`). Claims, with the table's vertices M_i and
Y_i and the witness's multipliers tau_k:

* decay rate and L2 gain: ``P > 0``, ``M_i > 0`` (so that E(z) is invertible) and for every i

      [X_i, B, E_i P C', E_i P c_1 ... E_i P c_m;  *, -gamma I, 0, 0;  *, *, -I, 0;  *, *, *, -diag(tau)] < 0,
      X_i = He(A P E_i' + B Y_i) + 2 alpha E_i P E_i' + sum_k tau_k r_k^2 B b_k b_k' B'

  Affine in (M, Y) but for the convex ``E P E'``, so it holds at every z of the box if it holds at the vertices. There
  ``V = xi' P^-1 xi`` has ``V' < -2 alpha V - |e|^2 + gamma |d|^2`` for all delta_k: multiply by ``P^-1 E^-1`` from both
  sides and use ``2 a b <= tau a^2 + b^2 / tau`` (Petersen 1987).
* gain limit: with ``S = diag(I, w I, I / w)``, w and the inertia unit m of the witness, ``D = diag(I, m I, I)``:
  ``P > beta S^2`` and ``[kappa beta I, Y_i (S D)^-1; *, kappa beta I] > 0``, so that
  ``|K(z) S| < kappa |D E(z)^-1|`` in the spectral norm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.claims import Claim
from quasilpv.certificate.exact_matrices import identity, magnitude, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.gate_data import inertia_data
from quasilpv.certificate.gate_inertia import true_inertia
from quasilpv.certificate.vertex_tables import VertexTable


@dataclass(frozen=True, eq=False)
class UnknownTerm:
    """A torque ``delta b c' xi`` with ``|delta| <= radius``: b is n x 1, c is 3n x 1."""

    torque: fmpq_mat
    state: fmpq_mat
    radius: fmpq


def check_hinf_tracking(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `hinf-tracking` artifact, given as its document.

    Raises:
        InputError: a robot the gates do not know.
        KeyError, TypeError, ValueError: the tables or the witness are not of the documented form, or the tables do not
            share one schedule.
    """
    law, witness = document["law"], document["witness"]["feedback"]
    tables = {name: VertexTable.parse(law[name]) for name in ("inertia", "numerator")}
    inertia, numerator = tables.values()
    if inertia.schedule != numerator.schedule:
        raise ValueError("the two tables differ in box, centre or blocks")
    terms = unknown_terms(document)
    P = matrix(law["lyapunov"])
    return (
        *_performance_claims(inertia.vertices(), numerator.vertices(), P, terms, witness),
        *_limit_claims(numerator.vertices(), P, witness),
        *(claim for name, table in tables.items() for claim in table.collapse_claim(name)),
    )


def _performance_claims(
    inertia: Sequence[fmpq_mat],
    numerator: Sequence[fmpq_mat],
    P: fmpq_mat,
    terms: Sequence[UnknownTerm],
    witness: Mapping[str, Any],
) -> Iterator[Claim]:
    n, m = inertia[0].nrows(), len(terms)
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none], [none, none, none], [one, none, none]])
    B, C = stack([[none], [one], [none]]), stack([[one, none, none]])
    alpha, gamma = (rational(witness[name]) for name in ("decay_per_s", "gamma"))
    tau = [rational(value) for value in witness["tau"]]
    if len(tau) != m:
        raise ValueError(f"{m} unknown terms, {len(tau)} multipliers")
    acting, multipliers = zero(3 * n, 3 * n), zero(m, m)
    for k, (term, value) in enumerate(zip(terms, tau, strict=True)):
        b = B * term.torque
        acting += value * term.radius**2 * b * b.transpose()
        multipliers[k, k] = value
    states = stack([[term.state for term in terms]])

    yield Claim.positive("feedback: decay rate", matrix([[alpha]]))
    yield Claim.positive("feedback: P", P)
    for i, (M, Y) in enumerate(zip(inertia, numerator, strict=True)):
        yield Claim.positive(f"feedback: inertia {i}", M)
        E = stack([[one, none, none], [none, M, none], [none, none, one]])
        product_i = A * P * E.transpose() + B * Y
        X = product_i + product_i.transpose() + 2 * alpha * E * P * E.transpose() + acting
        rows: list[list[fmpq_mat | None]] = [
            [X, B, E * P * C.transpose(), E * P * states],
            [None, -gamma * one, none, zero(n, m)],
            [None, None, -one, zero(n, m)],
            [None, None, None, -multipliers],
        ]
        yield Claim.positive(f"feedback: decay and L2 gain {i}", -symmetric(rows))


def _limit_claims(numerator: Sequence[fmpq_mat], P: fmpq_mat, witness: Mapping[str, Any]) -> Iterator[Claim]:
    n = numerator[0].nrows()
    kappa, beta, w, unit = (
        rational(witness[name]) for name in ("gain_limit", "beta", "bandwidth_rad_s", "inertia_unit_kg_m2")
    )
    one, none = identity(n), zero(n, n)
    square = stack([[one, none, none], [none, w**2 * one, none], [none, none, one / w**2]])
    inverse = stack([[one, none, none], [none, one / (w * unit), none], [none, none, w * one]])
    yield Claim.positive("gain limit: P", P - beta * square)
    for i, Y in enumerate(numerator):
        limit = kappa * beta
        bound = symmetric([[limit * one, Y * inverse], [None, limit * identity(3 * n)]])
        yield Claim.positive(f"gain limit: Y {i}", bound)


def unknown_terms(document: Mapping[str, Any]) -> tuple[UnknownTerm, ...]:
    """Coriolis, gravity and friction torque of an artifact's robot as terms of rank one with exact bounds.

    In absolute angles and speeds (s_k the k-th row of S) they are, with |sin| and |sinc| at most 1,

        D_kl sin(alpha_k - alpha_l) W_l  s_k s_l' w (k != l),   g_k sinc(alpha_k) s_k s_k' theta,   f_k e_k e_k' w

    with ``g_k = g h_k`` (`gate_mechanism`). D and g grow with masses and centres of mass: they are taken at the
    larger of nominal value and full payload. The order is that of the lines above, (k, l) row by row.
    """
    data = inertia_data(document)
    heavy = replace(
        data,
        mass_scale=tuple(max(1.0, scale) for scale in data.mass_scale),
        com_scale=tuple(max(1.0, scale) for scale in data.com_scale),
    )
    n, S = data.joints, data.mechanism.absolute_map
    D, moments = true_inertia(heavy), data.mechanism.first_moments(heavy.mass_scale, heavy.com_scale)
    largest = matrix(
        [[max(abs(rational(bound)) for bound in interval)] for interval in document["domain"]["speed_rad_s"]]
    )
    speed = (magnitude(S) * largest).entries()
    g = rational(document["robot"]["parameters"]["gravity_m_s2"])
    friction = rational(document["witness"]["feedback"]["friction_nm_s"])
    rows = [matrix([[factor] for factor in row]) for row in S.table()]

    def angle(column: fmpq_mat) -> fmpq_mat:
        return stack([[column], [zero(2 * n, 1)]])

    def rate(column: fmpq_mat) -> fmpq_mat:
        return stack([[zero(n, 1)], [column], [zero(n, 1)]])

    terms = [
        UnknownTerm(rows[k], rate(rows[j]), abs(D[k][j](fmpq(1))) * speed[j])
        for k, j in product(range(n), repeat=2)
        if k != j
    ]
    terms += [UnknownTerm(rows[k], angle(rows[k]), g * moments[k](fmpq(1))) for k in range(n)]
    for k in range(n):
        unit = matrix([[int(j == k)] for j in range(n)])
        terms.append(UnknownTerm(unit, rate(unit), friction))
    return tuple(terms)
