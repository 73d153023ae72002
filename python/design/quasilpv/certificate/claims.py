"""What a checker says of one artifact: a list of claims, each an inequality that holds or does not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact_matrices import is_positive_definite


@dataclass(frozen=True)
class Claim:
    """One inequality, decided exactly.

    Attributes:
        name: which inequality, e.g. ``"observer: pole disk"``.
        holds: the exact verdict.
        margin: smallest eigenvalue once rows and columns are scaled to a unit diagonal, in double arithmetic and at
            least -1: how far from the edge, for people, and the same in whatever units.
    """

    name: str
    holds: bool
    margin: float

    @classmethod
    def positive(cls, name: str, exact: fmpq_mat) -> Claim:
        """Decide ``exact > 0``."""
        return cls(name, is_positive_definite(exact), _margin(exact))


def all_positive(name: str, numbers: Iterable[fmpq]) -> Claim:
    """The claim that all these numbers are positive."""
    values = list(numbers)
    size = len(values)
    return Claim.positive(
        name, fmpq_mat(size, size, [x if i == j else 0 for i, x in enumerate(values) for j in range(size)])
    )


def _margin(exact: fmpq_mat) -> float:
    """Smallest eigenvalue of the symmetric part at unit diagonal; -1 if a diagonal entry is not positive.

    The squares ``m_ij^2 / (m_ii m_jj)`` are formed exactly. Units of rows and columns cancel in them: the result does
    not depend on units, not in its last digit either, and entries of any size, in double or beyond, are in range.
    """
    table = exact.table()
    size = len(table)
    if any(table[k][k] <= 0 for k in range(size)):
        return -1.0
    values = np.eye(size)
    for i in range(size):
        for j in range(i):
            entry = (table[i][j] + table[j][i]) / 2
            square = entry * entry / (table[i][i] * table[j][j])
            if square >= 4:  # an entry r next to two ones: an eigenvalue of 1 - |r| <= -1 at the most
                return -1.0
            root = math.sqrt(int(square.p) / int(square.q))
            values[i, j] = values[j, i] = root if entry > 0 else -root
    return max(-1.0, float(np.linalg.eigvalsh(values)[0]))


@dataclass(frozen=True)
class Verification:
    """All claims of one artifact."""

    claims: tuple[Claim, ...]
    seconds: float

    @property
    def verified(self) -> bool:
        """Whether there is at least one claim and every claim holds."""
        return bool(self.claims) and all(claim.holds for claim in self.claims)

    @property
    def worst_margin(self) -> float:
        """Smallest margin over all claims; NaN without claims."""
        return min((claim.margin for claim in self.claims), default=float("nan"))

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the claims that do not hold."""
        return tuple(claim.name for claim in self.claims if not claim.holds)

    def findings(self) -> dict[str, Any]:
        """JSON-able, the same at every run: verified, lmis, worst_margin, and the claims that fail."""
        return {
            "verified": self.verified,
            "lmis": len(self.claims),
            "worst_margin": self.worst_margin,
            "failed": list(self.failed),
        }

    def to_document(self) -> dict[str, Any]:
        """The findings, and how many seconds they took."""
        return {**self.findings(), "seconds": self.seconds}
