"""Systems whose matrices are affine in parameters, proved from their equations with the parameters left open.

``X(x; p) = sum_k z_k(x) (X_k0 + sum_i p_i X_ki)`` for X = E, A, B as an identity of expressions, with premises, bounds,
domain and C that do not depend on p. Whatever cannot be shown to be so is no family.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import frexp, ldexp
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.systems.descriptor.affine_terms import PremiseBasis
from quasilpv.systems.descriptor.open_parameters import Made, OpenParameters, opened
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.premise_search import find_premises
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.descriptor.vocabulary import exact

BASE_BITS = 20
"""Of the point the numbers of a family belong to, which is near the one asked for."""
ENTRY_BITS = 44
"""Numbers of an entry are multiples of a unit so many bits below the largest: three steps further they are doubles."""
_ROUNDING = 1e-6  # of numbers of a family beside those of a system made for a point: what `_LEAST_BITS` leaves
_LEAST_BITS = 20  # of a number that is not 0, after that


@dataclass(frozen=True, eq=False)
class AffineFamily:
    """``X(p) = X_b + sum_i (p_i - b_i)/h_i X_i`` for every coefficient matrix X of E, A, B; the rest is one system's.

    Attributes:
        origin: the system at b.
        base, steps: b and h by name of the parameter; h are powers of two.
        slopes: the X_i by name, one array (1 + premises, rows, columns) for E, A and B each: constant first.
    """

    origin: DescriptorSystem
    base: Mapping[str, float]
    steps: Mapping[str, float]
    slopes: Mapping[str, tuple[FloatArray, ...]]

    def holds(self, system: DescriptorSystem, point: Mapping[str, float]) -> bool:
        """Whether a system made for a point is the one of the family up to rounding: code may look at what it gets."""
        own = self.at(point)
        if [(p.expression, p.bounds, p.kind) for p in own.premises] != [
            (p.expression, p.bounds, p.kind) for p in system.premises
        ]:
            return False
        return all(
            np.allclose(_stacked(getattr(own, field)), _stacked(getattr(system, field)), rtol=_ROUNDING, atol=0.0)
            for field in "EABC"
        )

    def at(self, point: Mapping[str, float]) -> DescriptorSystem:
        """The system at a point; without rounding at ``b + k h`` for whole k >= 0 of sum 3 at most."""
        moved: dict[str, Any] = {}
        for index, field in enumerate("EAB"):
            matrix: AffineMatrix = getattr(self.origin, field)
            total = _stacked(matrix)
            for name, slopes in self.slopes.items():
                total = total + (point[name] - self.base[name]) / self.steps[name] * slopes[index]
            moved[field] = AffineMatrix(total[0], total[1:])
        return replace(self.origin, **moved, equations=())


def affine_family(
    make: Callable[[OpenParameters], DescriptorSystem], around: Mapping[str, float]
) -> AffineFamily | None:
    """The family a system belongs to, None if it is not shown to be affine in the parameters.

    Args:
        make: makes the system while the parameters are open; whatever it raises, there is no family.
        around: by name, the point near which the numbers of the family are exact to the last bits.
    """
    base = {name: _short(value) for name, value in around.items()}
    steps = {name: ldexp(1.0, frexp(value)[1] - 1) if value else 1.0 for name, value in base.items()}
    try:
        with opened({name: sp.Rational(base[name] + steps[name]) for name in base}) as record:
            made = make(record)
        if len(record.made) != 1 or record.made[0].system is not made:
            return None  # it was changed after it was made, or is another one
        return _family(made, record.made[0], record, base, steps)
    except Exception:  # code of users that needs numbers, or a system that does not exist for all of them
        return None


def _short(value: float) -> float:
    mantissa, exponent = frexp(value)
    return ldexp(round(ldexp(mantissa, BASE_BITS)), exponent - BASE_BITS)


def _family(
    system: DescriptorSystem,
    made: Made,
    record: OpenParameters,
    base: Mapping[str, float],
    steps: Mapping[str, float],
) -> AffineFamily | None:
    symbols = list(record.symbols.values())
    C = made.matrices[3]
    if C.free_symbols & set(symbols):
        return None  # which premises are measured may depend on it
    places = dict(zip(symbols, (sp.Rational(value) for value in base.values()), strict=True))
    lengths = dict(zip(symbols, (sp.Rational(value) for value in steps.values()), strict=True))
    parts: list[sp.Matrix] = []
    for matrix in made.matrices[:3]:
        slopes = [(matrix.applyfunc(exact).diff(own) * lengths[own]).applyfunc(sp.expand) for own in symbols]
        if any(slope.free_symbols & set(symbols) for slope in slopes):
            return None
        parts += [matrix.applyfunc(exact).xreplace(places), *slopes]
    if made.premises is not None:
        basis = PremiseBasis(system.name, made.premises)
        affine = [basis.affine("family", part) for part in parts]
    else:
        closed = record.closed(made.matrices)
        premises, found = find_premises([*closed, *parts], system.domain, made.unknown)
        own = [(p.expression, p.bounds) for p in system.premises]
        if [(p.expression, p.bounds) for p in premises] != own:
            return None  # terms that are one premise for each p and are more of them for all
        affine = found[len(closed) :]
    count = 1 + len(symbols)
    rounded = [_on_a_grid([_stacked(each) for each in affine[k * count : (k + 1) * count]]) for k in range(3)]
    if any(one is None for one in rounded):
        return None
    stacks = [one for one in rounded if one is not None]
    fields: dict[str, Any] = {
        name: AffineMatrix(stack[0][0], stack[0][1:]) for name, stack in zip("EAB", stacks, strict=True)
    }
    return AffineFamily(
        replace(system, **fields),
        dict(base),
        dict(steps),
        {name: tuple(stack[1 + i] for stack in stacks) for i, name in enumerate(base)},
    )


def _stacked(matrix: AffineMatrix) -> FloatArray:
    return np.concatenate([matrix.constant[None], matrix.coefficients])


def _on_a_grid(levels: Sequence[FloatArray]) -> list[FloatArray] | None:
    """The numbers of every entry on a common grid, so that few steps along it are exact; None if one would be lost."""
    whole = np.stack(levels)
    moving = (whole[1:] != 0.0).any(axis=0)
    largest = np.abs(whole).max(axis=0)
    unit = np.ldexp(1.0, np.frexp(largest)[1] - ENTRY_BITS)
    rounded = np.where(moving, np.round(whole / unit) * unit, whole)
    if np.any((whole != 0.0) & moving & (np.abs(whole) < np.ldexp(unit, _LEAST_BITS))):
        return None
    return [*rounded]
