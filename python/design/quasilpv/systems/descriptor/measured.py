"""Which premises a controller that has the outputs can compute."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind


def with_kinds(premises: Sequence[Premise], state: Sequence[sp.Symbol], C: AffineMatrix) -> tuple[Premise, ...]:
    """The premises, those called measured that depend on more than the outputs show as estimated ones.

    Rows of C that are constant show combinations of the state. A premise is a function of them if no direction that
    they do not see changes it: ``z(x + t v) = z(x)`` for every v with ``C v = 0``. Rows of C that depend on premises
    are not counted on, because what they show has to be computed first.

    Args:
        premises: with the kinds given so far.
        state: the symbols of x.
        C: of the outputs, (o, n).
    """
    constant = ~C.coefficients.any(axis=(0, 2)) if C.premises else slice(None)
    rows = [[sp.Rational(float(entry)) for entry in row] for row in C.constant[constant]]
    unseen = sp.Matrix(len(rows), len(state), [entry for row in rows for entry in row]).nullspace()
    return tuple(
        replace(premise, kind=PremiseKind.ESTIMATED)
        if premise.kind is PremiseKind.MEASURED and any(_changes(premise.expression, state, v) for v in unseen)
        else premise
        for premise in premises
    )


def _changes(expression: sp.Expr, state: Sequence[sp.Symbol], direction: sp.Matrix) -> bool:
    """Whether an expression is not seen to stay the same along a direction."""
    along = sp.Dummy("t", real=True)
    moved = {s: s + along * step for s, step in zip(state, direction, strict=True) if step != 0}
    if not expression.free_symbols & set(moved):
        return False
    return bool(sp.expand(expression.xreplace(moved)).has(along))
