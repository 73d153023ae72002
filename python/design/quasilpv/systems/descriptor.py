"""Descriptor systems whose matrices are affine in bounded premises."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError
from quasilpv.systems.affine_terms import PremiseBasis
from quasilpv.systems.equations import equation_matrices
from quasilpv.systems.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.premise_search import find_premises
from quasilpv.systems.uncertainty import NormBoundedUncertainty

SHOWN_PREMISES = 6
"""In the short description of a system."""


class SystemMatrices(NamedTuple):
    """The four matrices at one premise vector."""

    E: NDArray[np.float64]
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
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
        domain: Mapping[sp.Symbol, tuple[float, float]],
        premises: Sequence[Premise] | None = None,
        unknown: Collection[sp.Symbol] = (),
    ) -> DescriptorSystem:
        """The system of nonlinear matrices E(x), A(x), B(x), C(x) over a domain.

        Args:
            name: identifier.
            state: the symbols of x, differential states first.
            inputs: names of u.
            E, A, B, C: n x n, n x n, n x m and o x n matrices of expressions.
            domain: interval of every symbol the matrices depend on.
            premises: what the matrices are affine in. If they are not given they are found, as few as possible, with
                bounds proved over the domain (`find_premises`).
            unknown: parameters unknown to the controller, for premises that are to be found.

        Raises:
            InputError: an entry is not ``a_0 + sum a_k z_k(x)`` with numbers a_k (entry and remainder are named), the
                premises are linearly dependent (with each other or with a constant), or a found one is unbounded.
        """
        if premises is None:
            premises, matrices = find_premises((E, A, B, C), domain, unknown)
        else:
            basis = PremiseBasis(name, premises)
            matrices = [basis.affine(*named) for named in (("E", E), ("A", A), ("B", B), ("C", C))]
        affine = dict(zip("EABC", matrices, strict=True))
        return cls(name, tuple(state), tuple(inputs), tuple(premises), **affine, domain=dict(domain))

    @classmethod
    def from_equations(
        cls,
        equations: Sequence[sp.Expr | sp.Eq],
        *,
        name: str,
        state: Sequence[sp.Symbol],
        inputs: Sequence[sp.Symbol],
        domain: Mapping[sp.Symbol, tuple[float, float]],
        outputs: Sequence[sp.Expr] | None = None,
        unknown: Collection[sp.Symbol] = (),
    ) -> DescriptorSystem:
        """The system of implicit equations ``F(x, x', u) = 0``, affine in x' and u, of which x = 0 is an equilibrium.

        States whose rate occurs nowhere are algebraic and come last, in the order given otherwise, like the equations
        without a rate. How the drift is written as A(x) x: see `factored`.

        Args:
            equations: as many as states; an expression stands for itself = 0. ``rate(x1)`` is the symbol of x1'.
            name: identifier.
            state: the symbols of x, in any order.
            inputs: the symbols of u.
            domain: interval of every symbol the matrices depend on.
            outputs: y, expressions of the state that vanish at 0; the whole state if not given.
            unknown: parameters unknown to the controller; their premises are of kind UNKNOWN.

        Raises:
            InputError: an equation is not affine in rates and inputs, has a drift that does not vanish at x = 0 or that
                cannot be factored (the equation is named), there are not as many equations as states, or
                `from_symbols` refuses the matrices.
        """
        matrices = equation_matrices(name, equations, state, inputs, state if outputs is None else outputs)
        return cls.from_symbols(
            name=name,
            state=matrices.state,
            inputs=[symbol.name for symbol in inputs],
            E=matrices.E,
            A=matrices.A,
            B=matrices.B,
            C=matrices.C,
            domain=domain,
            unknown=unknown,
        )

    def __repr__(self) -> str:
        """In a few lines: name, sizes, premises."""
        names = ", ".join(symbol.name for symbol in self.state)
        algebraic = self.order - self.differential
        kinds = f"{self.differential} differential, {algebraic} algebraic" if algebraic else f"{self.order}"
        first = self.premises[:SHOWN_PREMISES]
        shown = [f"  {p.name} in [{p.lower:.4g}, {p.upper:.4g}], {p.kind.value}" for p in first]
        if len(self.premises) > SHOWN_PREMISES:
            shown.append(f"  and {len(self.premises) - SHOWN_PREMISES} more premises")
        inputs = ", ".join(self.inputs) or "none"
        return "\n".join([f"{self.name}: {kinds} states {names}; inputs {inputs}", *shown])

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

    def premise_values(self, x: ArrayLike, parameters: Mapping[sp.Symbol, float] | None = None) -> NDArray[np.float64]:
        """z(x), shape (p,), at a state of shape (n,) and at values of the uncertain parameters, if there are any.

        Raises:
            InputError: a premise depends on a parameter that has no value.
        """
        parameters, values = parameters or {}, np.asarray(x, dtype=float)
        if values.shape != (self.order,):
            raise InputError(self.name, "x", f"shape {values.shape}", f"shape ({self.order},)")
        missing = [symbol.name for symbol in self.parameters if symbol not in parameters]
        if missing:
            expected = "a value of every parameter the premises depend on"
            raise InputError(self.name, "parameters", f"none for {', '.join(missing)}", expected)
        return np.array(
            self._premise_function(*values, *(parameters[symbol] for symbol in self.parameters)), dtype=float
        )

    @cached_property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """The symbols other than states that the premises depend on, by name."""
        symbols = {symbol for premise in self.premises for symbol in premise.expression.free_symbols}
        return tuple(sorted(symbols - set(self.state), key=lambda symbol: symbol.name))

    @cached_property
    def _premise_function(self) -> Any:
        return sp.lambdify((*self.state, *self.parameters), [p.expression for p in self.premises], "numpy")
