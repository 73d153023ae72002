"""The quadtree of maps, with oracles whose answers are known."""

from collections.abc import Callable, Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from quasilpv.studies.quadtree import COARSE_PARTS, Cell, Division, Node, divide

GRIDS = st.tuples(st.integers(2, 40), st.integers(2, 40))
HALF_PLANES = st.tuples(st.integers(-5, 5), st.integers(-5, 5), st.integers(-60, 60))


class Recorder:
    """Answers from two predicates, and remembers what it was asked."""

    def __init__(self, feasible: Callable[[Node], bool], proves: Callable[[Cell], bool]) -> None:
        self._feasible, self._proves = feasible, proves
        self.nodes: list[Node] = []
        self.cells: list[Cell] = []

    def feasible(self, nodes: Sequence[Node]) -> list[bool]:
        self.nodes += nodes
        return [self._feasible(node) for node in nodes]

    def proved(self, cells: Sequence[Cell]) -> list[bool]:
        self.cells += cells
        return [self._proves(cell) for cell in cells]


def half_plane(a: int, b: int, c: int) -> Callable[[Node], bool]:
    return lambda node: a * node[0] + b * node[1] <= c


def covered_once(division: Division, columns: int, rows: int) -> bool:
    cells = [*division.proved, *division.undecided, *division.given_up]
    units = [(i, j) for c in cells for i in range(c.left, c.right) for j in range(c.bottom, c.top)]
    return sorted(units) == [(i, j) for i in range(columns - 1) for j in range(rows - 1)]


@given(GRIDS, HALF_PLANES)
@settings(max_examples=60, deadline=None)
def test_of_a_convex_set_every_cell_inside_is_proved_and_no_other(
    grid: tuple[int, int], line: tuple[int, int, int]
) -> None:
    inside = half_plane(*line)
    asked = Recorder(inside, lambda cell: True)
    division = divide(*grid, asked)
    assert covered_once(division, *grid)
    proved = {(i, j) for c in division.proved for i in range(c.left, c.right) for j in range(c.bottom, c.top)}
    for unit in [(i, j) for i in range(grid[0] - 1) for j in range(grid[1] - 1)]:
        corners = Cell(*unit, unit[0] + 1, unit[1] + 1).corners
        if unit in proved:
            assert all(map(inside, corners))
        elif all(map(inside, corners)):
            given_up = [c for c in division.given_up if all(map(c.contains, corners))]
            assert given_up, "feasible at all corners, not proved, and not in a cell at whose corners nothing was"


@given(GRIDS, st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_whatever_is_answered_the_grid_is_covered_once_and_nothing_is_asked_twice(
    grid: tuple[int, int], seed: int, share: float
) -> None:
    def chance(*key: int) -> bool:
        return hash((seed, *key)) % 1000 < 1000 * share

    asked = Recorder(lambda node: chance(*node), lambda cell: chance(cell.left, cell.bottom, cell.right, cell.top))
    division = divide(*grid, asked)
    assert covered_once(division, *grid)
    assert len(asked.nodes) == len(set(asked.nodes))
    assert len(asked.cells) == len(set(asked.cells))
    assert set(division.proved) == {c for c in asked.cells if chance(c.left, c.bottom, c.right, c.top)}
    coarse = [max(1, (count - 1) // COARSE_PARTS) for count in grid]
    for cell in division.given_up:
        assert not any(chance(*node) for node in (*cell.corners, cell.centre) if node in asked.nodes)
        assert cell.right - cell.left <= coarse[0]
        assert cell.top - cell.bottom <= coarse[1]
    assert all(cell.area == 1 for cell in division.undecided)
    shares = [division.share(cells) for cells in (division.proved, division.undecided, division.given_up)]
    assert abs(sum(shares) - 1.0) < 1e-12


def test_what_is_proved_whole_is_asked_once() -> None:
    asked = Recorder(lambda node: True, lambda cell: True)
    assert divide(33, 17, asked).proved == (Cell(0, 0, 32, 16),)
    assert len(asked.nodes) == 4


def test_points_on_the_border_of_a_proved_cell_are_not_asked_for() -> None:
    asked = Recorder(lambda node: node[0] <= 16, lambda cell: cell.area < 1024)
    division = divide(33, 33, asked)
    inner = [node for node in asked.nodes if any(cell.contains(node) for cell in division.proved)]
    assert all(cell.right <= 16 for cell in division.proved)
    # The border of what was proved on one level was known from the level before.
    assert len(inner) < 15
