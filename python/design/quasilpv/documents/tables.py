"""Tables of an artifact: matrices, and matrices scheduled over a box of premises (``docs/reference/formats.md``)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from quasilpv.documents.strict_model import FieldError, NonNegative, Number, Positive, StrictModel

MAX_PREMISES = 32
ROUNDING = 1e-12

Vector = tuple[Number, ...]
Matrix = tuple[Vector, ...]
PositiveVector = tuple[Positive, ...]
NonNegativeVector = tuple[NonNegative, ...]
Intervals = tuple[tuple[Number, Number], ...]


class BoxBlock(StrictModel):
    """One block of a block polytope: 2^g vertices for g premises, the first listed premise the most significant bit."""

    kind: Literal["box"]
    premises: tuple[int, ...]
    vertices: tuple[Matrix, ...]


class PolytopeTable(StrictModel):
    """A matrix X(z), affine in the premises z of a box, as vertices (weights in ``docs/reference/formats.md``)."""

    premises: int = Field(ge=0, le=MAX_PREMISES)
    lower: Vector
    upper: Vector
    centre: Vector
    blocks: tuple[BoxBlock, ...]

    @model_validator(mode="after")
    def _check_partition(self) -> Self:
        for field in ("lower", "upper", "centre"):
            require_size(field, getattr(self, field), self.premises)
        for i, (lower, centre, upper) in enumerate(zip(self.lower, self.centre, self.upper, strict=True)):
            if not lower < upper:
                raise FieldError(f"upper[{i}]", upper, f"more than lower[{i}] = {lower}")
            if not lower <= centre <= upper:
                raise FieldError(f"centre[{i}]", centre, "a point of the box")
        listed = [premise for block in self.blocks for premise in block.premises]
        if sorted(listed) != list(range(self.premises)):
            raise FieldError("blocks", f"premises {listed}", f"each of 0 to {self.premises - 1} in exactly one block")
        if not self.blocks or (self.premises == 0) != (len(self.blocks) == 1 and not self.blocks[0].premises):
            raise FieldError("blocks", len(self.blocks), "at least one, and one without premises if there are none")
        shape = None
        for field, vertex in self._vertices():
            shape = shape or (len(vertex), len(vertex[0]) if vertex else 0)
            if len(vertex) != shape[0] or any(len(row) != shape[1] for row in vertex) or 0 in shape:
                raise FieldError(field, "another shape", f"a {shape[0]} x {shape[1]} matrix, like the first vertex")
        return self

    def _vertices(self) -> Iterator[tuple[str, Matrix]]:
        for i, block in enumerate(self.blocks):
            if i > 0 and not block.premises:
                raise FieldError(f"blocks[{i}].premises", "none", "at least one premise")
            require_size(f"blocks[{i}].vertices", block.vertices, 2 ** len(block.premises))
            for j, vertex in enumerate(block.vertices):
                yield f"blocks[{i}].vertices[{j}]", vertex

    def at_centre(self) -> npt.NDArray[np.float64]:
        """Return X at the centring point: vertices of a block weighted with products of its premises' weights."""
        matrix = np.zeros(np.shape(self.blocks[0].vertices[0]))
        for block in self.blocks:
            weights = np.ones(1)
            for p in block.premises:
                upper_weight = (self.centre[p] - self.lower[p]) / (self.upper[p] - self.lower[p])
                weights = np.outer(weights, [1.0 - upper_weight, upper_weight]).ravel()
            matrix += np.tensordot(weights, np.array(block.vertices), axes=1) / len(self.blocks)
        return matrix

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return sum(len(block.vertices) for block in self.blocks)

    def require_shape(self, field: str, rows: int, columns: int) -> None:
        """Raise ``FieldError`` unless vertices are ``rows`` x ``columns``."""
        for path, vertex in self._vertices():
            require_shape(f"{field}.{path}", vertex, rows, columns)

    def require_gains(self, field: str, rows: int, columns: int, inertia: PolytopeTable) -> None:
        """Raise ``FieldError`` unless vertices are ``rows`` x ``columns``, scheduled on the premises of the inertia."""
        self.require_shape(field, rows, columns)
        if self._schedule() != inertia._schedule():
            raise FieldError(field, "another box, centre or partition of the premises", "that of law.inertia")

    def _schedule(self) -> tuple[object, ...]:
        return self.lower, self.upper, self.centre, tuple(block.premises for block in self.blocks)

    def require_inertia(self, field: str, size: int) -> None:
        """Raise ``FieldError`` unless vertices are symmetric ``size`` x ``size`` and the centre is positive definite.

        Corners of the box need not be configurations of the robot, so the vertices themselves may be indefinite.
        """
        self.require_shape(field, size, size)
        for path, vertex in self._vertices():
            require_symmetric(f"{field}.{path}", vertex)
        require_positive_definite(field, self.at_centre(), "a positive definite inertia", " at the centre")

    def require_lyapunov(self, field: str, size: int) -> None:
        """Raise ``FieldError`` unless every vertex is symmetric positive definite, ``size`` x ``size``."""
        for path, vertex in self._vertices():
            require_lyapunov(f"{field}.{path}", vertex, size)


def require_shape(field: str, matrix: Matrix, rows: int, columns: int) -> None:
    """Raise ``FieldError`` unless a matrix is ``rows`` x ``columns``."""
    if len(matrix) != rows or any(len(row) != columns for row in matrix):
        raise FieldError(field, f"{len(matrix)} x {len(matrix[0]) if matrix else 0}", f"{rows} x {columns}")


def require_lyapunov(field: str, matrix: Matrix, size: int) -> None:
    """Raise ``FieldError`` unless a matrix is symmetric positive definite, ``size`` x ``size``."""
    require_shape(field, matrix, size, size)
    require_symmetric(field, matrix)
    require_positive_definite(field, np.array(matrix), "a positive definite matrix")


def require_symmetric(field: str, rows: Matrix) -> None:
    """Raise ``FieldError`` unless a square matrix is symmetric."""
    matrix = np.array(rows)
    asymmetry = np.abs(matrix - matrix.T)
    if asymmetry.max() > ROUNDING * np.abs(matrix).max():
        i, j = np.unravel_index(int(asymmetry.argmax()), asymmetry.shape)
        raise FieldError(f"{field}[{i}][{j}]", rows[i][j], f"{rows[j][i]}, the symmetric entry")


def require_positive_definite(field: str, matrix: npt.NDArray[np.float64], expected: str, where: str = "") -> None:
    """Raise ``FieldError`` unless a symmetric matrix is positive definite."""
    eigenvalues = np.linalg.eigvalsh(matrix)
    smallest, largest = eigenvalues[0], np.abs(eigenvalues).max()
    if not smallest > ROUNDING * largest:
        raise FieldError(field, f"smallest eigenvalue {smallest:.3g}{where}", expected)


def require_size(field: str, values: tuple[object, ...], size: int) -> None:
    """Raise ``FieldError`` unless ``values`` has ``size`` entries."""
    if len(values) != size:
        raise FieldError(field, f"{len(values)} entries", f"{size}")
