"""Descriptor systems as numbers: matrices affine in bounded premises, and what can be read off them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError, one_of
from quasilpv.shown import html_table
from quasilpv.systems.descriptor.names import symbol
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise

SHOWN_PREMISES = 6
"""In the short description of a system."""
MAX_UNIT = 32
"""Characters of the text of a unit."""


class SystemMatrices(NamedTuple):
    """The four matrices at one premise vector."""

    E: NDArray[np.float64]
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class AffineSystem:
    """``E(z) x' = A(z) x + B(z) u``, ``y = C(z) x``, every matrix affine in the premises z(x), z in a guaranteed box.

    Attributes:
        name: identifier, e.g. ``"arm3"`` or ``"ex-I.1"``.
        state: the symbols of x.
        inputs: names of u.
        premises: z_1 ... z_p with bounds valid over the domain.
        E, A, B, C: affine matrices, n x n, n x n, n x m, o x n, with E = diag(E_1, 0): the algebraic states come last.
        domain: interval of every symbol the premises depend on; of other states it may be infinite.
        disturbance: what the equations leave over at a rounded equilibrium, d in ``E x' = A x + B u + d`` with one
            number per row; empty if they leave nothing. No condition accounts for it: a verdict is about d = 0, and
            whoever states one reports d.
        given_by_rules: the premises are the memberships of all rules but the last of a Takagi-Sugeno model: their
            sector coordinates sum to at most 1 (`from_rules`).
        from_formulas: the drift was given as a function of the state, and A(x) is one way among others to write it as
            A(x) x (`from_equations`).
        trim: the equilibrium that states and inputs are deviations from, (n + m,); empty for the origin.
        equations: F of ``F(x, x', u) = 0`` as they were written (`from_equations`), of the deviations, in the order of
            the rows; empty where there are none, or in other units.
        units: by name of a state, an input or a parameter, for people, logs and figures; those not named have none.

    Raises:
        InputError: the shapes of the parts do not agree, E has not the form diag(E_1(z), 0), or a unit is of nothing.

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
    disturbance: tuple[float, ...] = ()
    given_by_rules: bool = False
    from_formulas: bool = False
    trim: tuple[float, ...] = ()
    equations: tuple[sp.Expr, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse parts whose sizes disagree, states in another order than differential, algebraic, and units of
        nothing."""
        self._require_units()
        n, m = len(self.state), len(self.inputs)
        expected = {"E": (n, n), "A": (n, n), "B": (n, m), "C": (self.C.shape[0], n)}
        for name, shape in expected.items():
            matrix: AffineMatrix = getattr(self, name)
            if matrix.shape != shape:
                raise InputError(self.name, name, f"shape {matrix.shape}", f"shape {shape}")
            if matrix.premises != len(self.premises):
                raise InputError(self.name, name, f"{matrix.premises} coefficients", f"{len(self.premises)}")
        present = self._entries_of_E
        q = self.differential
        if present[q:].any() or present[:, q:].any() or not present[:, :q].any(axis=0).all():
            rows, columns = present.any(axis=1), present.any(axis=0)
            got = f"non-zero rows {np.flatnonzero(rows).tolist()} and columns {np.flatnonzero(columns).tolist()}"
            raise InputError(self.name, "E", got, "diag(E_1, 0): the algebraic equations and states last")

    def _require_units(self) -> None:
        names = [symbol.name for symbol in (*self.state, *self.domain)] + list(self.inputs)
        for name, unit in self.units.items():
            if name not in names:
                raise InputError(self.name, "units", name, one_of(names, name))
            if not (isinstance(unit, str) and 0 < len(unit) <= MAX_UNIT and unit.isprintable()):
                raise InputError(self.name, f"units: {name}", repr(unit), f"a text of 1 to {MAX_UNIT} characters")

    def __repr__(self) -> str:
        """In a few lines: name, sizes, premises."""
        names = ", ".join(symbol.name for symbol in self.state)
        algebraic = self.order - self.differential
        kinds = f"{self.differential} differential, {algebraic} algebraic" if algebraic else f"{self.order}"
        first = self.premises[:SHOWN_PREMISES]
        shown = [f"  {p.name} in [{p.lower:.4g}, {p.upper:.4g}], {p.kind.value}" for p in first]
        if len(self.premises) > SHOWN_PREMISES:
            shown.append(f"  and {len(self.premises) - SHOWN_PREMISES} more premises")
        if self.disturbance:
            shown.append(f"  constant disturbance of at most {max(map(abs, self.disturbance)):.2g}, in no verdict")
        inputs = ", ".join(self.inputs) or "none"
        return "\n".join([f"{self.name}: {kinds} states {names}; inputs {inputs}", *shown])

    def _repr_html_(self) -> str:
        """Sizes and premises as a table, for notebooks."""
        rows: dict[str, object] = {
            "states": ", ".join(symbol.name for symbol in self.state),
            "of these algebraic": self.order - self.differential,
            "inputs": ", ".join(self.inputs) or "none",
        }
        for p in self.premises[:SHOWN_PREMISES]:
            rows[p.name] = f"{p.expression} in [{p.lower:.4g}, {p.upper:.4g}], {p.kind.value}"
        if len(self.premises) > SHOWN_PREMISES:
            rows["and"] = f"{len(self.premises) - SHOWN_PREMISES} more premises"
        return html_table(self.name, rows)

    def __getstate__(self) -> dict[str, Any]:
        """The parts only: compiled functions of them do not travel between processes."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

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

    def premise_values(self, x: ArrayLike, parameters: Mapping[Any, float] | None = None) -> NDArray[np.float64]:
        """z(x), shape (p,), at a state of shape (n,) and at values by name of the uncertain parameters.

        Raises:
            InputError: a premise depends on a parameter that has no value.
        """
        parameters = {symbol(name): value for name, value in (parameters or {}).items()}
        values = np.asarray(x, dtype=float)
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
