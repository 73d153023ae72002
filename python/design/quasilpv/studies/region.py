"""Maps: the verdict of a condition over two parameters, as areas, on a full grid, or along the boundary only.

Every feasible point of a map is proved in exact arithmetic. Where the data are affine in both parameters, one solution
for the four corners of a rectangle proves all of it (`quasilpv.lmi.common`); elsewhere nothing is known between points.
The result does not depend on the order in which points are solved, nor on how many processes solve them, nor on
interruptions: a map is a set of independent answers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.errors import InputError
from quasilpv.progress import Progress
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.quadtree import Cell, Division, Node, divide
from quasilpv.studies.question import Question
from quasilpv.studies.sweep import Sweep
from quasilpv.systems.catalogue import system_kind

Place: TypeAlias = tuple[float, ...]
"""Values of the swept parameters."""

Places: TypeAlias = tuple[Place, ...]
"""One place, or several that are answered by one solution."""

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
class Rectangle:
    """A part of the plane of the two parameters, its border included."""

    x: tuple[float, float]
    y: tuple[float, float]


@dataclass(frozen=True)
class Areas:
    """What is known between points.

    Attributes:
        proved: rectangles in which one solution proves every point.
        undecided: rectangles of one grid spacing along the edge of the proved area.
        proved_share, undecided_share: of the area of the map. In the rest nothing feasible was found at the points
            tried, which is no proof.
    """

    proved: tuple[Rectangle, ...]
    undecided: tuple[Rectangle, ...]
    proved_share: float
    undecided_share: float

    def to_document(self) -> dict[str, Any]:
        """JSON-able: rectangles as ``[[x, x], [y, y]]``."""
        document = asdict(self)
        document.update({name: [[r.x, r.y] for r in getattr(self, name)] for name in ("proved", "undecided")})
        return document


@dataclass(frozen=True, repr=False)
class Region:
    """A map.

    Attributes:
        question: with everything but the two parameters.
        x, y: the axes.
        points: what was evaluated on the grid, in order of column, then row.
        boundary: where neighbouring points disagree.
        evaluations: problems solved, those along edges and those of rectangles included.
        seconds: of computation, summed over processes.
        areas: what is proved between points; None if nothing is.
    """

    question: Question
    x: Axis
    y: Axis
    points: tuple[Point, ...]
    boundary: tuple[Crossing, ...]
    evaluations: int
    seconds: float
    areas: Areas | None = None

    def __repr__(self) -> str:
        """In a few lines."""
        found = ", ".join(f"{number} {verdict.value}" for verdict, number in counts(self).items() if number)
        lines = [
            f"map of {self.question.condition} over {self.x.name} and {self.y.name}: {len(self.points)} points, {found}"
        ]
        if self.areas is not None:
            proved, undecided = self.areas.proved_share, self.areas.undecided_share
            lines.append(f"proved {proved:.1%} of the area, undecided {undecided:.1%}")
        return "\n".join([*lines, f"{self.evaluations} problems solved, {self.seconds:.3g} s"])

    def to_document(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "question": self.question.to_document(),
            "axes": [{"name": a.name, "start": a.start, "end": a.end, "count": a.count} for a in (self.x, self.y)],
            "points": [
                {"x": p.x, "y": p.y, "certified": p.answer.certified}
                | {name: p.answer.to_document()[name] for name in ("verdict", "evidence")}
                for p in self.points
            ],
            "boundary": [{"feasible": list(c.feasible), "other": list(c.other)} for c in self.boundary],
            "proved_share": self.areas.proved_share if self.areas else None,
            "areas": self.areas.to_document() if self.areas else None,
            "seconds_per_point": self.seconds / max(1, self.evaluations),
        }


@dataclass(frozen=True)
class Task:
    """A point to solve, or points for which one solution is wanted, as they are sent to a process.

    Attributes:
        question: of the map.
        swept: names of the parameters that change.
        places: their values, at one point or at several.
        rescaled: whether a solution for several is looked for in other units too.
    """

    question: Question
    swept: tuple[str, ...]
    places: Places
    rescaled: bool = False

    @property
    def points(self) -> list[dict[str, float]]:
        """The places by name of the parameters."""
        return [dict(zip(self.swept, place, strict=True)) for place in self.places]


Solver: TypeAlias = Callable[[Sequence[Task]], Iterable[Answer]]
"""Solves tasks, in order; see `quasilpv.studies.engines`."""


class Memory(Protocol):
    """Answers kept between runs; see `quasilpv.studies.checkpoint`."""

    def get(self, places: Places) -> Answer | None:
        """The answer at one place or several, if it is known."""

    def put(self, places: Places, answer: Answer) -> None:
        """Keep an answer."""


def solve_task(task: Task) -> Answer:
    """Answer one task; a process compiles a family once for all the tasks it is given."""
    sweep, points = sweep_of(task.question, task.swept), task.points
    return sweep.at(points[0]) if len(points) == 1 else sweep.common(points, rescaled=task.rescaled)


@lru_cache(maxsize=4)
def sweep_of(question: Question, swept: tuple[str, ...]) -> Sweep:
    """The sweep of a question, compiled once in a process."""
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
        progress: Progress,
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
        self._answers: dict[Places, Answer] = {}

    @property
    def proves_areas(self) -> bool:
        """Whether the data are affine in both parameters, so that `areas` can be asked for."""
        return sweep_of(self._question, self._swept).updates

    def areas(self) -> Region:
        """Rectangles that are proved as a whole, points only along their edge (`quasilpv.studies.quadtree`).

        Raises:
            InputError: the data are not affine in both parameters: nothing can be said between points.
        """
        if not self.proves_areas:
            got = f"{self._x.name} and {self._y.name}"
            raise InputError("region", "areas", got, "two parameters in which the data are affine")
        division = divide(self._x.count, self._y.count, self)
        return self._region(self._areas(division), bisections=0)

    def feasible(self, nodes: Sequence[Node]) -> list[bool]:
        """Whether points of the grid are proved to be feasible; solves what is not known."""
        self._solve(nodes)
        return [self._feasible(node) for node in nodes]

    def proved(self, cells: Sequence[Cell]) -> list[bool]:
        """Whether one solution proves a whole rectangle, for each of them; solves what is not known."""
        places = [tuple(self._place(corner) for corner in cell.corners) for cell in cells]
        self._solve_places(places)
        return [self._answers[place].certified for place in places]

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
        cells = [Cell(i, j, k, m) for i, k in pairwise(columns) for j, m in pairwise(rows)]
        self._solve([(i, j) for i in columns for j in rows])
        while cells:
            mixed = [cell for cell in cells if len({self._verdict(n) for n in cell.corners}) > 1]
            cells = [part for cell in mixed for part in cell.quarters()]
            self._solve([node for cell in cells for node in cell.corners])
        return self._region()

    def _region(self, areas: Areas | None = None, *, bisections: int = EDGE_BISECTIONS) -> Region:
        nodes = sorted((i, j) for i in range(self._x.count) for j in range(self._y.count) if self._known((i, j)))
        boundary = self._bisected(list(self._edges(nodes)), bisections)
        points = tuple(Point(*self._place(node), self._answer(node)) for node in nodes)
        seconds = sum(answer.seconds for answer in self._answers.values())
        return Region(self._question, self._x, self._y, points, boundary, len(self._answers), seconds, areas)

    def _areas(self, division: Division) -> Areas:
        proved, undecided = (tuple(map(self._rectangle, cells)) for cells in (division.proved, division.undecided))
        return Areas(proved, undecided, division.share(division.proved), division.share(division.undecided))

    def _rectangle(self, cell: Cell) -> Rectangle:
        (left, bottom), (right, top) = self._place(cell.corners[0]), self._place(cell.corners[-1])
        return Rectangle((left, right), (bottom, top))

    def _edges(self, nodes: Sequence[Node]) -> Iterator[tuple[Node, Node]]:
        """Neighbours, feasible first, of which one is feasible and the other is not."""
        for i, j in nodes:
            for other in ((i + 1, j), (i, j + 1)):
                if other[0] < self._x.count and other[1] < self._y.count and self._known(other):
                    one, two = ((i, j), other) if self._feasible((i, j)) else (other, (i, j))
                    if self._feasible(one) and not self._feasible(two):
                        yield one, two

    def _bisected(self, edges: Sequence[tuple[Node, Node]], bisections: int) -> tuple[Crossing, ...]:
        """Halve all edges at once, a fixed number of times: every round is one parallel batch."""
        ends = [(np.array(one, dtype=float), np.array(two, dtype=float)) for one, two in edges]
        for _ in range(bisections):
            middles = [0.5 * (good + bad) for good, bad in ends]
            places = [(self._place((float(m[0]), float(m[1]))),) for m in middles]
            self._solve_places(places)
            ends = [
                (m, bad) if self._answers[place].verdict is Verdict.FEASIBLE else (good, m)
                for (good, bad), m, place in zip(ends, middles, places, strict=True)
            ]
        return tuple(Crossing(self._place(tuple(good)), self._place(tuple(bad))) for good, bad in ends)

    def _solve(self, nodes: Iterable[Node]) -> None:
        self._solve_places([(self._place(node),) for node in nodes])

    def _solve_places(self, asked: Sequence[Places]) -> None:
        missing = []
        for places in dict.fromkeys(asked):
            if places in self._answers:
                continue
            kept = self._memory.get(places)
            if kept is None:
                missing.append(places)
            else:
                self._answers[places] = kept
        total = len(self._answers) + len(missing)
        tasks = [Task(self._question, self._swept, places, self._was_rescaled(places)) for places in missing]
        for places, answer in zip(missing, self._solver(tasks), strict=True):
            self._answers[places] = answer
            self._memory.put(places, answer)
            self._progress(len(self._answers), total)

    def _was_rescaled(self, places: Places) -> bool:
        """Whether one of the places is known to be feasible in other units."""
        return any(self._answers[(p,)].units is not None for p in places if (p,) in self._answers)

    @property
    def _swept(self) -> tuple[str, str]:
        return self._x.name, self._y.name

    def _place(self, node: tuple[float, float]) -> tuple[float, float]:
        return self._x.at(node[0]), self._y.at(node[1])

    def _known(self, node: Node) -> bool:
        return (self._place(node),) in self._answers

    def _answer(self, node: Node) -> Answer:
        return self._answers[(self._place(node),)]

    def _verdict(self, node: Node) -> Verdict:
        return self._answer(node).verdict

    def _feasible(self, node: Node) -> bool:
        return self._verdict(node) is Verdict.FEASIBLE


def _coarse(count: int) -> list[int]:
    """Indices a power of two apart, and the last one."""
    stride = COARSE_STRIDE
    while stride > 1 and stride * COARSE_CELLS > count - 1:
        stride //= 2
    return sorted({*range(0, count, stride), count - 1})


def counts(region: Region) -> Mapping[Verdict, int]:
    """How many grid points have each verdict."""
    return {verdict: sum(p.answer.verdict is verdict for p in region.points) for verdict in Verdict}
