"""What a checker says of one artifact: a list of claims, each an inequality that holds or does not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.matrices import is_positive_definite
from quasilpv.shown import html_table


class Evidence(StrEnum):
    """What the verdict on a claim rests on, the strongest first."""

    EXACT = "exact"
    """Rational arithmetic on the numbers as shipped: a proof."""
    ENCLOSED = "enclosed"
    """Intervals that are guaranteed to hold the true values: a proof."""
    SAMPLED = "sampled"
    """Double arithmetic at points: no proof."""

    def is_at_least(self, needed: Evidence) -> bool:
        """Whether it is as strong as what is needed, or stronger."""
        order = list(Evidence)
        return order.index(self) <= order.index(needed)


@dataclass(frozen=True)
class Claim:
    """One inequality and the verdict on it; made by one of the methods, each of which knows its evidence.

    Attributes:
        name: which inequality, e.g. ``"observer: pole disk"``.
        holds: the verdict.
        margin: smallest eigenvalue once rows and columns are scaled to a unit diagonal, in double arithmetic and at
            least -1: how far from the edge, for people, and the same in whatever units. Of a claim without a matrix,
            the part of what is allowed that is left.
        evidence: what the verdict rests on.
    """

    name: str
    holds: bool
    margin: float
    evidence: Evidence

    @classmethod
    def positive(cls, name: str, exact: fmpq_mat) -> Claim:
        """Decide ``exact > 0``.

        Raises:
            TypeError: the matrix is not one of rationals.
        """
        if not isinstance(exact, fmpq_mat):
            raise TypeError(f"{name}: {type(exact).__name__}, expected a matrix of rationals")
        return cls(name, is_positive_definite(exact), _margin(exact), Evidence.EXACT)

    @classmethod
    def at_most(cls, name: str, value: fmpq, limit: fmpq, margin: float | None = None) -> Claim:
        """Decide ``value <= limit``, both positive.

        Args:
            name: of the claim.
            value, limit: rationals.
            margin: default: ``1 - value / limit``, at least -1.

        Raises:
            TypeError: they are no rationals.
        """
        if not (isinstance(value, fmpq) and isinstance(limit, fmpq)):
            raise TypeError(f"{name}: {type(value).__name__} and {type(limit).__name__}, expected rationals")
        left = max(fmpq(-1), 1 - value / limit)
        return cls(name, value <= limit, int(left.p) / int(left.q) if margin is None else margin, Evidence.EXACT)

    @classmethod
    def enclosed(cls, name: str, holds: bool, margin: float) -> Claim:
        """A verdict from guaranteed enclosures."""
        return cls(name, holds, max(-1.0, margin), Evidence.ENCLOSED)

    @classmethod
    def sampled(cls, name: str, error: float, tolerance: float) -> Claim:
        """``error <= tolerance`` at the points looked at, in double arithmetic."""
        return cls(name, error <= tolerance, max(-1.0, 1.0 - error / tolerance), Evidence.SAMPLED)

    @classmethod
    def all_of(cls, name: str, claims: Sequence[Claim]) -> Claim:
        """The claim that all of them hold, with the weakest evidence among them."""
        weakest = max((claim.evidence for claim in claims), key=list(Evidence).index)
        return cls(name, all(claim.holds for claim in claims), min(claim.margin for claim in claims), weakest)


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

    def __repr__(self) -> str:
        """The verdict in a line; `claims` has all of it."""
        word = "verified" if self.verified else f"NOT verified: {', '.join(self.failed[:3]) or 'no claim'}"
        found = f"{len(self.claims)} inequalities, {self.evidence_in_words}" if self.claims else "nothing"
        return f"Verification({word}; {found}; worst margin {self.worst_margin:.3g})"

    def _repr_html_(self) -> str:
        """The verdict as a table, for notebooks."""
        rows = {
            "inequalities": len(self.claims),
            "rest on": self.evidence_in_words,
            "worst margin": f"{self.worst_margin:.3g}",
            "do not hold": ", ".join(self.failed[:3]) or "none",
        }
        return html_table("verified" if self.verified else "NOT verified", rows)

    @property
    def verified(self) -> bool:
        """Whether there is at least one claim and every claim holds."""
        return bool(self.claims) and all(claim.holds for claim in self.claims)

    @property
    def worst_margin(self) -> float:
        """Smallest margin over all claims; NaN without claims."""
        return min((claim.margin for claim in self.claims), default=float("nan"))

    @property
    def evidence(self) -> dict[str, int]:
        """How many claims rest on what: every kind of `Evidence`, the strongest first."""
        return {kind.value: sum(claim.evidence is kind for claim in self.claims) for kind in Evidence}

    @property
    def evidence_in_words(self) -> str:
        """E.g. ``"41 exact, 1 sampled"``."""
        return ", ".join(f"{number} {kind}" for kind, number in self.evidence.items() if number)

    def weaker_than(self, needed: Evidence) -> tuple[Claim, ...]:
        """The claims whose evidence does not suffice."""
        return tuple(claim for claim in self.claims if not claim.evidence.is_at_least(needed))

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the claims that do not hold."""
        return tuple(claim.name for claim in self.claims if not claim.holds)

    def findings(self) -> dict[str, Any]:
        """JSON-able, the same at every run: verified, lmis, evidence, worst_margin, and the claims that fail."""
        return {
            "verified": self.verified,
            "lmis": len(self.claims),
            "evidence": self.evidence,
            "worst_margin": self.worst_margin,
            "failed": list(self.failed),
        }

    def to_document(self) -> dict[str, Any]:
        """The findings, and how many seconds they took."""
        return {**self.findings(), "seconds": self.seconds}
