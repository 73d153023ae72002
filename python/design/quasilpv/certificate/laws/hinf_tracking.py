"""The law `hinf-tracking`: its document, and what is claimed of it, checked from its data and witness alone.

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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import identity, magnitude, matrix, rational, stack, symmetric, zero
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate, grid_gate, inertia_at, premises_at
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.certificate.reading import Shipped, WitnessDocument
from quasilpv.certificate.robot.data import inertia_data
from quasilpv.certificate.robot.design_model import check_design_model
from quasilpv.certificate.robot.inertia import true_inertia
from quasilpv.documents.law import VelocityLaw
from quasilpv.documents.tables import Matrix, PolytopeTable, require_lyapunov
from quasilpv.errors import InputError
from quasilpv.loops.hinf_law import hinf_tracking_law
from quasilpv.loops.velocity_law import VelocityLaw as FrozenVelocityLaw


class HinfTrackingLaw(VelocityLaw):
    """H-infinity PI tracking (Dehak 2022, Theorem III.10): ``Gamma = Y(z) diag(I, M, I)^-1 P^-1 (e, e', int e)``.

    ``numerator`` holds Y, n x 3n; ``lyapunov`` is P, 3n x 3n; e = x - x_r.
    """

    kind: Literal["hinf-tracking"]
    numerator: PolytopeTable
    lyapunov: Matrix

    def check(self, joints: int) -> None:
        """See `LawDocument.check`."""
        self.numerator.require_gains("law.numerator", joints, 3 * joints, self.inertia)
        require_lyapunov("law.lyapunov", self.lyapunov, 3 * joints)


class FeedbackWitness(WitnessDocument):
    """SI; ``gamma`` is the squared L2 gain, ``friction_nm_s`` the largest coefficient of a joint, ``tau`` per term."""

    decay_per_s: float
    gamma: float
    gain_limit: float
    beta: float
    bandwidth_rad_s: float
    inertia_unit_kg_m2: float
    friction_nm_s: float
    tau: tuple[float, ...]


class HinfTrackingWitness(WitnessDocument):
    """What the claims need beside the law."""

    feedback: FeedbackWitness


@dataclass(frozen=True, eq=False)
class UnknownTerm:
    """A torque ``delta b c' xi`` with ``|delta| <= radius``: b is n x 1, c is 3n x 1."""

    torque: fmpq_mat
    state: fmpq_mat
    radius: fmpq


def claims(shipped: Shipped[HinfTrackingLaw]) -> Iterator[Claim]:
    """What a `hinf-tracking` artifact claims.

    Raises:
        InputError: a robot the gates do not know, or a witness that is not of the documented form.
        ValueError: the tables do not share one schedule, or there is another number of multipliers.
    """
    law, witness = shipped.law, shipped.witness(HinfTrackingWitness).feedback
    inertia, numerator = VertexTable.of(law.inertia), VertexTable.of(law.numerator)
    if inertia.schedule != numerator.schedule:
        raise ValueError("the two tables differ in box, centre or blocks")
    terms = unknown_terms(shipped, rational(witness.friction_nm_s))
    P = matrix(law.lyapunov)
    yield from _performance_claims(inertia.vertices(), numerator.vertices(), P, terms, witness)
    yield from _limit_claims(numerator.vertices(), P, witness)
    yield from inertia.collapse_claim("inertia")
    yield from numerator.collapse_claim("numerator")


def freeze(shipped: Shipped[HinfTrackingLaw], angles: FloatArray) -> FrozenVelocityLaw:
    """The law at B configurations, (B, n), its premises clamped to their box."""
    return hinf_tracking_law(
        shipped.artifact.sample_period_s,
        shipped.law.velocity_filter_time_constant_s,
        VertexTable.of(shipped.law.numerator).evaluate(premises_at(shipped, angles)),
        inertia_at(shipped, angles),
        np.array(shipped.law.lyapunov, dtype=float),
    )


def gate(shipped: Shipped[HinfTrackingLaw], delay_samples: fmpq) -> GridGate:
    """A grid: with matrix gains the loop of n joints does not decouple."""
    return grid_gate(shipped, delay_samples, freeze)


def _performance_claims(
    inertia: Sequence[fmpq_mat],
    numerator: Sequence[fmpq_mat],
    P: fmpq_mat,
    terms: Sequence[UnknownTerm],
    witness: FeedbackWitness,
) -> Iterator[Claim]:
    n, m = inertia[0].nrows(), len(terms)
    one, none = identity(n), zero(n, n)
    A = stack([[none, one, none], [none, none, none], [one, none, none]])
    B, C = stack([[none], [one], [none]]), stack([[one, none, none]])
    alpha, gamma = rational(witness.decay_per_s), rational(witness.gamma)
    tau = [rational(value) for value in witness.tau]
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


def _limit_claims(numerator: Sequence[fmpq_mat], P: fmpq_mat, witness: FeedbackWitness) -> Iterator[Claim]:
    n = numerator[0].nrows()
    kappa, beta = rational(witness.gain_limit), rational(witness.beta)
    w, unit = rational(witness.bandwidth_rad_s), rational(witness.inertia_unit_kg_m2)
    one, none = identity(n), zero(n, n)
    square = stack([[one, none, none], [none, w**2 * one, none], [none, none, one / w**2]])
    inverse = stack([[one, none, none], [none, one / (w * unit), none], [none, none, w * one]])
    yield Claim.positive("gain limit: P", P - beta * square)
    for i, Y in enumerate(numerator):
        limit = kappa * beta
        bound = symmetric([[limit * one, Y * inverse], [None, limit * identity(3 * n)]])
        yield Claim.positive(f"gain limit: Y {i}", bound)


def unknown_terms(shipped: Shipped[Any], friction: fmpq) -> tuple[UnknownTerm, ...]:
    """Coriolis, gravity and friction torque of an artifact's robot as terms of rank one with exact bounds.

    In absolute angles and speeds (s_k the k-th row of S) they are, with |sin| and |sinc| at most 1,

        D_kl sin(alpha_k - alpha_l) W_l  s_k s_l' w (k != l),   g_k sinc(alpha_k) s_k s_k' theta,   f_k e_k e_k' w

    with ``g_k = g h_k`` (`robot.mechanism`). D and g grow with masses and centres of mass: they are taken at the
    larger of nominal value and full payload. The order is that of the lines above, (k, l) row by row.

    Args:
        shipped: the artifact.
        friction: largest coefficient of a joint, N m s/rad.

    Raises:
        InputError: the torque of the robot at rest is not that of gravity.
    """
    data = inertia_data(shipped)
    if data.mechanism.gravity is None:
        raise InputError(
            shipped.source, "robot.parameters.kind", shipped.mechanism.kind, "a robot that only gravity pulls"
        )
    heavy = replace(
        data,
        mass_scale=tuple(max(1.0, scale) for scale in data.mass_scale),
        com_scale=tuple(max(1.0, scale) for scale in data.com_scale),
    )
    n, S = data.joints, data.mechanism.absolute_map
    D, moments = true_inertia(heavy), data.mechanism.first_moments(heavy.mass_scale, heavy.com_scale)
    largest = matrix(
        [[max(abs(rational(bound)) for bound in interval)] for interval in shipped.artifact.domain.speed_rad_s]
    )
    speed = (magnitude(S) * largest).entries()
    g = abs(data.mechanism.gravity)
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


LAW = LawKind(HinfTrackingLaw, (claims, check_design_model), gate)
