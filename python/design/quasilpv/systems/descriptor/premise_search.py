"""The premises of a system given by nonlinear matrices: as few as possible, with guaranteed bounds.

The entries of E, A, B and C are expanded into terms. Up to constants they span a linear space; its dimension is the
smallest number of premises in which the matrices are affine, and a reduced basis of it is taken. Terms that are
linearly dependent as functions (cos^2 x = 1 - sin^2 x) are found on samples and merged only if the identity is proved.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from math import inf, isfinite, log2

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from quasilpv.systems.descriptor.affine_terms import ROUNDING, Expansion, expansion, summed
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.intervals.algebra import of_functions

Domain = Mapping[sp.Symbol, tuple[float, float]]

_SAMPLING_RANGE = 3.0  # of an interval that is unbounded or missing
_DEPENDENT = 1e-9  # relative distance from the span of other terms that makes a dependence worth proving
_LARGEST_DENOMINATOR = 1000
_SMALL = 1e-6  # values of a premise


def find_premises(
    matrices: Sequence[sp.Matrix], domain: Domain, unknown: Collection[sp.Symbol] = ()
) -> tuple[tuple[Premise, ...], list[AffineMatrix]]:
    """Premises z1, z2, ... in which all entries of some matrices are affine, and the matrices as such.

    Known and unknown parts of an entry never share a premise. Premises are numbered in the order in which their leading
    terms appear, known ones first; each is scaled so that its leading term has the factor 1, or its values size 1.

    Args:
        matrices: of nonlinear expressions.
        domain: interval of every symbol that occurs in an entry that is not constant.
        unknown: symbols that are parameters unknown to the controller: premises that hold one are of kind UNKNOWN.

    Raises:
        InputError: a premise has no bounds over the domain (`enclose` says why).
    """
    entries = [[expansion(entry) for entry in matrix] for matrix in matrices]
    terms = list(dict.fromkeys(term for numbers in _flat(entries) for term in numbers if term != 1))
    samples = _sampled(terms, domain)
    sizes = {
        t: sp.Rational(float(s)) for t, s in zip(terms, np.abs(samples).max(axis=0, initial=0.0), strict=True) if s
    }
    relations = _proved_relations(terms, samples)
    entries = [[_rewritten(numbers, relations) for numbers in matrix] for matrix in entries]
    parts: dict[PremiseKind, list[Expansion]] = {PremiseKind.MEASURED: [], PremiseKind.UNKNOWN: []}
    for numbers in _flat(entries):
        for kind, vectors in parts.items():
            vectors.append({t: c for t, c in numbers.items() if t != 1 and _kind(t, unknown) is kind})
    found = [
        (leading, vector, kind)
        for kind, vectors in parts.items()
        for leading, vector in _reduced_basis(vectors, terms, sizes).items()
    ]
    written = [(leading, _readable(vector), kind) for leading, vector, kind in found]
    constants = {leading: number for leading, number, _ in written if not number.free_symbols}  # terms that are equal
    moving = [(leading, f, _scale(f, domain), kind) for leading, f, kind in written if f.free_symbols]
    premises = tuple(
        Premise.over(domain, f"z{index}", scale * f, kind) for index, (_, f, scale, kind) in enumerate(moving, 1)
    )
    # No premise but its own holds a leading term, so its number in an entry is the coefficient of the premise.
    affine = []
    for matrix, row in zip(matrices, entries, strict=True):
        fixed = [entry.get(sp.S.One, 0) + sum(entry.get(t, 0) * c for t, c in constants.items()) for entry in row]
        slopes = [[entry.get(leading, 0) / scale for entry in row] for leading, _, scale, _ in moving]
        stacked = np.array([[float(value) for value in values] for values in (fixed, *slopes)])
        stacked = stacked.reshape(len(moving) + 1, *matrix.shape)
        affine.append(AffineMatrix(stacked[0], stacked[1:]))
    return premises, affine


def _scale(expression: sp.Expr, domain: Domain) -> sp.Rational:
    """1, or the power of two that makes tiny or huge values about 1: bounds are proved to an absolute tolerance."""
    largest = 0.0
    for share in (0.25, 0.5, 0.8):
        ends = {symbol: _bounded(*domain.get(symbol, (-inf, inf))) for symbol in expression.free_symbols}
        value = sp.N(expression.subs({s: sp.Float(low + share * (high - low)) for s, (low, high) in ends.items()}))
        largest = max(largest, abs(float(value)) if value.is_real and value.is_finite else 0.0)
    if largest == 0.0 or _SMALL < largest < 1 / _SMALL:
        return sp.S.One
    return sp.Integer(2) ** -round(log2(largest))


def dimension(entries: Iterable[Expansion]) -> int:
    """How many premises entries have between them: the dimension of what they span up to constants.

    Dependences of functions that are no identities of terms (cos^2 x = 1 - sin^2 x) are not looked for.
    """
    vectors = [{term: number for term, number in entry.items() if term != 1} for entry in entries]
    return len(_reduced_basis(vectors, list(dict.fromkeys(term for vector in vectors for term in vector))))


def _flat(entries: Iterable[Iterable[Expansion]]) -> Iterable[Expansion]:
    return (numbers for matrix in entries for numbers in matrix)


def _kind(term: sp.Expr, unknown: Collection[sp.Symbol]) -> PremiseKind:
    return PremiseKind.UNKNOWN if term.free_symbols & set(unknown) else PremiseKind.MEASURED


def _readable(vector: Expansion) -> sp.Expr:
    """The premise written so that symbols occur seldom, once at best: the sooner its range is found."""
    short = {term: c if c.q < 10**6 else sp.Float(float(c)) for term, c in vector.items()}
    whole = summed(short)
    return min(sp.factor_terms(whole), of_functions(sp.factor, whole), key=_symbol_count)


def _symbol_count(expression: sp.Expr) -> int:
    return sum(isinstance(node, sp.Symbol) for node in sp.preorder_traversal(expression))


def _reduced_basis(
    vectors: Iterable[Expansion], order: Sequence[sp.Expr], sizes: Mapping[sp.Expr, sp.Expr] | None = None
) -> dict[sp.Expr, Expansion]:
    """Reduced basis of the span of the vectors by leading term, which occurs in no other member of the basis.

    What is left of a term by rounding is dropped: its number times the size of the term is nothing beside the others.
    """
    size = sizes or {}
    rank = {term: position for position, term in enumerate(order)}
    basis: dict[sp.Expr, Expansion] = {}
    for vector in vectors:
        scale = max((abs(number) * size.get(term, 1) for term, number in vector.items()), default=sp.S.Zero)
        rest = dict(vector)
        for leading, member in basis.items():
            if leading in rest:
                rest = _combined(rest, member, -rest[leading])
        rest = {term: number for term, number in rest.items() if abs(number) * size.get(term, 1) > ROUNDING * scale}
        if not rest:
            continue
        leading = min(rest, key=rank.__getitem__)
        new = {term: number / rest[leading] for term, number in rest.items()}
        for other, member in basis.items():
            if leading in member:
                basis[other] = _combined(member, new, -member[leading])
        basis[leading] = new
    return {leading: basis[leading] for leading in sorted(basis, key=rank.__getitem__)}


def _combined(first: Expansion, second: Expansion, factor: sp.Rational) -> Expansion:
    """First plus factor times second."""
    total = dict(first)
    for term, number in second.items():
        total[term] = total.get(term, sp.S.Zero) + factor * number
    return {term: number for term, number in total.items() if number != 0}


def _rewritten(numbers: Expansion, relations: Mapping[sp.Expr, Expansion]) -> Expansion:
    """The expansion with dependent terms replaced by what they equal."""
    total: Expansion = {}
    for term, number in numbers.items():
        total = _combined(total, relations.get(term, {term: sp.S.One}), number)
    return total


# ---- linear dependence of terms as functions -------------------------------------------------------------------------


def _proved_relations(terms: Sequence[sp.Expr], samples: NDArray[np.float64]) -> dict[sp.Expr, Expansion]:
    """Terms that equal a combination of a constant and earlier terms, each with the combination."""
    independent, relations = [sp.S.One], {}
    columns = [np.ones(len(samples))]
    for term, values in zip(terms, samples.T, strict=True):
        relation = _candidate(independent, np.array(columns).T, values)
        if relation is not None and sp.simplify(term - summed(relation)) == 0:
            relations[term] = relation
        else:
            independent.append(term)
            columns.append(values)
    return relations


def _sampled(terms: Sequence[sp.Expr], domain: Domain) -> NDArray[np.float64]:
    """Values of the terms at random points of the domain, only those points where all are finite, (points, terms)."""
    symbols = sorted({symbol for term in terms for symbol in term.free_symbols}, key=lambda symbol: symbol.name)
    count = 4 * len(terms) + 20
    generator = np.random.default_rng(0)
    points = [generator.uniform(*_bounded(*domain.get(symbol, (-inf, inf))), count) for symbol in symbols]
    with np.errstate(all="ignore"):
        values = sp.lambdify(symbols, list(terms), "numpy")(*points)
    table = np.array([np.broadcast_to(of_term, count) for of_term in values], dtype=float).reshape(len(terms), count)
    return np.asarray(table[:, np.isfinite(table).all(axis=0)].T)


def _bounded(low: float, high: float) -> tuple[float, float]:
    """An interval to sample: the given one, or a part of it if it is unbounded."""
    if isfinite(low) and isfinite(high):
        return low, high
    if isfinite(low):
        return low, low + _SAMPLING_RANGE
    return (high - _SAMPLING_RANGE, high) if isfinite(high) else (-_SAMPLING_RANGE, _SAMPLING_RANGE)


def _candidate(
    independent: Sequence[sp.Expr], columns: NDArray[np.float64], values: NDArray[np.float64]
) -> Expansion | None:
    """Rational coefficients that give the values on the samples, None if there are none."""
    if len(values) <= len(independent):
        return None
    scales = np.abs(columns).max(axis=0, initial=0.0)
    scales[scales == 0] = 1.0
    coefficients = np.linalg.lstsq(columns / scales, values, rcond=None)[0] / scales
    if np.abs(columns @ coefficients - values).max() > _DEPENDENT * np.abs(values).max(initial=0.0):
        return None
    rational = [Fraction(float(c)).limit_denominator(_LARGEST_DENOMINATOR) for c in coefficients]
    return {t: sp.Rational(c.numerator, c.denominator) for t, c in zip(independent, rational, strict=True) if c}
