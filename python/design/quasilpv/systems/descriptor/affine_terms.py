"""Expressions as exact numbers times distinct terms, and matrices as affine functions of premises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise

Expansion = dict[sp.Expr, sp.Rational]

# Coefficients are found exactly; two ways of writing one product of doubles may still differ by rounding.
ROUNDING = 1e-12
_DIGITS = 40


class PremiseBasis:
    """The premises as linear combinations of distinct symbolic terms, e.g. ``2 omega_1 sin(theta_2)`` and so on."""

    def __init__(self, source: str, premises: Sequence[Premise]) -> None:
        """Expand the premises.

        Raises:
            InputError: they are linearly dependent, with each other or with a constant.
        """
        self._source = source
        self._names = [premise.name for premise in premises]
        expansions = [{sp.S.One: sp.S.One}] + [expansion(premise.expression) for premise in premises]
        self._terms = list(dict.fromkeys(term for numbers in expansions for term in numbers))
        self._matrix = sp.Matrix([[numbers.get(term, 0) for numbers in expansions] for term in self._terms])
        _, rows = self._matrix.T.rref()
        if len(rows) < len(expansions):
            names = ", ".join(self._names)
            raise InputError(source, "premises", names, "linearly independent functions, none constant")
        self._rows = list(rows)
        self._inverse = self._matrix.extract(self._rows, list(range(len(expansions)))).inv()

    def affine(self, field: str, matrix: sp.Matrix) -> AffineMatrix:
        """Coefficients of every entry of a matrix."""
        stacked = np.zeros((len(self._names) + 1, *matrix.shape))
        for row in range(matrix.rows):
            for column in range(matrix.cols):
                entry = matrix[row, column]
                stacked[:, row, column] = self._coefficients(f"{field}[{row},{column}]", entry)
        return AffineMatrix(stacked[0], stacked[1:])

    def _coefficients(self, field: str, entry: sp.Expr) -> list[float]:
        numbers = expansion(entry)
        solution = self._inverse * sp.Matrix([numbers.get(self._terms[row], 0) for row in self._rows])
        explained = dict(zip(self._terms, self._matrix * solution, strict=True))
        scale = max((abs(number) for number in numbers.values()), default=0)
        for term, number in numbers.items():
            if abs(number - explained.pop(term, 0)) > ROUNDING * scale:
                raise InputError(self._source, field, f"the term {sp.Float(number, 6) * term}", self._expected())
        for term, number in explained.items():
            if abs(number) > ROUNDING * scale:
                raise InputError(self._source, field, f"no term in {term}", self._expected())
        return [float(number) for number in solution]

    def _expected(self) -> str:
        return f"an expression affine in the premises {', '.join(self._names) or '(none)'}"


def expansion(expression: sp.Expr) -> Expansion:
    """Write an expression as a sum of exact numbers times distinct terms; the constant is the number of the term 1."""
    numbers: Expansion = {}
    for summand in sp.Add.make_args(sp.expand(expression)):
        symbols = summand.free_symbols
        number, term = summand.as_independent(*symbols, as_Add=False) if symbols else (summand, sp.S.One)
        numbers[term] = numbers.get(term, sp.S.Zero) + _rational(number)
    return {term: number for term, number in numbers.items() if number != 0}


def _rational(number: sp.Expr) -> sp.Rational:
    """A number exactly if it is rational or a float, to far more digits than a double has if it is pi or a root."""
    return sp.Rational(number if number.is_Rational or number.is_Float else sp.N(number, _DIGITS))


def summed(numbers: Mapping[sp.Expr, sp.Rational]) -> sp.Expr:
    """The expression an expansion stands for."""
    return sp.Add(*(number * term for term, number in numbers.items()))
