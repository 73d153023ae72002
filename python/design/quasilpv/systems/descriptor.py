"""Descriptor systems whose matrices are affine in bounded premises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError
from quasilpv.systems.premise import AffineMatrix, Premise, PremiseKind

# Coefficients are found exactly; two ways of writing one product of doubles may still differ by rounding.
_ROUNDING = 1e-12


class SystemMatrices(NamedTuple):
    """The four matrices at one premise vector."""

    E: NDArray[np.float64]
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DescriptorSystem:
    """``E(z) x' = A(z) x + B(z) u``, ``y = C(z) x``, every matrix affine in the premises z(x), z in a guaranteed box.

    Attributes:
        name: identifier, e.g. ``"arm3"`` or ``"ex-I.1"``.
        state: the symbols of x.
        inputs: names of u.
        premises: z_1 ... z_p with bounds valid over the domain.
        E, A, B, C: affine matrices, n x n, n x n, n x m, o x n, with E = diag(E_1, 0): the algebraic states come last.
        domain: interval of every symbol the premises depend on; of other states it may be infinite.

    Raises:
        InputError: the shapes of the parts do not agree, or E has not the form diag(E_1(z), 0).

    Reference: Dehak 2022, (I.1), (I.21) and (I.25).
    """

    name: str
    state: tuple[sp.Symbol, ...]
    inputs: tuple[str, ...]
    premises: tuple[Premise, ...]
    E: AffineMatrix
    A: AffineMatrix
    B: AffineMatrix
    C: AffineMatrix
    domain: Mapping[sp.Symbol, tuple[float, float]]

    def __post_init__(self) -> None:
        """Refuse parts whose sizes disagree and states in another order than differential, algebraic."""
        n, m = len(self.state), len(self.inputs)
        expected = {"E": (n, n), "A": (n, n), "B": (n, m), "C": (self.C.shape[0], n)}
        for field, shape in expected.items():
            matrix: AffineMatrix = getattr(self, field)
            if matrix.shape != shape:
                raise InputError(self.name, field, f"shape {matrix.shape}", f"shape {shape}")
            if matrix.premises != len(self.premises):
                raise InputError(self.name, field, f"{matrix.premises} coefficients", f"{len(self.premises)}")
        present = self._entries_of_E
        q = self.differential
        if present[q:].any() or present[:, q:].any() or not present[:, :q].any(axis=0).all():
            rows, columns = present.any(axis=1), present.any(axis=0)
            got = f"non-zero rows {np.flatnonzero(rows).tolist()} and columns {np.flatnonzero(columns).tolist()}"
            raise InputError(self.name, "E", got, "diag(E_1, 0): the algebraic equations and states last")

    @classmethod
    def from_symbols(
        cls,
        *,
        name: str,
        state: Sequence[sp.Symbol],
        inputs: Sequence[str],
        E: sp.Matrix,
        A: sp.Matrix,
        B: sp.Matrix,
        C: sp.Matrix,
        premises: Sequence[Premise],
        domain: Mapping[sp.Symbol, tuple[float, float]],
    ) -> DescriptorSystem:
        """Find the coefficients of matrices that are affine in the given premises.

        Raises:
            InputError: an entry is not ``a_0 + sum a_k z_k(x)`` with numbers a_k (entry and remainder are named), or
                the premises are linearly dependent (with each other or with a constant).
        """
        basis = _PremiseBasis(name, premises)
        return cls(
            name,
            tuple(state),
            tuple(inputs),
            tuple(premises),
            E=basis.affine("E", E),
            A=basis.affine("A", A),
            B=basis.affine("B", B),
            C=basis.affine("C", C),
            domain=dict(domain),
        )

    @property
    def order(self) -> int:
        """Number of states n."""
        return len(self.state)

    @cached_property
    def differential(self) -> int:
        """Number q of differential states x_d, the first ones: ``E(z) = diag(E_1(z), 0)`` with E_1 q x q.

        q = n for a regular system. Whether E_1(z) is invertible in the box is another question: `structure_report`.
        """
        return int(self._entries_of_E.any(axis=1).sum())

    @property
    def _entries_of_E(self) -> NDArray[np.bool_]:
        """Which entries of E are not identically 0, (n, n)."""
        entries: NDArray[np.bool_] = (self.E.constant != 0) | (self.E.coefficients != 0).any(axis=0)
        return entries

    @cached_property
    def uncertainty(self) -> NormBoundedUncertainty | None:
        """The norm-bounded view of the unknown premises, None if every premise is known to the controller.

        Raises:
            InputError: E or C depends on an unknown premise.
        """
        unknown = [p for p, premise in enumerate(self.premises) if premise.kind is PremiseKind.UNKNOWN]
        return NormBoundedUncertainty.of(self, unknown) if unknown else None

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower bounds of the premises, (p,)."""
        return np.array([premise.lower for premise in self.premises])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper bounds of the premises, (p,)."""
        return np.array([premise.upper for premise in self.premises])

    def evaluate(self, z: ArrayLike) -> SystemMatrices:
        """The matrices at a premise vector z of shape (p,)."""
        return SystemMatrices(self.E.evaluate(z), self.A.evaluate(z), self.B.evaluate(z), self.C.evaluate(z))

    def premise_values(self, x: ArrayLike) -> NDArray[np.float64]:
        """z(x), shape (p,), at a state of shape (q,).

        Raises:
            InputError: a premise depends on something that is not a state (an uncertain parameter).
        """
        return np.array(self._premise_function(*np.asarray(x, dtype=float)), dtype=float)

    @cached_property
    def _premise_function(self) -> Any:
        for premise in self.premises:
            others = premise.expression.free_symbols - set(self.state)
            if others:
                raise InputError(self.name, f"premise {premise.name}", f"parameters {others}", "states only")
        return sp.lambdify(self.state, [premise.expression for premise in self.premises], "numpy")


@dataclass(frozen=True, eq=False)
class NormBoundedUncertainty:
    """Unknown premises as ``A + H_a Delta W_a`` and ``B + H_b Delta' W_b`` with ``|Delta| <= 1``, ``|Delta'| <= 1``.

    An unknown premise in [lower, upper] is ``centre + radius d`` with ``|d| <= 1``; each coefficient matrix times its
    radius is factored at its rank k, so that Delta is diagonal, every d repeated k times.

    Attributes:
        nominal: the system at the centres of the unknown premises; the known premises remain.
        Ha, Wa: n x k_a and k_a x n; no column if A does not depend on an unknown premise.
        Hb, Wb: n x k_b and k_b x m.

    Reference: Dehak 2022, (I.37) and Theorem I.3.
    """

    nominal: DescriptorSystem
    Ha: NDArray[np.float64]
    Wa: NDArray[np.float64]
    Hb: NDArray[np.float64]
    Wb: NDArray[np.float64]

    @classmethod
    def of(cls, system: DescriptorSystem, unknown: Sequence[int]) -> NormBoundedUncertainty:
        """Take the premises of the given indices for unknown.

        Raises:
            InputError: E or C depends on one of them.
        """
        for field in ("E", "C"):
            matrix: AffineMatrix = getattr(system, field)
            if matrix.coefficients[list(unknown)].any():
                raise InputError(
                    system.name, field, "an entry in an unknown premise", "unknown premises in A and B only"
                )
        known = [p for p in range(len(system.premises)) if p not in unknown]
        centre = np.zeros(len(system.premises))
        centre[list(unknown)] = 0.5 * (system.lower + system.upper)[list(unknown)]
        radius = 0.5 * (system.upper - system.lower)

        def nominal(matrix: AffineMatrix) -> AffineMatrix:
            return AffineMatrix(matrix.evaluate(centre), matrix.coefficients[known])

        Ha, Wa = _factored([radius[p] * system.A.coefficients[p] for p in unknown])
        Hb, Wb = _factored([radius[p] * system.B.coefficients[p] for p in unknown])
        return cls(
            replace(
                system,
                premises=tuple(system.premises[p] for p in known),
                E=nominal(system.E),
                A=nominal(system.A),
                B=nominal(system.B),
                C=nominal(system.C),
            ),
            Ha,
            Wa,
            Hb,
            Wb,
        )


def _factored(matrices: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left factors side by side and right factors stacked, each at the rank of its matrix (full pivoting)."""
    rows, columns = matrices[0].shape
    left, right = [np.zeros((rows, 0))], [np.zeros((0, columns))]
    for matrix in matrices:
        remainder = np.array(matrix)
        scale = np.abs(remainder).max(initial=0.0)
        while np.abs(remainder).max(initial=0.0) > _ROUNDING * scale:
            row, column = np.unravel_index(np.abs(remainder).argmax(), remainder.shape)
            left.append(remainder[:, [column]])
            right.append(remainder[[row], :] / remainder[row, column])
            remainder = remainder - left[-1] @ right[-1]
    return np.hstack(left), np.vstack(right)


class _PremiseBasis:
    """The premises as linear combinations of distinct symbolic terms, e.g. ``2 omega_1 sin(theta_2)`` and so on."""

    def __init__(self, source: str, premises: Sequence[Premise]) -> None:
        self._source = source
        self._names = [premise.name for premise in premises]
        expansions = [{sp.S.One: sp.S.One}] + [_expansion(premise.expression) for premise in premises]
        self._terms = list(dict.fromkeys(term for expansion in expansions for term in expansion))
        self._matrix = sp.Matrix([[e.get(term, 0) for e in expansions] for term in self._terms])
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
                entry = sp.sympify(matrix[row, column])
                stacked[:, row, column] = self._coefficients(f"{field}[{row},{column}]", entry)
        return AffineMatrix(stacked[0], stacked[1:])

    def _coefficients(self, field: str, entry: sp.Expr) -> list[float]:
        expansion = _expansion(entry)
        solution = self._inverse * sp.Matrix([expansion.get(self._terms[row], 0) for row in self._rows])
        explained = dict(zip(self._terms, self._matrix * solution, strict=True))
        scale = max((abs(number) for number in expansion.values()), default=0)
        for term, number in expansion.items():
            if abs(number - explained.pop(term, 0)) > _ROUNDING * scale:
                raise InputError(self._source, field, f"the term {sp.Float(number, 6) * term}", self._expected())
        for term, number in explained.items():
            if abs(number) > _ROUNDING * scale:
                raise InputError(self._source, field, f"no term in {term}", self._expected())
        return [float(number) for number in solution]

    def _expected(self) -> str:
        return f"an expression affine in the premises {', '.join(self._names) or '(none)'}"


def _expansion(expression: sp.Expr) -> dict[sp.Expr, sp.Rational]:
    """Write an expression as a sum of exact numbers times distinct terms."""
    expansion: dict[sp.Expr, sp.Rational] = {}
    for summand in sp.Add.make_args(sp.expand(expression)):
        number, term = summand.as_coeff_Mul()
        if term.is_number:  # pi, sqrt(2), ...: a constant like any other
            number, term = sp.Float(summand), sp.S.One
        exact = sp.Rational(number)
        expansion[term] = expansion.get(term, sp.S.Zero) + exact
    return {term: number for term, number in expansion.items() if number != 0}
