"""Problems in the SDPA sparse format, the common file format of semidefinite solvers.

The format states ``minimise c'x subject to sum_k x_k F_k - F_0 >= 0``, all F_k block diagonal with the same blocks
(Fujisawa, Kojima, Nakata and Yamashita 2002, SDPA User's Manual). Here every inequality is one block, and the unknowns
are those of the variables, one after the other, symmetric ones as their upper triangle, column by column. Doubles are
written in their shortest form that reads back as the same double.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.lmi.assembly import gradient, triangle_places, upper_triangle
from quasilpv.lmi.expressions import Expression, ScalarProduct, Variable, zeros
from quasilpv.lmi.problem import Problem

_COMMENT_MARKS = ('"', "*")
_SEPARATORS = str.maketrans(dict.fromkeys(",(){}", " "))


@dataclass(frozen=True)
class Entry:
    """One entry (row <= column, from 0) of block ``block`` of the matrix F_``matrix``; F_0 is the negated constant."""

    matrix: int
    block: int
    row: int
    column: int
    value: float


@dataclass(frozen=True)
class SdpaProgram:
    """A semidefinite program as the file has it.

    Attributes:
        objective: c.
        blocks: sizes.
        entries: the non-zero entries of all upper triangles.
        comments: lines at the head of the file, for people.
    """

    objective: tuple[float, ...]
    blocks: tuple[int, ...]
    entries: tuple[Entry, ...]
    comments: tuple[str, ...] = ()

    @classmethod
    def of(cls, problem: Problem, comments: Sequence[str] = ()) -> SdpaProgram:
        """The problem, a constant in its objective left out; the comments go on to name blocks and unknowns."""
        blocks = tuple(c.expression.shape[0] for c in problem.constraints)
        return cls(
            tuple(map(float, gradient(problem.objective, problem.variables))),
            blocks,
            tuple(_entries(problem)),
            (*comments, *_legend(problem)),
        )

    def to_text(self) -> str:
        """The file."""
        lines = [f"* {comment}" for comment in self.comments]
        lines += [str(len(self.objective)), str(len(self.blocks)), " ".join(map(str, self.blocks))]
        lines.append(" ".join(map(repr, self.objective)))
        lines += [f"{e.matrix} {e.block + 1} {e.row + 1} {e.column + 1} {e.value!r}" for e in self.entries]
        return "\n".join(lines) + "\n"

    @classmethod
    def parse(cls, text: str, source: str) -> SdpaProgram:
        """Read a file; diagonal blocks (negative sizes) become full ones, entries below the diagonal go above it.

        Args:
            text: of the file.
            source: what to call it in errors.

        Raises:
            InputError: it is not of the format, or an index is out of range.
        """
        lines = text.splitlines()
        comments = tuple(line[1:].strip() for line in lines if line.startswith(_COMMENT_MARKS))
        body = [line for line in lines if line.strip() and not line.startswith(_COMMENT_MARKS)]
        try:
            unknowns, count = _leading_number(body[0]), _leading_number(body[1])
            sizes = tuple(abs(int(token)) for token in body[2].translate(_SEPARATORS).split()[:count])
            tokens = " ".join(body[3:]).translate(_SEPARATORS).split()
            objective = tuple(map(float, tokens[:unknowns]))
            entries = tuple(_parse_entries(tokens[unknowns:]))
        except (ValueError, IndexError) as error:
            raise InputError(source, "text", error, "the SDPA sparse format") from error
        if len(sizes) != count or len(objective) != unknowns:
            raise InputError(source, "head", f"{len(sizes)} blocks, {len(objective)} costs", f"{count}, {unknowns}")
        for entry in entries:
            if not (0 <= entry.matrix <= unknowns and 0 <= entry.block < count and entry.column < sizes[entry.block]):
                raise InputError(source, "entry", entry, f"matrix up to {unknowns}, block and place inside {sizes}")
        return cls(objective, sizes, entries, comments)

    def problem(self) -> tuple[Problem, tuple[Variable, ...]]:
        """The program in this vocabulary, and its unknowns x_1, x_2, ... as 1 x 1 variables."""
        unknowns = tuple(Variable(f"x{k + 1}", 1) for k in range(len(self.objective)))
        matrices: list[dict[int, FloatArray]] = [{} for _ in self.blocks]
        for e in self.entries:
            matrix = matrices[e.block].setdefault(e.matrix, np.zeros((self.blocks[e.block],) * 2))
            matrix[e.row, e.column] += e.value
            if e.row != e.column:
                matrix[e.column, e.row] += e.value
        problem = Problem()
        for number, (size, found) in enumerate(zip(self.blocks, matrices, strict=True), start=1):
            constant = -found.pop(0, np.zeros((size, size)))
            terms = tuple(ScalarProduct(F, unknowns[k - 1]) for k, F in found.items())
            problem.positive(f"block {number}", Expression(constant, terms))
        if any(self.objective):
            problem.minimise(sum((x * c for x, c in zip(unknowns, self.objective, strict=True)), zeros(1, 1)))
        return problem, unknowns


def _entries(problem: Problem) -> Iterator[Entry]:
    for block, constraint in enumerate(problem.constraints):
        coefficients, constant = upper_triangle(constraint.expression, problem.variables)
        i, j = triangle_places(constraint.expression.shape[0])
        for place in np.flatnonzero(constant):
            yield Entry(0, block, int(i[place]), int(j[place]), -float(constant[place]))
        columns = coefficients.tocoo()
        order = np.lexsort((columns.row, columns.col))
        for place, unknown, value in zip(columns.row[order], columns.col[order], columns.data[order], strict=True):
            if value != 0.0:
                yield Entry(int(unknown) + 1, block, int(i[place]), int(j[place]), float(value))


def _legend(problem: Problem) -> Iterator[str]:
    """Which block is which inequality, and which unknowns are which variable."""
    for number, constraint in enumerate(problem.constraints, start=1):
        yield f"block {number}: {constraint.name}"
    first = 1
    for v in problem.variables:
        form = "symmetric, upper triangle by columns" if v.symmetric else "by columns"
        yield f"unknowns {first} to {first + v.size - 1}: {v.name}, {v.rows} x {v.cols}, {form}"
        first += v.size


def _leading_number(line: str) -> int:
    """The number a line starts with; anything may follow."""
    found = re.match(r"\s*(\d+)", line)
    if found is None:
        raise ValueError(f"{line!r}, a line that starts with no number")
    return int(found[1])


def _parse_entries(tokens: Sequence[str]) -> Iterator[Entry]:
    if len(tokens) % 5:
        raise ValueError(f"{len(tokens)} numbers after the objective, which is no multiple of five")
    for k in range(0, len(tokens), 5):
        matrix, block, row, column = map(int, tokens[k : k + 4])
        if min(row, column) < 1:
            raise ValueError(f"indices count from 1, got row {row}, column {column}")
        yield Entry(matrix, block - 1, min(row, column) - 1, max(row, column) - 1, float(tokens[k + 4]))
