"""Maps: the verdict of a condition over two parameters, on a full grid or along the boundary only.

Every feasible point of a map is proved in exact arithmetic. The result does not depend on the order in which points are
solved, nor on how many processes solve them, nor on interruptions: a map is a set of independent answers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InputError
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.question import Question, Sweep
from quasilpv.systems.catalogue import system_kind

Node: TypeAlias = tuple[int, int]
"""Column and row of a point of the grid."""

COARSE_STRIDE = 8
"""Largest first spacing of the adaptive map, in grid points; halved where neighbours disagree."""

COARSE_CELLS = 4
"""An axis has at least so many coarse cells, if it has so many points."""

EDGE_BISECTIONS = 5
"""The boundary is located to 1/32 of the grid spacing."""


@dataclass(frozen=True)
class Axis:
    """One parameter of a map: equally spaced values.

    Attributes:
        name: of the parameter.
        start, end: first and last value.
        count: how many values, at least 2.

    Raises:
        InputError: fewer than two values, or both ends the same.
    """

    name: str
    start: float
    end: float
    count: int

    def __post_init__(self) -> None:
        """Refuse what spans no range."""
        if self.count < 2 or self.start == self.end:
            got = f"{self.start:g}:{self.end:g}:{self.count}"
            raise InputError("region", f"axis {self.name}", got, "two different ends and at least 2 points")

    @property
    def values(self) -> npt.NDArray[np.float64]:
        """The grid, (count,)."""
        return np.linspace(self.start, self.end, self.count)

    def at(self, place: float) -> float:
        """Value at a place counted in grid spacings; the grid value itself at a whole number."""
        if float(place).is_integer():
            return float(self.values[int(place)])
        return self.start + (self.end - self.start) * place / (self.count - 1)


@dataclass(frozen=True)
class Point:
    """One evaluated point of a map."""

    x: float
    y: float
    answer: Answer


@dataclass(frozen=True)
class Crossing:
    """Where the boundary crosses an edge of the grid: feasible (proved) on one side, not feasible on the other."""

    feasible: tuple[float, float]
    other: tuple[float, float]


@dataclass(frozen=True)
class Region:
    """A map.

    Attributes:
        question: with everything but the two parameters.
        x, y: the axes.
        points: what was evaluated on the grid, in order of column, then row.
        boundary: where neighbouring points disagree.
        evaluations: points solved, those along edges included.
        seconds: of computation, summed over processes.
    """

    question: Question
    x: Axis
    y: Axis
    points: tuple[Point, ...]
    boundary: tuple[Crossing, ...]
    evaluations: int
    seconds: float

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "question": self.question.to_document(),
            "axes": [{"name": a.name, "start": a.start, "end": a.end, "count": a.count} for a in (self.x, self.y)],
            "points": [
                {"x": p.x, "y": p.y, "verdict": p.answer.verdict.value, "certified": p.answer.certified}
                for p in self.points
            ],
            "boundary": [{"feasible": list(c.feasible), "other": list(c.other)} for c in self.boundary],
            "seconds_per_point": self.seconds / max(1, self.evaluations),
        }


@dataclass(frozen=True)
class Task:
    """A point to solve, as it is sent to a process.

    Attributes:
        question: of the map.
        swept: names of the parameters that change.
        place: their values.
    """

    question: Question
    swept: tuple[str, ...]
    place: tuple[float, ...]


Solver: TypeAlias = Callable[[Sequence[Task]], Iterable[Answer]]
"""Solves tasks, in order; see `quasilpv.studies.engines`."""


class Memory(Protocol):
    """Answers kept between runs; see `quasilpv.studies.checkpoint`."""

    def get(self, place: tuple[float, float]) -> Answer | None:
        """The answer at a point, if it is known."""

    def put(self, place: tuple[float, float], answer: Answer) -> None:
        """Keep an answer."""


def solve_task(task: Task) -> Answer:
    """Answer one task; a process compiles a family once for all the tasks it is given."""
    return _sweep(task.question, task.swept).at(dict(zip(task.swept, task.place, strict=True)))


@lru_cache(maxsize=4)
def _sweep(question: Question, swept: tuple[str, ...]) -> Sweep:
    return Sweep(question, swept)


class Map:
    """The evaluation of one map.

    Args:
        question: with all other parameters set.
        x, y: the axes.
        solver: where points are solved.
        memory: answers of an earlier run, and where new ones are kept.
        progress: called with (points solved, points known to be needed so far).

    Raises:
        InputError: an axis is no parameter of the system, or both are the same.
    """

    def __init__(
        self,
        question: Question,
        x: Axis,
        y: Axis,
        *,
        solver: Solver,
        memory: Memory,
        progress: Callable[[int, int], None],
    ) -> None:
        """Check the axes; nothing is solved yet."""
        known = system_kind(question.system).parameters
        for axis in (x, y):
            if axis.name not in known:
                raise InputError("region", "axis", axis.name, f"one of {', '.join(known)}")
        if x.name == y.name:
            raise InputError("region", "axes", f"{x.name} twice", "two parameters")
        self._question, self._x, self._y = question, x, y
        self._solver, self._memory, self._progress = solver, memory, progress
        self._answers: dict[tuple[float, float], Answer] = {}

    def full(self) -> Region:
        """Every point of the grid."""
        self._solve([(i, j) for i in range(self._x.count) for j in range(self._y.count)])
        return self._region()

    def adaptive(self) -> Region:
        """A coarse grid, refined to the full one in cells whose corners disagree, and bisection along the boundary.

        A feature smaller than the coarse spacing (at most `COARSE_STRIDE` points) that touches no coarse point is
        missed.
        """
        columns, rows = _coarse(self._x.count), _coarse(self._y.count)
        cells = [(i, j, k, m) for i, k in pairwise(columns) for j, m in pairwise(rows)]
        self._solve([(i, j) for i in columns for j in rows])
        while cells:
            mixed = [cell for cell in cells if len({self._verdict(n) for n in _corners(cell)}) > 1]
            cells = [part for cell in mixed for part in _quarters(cell)]
            self._solve([node for cell in cells for node in _corners(cell)])
        return self._region()

    def _region(self) -> Region:
        nodes = sorted((i, j) for i in range(self._x.count) for j in range(self._y.count) if self._known((i, j)))
        boundary = self._bisected(list(self._edges(nodes)))
        points = tuple(Point(*self._place(node), self._answers[self._place(node)]) for node in nodes)
        seconds = sum(answer.seconds for answer in self._answers.values())
        return Region(self._question, self._x, self._y, points, boundary, len(self._answers), seconds)

    def _edges(self, nodes: Sequence[Node]) -> Iterator[tuple[Node, Node]]:
        """Neighbours, feasible first, of which one is feasible and the other is not."""
        for i, j in nodes:
            for other in ((i + 1, j), (i, j + 1)):
                if other[0] < self._x.count and other[1] < self._y.count and self._known(other):
                    one, two = ((i, j), other) if self._feasible((i, j)) else (other, (i, j))
                    if self._feasible(one) and not self._feasible(two):
                        yield one, two

    def _bisected(self, edges: Sequence[tuple[Node, Node]]) -> tuple[Crossing, ...]:
        """Halve all edges at once, a fixed number of times: every round is one parallel batch."""
        ends = [(np.array(one, dtype=float), np.array(two, dtype=float)) for one, two in edges]
        for _ in range(EDGE_BISECTIONS):
            middles = [0.5 * (good + bad) for good, bad in ends]
            places = [self._place((float(m[0]), float(m[1]))) for m in middles]
            self._solve_places(places)
            ends = [
                (m, bad) if self._answers[place].verdict is Verdict.FEASIBLE else (good, m)
                for (good, bad), m, place in zip(ends, middles, places, strict=True)
            ]
        return tuple(Crossing(self._place(tuple(good)), self._place(tuple(bad))) for good, bad in ends)

    def _solve(self, nodes: Iterable[Node]) -> None:
        self._solve_places([self._place(node) for node in nodes])

    def _solve_places(self, places: Sequence[tuple[float, float]]) -> None:
        missing = []
        for place in dict.fromkeys(places):
            if place in self._answers:
                continue
            kept = self._memory.get(place)
            if kept is None:
                missing.append(place)
            else:
                self._answers[place] = kept
        total = len(self._answers) + len(missing)
        tasks = [Task(self._question, (self._x.name, self._y.name), place) for place in missing]
        for place, answer in zip(missing, self._solver(tasks), strict=True):
            self._answers[place] = answer
            self._memory.put(place, answer)
            self._progress(len(self._answers), total)

    def _place(self, node: tuple[float, float]) -> tuple[float, float]:
        return self._x.at(node[0]), self._y.at(node[1])

    def _known(self, node: Node) -> bool:
        return self._place(node) in self._answers

    def _verdict(self, node: Node) -> Verdict:
        return self._answers[self._place(node)].verdict

    def _feasible(self, node: Node) -> bool:
        return self._verdict(node) is Verdict.FEASIBLE


def _coarse(count: int) -> list[int]:
    """Indices a power of two apart, and the last one."""
    stride = COARSE_STRIDE
    while stride > 1 and stride * COARSE_CELLS > count - 1:
        stride //= 2
    return sorted({*range(0, count, stride), count - 1})


def _corners(cell: tuple[int, int, int, int]) -> tuple[Node, Node, Node, Node]:
    i, j, k, m = cell
    return (i, j), (k, j), (i, m), (k, m)


def _quarters(cell: tuple[int, int, int, int]) -> list[tuple[int, int, int, int]]:
    """The cell cut at its middle indices; nothing if it has no inner grid line."""
    i, j, k, m = cell
    if k - i <= 1 and m - j <= 1:
        return []
    columns = [(i, k)] if k - i <= 1 else [(i, (i + k) // 2), ((i + k) // 2, k)]
    rows = [(j, m)] if m - j <= 1 else [(j, (j + m) // 2), ((j + m) // 2, m)]
    return [(a, c, b, d) for a, b in columns for c, d in rows]


def counts(region: Region) -> Mapping[Verdict, int]:
    """How many grid points have each verdict."""
    return {verdict: sum(p.answer.verdict is verdict for p in region.points) for verdict in Verdict}
