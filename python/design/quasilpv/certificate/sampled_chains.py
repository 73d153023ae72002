"""Exact check of the gains of `dob-acceleration`, from the artifact's data and witness alone.

The gains are the doubles of the artifact, taken as the rationals they are; the Lyapunov matrices are the witness. In
the time unit ``1/w`` of each chain (w: the bandwidth in the witness), with ``t = w T``:

* feedback ``K = (kp / w^2, kd / w, ki / w^3)``, chain ``A = [[1, t, 0], [0, 1, 0], [t, 0, 1]]``,
  ``B = [t^2/2, t, 0]'``; claims: with F = A + B K, ``[[r P, (F - c I) P], [*, r P]] > 0`` (poles in the disk
  ``|z - c| < r``) and ``[[P, F P, B], [*, P, 0], [*, *, 1]] > 0`` (P bounds the stationary covariance under unit white
  acceleration).
* observer ``l = (l1, l2 / w, l3 / w^2, l4 / w^3)'``, chain ``A = exp(N t)``, N the nilpotent shift; claims: with
  ``F = A (I - l C)``, ``[[r Q, Q (F - c I)], [*, r Q]] > 0``, ``[[Q, Q F], [*, Q - c3' c3]] > 0``, and
  ``objective > trace(H' Q H)`` with ``H = [A l, G]``: the variance of the disturbance estimate.
* the table of the design inertia: what the run-time side collapses it to (`vertex_tables`);
* the operating envelope, if the witness has one (`sampled_envelope`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.claims import Claim
from quasilpv.certificate.exact_matrices import identity, matrix, rational, symmetric, trace, zero
from quasilpv.certificate.sampled_envelope import check_sampled_envelope
from quasilpv.certificate.vertex_tables import VertexTable


def check_dob_acceleration(document: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Claims of a `dob-acceleration` artifact, given as its document.

    Raises:
        KeyError, TypeError, ValueError: the witness is not of the documented form.
    """
    period = rational(document["sample_period_s"])
    law, witness = document["law"], document["witness"]
    return (
        *_feedback_claims(period, law["feedback"], witness["feedback"]),
        *_observer_claims(period, law["observer"], witness["observer"]),
        *VertexTable.parse(law["inertia"]).collapse_claim("inertia"),
        *check_sampled_envelope(document),
    )


def _feedback_claims(period: fmpq, gains: Mapping[str, float], witness: Mapping[str, Any]) -> tuple[Claim, ...]:
    w = rational(witness["bandwidth_rad_s"])
    t = w * period
    transition = matrix([[1, t, 0], [0, 1, 0], [t, 0, 1]])
    drive = matrix([[t * t / 2], [t], [0]])
    kp, kd, ki = (rational(gains[name]) for name in ("kp", "kd", "ki"))
    closed = transition + drive * matrix([[kp / w**2, kd / w, ki / w**3]])
    P = matrix(witness["P"])
    c, r = rational(witness["disk_centre"]), rational(witness["disk_radius"])
    disk = symmetric([[r * P, (closed - c * identity(3)) * P], [None, r * P]])
    covariance = symmetric([[P, closed * P, drive], [None, P, zero(3, 1)], [None, None, identity(1)]])
    return (
        Claim.positive("feedback: pole disk", disk),
        Claim.positive("feedback: covariance", covariance),
    )


def _observer_claims(period: fmpq, gains: list[float], witness: Mapping[str, Any]) -> tuple[Claim, ...]:
    w = rational(witness["bandwidth_rad_s"])
    t = w * period
    transition = matrix([[1, t, t**2 / 2, t**3 / 6], [0, 1, t, t**2 / 2], [0, 0, 1, t], [0, 0, 0, 1]])
    drive = matrix([[t**4 / 24], [t**3 / 6], [t**2 / 2], [t]])
    correction = matrix([[rational(gain) / w**i] for i, gain in enumerate(gains)])
    error = transition * (identity(4) - correction * matrix([[1, 0, 0, 0]]))
    Q = matrix(witness["Q"])
    c, r = rational(witness["disk_centre"]), rational(witness["disk_radius"])
    estimate = matrix([[0, 0, 1, 0]])
    disk = symmetric([[r * Q, Q * (error - c * identity(4))], [None, r * Q]])
    gramian = symmetric([[Q, Q * error], [None, Q - estimate.transpose() * estimate]])
    variance = _quadratic(Q, transition * correction) + _quadratic(Q, drive)
    budget = rational(witness["objective"]) - variance
    return (
        Claim.positive("observer: pole disk", disk),
        Claim.positive("observer: Gramian", gramian),
        Claim.positive("observer: variance", matrix([[budget]])),
    )


def _quadratic(weight: fmpq_mat, columns: fmpq_mat) -> fmpq:
    """``trace(columns' weight columns)``."""
    return trace(columns.transpose() * weight * columns)
