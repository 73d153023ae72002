"""Maps on full grids, point by point the same for every condition, so that regions can be compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import joblib
from matplotlib.figure import Figure

from quasilpv.figures.region import region_figure
from quasilpv.reproduction.item import Effort
from quasilpv.reproduction.rules import feasible, undecided
from quasilpv.studies.boundary import Boundary, Interval, find_boundary
from quasilpv.studies.engines import in_processes
from quasilpv.studies.question import Question
from quasilpv.studies.region import Axis, Point, Region, Task

PROCESSES = 2


def axis(name: str, start: float, end: float, effort: Effort, *, quick: int, full: int) -> Axis:
    """An axis with as many points as the effort asks for."""
    return Axis(name, start, end, quick if effort is Effort.QUICK else full)


def grid(
    question: Question, x: Axis, y: Axis, also: Callable[[float, float], Mapping[str, float]] = lambda x, y: {}
) -> Region:
    """Answers at every point of a grid, nothing between them.

    Args:
        question: with all other parameters set.
        x, y: the axes.
        also: from a point to further parameters that move with it.
    """
    places = [(float(a), float(b)) for a in x.values for b in y.values]
    points = [{x.name: a, y.name: b, **also(a, b)} for a, b in places]
    tasks = [Task(question, tuple(point), (tuple(point.values()),)) for point in points]
    answers = list(in_processes(PROCESSES)(tasks))
    answered = tuple(Point(*place, answer) for place, answer in zip(places, answers, strict=True))
    return Region(question, x, y, answered, (), len(answers), sum(answer.seconds for answer in answers))


def limits(asked: Mapping[str, tuple[Question, Interval]], tolerance: float) -> dict[str, float | None]:
    """Where questions stop being feasible, by bisection, in processes: the last proved value of each.

    Args:
        asked: question and range, by name.
        tolerance: relative.
    """
    parallel: Any = joblib.Parallel(n_jobs=PROCESSES)
    found: list[Boundary] = parallel(joblib.delayed(find_boundary)(*one, tolerance) for one in asked.values())
    return {name: boundary.certified_up_to for name, boundary in zip(asked, found, strict=True)}


def nested_figure(regions: Mapping[str, Region], title: str, axis_labels: tuple[str, str]) -> Figure:
    """Several maps in one figure, the largest region first.

    Args:
        regions: by what the legend calls them.
        title: of the figure.
        axis_labels: with units.
    """
    order: Sequence[str] = sorted(regions, key=lambda name: -len(feasible(regions[name])))
    labels = [f"{name}: {len(feasible(regions[name]))} of {len(regions[name].points)}" for name in order]
    return region_figure([regions[name] for name in order], title, labels=labels, axis_labels=axis_labels)


def sizes(regions: Mapping[str, Region]) -> dict[str, dict[str, float]]:
    """Number of feasible, undecided and all points, and seconds per point, of every map."""
    return {
        name: {
            "feasible": len(feasible(region)),
            "undecided": undecided([region]),
            "points": len(region.points),
            "seconds_per_point": region.seconds / len(region.points),
        }
        for name, region in regions.items()
    }
