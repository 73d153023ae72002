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

from quasilpv.conditions.forms.blocks import single_sum
from quasilpv.lmi import Expression, Problem, Variable, is_positive_definite, to_rational
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.exact import Matrix, null_space, symmetric_part
from quasilpv.lmi.expressions import as_expression
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.descriptor.system import DescriptorSystem

MAX_CORNERS_OF = 6
"""Premises whose corners are all looked at; of more, every one is a block of its own, with slack."""


WELL_CONDITIONED = 1e12
"""Condition number up to which the inverse at the centre is worth trying."""


def proof_of_invertibility(*systems: DescriptorSystem) -> str | None:
    """How E_1(z), the block of E of the differential states, was proved invertible over the box; None if it was not.

    That it was not says nothing: `quasilpv.systems.descriptor.structure` has other means, and those that refute.

    Args:
        systems: one, or several with the same premises that differ in numbers: then every convex combination of them.
    """
    q, premises = systems[0].differential, range(len(systems[0].premises))
    slopes = [system.E.coefficients[:, :q, :q] for system in systems]
    used = [p for p in premises if any(own[p].any() for own in slopes)]
    box = tuple(systems[0].premises[p].bounds for p in used)
    numbers = {
        (system.E.constant[:q, :q].tobytes(), own[used].tobytes()) for system, own in zip(systems, slopes, strict=True)
    }
    return _proof(tuple(sorted(numbers)), q, box)


@lru_cache(maxsize=256)
def _proof(numbers: tuple[tuple[bytes, bytes], ...], size: int, box: tuple[tuple[float, float], ...]) -> str | None:
    """The same of E_1 by its numbers: systems that differ in A and B only are asked about again and again."""
    affine = [
        (np.frombuffer(constant).reshape(size, size), np.frombuffer(slopes).reshape(len(box), size, size))
        for constant, slopes in numbers
    ]
    if not box and len(affine) == 1:
        return None if null_space(to_rational(affine[0][0])).shape[1] else "E is constant and invertible"
    low, high = np.array(box).reshape(-1, 2).T
    if len(box) <= MAX_CORNERS_OF:
        corners = [_at(*own, corner) for own in affine for corner in product(*box)]
        centre = np.mean([corner.astype(float) for corner in corners], axis=0)
        if np.linalg.cond(centre) < WELL_CONDITIONED and _all_positive(corners, np.linalg.inv(centre)):
            return "He(E(z) G) > 0 at the corners of the box, G the inverse at its centre"
    problem = _problem(affine, low, high)
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


def _problem(affine: list[tuple[Matrix, Matrix]], low: Matrix, high: Matrix) -> Problem:
    """``He(E_i G) > 0`` at the vertices, one G, with slack if there are several blocks."""
    few = len(low) <= MAX_CORNERS_OF
    polytope = (BlockPolytope.takagi_sugeno if few else BlockPolytope.per_premise)(low, high)
    G = Variable("G", len(affine[0][0]))
    problem = Problem()
    for k, own in enumerate(affine):
        vertices = [_at(*own, offset) for offset in polytope.exact_vertex_offsets]

        def entry(i: int, vertices: list[Matrix] = vertices) -> Expression:
            return as_expression(-(vertices[i] @ G))

        single_sum(problem, f"E G {k}", entry, len(vertices), polytope.block_index)
    return problem
