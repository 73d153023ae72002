"""Modes of a frozen system that no input reaches, decided in rational arithmetic.

At a premise vector z0 with E_1(z0) and A_22(z0) invertible the algebraic states are eliminated, ``x_d' = A x_d + B u``.
The vectors v with ``v' A^k B = 0`` for all k form the largest subspace on which ``v' x_d`` moves by itself, whatever u
is (Krylov; Popov, Belevitch, Hautus). With a basis N of them, ``N' A = A_u N'``: the eigenvalues of A_u are among those
of every closed loop. Where they lie is decided on the characteristic polynomial, without roots: Routh's array for a
half-plane, the recursion of Schur and Cohn for a disk. Nothing is rounded.

Source: Kailath (1980), *Linear Systems*, section 2.4; Gantmacher (1959), *Applications of the Theory of Matrices*,
chapter V; Jury (1964), *Theory and Application of the z-Transform Method*, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np
import scipy.linalg

from quasilpv.lmi.exact import Matrix, null_space, to_rational

SUPPORT = 1e-6
"""A state takes part in a mode if its coefficient is at least so large, relative to the largest."""


class Stable(Protocol):
    """Where the modes of a loop have to lie."""

    def holds(self, matrix: Matrix) -> bool:
        """Whether all eigenvalues of a rational matrix lie there, exactly."""

    def excess(self, eigenvalue: complex) -> float:
        """Negative inside, in double."""


@dataclass(frozen=True)
class HalfPlane:
    """``Re s < -decay_rate``."""

    decay_rate: Fraction

    def holds(self, matrix: Matrix) -> bool:
        """By Routh's array of the matrix plus ``decay_rate I``."""
        shifted = matrix + self.decay_rate * np.eye(len(matrix), dtype=int).astype(object)
        return is_hurwitz(characteristic_polynomial(shifted))

    def excess(self, eigenvalue: complex) -> float:
        """``Re s + decay_rate``."""
        return eigenvalue.real + float(self.decay_rate)


@dataclass(frozen=True)
class Disk:
    """``|1 + h s|^2 < contraction``: Euler's step contracts by the root of it.

    Attributes:
        step: h.
        contraction: rational.
    """

    step: Fraction
    contraction: Fraction

    def holds(self, matrix: Matrix) -> bool:
        """By the recursion of Schur and Cohn for ``I + h A``."""
        stepped = np.eye(len(matrix), dtype=int).astype(object) + self.step * matrix
        return is_schur(characteristic_polynomial(stepped), self.contraction)

    def excess(self, eigenvalue: complex) -> float:
        """``(|1 + h s| - rho) / h``."""
        return float((abs(1.0 + float(self.step) * eigenvalue) - float(self.contraction) ** 0.5) / float(self.step))


@dataclass(frozen=True)
class Mode:
    """A mode that no input moves to where it would have to be.

    Attributes:
        eigenvalue: in double; that it is out of place was decided exactly.
        states: places of the states it consists of, those of the subspace of all such modes.
    """

    eigenvalue: complex
    states: tuple[int, ...]


def unreachable_mode(A: Matrix, B: Matrix, stable: Stable) -> Mode | None:
    """A mode of ``x' = A x + B u`` that stays out of place whatever u is; None if there is none.

    Args:
        A, B: rational, (n, n) and (n, m).
        stable: where modes have to lie.
    """
    N = unreachable_space(A, B)
    if N.shape[1] == 0:
        return None
    free = [int(np.flatnonzero(column)[-1]) for column in N.T]  # N has ones there and zeros in its other columns
    own = (N.T @ A)[:, free]
    if stable.holds(own):
        return None
    return _named(own.astype(float), N.astype(float), stable)


def unreachable_space(A: Matrix, B: Matrix) -> Matrix:
    """Basis of the v with ``v' A^k B = 0`` for all k, as columns of an echelon form, (n, dimension)."""
    reached = B
    while True:
        N = null_space(reached.T) if reached.shape[1] else to_rational(np.eye(len(A), dtype=int))
        moved = N.T @ A @ reached if reached.shape[1] else np.zeros((0, 0))
        new = [column for column in range(moved.shape[1]) if moved[:, column].any()] if moved.size else []
        if not new:
            return N
        reached = np.hstack([reached, (A @ reached)[:, new]])


def eliminated(E: Matrix, A: Matrix, B: Matrix, differential: int) -> tuple[Matrix, Matrix] | None:
    """``x_d' = A x_d + B u`` of a descriptor system with ``E = diag(E_1, 0)``; None if E_1 or A_22 is singular."""
    q = differential
    whole = np.hstack([A, B])
    if q < len(A):
        onto = solved(A[q:, q:], whole[q:][:, [*range(q), *range(len(A), whole.shape[1])]])
        if onto is None:
            return None
        rest = whole[:q][:, [*range(q), *range(len(A), whole.shape[1])]] - A[:q, q:] @ onto
    else:
        rest = whole
    reduced = solved(E[:q, :q], rest)
    return None if reduced is None else (reduced[:, :q], reduced[:, q:])


def solved(matrix: Matrix, right: Matrix) -> Matrix | None:
    """``X^-1 Y``, exact; None if X is singular."""
    null = null_space(np.hstack([matrix, -right]))
    size = len(matrix)
    if null.shape[1] != right.shape[1] or null_space(matrix).shape[1]:
        return None
    return null[:size]


def characteristic_polynomial(matrix: Matrix) -> list[Fraction]:
    """Coefficients of ``det(s I - X)``, the leading one first (Faddeev and Leverrier)."""
    size = len(matrix)
    identity = np.eye(size, dtype=int).astype(object)
    coefficients, power = [Fraction(1)], 0 * identity
    for k in range(1, size + 1):
        power = matrix @ (power + coefficients[-1] * identity)
        coefficients.append(-Fraction(np.trace(power)) / k)
    return coefficients


def is_hurwitz(polynomial: Sequence[Fraction]) -> bool:
    """Whether all roots have a negative real part: no entry of the first column of Routh's array is <= 0.

    Args:
        polynomial: the leading coefficient, positive, first.
    """
    above, row = list(polynomial[0::2]), list(polynomial[1::2])
    while row:
        if row[0] <= 0:
            return False
        ratio = above[0] / row[0]
        padded = [*row[1:], *[Fraction(0)] * (len(above) - len(row))]
        above, row = row, [a - ratio * b for a, b in zip(above[1:], padded, strict=False)]
    return True


def is_schur(polynomial: Sequence[Fraction], squared_radius: Fraction) -> bool:
    """Whether all roots lie in ``|z|^2 < squared_radius``.

    With ``q(w) = p(rho w) = sum_k a_k rho^k w^k`` one step of the recursion leaves, up to a common factor, coefficients
    of the same form with ``a_k <- a_n a_k+1 - rho^(-2(k+1)) a_0 a_n-k-1``, and it needs ``|a_0| < rho^n |a_n|``.

    Args:
        polynomial: the leading coefficient first.
        squared_radius: rho^2 > 0.
    """
    a = list(reversed(polynomial))
    while len(a) > 1:
        n = len(a) - 1
        if a[0] ** 2 >= squared_radius**n * a[n] ** 2:
            return False
        a = [a[n] * a[k] - a[0] * a[n - k] / squared_radius**k for k in range(1, n + 1)]
    return True


def _named(own: np.ndarray, basis: np.ndarray, stable: Stable) -> Mode:
    """The worst eigenvalue, and the states of the left invariant subspace of all that are out of place."""
    scale = np.abs(own).max(initial=1.0)
    tolerance = 1e-6 * scale
    worst = max(np.linalg.eigvals(own), key=stable.excess)
    limit = min(-tolerance, stable.excess(worst) - tolerance)
    _, vectors, count = scipy.linalg.schur(
        own.T.astype(complex), output="complex", sort=lambda eigenvalue: stable.excess(eigenvalue) >= limit
    )
    left = np.abs(basis @ vectors[:, :count]).max(axis=1)
    states = np.flatnonzero(left > SUPPORT * left.max())
    return Mode(complex(worst), tuple(states.tolist()))
