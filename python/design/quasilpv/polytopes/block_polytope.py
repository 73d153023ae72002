"""The block polytope: vertices, weights, slack and collapse of one representation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain, combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quasilpv.errors import InputError
from quasilpv.polytopes.block import Block
from quasilpv.polytopes.multilinear import Matrices, MultilinearForm

Vector = NDArray[np.float64]

ELSEWHERE = np.iinfo(np.intp).min
"""Stands in a table of corners for the premises of other blocks, which a vertex leaves at the centre."""


@dataclass(frozen=True, eq=False)
class BlockPolytope:
    """The block polytope of a box of premises. The package's description has the mathematics.

    Attributes:
        lower, upper: bounds of the premises, (r,), lower < upper.
        centre: centring point zc, (r,); any point gives an exact representation. The box centre keeps the vertices
            close to the physical range; the thesis uses 0.
        blocks: the partition of the premises.
        unknown: indices of the premises whose value the controller does not have.

    Raises:
        InputError: bounds or centre of wrong shape, not finite or not in order; blocks that are no partition.
    """

    lower: Vector
    upper: Vector
    centre: Vector
    blocks: tuple[Block, ...]
    unknown: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        """Refuse what is not a box with a partition of its axes; store read-only copies."""
        r = np.size(self.lower)
        for field in ("lower", "upper", "centre"):
            values = np.array(getattr(self, field), dtype=float)
            if values.shape != (r,) or not np.isfinite(values).all():
                raise InputError("polytope", field, values.tolist(), f"{r} finite numbers")
            values.setflags(write=False)
            object.__setattr__(self, field, values)
        for p in np.flatnonzero(self.lower >= self.upper):
            got = (float(self.lower[p]), float(self.upper[p]))
            raise InputError("polytope", f"bounds of premise {p}", got, "lower < upper (a constant is no premise)")
        listed = sorted(chain.from_iterable(block.premises for block in self.blocks))
        if listed != list(range(r)):
            raise InputError("polytope", "blocks", listed, f"each premise of 0..{r - 1} in exactly one block")
        if not self.blocks or (r > 0 and any(not block.premises for block in self.blocks)):
            raise InputError("polytope", "blocks", "an empty block", "at least one premise per block")
        if not self.unknown <= set(range(r)):
            raise InputError("polytope", "unknown", sorted(self.unknown), f"indices in 0..{r - 1}")

    # ---- constructors ----------------------------------------------------------------------------------------------

    @classmethod
    def from_blocks(
        cls,
        lower: ArrayLike,
        upper: ArrayLike,
        blocks: Sequence[Block],
        *,
        centre: ArrayLike | None = None,
        unknown: Sequence[int] = (),
    ) -> BlockPolytope:
        """Any partition into box and simplex blocks; ``centre=None`` is the centre of the box."""
        low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        if low.shape != high.shape:
            raise InputError("polytope", "upper", f"shape {high.shape}", f"shape {low.shape}")
        middle = (
            0.5 * low + 0.5 * high if centre is None else np.broadcast_to(np.asarray(centre, dtype=float), low.shape)
        )
        return cls(low, high, middle, tuple(blocks), frozenset(unknown))

    @classmethod
    def grouped(
        cls,
        lower: ArrayLike,
        upper: ArrayLike,
        partition: Sequence[Sequence[int]],
        *,
        centre: ArrayLike | None = None,
        unknown: Sequence[int] = (),
    ) -> BlockPolytope:
        """Box blocks of a given partition: fewer, larger groups are less conservative and cost more vertices."""
        blocks = [Block("box", tuple(group)) for group in partition]
        return cls.from_blocks(lower, upper, blocks, centre=centre, unknown=unknown)

    @classmethod
    def takagi_sugeno(cls, lower: ArrayLike, upper: ArrayLike, *, unknown: Sequence[int] = ()) -> BlockPolytope:
        """One box block of all premises, 2^r vertices (centring has no effect on a single block)."""
        return cls.grouped(lower, upper, [range(np.size(lower))], unknown=unknown)

    @classmethod
    def per_premise(
        cls, lower: ArrayLike, upper: ArrayLike, *, centre: ArrayLike | None = None, unknown: Sequence[int] = ()
    ) -> BlockPolytope:
        """One box block per premise, 2 r vertices (one vertex when there are no premises)."""
        partition: list[tuple[int, ...]] = [(p,) for p in range(np.size(lower))] or [()]
        return cls.grouped(lower, upper, partition, centre=centre, unknown=unknown)

    @classmethod
    def uncertain(
        cls,
        known: tuple[ArrayLike, ArrayLike],
        unknown: tuple[ArrayLike, ArrayLike],
        *,
        centre: ArrayLike | None = None,
    ) -> BlockPolytope:
        """One block per premise; r known premises (lower, upper) come first, l unknown ones last."""
        r, total = np.size(known[0]), np.size(known[0]) + np.size(unknown[0])
        lower = np.concatenate([np.atleast_1d(known[0]), np.atleast_1d(unknown[0])])
        upper = np.concatenate([np.atleast_1d(known[1]), np.atleast_1d(unknown[1])])
        return cls.per_premise(lower, upper, centre=centre, unknown=range(r, total))

    @classmethod
    def reduced_affine(cls, lower: ArrayLike, upper: ArrayLike, *, unknown: Sequence[int] = ()) -> BlockPolytope:
        """One simplex block of all premises, r + 1 vertices (centring has no effect on a single block)."""
        r = np.size(lower)
        return cls.from_blocks(lower, upper, [Block("simplex" if r else "box", tuple(range(r)))], unknown=unknown)

    @classmethod
    def of_rules(cls, lower: ArrayLike, upper: ArrayLike, *, unknown: Sequence[int] = ()) -> BlockPolytope:
        """The memberships of all rules but the last as one block, a vertex per rule (centring has no effect).

        Valid for premises whose sector coordinates sum to at most 1, which the box does not say.
        """
        r = np.size(lower)
        return cls.from_blocks(lower, upper, [Block("memberships" if r else "box", tuple(range(r)))], unknown=unknown)

    def holds(self, z: Sequence[Fraction]) -> bool:
        """Whether a point of the box is one the vertices are made for, exactly: memberships leave some out."""
        for block in self.blocks:
            if block.kind == "memberships":
                low = [Fraction(self.lower[p]) for p in block.premises]
                high = [Fraction(self.upper[p]) for p in block.premises]
                sector = [(z[p] - a) / (b - a) for p, a, b in zip(block.premises, low, high, strict=True)]
                if min(sector) < 0 or sum(sector) > 1:
                    return False
        return True

    def restricted(self, premises: Sequence[int]) -> BlockPolytope:
        """The same blocks on some of the premises, in ascending order; blocks that lose all of theirs are left out."""
        kept = sorted(premises)
        place = {p: index for index, p in enumerate(kept)}
        remaining = [tuple(place[p] for p in block.premises if p in place) for block in self.blocks]
        blocks = [Block(own.kind, left) for own, left in zip(self.blocks, remaining, strict=True) if left]
        return BlockPolytope.from_blocks(
            self.lower[kept],
            self.upper[kept],
            blocks or [Block("box", ())],
            centre=self.centre[kept],
            unknown=[place[p] for p in self.unknown if p in place],
        )

    # ---- sizes and indices -----------------------------------------------------------------------------------------

    @property
    def premises(self) -> int:
        """Number of premises r."""
        return len(self.lower)

    @property
    def vertex_count(self) -> int:
        """Number of vertices N."""
        return sum(block.vertices for block in self.blocks)

    @cached_property
    def block_index(self) -> NDArray[np.intp]:
        """Block of every vertex, (N,)."""
        return np.repeat(np.arange(len(self.blocks)), [block.vertices for block in self.blocks])

    def block_of(self, vertex: int) -> int:
        """Index of the block a vertex belongs to."""
        return int(self.block_index[vertex])

    @cached_property
    def known_vertices(self) -> tuple[int, ...]:
        """Vertices of the blocks without unknown premises: those whose weights the controller can compute."""
        return tuple(i for i in range(self.vertex_count) if self.unknown.isdisjoint(self._block(i).premises))

    @cached_property
    def shared_gain(self) -> tuple[int, ...]:
        """For every vertex, the first vertex whose gain it must share, (N,).

        Vertices of a box block that differ only in unknown premises must have equal gains, all vertices of another
        block with an unknown premise must: then the gain ``sum w_i(z) K_i`` does not depend on what is unknown.
        """
        first: dict[tuple[Any, ...], int] = {}
        representative = []
        for vertex, corner in enumerate(chain.from_iterable(block.corners() for block in self.blocks)):
            block = self._block(vertex)
            if block.kind != "box":
                seen: tuple[Any, ...] = () if self.unknown & set(block.premises) else tuple(corner)
            else:
                seen = tuple(c for c, p in zip(corner, block.premises, strict=True) if p not in self.unknown)
            representative.append(first.setdefault((self.block_of(vertex), seen), vertex))
        return tuple(representative)

    def _block(self, vertex: int) -> Block:
        return self.blocks[self.block_of(vertex)]

    # ---- the representation ----------------------------------------------------------------------------------------

    @cached_property
    def vertex_offsets(self) -> NDArray[np.float64]:
        """Premise vectors relative to 0 at which the affine matrix takes its vertices, (N, r): X_i = X(offsets_i).

        ``zc + G (c_i - zc)`` on the premises of the vertex's block, ``zc`` on the others.
        """
        return self.exact_vertex_offsets.astype(float)

    @cached_property
    def exact_vertex_offsets(self) -> NDArray[Any]:
        """`vertex_offsets` without rounding: bounds and centre are taken as the rationals they are, (N, r)."""
        return self.exact_offsets(range(self.vertex_count))

    def exact_offsets(self, vertices: Sequence[int]) -> NDArray[Any]:
        """Rows of `exact_vertex_offsets`, for representations with too many vertices to want them all."""
        offsets = np.empty((len(vertices), self.premises), dtype=object)
        for p, (low, high, centre) in enumerate(zip(self.lower, self.upper, self.centre, strict=True)):
            # A coordinate takes two or three values, however many vertices there are.
            corners, number = np.unique(self._corner_table[list(vertices), p], return_inverse=True)
            start, width, middle = Fraction(low), Fraction(high) - Fraction(low), Fraction(centre)
            values = [
                middle if corner == ELSEWHERE else middle + len(self.blocks) * (start + int(corner) * width - middle)
                for corner in corners
            ]
            offsets[:, p] = np.array(values, dtype=object)[number.ravel()]
        return offsets

    @cached_property
    def _corner_table(self) -> NDArray[np.intp]:
        """Sector coordinates of every vertex, whole numbers, (N, r); `ELSEWHERE` for premises of other blocks."""
        table = np.full((self.vertex_count, self.premises), ELSEWHERE)
        row = 0
        for block in self.blocks:
            table[row : row + block.vertices, list(block.premises)] = block.corners().astype(int)
            row += block.vertices
        return table

    def equal_vertices(self, premises: Sequence[int]) -> NDArray[np.intp]:
        """For every vertex the first one that agrees with it in the given premises, (N,): equal in what they decide."""
        if not premises:
            return np.zeros(self.vertex_count, dtype=np.intp)
        corners = self._corner_table[:, list(premises)]
        _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        return np.asarray(first[inverse.ravel()])

    def vertices(self, constant: ArrayLike, coefficients: ArrayLike) -> Matrices:
        """Vertices of ``X_0 + sum_p z_p X_p``: X_0 of shape (...), X_p stacked (r, ...); returns (N, ...)."""
        X0, Xp = np.asarray(constant, dtype=float), np.asarray(coefficients, dtype=float)
        if Xp.shape != (self.premises, *X0.shape):
            raise InputError("polytope", "coefficients", f"shape {Xp.shape}", f"shape {(self.premises, *X0.shape)}")
        result: Matrices = X0 + np.tensordot(self.vertex_offsets, Xp, axes=1)
        return result

    def weights(self, z: ArrayLike) -> NDArray[np.float64]:
        """Weights of z, (..., r) -> (..., N): non-negative in the box, some negative outside (see `saturate`).

        Every block's weights sum to 1/G, G the number of blocks.
        """
        values = self._checked(z)
        omega = (values - self.lower) / (self.upper - self.lower)
        parts = [block.weights(omega[..., list(block.premises)]) for block in self.blocks]
        weights: NDArray[np.float64] = np.concatenate(parts, axis=-1) / len(self.blocks)
        return weights

    def saturate(self, z: ArrayLike) -> tuple[NDArray[np.float64], bool]:
        """The nearest point of the box, and whether z was outside: to be flagged and counted, never passed over."""
        values = self._checked(z)
        clamped = np.clip(values, self.lower, self.upper)
        return clamped, bool((clamped != values).any())

    def evaluate(self, vertex_matrices: ArrayLike, z: ArrayLike) -> Matrices:
        """``sum_i w_i(z) X_i`` for vertex matrices (N, ...) and one premise vector z (r,)."""
        result: Matrices = np.tensordot(self.weights(z), self._stack(vertex_matrices), axes=1)
        return result

    # ---- slack -----------------------------------------------------------------------------------------------------

    @cached_property
    def slack_pattern(self) -> NDArray[np.float64]:
        """Matrix Z, (N, G): adding ``sum_b Z_ib T_b`` to every vertex i changes X(z) nowhere, whatever the T_b.

        ``Z_ib = [i in block b] - 1/G``, because the weights of every block sum to 1/G. In an LMI the T_b are unknowns
        (Dehak 2022, (II.11)); in a double sum they may depend on the other index.
        """
        membership = self.block_index[:, None] == np.arange(len(self.blocks))
        pattern: NDArray[np.float64] = membership.astype(float) - 1.0 / len(self.blocks)
        return pattern

    def slack_shift(self, vertex_matrices: ArrayLike, slacks: ArrayLike) -> Matrices:
        """Vertices ``X_i + T_b(i) - (1/G) sum_b T_b`` of the same X(z), for slacks T (G, ...)."""
        X, T = self._stack(vertex_matrices), np.asarray(slacks, dtype=float)
        if T.shape != (len(self.blocks), *X.shape[1:]):
            raise InputError("polytope", "slacks", f"shape {T.shape}", f"shape {(len(self.blocks), *X.shape[1:])}")
        shifted: Matrices = X + np.tensordot(self.slack_pattern, T, axes=1)
        return shifted

    # ---- what leaves this module -----------------------------------------------------------------------------------

    def collapse(self, vertex_matrices: ArrayLike) -> MultilinearForm:
        """``sum_i w_i(z) X_i`` as a polynomial in z.

        Blocks of one premise and simplex blocks give degree 1 (affine), box blocks of g premises degree g. The
        vertex sum is the definition; the collapsed form is the cheap run-time one.
        """
        X = self._stack(vertex_matrices)
        terms: dict[tuple[int, ...], Matrices] = {}
        row = 0
        for block in self.blocks:
            for monomial, coefficient in self._collapsed_block(block, X[row : row + block.vertices]).items():
                scaled = coefficient / len(self.blocks)
                terms[monomial] = terms[monomial] + scaled if monomial in terms else scaled
            row += block.vertices
        return MultilinearForm(self.premises, terms)

    def _collapsed_block(self, block: Block, X: Matrices) -> dict[tuple[int, ...], Matrices]:
        """Monomials of one block, whose weights here sum to 1."""
        g = len(block.premises)
        width = self.upper - self.lower
        if block.kind != "box":
            at_lower = np.tensordot(block.weights(np.zeros(g)), X, axes=1)
            slopes = [
                (np.tensordot(block.weights(unit), X, axes=1) - at_lower) / width[p]
                for p, unit in zip(block.premises, np.eye(g), strict=True)
            ]
            terms: dict[tuple[int, ...], Matrices] = {
                (p,): slope for p, slope in zip(block.premises, slopes, strict=True)
            }
            terms[()] = at_lower - sum(self.lower[p] * slope for p, slope in zip(block.premises, slopes, strict=True))
            return terms
        tensor = X.reshape((2,) * g + X.shape[1:])
        for axis, p in enumerate(block.premises):
            low, high = np.moveaxis(tensor, axis, 0)
            pair = ((self.upper[p] * low - self.lower[p] * high) / width[p], (high - low) / width[p])
            tensor = np.stack(pair, axis=axis)
        return {
            tuple(sorted(block.premises[axis] for axis in subset)): tensor[tuple(int(a in subset) for a in range(g))]
            for size in range(g + 1)
            for subset in combinations(range(g), size)
        }

    def to_document(self, vertex_matrices: ArrayLike) -> dict[str, Any]:
        """The *block polytope* member of an artifact, JSON-able, for vertices of shape (N, rows, columns).

        Raises:
            InputError: a simplex block (the format holds box blocks), or vertices that are not N matrices.
        """
        X = self._stack(vertex_matrices)
        if X.ndim != 3:
            raise InputError("polytope", "vertices", f"shape {X.shape}", f"shape ({self.vertex_count}, rows, columns)")
        blocks = []
        for index, block in enumerate(self.blocks):
            if block.kind != "box":
                raise InputError(
                    "polytope", f"blocks[{index}].kind", block.kind, "box, the only kind an artifact holds"
                )
            own = X[self.block_index == index]
            blocks.append({"kind": "box", "premises": list(block.premises), "vertices": own.tolist()})
        return {
            "premises": self.premises,
            "lower": self.lower.tolist(),
            "upper": self.upper.tolist(),
            "centre": self.centre.tolist(),
            "blocks": blocks,
        }

    def _checked(self, z: ArrayLike) -> NDArray[np.float64]:
        values = np.asarray(z, dtype=float)
        if values.ndim == 0 or values.shape[-1] != self.premises:
            raise InputError("polytope", "z", f"shape {values.shape}", f"shape (..., {self.premises})")
        return values

    def _stack(self, vertex_matrices: ArrayLike) -> Matrices:
        X = np.asarray(vertex_matrices, dtype=float)
        if X.ndim == 0 or len(X) != self.vertex_count:
            raise InputError("polytope", "vertices", f"shape {X.shape}", f"{self.vertex_count} vertices")
        return X
