"""What can be proved of the structure of a descriptor system: Assumption 1, an invertible E_1, index one.

`structure_report` is the function to call; of its findings, `Finding.holds` and `Finding.standing` are what a condition
that relies on the structure looks at.

Dehak 2022, section I.4.1: with ``E = diag(E_1, 0)`` and ``A = [A_11, A_12; A_21, A_22]``, if the premises depend on the
differential states alone (Assumption 1) and ``det A_22(z) != 0``, the algebraic states follow from the others as
``x_a = -A_22^-1 A_21 x_d`` (u = 0): the system has index one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import product

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.polys.matrices import DomainMatrix

from quasilpv.arguments import checked
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.algebraic import follows
from quasilpv.systems.descriptor.invertible_cells import cells_with_inverse
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.chords import Ramp, abs_chord, ramp_chord
from quasilpv.systems.intervals.enclosure import enclose

Interval = tuple[float, float]

_MAX_CORNERS_OF = 12  # premises
_CORNERS = (abs_chord, ramp_chord, Ramp, sp.Abs, sp.Max, sp.Min, sp.sign)
_SIGN_TOLERANCES = (0.1, 1e-3)  # of a determinant relative to its size at the centre of the box, coarse first


class Standing(StrEnum):
    """How far a property is established."""

    PROVED = "proved"
    PROVED_OVER_DOMAIN = "proved over the operating domain, not over the box of premises"
    REFUTED = "refuted"
    NOT_PROVED = "not proved"


@dataclass(frozen=True)
class Finding:
    """A property, how far it is established, and why."""

    standing: Standing
    reason: str

    @property
    def holds(self) -> bool:
        """Established at every state of the operating domain."""
        return self.standing in (Standing.PROVED, Standing.PROVED_OVER_DOMAIN)


class StructureVerdict(StrEnum):
    """What kind of descriptor system it is."""

    REGULAR = "regular"
    INDEX_ONE = "index-one"
    NOT_PROVED = "not proved"


@dataclass(frozen=True)
class StructureReport:
    """The structure of a descriptor system.

    Attributes:
        name: of the system.
        differential, algebraic: numbers q and s of differential and algebraic states.
        assumption_1: the premises are differentiable functions of the differential states (and of outside parameters),
            also through algebraic states that follow from them (`quasilpv.systems.descriptor.algebraic`). Refuted where
            an algebraic equation folds: there the algebraic states do not follow, whatever A_22(z) says.
        leading: E_1(z) is invertible.
        algebraic_pivot: A_22(z) is invertible; trivially so if s = 0.
    """

    name: str
    differential: int
    algebraic: int
    assumption_1: Finding
    leading: Finding
    algebraic_pivot: Finding

    @property
    def verdict(self) -> StructureVerdict:
        """Regular, of index one, or not proved to be either."""
        if not self.leading.holds:
            return StructureVerdict.NOT_PROVED
        if self.algebraic == 0:
            return StructureVerdict.REGULAR
        proved = self.assumption_1.holds and self.algebraic_pivot.holds
        return StructureVerdict.INDEX_ONE if proved else StructureVerdict.NOT_PROVED

    def __str__(self) -> str:
        """The report in four lines."""
        findings = {
            "Assumption 1": self.assumption_1,
            "E_1 invertible": self.leading,
            "A_22 invertible": self.algebraic_pivot,
        }
        states = f"{self.differential} differential, {self.algebraic} algebraic states"
        lines = [f"{self.name}: {self.verdict} ({states})"]
        return "\n".join(lines + [f"  {title}: {f.standing}; {f.reason}" for title, f in findings.items()])


@checked
def structure_report(system: DescriptorSystem) -> StructureReport:
    """Prove what can be proved of the structure of a system. Nothing here is decided by samples or rounding.

    >>> import quasilpv as ql
    >>> pendulum = ql.DescriptorSystem.from_equations(
    ...     ["x' = w", "w' = 9.81*sin(x) + u"], state="x w", inputs="u", domain={"x": (-1, 1)}
    ... )
    >>> str(ql.structure_report(pendulum).verdict)
    'regular'
    """
    q = system.differential
    return StructureReport(
        system.name,
        q,
        system.order - q,
        _assumption_1(system),
        _invertible(system, "E_1", system.E, slice(0, q)),
        _invertible(system, "A_22", system.A, slice(q, None)),
    )


def _assumption_1(system: DescriptorSystem) -> Finding:
    algebraic = set(system.state[system.differential :])
    for premise in system.premises:
        for root in premise.expression.atoms(sp.Pow):
            if root.exp.is_Rational and 0 < root.exp < 1 and not _proved_positive(root.base, system.domain):
                return Finding(Standing.NOT_PROVED, f"{premise.name} is not differentiable where {root.base} = 0")
        if algebraic and premise.expression.has(*_CORNERS):
            return Finding(Standing.NOT_PROVED, f"{premise.name} has a corner")
    if not algebraic:
        return Finding(Standing.PROVED, "there are no algebraic states")
    through = [premise for premise in system.premises if premise.expression.free_symbols & algebraic]
    if through:
        holds, reason = follows(system)
        standing = {True: Standing.PROVED_OVER_DOMAIN, False: Standing.REFUTED, None: Standing.NOT_PROVED}[holds]
        names = ", ".join(sorted({s.name for premise in through for s in premise.expression.free_symbols & algebraic}))
        return Finding(standing, f"{through[0].name} depends on the algebraic state {names}; {reason}")
    return Finding(Standing.PROVED, "every premise is a smooth function of the differential states or a parameter")


def _proved_positive(expression: sp.Expr, domain: Mapping[sp.Symbol, Interval]) -> bool:
    try:
        return enclose(expression, domain)[0] > 0
    except InputError:  # an unbounded range or domain
        return False


# ---- determinants ----------------------------------------------------------------------------------------------------


def _invertible(system: DescriptorSystem, name: str, matrix: AffineMatrix, block: slice) -> Finding:
    """Whether a diagonal block of an affine matrix is invertible, over the box of premises or else over the domain."""
    z = [sp.Dummy(premise.name, real=True) for premise in system.premises]
    coefficients = matrix.coefficients[:, block, block]
    entries = _exact(matrix.constant[block, block])
    for symbol, coefficient in zip(z, coefficients, strict=True):
        entries += symbol * _exact(coefficient)
    if entries.rows == 0:
        return Finding(Standing.PROVED, f"{name} has no rows")
    domain_matrix = DomainMatrix.from_Matrix(entries)
    determinant = domain_matrix.domain.to_sympy(domain_matrix.det())
    box = {symbol: p.bounds for symbol, p in zip(z, system.premises, strict=True) if symbol in determinant.free_symbols}
    finding = _nonzero_over_box(f"det {name}", determinant, box)
    if finding.holds:
        return finding
    cells = cells_with_inverse(system, matrix, block)
    if cells is not None:
        many = "" if cells == 1 else f" of each of {cells} cells of the domain"
        reason = f"He({name} G) > 0 at the corners of the premises{many}; {finding.reason}"
        return Finding(Standing.PROVED_OVER_DOMAIN, reason)
    of_state = determinant.subs(
        {symbol: _without_floats(p.expression) for symbol, p in zip(z, system.premises, strict=True)}
    )
    try:
        low, high = _sign_range(of_state, system.domain)
    except InputError:  # no range: unbounded, or unbounded domain
        return finding
    if low <= 0 <= high:
        return finding
    return Finding(Standing.PROVED_OVER_DOMAIN, f"det {name} in [{low:.4g}, {high:.4g}] there; {finding.reason}")


def _exact(matrix: NDArray[np.float64]) -> sp.Matrix:
    return sp.Matrix(*matrix.shape, [sp.Rational(float(entry)) for entry in matrix.flat])


def _without_floats(expression: sp.Expr) -> sp.Expr:
    """The expression with its floats as the rationals they are, which products do not round."""
    return expression.xreplace({number: sp.Rational(number) for number in expression.atoms(sp.Float)})


def _nonzero_over_box(name: str, determinant: sp.Expr, box: Mapping[sp.Symbol, Interval]) -> Finding:
    """Exact at the corners of the box, where a multi-affine determinant has its extrema; enclosed if it is not."""
    if not box:
        standing = Standing.REFUTED if determinant == 0 else Standing.PROVED
        return Finding(standing, f"{name} = {float(determinant):.4g}")
    polynomial = sp.Poly(determinant, *box)
    if len(box) <= _MAX_CORNERS_OF:
        ends = [tuple(sp.Rational(end) for end in interval) for interval in box.values()]
        values = [polynomial.eval(corner) for corner in product(*ends)]
        low, high = min(values), max(values)
        extrema = f"{name} in [{float(low):.4g}, {float(high):.4g}] at the corners of the box of premises"
        if low <= 0 <= high:
            return Finding(Standing.REFUTED, extrema)
        if all(degree <= 1 for degree in polynomial.degree_list()):
            return Finding(Standing.PROVED, f"{extrema}, and it is affine in each premise")
    low, high = _sign_range(determinant, box)
    standing = Standing.NOT_PROVED if low <= 0 <= high else Standing.PROVED
    return Finding(standing, f"{name} enclosed in [{low:.4g}, {high:.4g}] over the box of premises")


def _sign_range(expression: sp.Expr, domain: Mapping[sp.Symbol, Interval]) -> Interval:
    """Guaranteed range, tight enough for a sign unless the expression is small against its value in the middle."""
    middle = {symbol: 0.5 * (low + high) for symbol, (low, high) in domain.items()}
    size = abs(expression.subs(middle))
    scale = sp.Rational(size) if size.is_finite and size.is_positive else sp.S.One
    low, high = -1.0, 1.0
    for tolerance in _SIGN_TOLERANCES:
        low, high = enclose(expression / scale, domain, tolerance)
        if not low <= 0 <= high:
            break
    return low * float(scale), high * float(scale)
