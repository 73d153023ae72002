"""The vertex tables of an artifact, exactly, and how far the run-time side's collapsed form is from them.

A table stands for ``X(z) = sum_i w_i(z) X_i`` with weights ``w_i >= 0`` that sum to 1 (``docs/reference/formats.md``,
"Block polytope"). If every block has one premise, the run-time side replaces the sum, once, at load, by
``X_c + sum_p (z_p - z_c,p) S_p`` with X_c and S_p computed in doubles. Both are affine in z, so their difference is
bounded over the whole box by its value at the centre and its slopes: no sampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpq_mat

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import matrix, rational
from quasilpv.documents.tables import PolytopeTable

COLLAPSE_TOLERANCE = fmpq(1, 1 << 40)
"""Largest error of a collapsed entry, relative to that entry's largest magnitude over the vertices: about 9e-13."""

Rows = Sequence[Sequence[float]]


@dataclass(frozen=True, eq=False)
class VertexTable:
    """A block polytope table of an artifact.

    Attributes:
        lower, upper, centre: of the premises.
        blocks: premises of each block.
        doubles: vertices as shipped, block by block.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    centre: tuple[float, ...]
    blocks: tuple[tuple[int, ...], ...]
    doubles: tuple[Rows, ...]

    @classmethod
    def of(cls, table: PolytopeTable) -> VertexTable:
        """A table as it is written."""
        blocks = tuple(block.premises for block in table.blocks)
        doubles = tuple(vertex for block in table.blocks for vertex in block.vertices)
        return cls(table.lower, table.upper, table.centre, blocks, doubles)

    @property
    def schedule(self) -> tuple[object, ...]:
        """What fixes the weights: two tables with equal schedules have equal weights at every z."""
        return self.lower, self.upper, self.centre, self.blocks

    def vertices(self) -> tuple[fmpq_mat, ...]:
        """The vertices X_i, exactly."""
        return tuple(matrix(vertex) for vertex in self.doubles)

    def monomials(self) -> dict[tuple[int, ...], fmpq_mat]:
        """``X(z)`` inside the box as a polynomial, exact: the coefficient of every product of premises."""
        total: dict[tuple[int, ...], fmpq_mat] = {}
        vertices = iter(self.vertices())
        for block in self.blocks:
            terms: dict[tuple[int, ...], list[fmpq_mat]] = {}
            terms[()] = [next(vertices) / len(self.blocks) for _ in range(2 ** len(block))]
            for p in block:
                low, high = rational(self.lower[p]), rational(self.upper[p])
                split: dict[tuple[int, ...], list[fmpq_mat]] = {}
                for premises, corners in terms.items():
                    half = len(corners) // 2
                    pairs = list(zip(corners[:half], corners[half:], strict=True))
                    split[premises] = [(below * high - above * low) / (high - low) for below, above in pairs]
                    split[(*premises, p)] = [(above - below) / (high - low) for below, above in pairs]
                terms = split
            for premises, (coefficient,) in terms.items():
                total[premises] = total[premises] + coefficient if premises in total else coefficient
        return total

    def evaluate(self, premises: FloatArray) -> FloatArray:
        """``X(z)`` in doubles at B premise vectors, (B, p), clamped to the box as at run time; (B, rows, columns)."""
        return np.asarray(np.tensordot(self.weights(premises), np.array(self.doubles), axes=1))

    def weights(self, premises: FloatArray) -> FloatArray:
        """Weights of the vertices in doubles at B premise vectors, (B, p), clamped to the box; (B, N)."""
        low, high = np.array(self.lower), np.array(self.upper)
        share = (np.clip(premises, low, high) - low) / (high - low)
        weights = []
        for block in self.blocks:
            own = np.full((len(share), 1), 1.0 / len(self.blocks))
            for p in block:  # the first premise is the most significant bit
                upper = share[:, p, None]
                own = np.stack([own * (1.0 - upper), own * upper], axis=2).reshape(len(share), -1)
            weights.append(own)
        return np.concatenate(weights, axis=1)

    def collapse_claim(self, name: str) -> tuple[Claim, ...]:
        """The claim that the collapsed form stays within `COLLAPSE_TOLERANCE`; none if there is no collapsed form."""
        if any(len(block) > 1 for block in self.blocks):
            return ()
        ratio = self.collapse_error()
        title = f"{name} table: collapsed form within {_double(ratio):.1e} of the vertices"
        return (Claim.at_most(title, ratio, COLLAPSE_TOLERANCE),)

    def collapse_error(self) -> fmpq:
        """Bound of ``|collapsed - sum of vertices|`` over the box and all entries, each relative to its own size.

        Raises:
            ValueError: a block has several premises, so that the run-time side keeps the sum.
        """
        if any(len(block) > 1 for block in self.blocks):
            raise ValueError("only blocks of one premise collapse")
        worst = fmpq(0)
        for i, row in enumerate(self.doubles[0]):
            for j in range(len(row)):
                values = [float(vertex[i][j]) for vertex in self.doubles]
                size = max(abs(rational(value)) for value in values)
                error = self._entry_error(values)
                if error > 0:
                    worst = max(worst, error / size)  # an entry that is zero at every vertex collapses without error
        return worst

    def _entry_error(self, values: list[float]) -> fmpq:
        """Bound of the error of one entry, given at the vertices."""
        count = len(self.blocks)
        weight = 1.0 / count
        at_centre, error_at_centre = 0.0, fmpq(0)
        error = fmpq(0)
        for b, block in enumerate(self.blocks):
            if not block:  # no premises at all: one vertex
                return fmpq(0)
            (p,) = block
            low, high, centre = self.lower[p], self.upper[p], self.centre[p]
            below, above = values[2 * b : 2 * b + 2]
            # As the run-time side computes them, in doubles and in this order.
            slope = (above - below) * (weight / (high - low))
            omega = (centre - low) / (high - low)
            at_centre += weight * (1.0 - omega) * below
            at_centre += weight * omega * above
            # What they stand for.
            width = rational(high) - rational(low)
            exact_slope = (rational(above) - rational(below)) / (count * width)
            share = (rational(centre) - rational(low)) / width
            error_at_centre += ((1 - share) * rational(below) + share * rational(above)) / count
            reach = max(rational(high) - rational(centre), rational(centre) - rational(low))
            error += abs(rational(slope) - exact_slope) * reach
        return error + abs(rational(at_centre) - error_at_centre)


def _double(value: fmpq) -> float:
    return int(value.p) / int(value.q)
