"""Other ways of writing the same drift as A(x) x: which one is taken decides what a condition can prove.

``x4^2 sin x3`` is ``(x4 sin x3) x4`` by the documented rule and ``(x4^2 sinc x3) x3`` by another; both are exact, and
there are systems that a condition stabilises in one of them only.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations, islice, product
from typing import TypeAlias

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.affine_terms import expansion
from quasilpv.systems.descriptor.factoring import Row, expanded, term_rows
from quasilpv.systems.descriptor.premise import AffineMatrix, PremiseKind
from quasilpv.systems.descriptor.premise_search import dimension
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.descriptor.vocabulary import exact

MOST_FACTORINGS = 16
_MOST_CANDIDATES = 64  # whose premises are counted

Place: TypeAlias = "tuple[int, int]"
"""Row of the drift, and number of a term in it."""
Choices: TypeAlias = "tuple[tuple[Place, int], ...]"
"""Which of its rows the terms at some places are written as; the documented one elsewhere."""


def factorings(system: DescriptorSystem, limit: int = MOST_FACTORINGS) -> Iterator[DescriptorSystem]:
    """The system and others with the same E(x), B(x), C(x) and drift ``A(x) x``, those with the fewest premises first.

    Every expanded term of the drift can be divided by any state in it, or by a sine or tanh of something that vanishes
    at 0. The documented rule comes first among equals, then what differs from it in one term, in all terms towards one
    state, in two terms.

    Args:
        system: from equations, matrices or the catalogue. One given by rules has no other factoring: it comes alone.
        limit: at most so many.

    Returns:
        The systems one after the other, each built when it is asked for; those whose premises are unbounded are left
        out. All premises are found anew, but for the system itself.
    """
    return islice(_factorings(system), limit)


def _factorings(system: DescriptorSystem) -> Iterator[DescriptorSystem]:
    terms = _terms(system)
    if system.given_by_rules or not any(len(rows) > 1 for rows in terms.values()):
        yield system
        return
    weights = [sp.S.One, *(exact(premise.expression) for premise in system.premises)]
    E, B, C = (_in_state(matrix, weights) for matrix in (system.E, system.B, system.C))
    fixed = [expansion(entry) for matrix in (E, B, C) for entry in matrix]
    seen = {sp.ImmutableMatrix(_in_state(system.A, weights).applyfunc(sp.expand))}
    found: list[tuple[int, int, sp.Matrix | None]] = [(len(system.premises), 0, None)]
    for number, choices in enumerate(islice(_candidates(terms, system.state), _MOST_CANDIDATES), 1):
        A = _drift(system, terms, dict(choices))
        key = sp.ImmutableMatrix(A.applyfunc(sp.expand))
        if key not in seen:
            seen.add(key)
            found.append((dimension([*fixed, *(expansion(entry) for entry in A)]), number, A))
    for _, _, A in sorted(found, key=lambda candidate: candidate[:2]):
        if A is None:
            yield system
            continue
        try:
            yield _rebuilt(system, E, A, B, C)
        except InputError:  # a premise without bounds
            continue


def _terms(system: DescriptorSystem) -> dict[Place, list[Row]]:
    """The rows every term of the drift can be written as."""
    weights = [sp.S.One, *(exact(premise.expression) for premise in system.premises)]
    drift = _in_state(system.A, weights) * sp.Matrix(system.state)
    algebraic = system.state[system.differential :]
    terms: dict[Place, list[Row]] = {}
    for row, entry in enumerate(drift):
        for number, term in enumerate(expanded(entry)):
            if term != 0:
                terms[row, number] = term_rows(system.name, term, system.state, algebraic)
    return terms


def _in_state(matrix: AffineMatrix, weights: list[sp.Expr]) -> sp.Matrix:
    """An affine matrix as one of expressions; doubles are the rationals they are."""
    total = sp.zeros(*matrix.shape)
    for weight, coefficient in zip(weights, [matrix.constant, *matrix.coefficients], strict=True):
        total += weight * sp.Matrix(*matrix.shape, [sp.Rational(float(entry)) for entry in coefficient.flat])
    return total


def _candidates(terms: Mapping[Place, list[Row]], state: tuple[sp.Symbol, ...]) -> Iterator[Choices]:
    """The documented rule, one term otherwise, all terms towards one state, two terms otherwise."""
    others = {place: range(1, len(rows)) for place, rows in terms.items() if len(rows) > 1}
    yield ()
    for place, choices in others.items():
        yield from (((place, choice),) for choice in choices)
    for symbol in state:
        towards = [
            (place, next(number for number, row in enumerate(terms[place]) if symbol in row))
            for place in others
            if any(symbol in row for row in terms[place])
        ]
        yield tuple(towards)
    for first, second in combinations(others, 2):
        for one, other in product(others[first], others[second]):
            yield ((first, one), (second, other))


def _drift(system: DescriptorSystem, terms: Mapping[Place, list[Row]], choices: Mapping[Place, int]) -> sp.Matrix:
    """A(x) with some terms written otherwise."""
    A = sp.zeros(system.order, system.order)
    for place, rows in terms.items():
        for symbol, entry in rows[choices.get(place, 0)].items():
            A[place[0], system.state.index(symbol)] += entry
    return A


def _rebuilt(system: DescriptorSystem, E: sp.Matrix, A: sp.Matrix, B: sp.Matrix, C: sp.Matrix) -> DescriptorSystem:
    """The given system with these matrices: its equilibrium, disturbance and equations are what they were."""
    by_kind = {
        kind: {s for p in system.premises if (p.kind is PremiseKind.UNKNOWN) is kind for s in p.expression.free_symbols}
        for kind in (True, False)
    }
    unknown = sorted(by_kind[True] - by_kind[False] - set(system.state), key=str)
    other = DescriptorSystem.from_symbols(
        name=system.name,
        state=system.state,
        inputs=system.inputs,
        E=E,
        A=A,
        B=B,
        C=C,
        domain=system.domain,
        unknown=unknown,
    )
    return replace(system, premises=other.premises, E=other.E, A=other.A, B=other.B, C=other.C)
