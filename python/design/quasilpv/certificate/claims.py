"""What a checker says of one artifact: a list of claims, each an inequality that holds or does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq_mat

from quasilpv.certificate.exact_matrices import is_positive_definite


@dataclass(frozen=True)
class Claim:
    """One matrix inequality ``matrix > 0``, decided exactly.

    Attributes:
        name: which inequality, e.g. ``"observer: pole disk"``.
        holds: the exact verdict.
        margin: smallest eigenvalue over the largest, in double arithmetic: how far from the edge, for people.
    """

    name: str
    holds: bool
    margin: float

    @classmethod
    def positive(cls, name: str, exact: fmpq_mat) -> Claim:
        """Decide ``exact > 0``."""
        values = np.array([[int(entry.p) / int(entry.q) for entry in row] for row in exact.table()])
        spectrum = np.linalg.eigvalsh((values + values.T) / 2.0)
        largest = max(abs(spectrum[0]), abs(spectrum[-1]), np.finfo(float).tiny)
        return cls(name, is_positive_definite(exact), float(spectrum[0] / largest))


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

    def to_document(self) -> dict[str, Any]:
        """JSON-able summary: verified, lmis, worst_margin, seconds, and the claims that fail."""
        return {
            "verified": self.verified,
            "lmis": len(self.claims),
            "worst_margin": self.worst_margin,
            "seconds": self.seconds,
            "failed": [claim.name for claim in self.claims if not claim.holds],
        }
