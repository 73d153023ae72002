"""What may be chosen of every condition, by name."""

from __future__ import annotations

from enum import StrEnum


class Slack(StrEnum):
    """Which slack matrices a sum is given. The families grow in this order, and so does what they prove."""

    NONE = "none"
    THESIS = "thesis"
    """One T_b and one S_b per block b: ``X_ij + T_b(i) + S_b(j) - mean`` (Dehak 2022, Lemma II.1). Only T_b + S_b
    counts, since X_ij and X_ji appear in one sum."""
    PAIRS = "pairs"
    """One T_bc per pair of blocks: ``X_ij + T_b(i),b(j) - (1/G^2) sum_bc T_bc`` (counted in Dehak 2022, Table II.4)."""
    FULL = "full"
    """One T_i,b per vertex i and block b: ``X_ij + T_i,b(j) - (1/G) sum_b T_i,b``."""


class Form(StrEnum):
    """How a condition is written down."""

    PUBLISHED = "published"
    """Every unknown and inequality of the source: what its complexity tables count."""

    REDUCED = "reduced"
    """Equivalent, smaller: unknowns eliminated and inequalities dropped where a proof allows it."""
