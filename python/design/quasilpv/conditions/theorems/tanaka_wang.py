"""Tanaka and Wang 2004, chapter 10: fuzzy descriptor systems with a common Lyapunov matrix.

With one vertex per combination of premise bounds this is Theorem I.2 (`i2`), the unknowns and inequalities counted in
Dehak 2022, Table II.3 included.
"""

from __future__ import annotations

from quasilpv.conditions.condition import Condition
from quasilpv.conditions.reliance import COMPENSATION
from quasilpv.conditions.theorems import i2

CONDITION = Condition(
    id="tanaka-wang",
    summary="fuzzy descriptor systems, common Lyapunov matrix; I.2 on all combinations of bounds",
    reference="Tanaka and Wang 2004, chapter 10",
    representation="ts",
    inequalities=i2.inequalities,
    relies_on=COMPENSATION,
)
