"""Where does a property hold that is proved for whole rectangles, and refuted or not found at single points?

A rectangle of grid cells whose four corners are feasible is put to the proof as a whole; one that is not proved is cut
in four. A proof covers the closed rectangle, so that no point on it is asked for again. A rectangle none of whose
corners, nor its centre, is feasible is not cut further; it is no proof that nothing in it is feasible, and features
smaller than it are missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

Node: TypeAlias = tuple[int, int]
"""Column and row of a point of the grid."""

COARSE_PARTS = 4
"""A rectangle is given up only if it is no longer, along each axis, than the grid cut in so many parts."""


@dataclass(frozen=True, order=True)
class Cell:
    """A rectangle of the grid: columns from `left` to `right`, rows from `bottom` to `top`."""

    left: int
    bottom: int
    right: int
    top: int

    @property
    def corners(self) -> tuple[Node, Node, Node, Node]:
        """Its corners."""
        return (self.left, self.bottom), (self.right, self.bottom), (self.left, self.top), (self.right, self.top)

    @property
    def centre(self) -> Node:
        """The node next to its centre; a corner if it has no inner grid line."""
        return (self.left + self.right) // 2, (self.bottom + self.top) // 2

    @property
    def area(self) -> int:
        """In unit cells."""
        return (self.right - self.left) * (self.top - self.bottom)

    def contains(self, node: Node) -> bool:
        """Whether a node is inside or on the border."""
        return self.left <= node[0] <= self.right and self.bottom <= node[1] <= self.top

    def quarters(self) -> list[Cell]:
        """The rectangle cut at its middle indices; nothing if it has no inner grid line."""
        if self.area == 1:
            return []
        columns, rows = _halves(self.left, self.right), _halves(self.bottom, self.top)
        return [Cell(a, b, c, d) for a, c in columns for b, d in rows]


class Oracle(Protocol):
    """What is asked; every call is one batch of independent questions."""

    def feasible(self, nodes: Sequence[Node]) -> Sequence[bool]:
        """Whether single points are feasible, with a proof."""

    def proved(self, cells: Sequence[Cell]) -> Sequence[bool]:
        """Whether one proof holds in a whole cell, for each cell."""


@dataclass(frozen=True)
class Division:
    """The grid taken apart; the three kinds of cells together cover it once.

    Attributes:
        proved: feasible everywhere in them, in order of column, then row.
        undecided: cells of one grid spacing, some of whose corners are feasible, which no single proof covers.
        given_up: nothing feasible was found at their corners and centre. No proof.
    """

    proved: tuple[Cell, ...]
    undecided: tuple[Cell, ...]
    given_up: tuple[Cell, ...]

    def share(self, cells: Sequence[Cell]) -> float:
        """Of the area."""
        return sum(cell.area for cell in cells) / sum(c.area for c in (*self.proved, *self.undecided, *self.given_up))


def divide(columns: int, rows: int, oracle: Oracle) -> Division:
    """Take a grid apart, level by level.

    Args:
        columns, rows: number of grid points along each axis, at least 2.
        oracle: answers.
    """
    whole = Cell(0, 0, columns - 1, rows - 1)
    coarse = max(1, whole.right // COARSE_PARTS), max(1, whole.top // COARSE_PARTS)
    known: dict[Node, bool] = {}
    proved: list[Cell] = []
    undecided: list[Cell] = []
    given_up: list[Cell] = []
    pending = [whole]
    while pending:
        _learn(known, [n for cell in pending for n in cell.corners], proved, oracle)
        full = [cell for cell in pending if all(known[n] for n in cell.corners)]
        held = {cell for cell, holds in zip(full, oracle.proved(full), strict=True) if holds}
        proved += held
        rest = [cell for cell in pending if cell not in held]
        empty = [cell for cell in rest if _is_small(cell, coarse) and not any(known[n] for n in cell.corners)]
        _learn(known, [cell.centre for cell in empty], proved, oracle)
        left_alone = {cell for cell in empty if not known[cell.centre]}
        given_up += left_alone
        undecided += [cell for cell in rest if cell.area == 1 and cell not in left_alone]
        pending = [part for cell in rest if cell not in left_alone for part in cell.quarters()]
    return Division(tuple(sorted(proved)), tuple(sorted(undecided)), tuple(sorted(given_up)))


def _learn(known: dict[Node, bool], nodes: Sequence[Node], proved: Sequence[Cell], oracle: Oracle) -> None:
    """Whether nodes are feasible: those on a proved cell are, the others are asked for."""
    new = sorted({node for node in nodes if node not in known})
    known.update({node: True for node in new if any(cell.contains(node) for cell in proved)})
    asked = [node for node in new if node not in known]
    known.update(zip(asked, oracle.feasible(asked), strict=True))


def _is_small(cell: Cell, coarse: Node) -> bool:
    return cell.right - cell.left <= coarse[0] and cell.top - cell.bottom <= coarse[1]


def _halves(low: int, high: int) -> list[tuple[int, int]]:
    middle = (low + high) // 2
    return [(low, high)] if middle == low else [(low, middle), (middle, high)]
