"""What estimated premises do to an observer: a difference ``p = f(x) - f(x^)`` in a class of nonlinearities.

``f(x)`` is the part of A(z) x that belongs to estimated premises. The difference enters the equation of the error
``e = x - x^`` as ``drift e + B p``; all that is used of it are inequalities ``[e; p]' Pi_k [e; p] >= 0``, so that a
condition on e may add any positive multiple of each (S-procedure). With ``p`` and ``G e`` the rows and columns that
take part:

| class | inequalities |
|---|---|
| bounded Jacobian | ``p_k^2 <= (r_k g_k e)^2``, one per entry ``c_k +- r_k`` of the Jacobian; c_k goes into the drift |
| Lipschitz | ``p'p <= gamma^2 e'G'G e``, or with a weight ``p'W p <= gamma^2 e'G'W G e`` |
| one-sided Lipschitz | ``p'G e <= gamma e'G'G e``, beside one that bounds p |
| quadratically inner-bounded | ``p'p <= gamma_1 e'G'G e + gamma_2 p'G e`` |

Reference: Dehak 2022, Table III.3; Nugroho, Taha and Hoang (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.lmi import to_rational
from quasilpv.lmi.exact import Matrix

Real = float | Fraction


@dataclass(frozen=True, eq=False)
class Form:
    """The inequality ``e' ee e + 2 p' pe e + p' pp p >= 0``, exact."""

    ee: Matrix
    pe: Matrix
    pp: Matrix


@dataclass(frozen=True, eq=False)
class Mismatch:
    """A class of differences.

    Attributes:
        drift: what is linear in e, (n, n).
        input: B, (n, m).
        forms: at least one that bounds p.
    """

    drift: Matrix
    input: Matrix
    forms: tuple[Form, ...]


def bounded_jacobian(lower: FloatArray, upper: FloatArray) -> Mismatch:
    """Every entry of the Jacobian of f in an interval, whatever the others are.

    Args:
        lower, upper: of the entries, (n, n); equal where the Jacobian is constant.
    """
    n = len(lower)
    low, high = to_rational(lower), to_rational(upper)
    drift, radius = (low + high) / 2, (high - low) / 2
    entries = [(i, j) for i in range(n) for j in range(n) if radius[i, j]]
    m = len(entries)
    B, forms = _zero(n, m), []
    for k, (i, j) in enumerate(entries):
        B[i, k] = radius[i, j]  # p_k is divided by its radius, which keeps the unknowns of one size
        ee, pp = _zero(n, n), _zero(m, m)
        ee[j, j], pp[k, k] = Fraction(1), Fraction(-1)
        forms.append(Form(ee, _zero(m, n), pp))
    return Mismatch(drift, B, tuple(forms))


def lipschitz(rows: Matrix, columns: Matrix, gamma: Real) -> Mismatch:
    """``p'p <= gamma^2 e'G'G e`` with ``B = rows`` (n, m) and ``G = columns`` (m, n)."""
    return inner_bounded(rows, columns, Fraction(gamma) ** 2, 0)


def weighted_lipschitz(rows: Matrix, columns: Matrix, weight: Matrix, gamma: Real) -> Mismatch:
    """``p'W p <= gamma^2 e'G'W G e``, W (m, m) positive definite; other arguments as in `lipschitz`."""
    B, G, W = to_rational(rows), to_rational(columns), to_rational(weight)
    form = Form(Fraction(gamma) ** 2 * G.T @ W @ G, _zero(*G.shape), -W)
    return Mismatch(_zero(len(B), len(B)), B, (form,))


def inner_bounded(rows: Matrix, columns: Matrix, gamma_1: Real, gamma_2: Real) -> Mismatch:
    """``p'p <= gamma_1 e'G'G e + gamma_2 p'G e``; arguments as in `lipschitz`."""
    B, G = to_rational(rows), to_rational(columns)
    form = Form(Fraction(gamma_1) * G.T @ G, Fraction(gamma_2) / 2 * G, -_identity(len(G)))
    return Mismatch(_zero(len(B), len(B)), B, (form,))


def with_one_sided(mismatch: Mismatch, columns: Matrix, gamma: Real) -> Mismatch:
    """The same class, one-sided Lipschitz as well: ``p'G e <= gamma e'G'G e``."""
    G = to_rational(columns)
    form = Form(Fraction(gamma) * G.T @ G, -G / 2, _zero(len(G), len(G)))
    return Mismatch(mismatch.drift, mismatch.input, (*mismatch.forms, form))


def _zero(rows: int, columns: int) -> Matrix:
    return to_rational(np.zeros((rows, columns)))


def _identity(size: int) -> Matrix:
    return to_rational(np.eye(size))
