"""Descriptor systems whose matrices are affine in bounded premises, and the ways they are given."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf, nextafter
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.arguments import checked
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.affine_system import AffineSystem
from quasilpv.systems.descriptor.affine_terms import PremiseBasis
from quasilpv.systems.descriptor.equations import Equilibrium, equation_matrices
from quasilpv.systems.descriptor.names import Name
from quasilpv.systems.descriptor.open_parameters import Made, open_parameters, opened
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind, with_kinds
from quasilpv.systems.descriptor.premise_search import find_premises
from quasilpv.systems.descriptor.rules import affine_in_memberships, membership_premises, read_constant
from quasilpv.systems.descriptor.uncertainty import NormBoundedUncertainty
from quasilpv.systems.descriptor.vocabulary import Bounds, Formula, SymbolicMatrix, Vocabulary, exact


@dataclass(frozen=True, eq=False, repr=False)
class DescriptorSystem(AffineSystem):
    """``E(z) x' = A(z) x + B(z) u``, ``y = C(z) x``, made from matrices, equations or rules.

    >>> import quasilpv as ql
    >>> ql.DescriptorSystem.from_equations(
    ...     ["x' = w", "w' = 9.81*sin(x) + u"], state="x w", inputs="u", domain={"x": (-1, 1)}, name="pendulum"
    ... )
    pendulum: 2 states x, w; inputs u
      z1 in [0.8415, 1], measured

    What it consists of, and what is read off it: `AffineSystem`.
    """

    @classmethod
    def from_symbols(
        cls,
        *,
        name: str = "system",
        state: str | Sequence[Name],
        inputs: str | Sequence[Name] = (),
        E: SymbolicMatrix,
        A: SymbolicMatrix,
        B: SymbolicMatrix,
        C: SymbolicMatrix,
        domain: Mapping[Any, Any],
        premises: Sequence[Premise] | None = None,
        unknown: str | Collection[Name] = (),
    ) -> DescriptorSystem:
        """The system of nonlinear matrices E(x), A(x), B(x), C(x) over a domain.

        Names are given as text or as symbols, with whatever assumptions: one name is one thing. Entries are
        expressions, numbers or formulas as text (`quasilpv.systems.descriptor.formula`).

        Args:
            name: identifier.
            state: names of x, differential states first.
            inputs: names of u.
            E, A, B, C: n x n, n x n, n x m and o x n matrices.
            domain: by name, the interval (low, high) of everything the matrices depend on.
            premises: what the matrices are affine in. If they are not given they are found, as few as possible, with
                bounds proved over the domain (`find_premises`).
            unknown: parameters unknown to the controller, for premises that are to be found.

        Returns:
            The system. A premise that depends on states which the outputs C x do not show is `PremiseKind.ESTIMATED`:
            a law that has the whole state may use it, an observer may not.

        Raises:
            InputError: an entry is not ``a_0 + sum a_k z_k(x)`` with numbers a_k (entry and remainder are named), the
                premises are linearly dependent (with each other or with a constant), a found one is unbounded, a name
                is not declared or declared in vain, or an interval is none.
        """
        bases = [premise.expression for premise in premises or ()]
        names = Vocabulary(name, state, inputs, domain, unknown=unknown, declared=bases)
        matrices = [names.read_matrix(field, matrix) for field, matrix in zip("EABC", (E, A, B, C), strict=True)]
        if premises is not None:
            premises = [replace(p, expression=names.read(f"premise {p.name}", p.expression)) for p in premises]
        names.finish()
        return cls._of(names, matrices, premises)

    @classmethod
    def _of(
        cls,
        names: Vocabulary,
        matrices: Sequence[sp.Matrix],
        premises: Sequence[Premise] | None = None,
        *,
        state: Sequence[sp.Symbol] = (),
        domain: Mapping[sp.Symbol, Bounds] | None = None,
        disturbance: tuple[float, ...] = (),
        from_formulas: bool = False,
        trim: tuple[float, ...] = (),
        equations: tuple[sp.Expr, ...] = (),
        units: Mapping[str, str] | None = None,
    ) -> DescriptorSystem:
        """The system of matrices whose entries have been read; state and domain are those of the names by default."""
        state, domain = state or names.state, names.domain if domain is None else domain
        left_open = open_parameters()
        if left_open is not None:
            with opened(None):
                closed = left_open.closed(matrices)
                system = cls._of(
                    names,
                    closed,
                    premises,
                    state=state,
                    domain=domain,
                    disturbance=disturbance,
                    from_formulas=from_formulas,
                    trim=trim,
                    equations=tuple(left_open.closed([sp.Matrix(equations)])[0]) if equations else (),
                    units=units,
                )
            left_open.made.append(Made(system, matrices, premises, names.unknown))
            return system
        if premises is None:
            premises, affine = find_premises(matrices, domain, names.unknown)
        else:
            basis = PremiseBasis(names.source, premises)
            affine = [basis.affine(field, matrix) for field, matrix in zip("EABC", matrices, strict=True)]
        return cls(
            name=names.source,
            state=tuple(state),
            inputs=tuple(each.name for each in names.inputs),
            premises=with_kinds(premises, state, affine[-1]),
            E=affine[0],
            A=affine[1],
            B=affine[2],
            C=affine[3],
            domain=dict(domain),
            disturbance=disturbance,
            from_formulas=from_formulas,
            trim=trim,
            equations=equations,
            units=dict(units or {}),
        )

    @classmethod
    @checked
    def from_equations(
        cls,
        equations: str | Sequence[Formula],
        *,
        name: str = "system",
        state: str | Sequence[Name],
        inputs: str | Sequence[Name] = (),
        domain: Mapping[Any, Any],
        outputs: str | Sequence[Formula] | None = None,
        unknown: str | Collection[Name] = (),
        equilibrium: tuple[Any, Any] | None = None,
        constants: Mapping[str, sp.Expr] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> DescriptorSystem:
        """The system of implicit equations ``F(x, x', u) = 0``, affine in x' and u, around an equilibrium.

        States whose rate occurs nowhere are algebraic and come last, in the order given otherwise, like the equations
        without a rate. How the drift is written as A(x) x: see `quasilpv.systems.descriptor.factoring.split`. Names are
        given as text or as symbols, with whatever assumptions: one name is one thing.

        Args:
            equations: as many as states; text such as ``"x1' = -sin(x2) + u"`` (`quasilpv.systems.descriptor.formula`),
                an equation or an expression, which stands for itself = 0. ``rate(x1)`` is the symbol of x1'.
            name: identifier.
            state: names of x, in any order.
            inputs: names of u.
            domain: by name, the interval (low, high) of everything the matrices depend on, as it is in the equations.
            outputs: y, expressions of the state; the whole state if not given.
            unknown: parameters unknown to the controller; their premises are of kind UNKNOWN.
            equilibrium: ``(x0, u0)``, each values in order or by name; doubles are taken as the rationals they are.
                State and inputs of the system are then the deviations from it, under the same names. The origin if not
                given.
            constants: by name, numbers that stand for that name in every formula.
            units: by name, of states, inputs and parameters: text that goes with the signals into artifacts, logs and
                figures, and means nothing to the design.

        Returns:
            The system. What the equations leave over at the equilibrium, up to `equations.RESIDUAL` of the terms of a
            row, is its `disturbance`. Kinds of premises: see `from_symbols`.

        Raises:
            InputError: an equation is not affine in rates and inputs, has a drift that does not vanish at the
                equilibrium or that cannot be factored (the equation is named), there are not as many equations as
                states, a text is no formula, or `from_symbols` refuses names, domain or matrices.
        """
        names = Vocabulary(name, state, inputs, domain, unknown=unknown, constants=constants)
        around = Equilibrium.of(names, equilibrium)
        shown = [each.name for each in names.state] if outputs is None else outputs
        listed = [equations] if isinstance(equations, str) else equations
        matrices = equation_matrices(names, listed, [shown] if isinstance(shown, str) else shown, around)
        names.finish()
        return cls._of(
            names,
            (matrices.E, matrices.A, matrices.B, matrices.C),
            state=matrices.state,
            domain={each: _shifted(name, each, bounds, around) for each, bounds in names.domain.items()},
            disturbance=matrices.d if any(matrices.d) else (),
            from_formulas=True,
            trim=around.values(matrices.state, names.inputs),
            equations=matrices.residuals,
            units=units,
        )

    @classmethod
    def from_rules(
        cls,
        rules: Sequence[tuple[Formula, SymbolicMatrix, SymbolicMatrix, SymbolicMatrix]],
        *,
        name: str = "system",
        state: str | Sequence[Name],
        inputs: str | Sequence[Name] = (),
        C: SymbolicMatrix | None = None,
        domain: Mapping[Any, Any],
        unknown: str | Collection[Name] = (),
    ) -> DescriptorSystem:
        """The Takagi-Sugeno model ``sum_i h_i(x) (E_i x' - A_i x - B_i u) = 0``.

        Its premises are the memberships of all rules but the last, and its representation ``rules`` (also ``ts``) has a
        vertex for each rule. A box of memberships would hold points where they sum to more than 1, and lose solutions.

        Args:
            rules: ``(h_i, E_i, A_i, B_i)`` with a membership function h_i of states or parameters and matrices of
                numbers, n x n, n x n and n x m.
            name: identifier.
            state: names of x, differential states first.
            inputs: names of u.
            C: outputs, o x n, of numbers; the whole state if not given.
            domain: by name, the interval of everything the memberships depend on.
            unknown: parameters unknown to the controller.

        Raises:
            InputError: the memberships are not proved to sum to 1 or not to be negative over the domain, an entry of a
                matrix is no number, shapes do not agree, or names or domain as in `from_symbols`.
        """
        names = Vocabulary(name, state, inputs, domain, unknown=unknown)
        memberships = [exact(names.read(f"h_{i}", rule[0])) for i, rule in enumerate(rules, 1)]
        parts = [
            [read_constant(names, f"{field}_{i}", matrix) for field, matrix in zip("EAB", rule[1:], strict=True)]
            for i, rule in enumerate(rules, 1)
        ]
        names.finish()
        premises = membership_premises(names, memberships)
        outputs = np.eye(len(names.state)) if C is None else read_constant(names, "C", C)
        affine = [affine_in_memberships(name, field, [part[k] for part in parts]) for k, field in enumerate("EAB")]
        affine.append(AffineMatrix(outputs, np.zeros((len(premises), *outputs.shape))))
        return cls(
            name=name,
            state=names.state,
            inputs=tuple(each.name for each in names.inputs),
            premises=with_kinds(premises, names.state, affine[-1]),
            E=affine[0],
            A=affine[1],
            B=affine[2],
            C=affine[3],
            domain=dict(names.domain),
            given_by_rules=True,
        )

    @cached_property
    def uncertainty(self) -> NormBoundedUncertainty[DescriptorSystem] | None:
        """The norm-bounded view of the unknown premises, None if every premise is known to the controller.

        Raises:
            InputError: E or C depends on an unknown premise.
        """
        unknown = [p for p, premise in enumerate(self.premises) if premise.kind is PremiseKind.UNKNOWN]
        return NormBoundedUncertainty.of(self, unknown) if unknown else None


def _shifted(source: str, name: sp.Symbol, bounds: Bounds, around: Equilibrium) -> Bounds:
    """The interval of the deviation from an equilibrium, rounded outward.

    Raises:
        InputError: the interval does not hold the equilibrium.
    """
    value = around.state.get(name, sp.S.Zero)
    if value == 0:
        return bounds
    near = sp.Rational(value if value.is_Rational else sp.N(value, 60))
    low, high = (bound if abs(bound) == inf else Fraction(bound) - Fraction(near.p, near.q) for bound in bounds)
    if not low <= 0 <= high:
        raise InputError(source, f"domain of {name}", bounds, f"an interval that holds the equilibrium {value}")
    ends = (float(low), float(high))
    if not value.is_Rational:  # a value such as pi is nearer than a double can say
        return nextafter(ends[0], -inf), nextafter(ends[1], inf)
    return (
        ends[0] if abs(low) == inf or Fraction(ends[0]) <= low else nextafter(ends[0], -inf),
        ends[1] if abs(high) == inf or Fraction(ends[1]) >= high else nextafter(ends[1], inf),
    )
