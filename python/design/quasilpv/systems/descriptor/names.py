"""One name is one thing: the symbol of a name, and that of its rate."""

from __future__ import annotations

import re
from typing import TypeAlias

import sympy as sp
from sympy.core.function import AppliedUndef

from quasilpv.errors import InputError

Name: TypeAlias = str | sp.Symbol | AppliedUndef
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)


def symbol(name: Name) -> sp.Symbol:
    """The real symbol of a name, a symbol with any assumptions, or a function of time such as x(t).

    Raises:
        InputError: a text that is no name, or anything else.
    """
    if isinstance(name, str) and IDENTIFIER.fullmatch(name):
        return sp.Symbol(name, real=True)
    if isinstance(name, sp.Dummy):  # the same name does not make two of them one
        return name
    if isinstance(name, sp.Symbol):
        return sp.Symbol(name.name, real=True)
    if isinstance(name, AppliedUndef) and len(name.args) == 1 and name.args[0].is_Symbol:
        return sp.Symbol(name.func.__name__, real=True)
    raise InputError("system", "name", name, "a name of letters, digits and _, or a symbol")


def rate(state: Name) -> sp.Symbol:
    """The symbol that stands for the time derivative of a state in an equation.

    >>> import quasilpv as ql
    >>> ql.rate("x")
    x'
    """
    return sp.Symbol(f"{symbol(state).name}'", real=True)
