"""Whether E(z) is invertible for every z of the box, by one linear matrix inequality.

A matrix with ``He(E(z) G) > 0`` for one G is invertible: ``E(z)' v = 0`` would give ``v' He(E(z) G) v = 0``. The left
side is affine in z, so that the corners of the box of the premises in E decide; with many premises the vertices of one
block each, with slack, are enough. The inequality shares no unknown with those of a condition: it is decided by itself,
once for each E, and the problem of the condition stays as its source prints it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np

from quasilpv.conditions.blocks import single_sum
from quasilpv.lmi import Expression, Problem, Variable, is_positive_definite, to_rational
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.exact import Matrix, null_space, symmetric_part
from quasilpv.lmi.expressions import as_expression
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.descriptor import DescriptorSystem

MAX_CORNERS_OF = 6
"""Premises whose corners are all looked at; of more, every one is a block of its own, with slack."""


def proof_of_invertibility(system: DescriptorSystem) -> str | None:
    """How E_1(z), the block of E of the differential states, was proved invertible over the box; None if it was not.

    That it was not says nothing: `quasilpv.systems.structure` has other means, and those that refute.
    """
    q = system.differential
    constant, coefficients = system.E.constant[:q, :q], system.E.coefficients[:, :q, :q]
    used = [p for p in range(len(system.premises)) if coefficients[p].any()]
    box = tuple(system.premises[p].bounds for p in used)
    return _proof(constant.tobytes(), coefficients[used].tobytes(), q, box)


@lru_cache(maxsize=256)
def _proof(constant: bytes, coefficients: bytes, size: int, box: tuple[tuple[float, float], ...]) -> str | None:
    """The same of E_1 by its numbers: systems that differ in A and B only are asked about again and again."""
    E0 = np.frombuffer(constant).reshape(size, size)
    slopes = np.frombuffer(coefficients).reshape(len(box), size, size)
    if not box:
        return None if null_space(to_rational(E0)).shape[1] else "E is constant and invertible"
    low, high = np.array(box).T
    centre = E0 + np.tensordot(0.5 * (low + high), slopes, axes=1)
    if len(box) <= MAX_CORNERS_OF:
        corners = [_at(E0, slopes, corner) for corner in product(*box)]
        if np.linalg.cond(centre) < 1e12 and _all_positive(corners, np.linalg.inv(centre)):
            return "He(E(z) G) > 0 at the corners of the box, G the inverse at its centre"
    problem = _problem(E0, slopes, low, high)
    return "He(E(z) G) > 0 over the box for a G" if decide(CompiledProblem.of(problem)).feasible else None


def _at(constant: Matrix, slopes: Matrix, z: tuple[float, ...]) -> Matrix:
    """E_1(z), exact."""
    exact: Matrix = to_rational(constant) + sum(
        value * to_rational(slope) for value, slope in zip(to_rational(z), slopes, strict=True)
    )
    return exact


def _all_positive(matrices: list[Matrix], G: Matrix) -> bool:
    """Whether ``He(E G) > 0`` for all of them, exact."""
    right = to_rational(G)
    return all(is_positive_definite(symmetric_part(E @ right)) for E in matrices)


def _problem(constant: Matrix, slopes: Matrix, low: Matrix, high: Matrix) -> Problem:
    """``He(E_i G) > 0`` at the vertices, with slack if there are several blocks."""
    few = len(slopes) <= MAX_CORNERS_OF
    polytope = (BlockPolytope.takagi_sugeno if few else BlockPolytope.per_premise)(low, high)
    vertices = [_at(constant, slopes, offset) for offset in polytope.exact_vertex_offsets]
    G = Variable("G", len(constant))

    def entry(i: int) -> Expression:
        return as_expression(-(vertices[i] @ G))

    problem = Problem()
    single_sum(problem, "E G", entry, len(vertices), polytope.block_index)
    return problem
