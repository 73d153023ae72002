"""Algebra of expressions in which functions are unknowns like any other."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp


def of_functions(operation: Callable[[sp.Expr], sp.Expr], expression: sp.Expr) -> sp.Expr:
    """An operation on polynomials and quotients, of an expression whose functions stand for unknowns meanwhile.

    sympy takes ``exp(p w/q)`` for a power of ``exp(w/q)``, of degree p: where p is what is left of a double, factoring
    does not end.

    Args:
        operation: e.g. `sympy.factor` or `sympy.cancel`.
        expression: what it is done to.
    """
    hidden: dict[sp.Expr, sp.Dummy] = {}

    def hide(e: sp.Expr) -> sp.Expr:
        if isinstance(e, sp.Function):
            return hidden.setdefault(e, sp.Dummy(real=True))
        return e.func(*map(hide, e.args)) if e.args else e

    done = operation(hide(expression))
    return done.xreplace({dummy: function for function, dummy in hidden.items()})
