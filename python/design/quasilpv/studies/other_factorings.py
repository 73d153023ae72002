"""The same question with other factorings of A(x) x: the equations do not say which one is meant.

Asked only after the given one is not feasible, and only of systems made from equations: whoever gives matrices means
them. A refutation at x = 0 concerns them all, because ``A(0)`` is the Jacobian of the drift in each.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.lmi import budget
from quasilpv.lmi.budget import Limits, TimeUpError
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.refutation import Refutation
from quasilpv.systems.descriptor.factorings import factorings
from quasilpv.systems.descriptor.system import DescriptorSystem

SHOWN_PREMISES = 6
_SAME = 1e-9  # of values of premises: points of a refutation are decided in rationals and kept in doubles


def with_other_factorings(
    system: DescriptorSystem, first: Answer, limits: Limits, ask: Callable[[DescriptorSystem], Answer]
) -> Answer:
    """The first answer, or that for another factoring which is feasible.

    Args:
        system: the question is about.
        first: the answer for the factoring it comes in.
        limits: of the whole, what the first answer took included.
        ask: the question about another system.

    Returns:
        An answer whose reason says which factoring it is about, if others were tried.
    """
    undecided = first.verdict is not Verdict.FEASIBLE and first.unknowns > 0
    if not undecided or not system.from_formulas or _concerns_all(system, first.refutation):
        return first
    start, tried = time.perf_counter(), 0
    left = None if limits.time_s is None else max(limits.time_s - first.seconds, 1e-3)
    try:
        with budget.limited(replace(limits, time_s=left)):
            for other in factorings(system):
                budget.time_left_s()
                found = None if other is system else _answer(other, ask)
                tried += found is not None
                if found is not None and found.verdict is Verdict.FEASIBLE:
                    premises = _premises(other)
                    reason = f"with another factoring of A(x) x: {found.reason}; its premises are {premises}"
                    seconds = first.seconds + time.perf_counter() - start
                    return replace(found, reason=reason, factoring=premises, seconds=seconds)
    except TimeUpError:
        pass
    own = "; this concerns one factoring of A(x) x" if first.refutation else ""
    more = f"; nor was one found with {tried} other factoring{'s' if tried > 1 else ''} of A(x) x" if tried else ""
    if first.refutation and tried:
        more = f", {tried} other{'s' if tried > 1 else ''} gave no solution either"
    return replace(first, reason=first.reason + own + more, seconds=first.seconds + time.perf_counter() - start)


def _answer(other: DescriptorSystem, ask: Callable[[DescriptorSystem], Answer]) -> Answer | None:
    """None if the condition or the representation does not apply to it."""
    try:
        return ask(other)
    except InputError:
        return None


def _concerns_all(system: DescriptorSystem, refutation: Refutation | None) -> bool:
    """Whether a refutation is at x = 0, as far as the premises tell."""
    if refutation is None:
        return False
    at_rest = dict.fromkeys(system.state, 0)
    values = dict(refutation.point)
    for premise in system.premises:
        if premise.expression.free_symbols & set(system.state):
            value = sp.N(premise.expression.subs(at_rest))
            size = max(abs(premise.lower), abs(premise.upper))
            # With a parameter in it the value at rest is not one number.
            if not (value.is_number and value.is_real and abs(float(value) - values[premise.name]) <= _SAME * size):
                return False
    return True


def _premises(system: DescriptorSystem) -> str:
    shown = ", ".join(f"{p.name} = {p.expression}" for p in system.premises[:SHOWN_PREMISES]) or "none"
    return shown if len(system.premises) <= SHOWN_PREMISES else f"{shown}, ..."
