"""Maps of feasibility: proved areas and points, their edge, and where nothing feasible was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from quasilpv.arguments import checked
from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, one_plot, style
from quasilpv.studies.answer import Evidence, Verdict
from quasilpv.studies.question import Question
from quasilpv.studies.region import Rectangle, Region
from quasilpv.systems.catalogue import system_kind

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, BLACK)
INFEASIBLE_COLOUR = "#bdbdbd"
PROVED_LOOK = {"facecolor": SKY, "edgecolor": BLUE, "alpha": 0.6}
UNDECIDED_LOOK = {"facecolor": "none", "edgecolor": ORANGE, "hatch": "/////"}


@checked
def plot_region(*maps: Region, title: str | None = None, ax: Axes | None = None) -> Figure:
    """One map of `quasilpv.region`, or several over the same axes; see `region_figure`.

    >>> import quasilpv as ql
    >>> found = ql.region("ex-I.1", "II.6", ("a", -8.0, 8.0, 3), ("b", -20.0, 20.0, 3))
    >>> ql.plot_region(found).axes[0].get_xlabel()
    'a, parameter of ex-I.1'
    """
    return region_figure(maps, title, ax=ax)


def region_figure(
    regions: Sequence[Region],
    title: str | None = None,
    *,
    labels: Sequence[str] = (),
    axis_labels: tuple[str, str] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """One or several maps over the same axes.

    One map shows its proved and undecided areas if it has them, and its grid points by verdict; several are nested
    markers of decreasing size, largest region first, each with its boundary.

    Args:
        regions: at least one, all with the same axes.
        title: default: system and condition of the first.
        labels: of several maps; default: condition, representation and number of feasible points.
        axis_labels: default: the names of the two parameters, and whose they are.
        ax: draw into this plot.
    """
    first = regions[0]
    names = labels or [_label(region) for region in regions]
    whose = f"parameter of {system_kind(first.question.system).stem}"
    x_label, y_label = axis_labels or (f"{first.x.name}, {whose}", f"{first.y.name}, {whose}")
    with style():
        figure, axes = one_plot(4.2, title or _title(first.question), ax)
        if len(regions) == 1:
            _verdicts(axes, first)
        else:
            for order, region in enumerate(regions):
                _nested(axes, region, names[order], order, len(regions))
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        _frame(axes, first)
        beside = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
        axes.legend(**(beside if ax is None else {}))
    return figure


def _verdicts(axes: Axes, region: Region) -> None:
    looks = {
        (Verdict.INFEASIBLE, Evidence.NUMERICAL): ("x", INFEASIBLE_COLOUR, "infeasible (numerical)"),
        (Verdict.INFEASIBLE, Evidence.PROVED): ("X", BLACK, "infeasible, proved"),
        (Verdict.UNKNOWN, None): ("$?$", VERMILION, "unknown"),
        (Verdict.FEASIBLE, Evidence.PROVED): ("o", BLUE, "feasible, proved"),
    }
    size = _marker_size(region)
    if region.areas:
        del looks[Verdict.FEASIBLE, Evidence.PROVED]  # corners of proved areas, or of undecided ones
        _rectangles(axes, region.areas.proved, f"proved, {region.areas.proved_share:.1%}", PROVED_LOOK)
        _rectangles(axes, region.areas.undecided, f"undecided, {region.areas.undecided_share:.1%}", UNDECIDED_LOOK)
    for known, (marker, colour, label) in looks.items():
        places = np.array([(p.x, p.y) for p in region.points if (p.answer.verdict, p.answer.evidence) == known])
        if places.size:
            axes.plot(*places.T, linestyle="none", marker=marker, color=colour, markersize=size, label=label)
    if region.areas:
        axes.plot([], [], linestyle="none", label="white: asked at the marks only")
    else:
        _boundary(axes, region, BLACK, "boundary")


def _rectangles(axes: Axes, rectangles: Sequence[Rectangle], label: str, look: Mapping[str, Any]) -> None:
    """Rectangles as one collection, with one entry in the legend."""
    corners = [[(r.x[i], r.y[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))] for r in rectangles]
    if corners:
        axes.add_collection(PolyCollection(corners, linewidth=0.6, label=label, **look))


def _label(region: Region) -> str:
    feasible = sum(p.answer.verdict is Verdict.FEASIBLE for p in region.points)
    return f"{region.question.condition}, {region.question.representation}: {feasible} points"


def _nested(axes: Axes, region: Region, label: str, order: int, total: int) -> None:
    places = np.array([(p.x, p.y) for p in region.points if p.answer.verdict is Verdict.FEASIBLE]).reshape(-1, 2)
    size = _marker_size(region) * (1.6 - order / max(1, total - 1))
    colour = COLOURS[order % len(COLOURS)]
    axes.plot(
        *places.T,
        linestyle="none",
        marker=MARKERS[order % len(MARKERS)],
        markerfacecolor="none",
        color=colour,
        markersize=size,
        label=label,
    )


def _boundary(axes: Axes, region: Region, colour: str, label: str) -> None:
    if region.boundary:
        middles = np.array([np.mean([c.feasible, c.other], axis=0) for c in region.boundary])
        axes.plot(*middles.T, linestyle="none", marker=".", color=colour, markersize=3.0, label=label)


def _marker_size(region: Region) -> float:
    """In points, so that neighbours on the full grid do not touch."""
    return float(np.clip(150.0 / max(region.x.count, region.y.count), 1.5, 6.0))


def _frame(axes: Axes, region: Region) -> None:
    for axis, limits in ((region.x, axes.set_xlim), (region.y, axes.set_ylim)):
        half = 0.5 * abs(axis.end - axis.start) / (axis.count - 1)
        limits(min(axis.start, axis.end) - half, max(axis.start, axis.end) + half)


def _title(question: Question) -> str:
    fixed = ", ".join(f"{name} = {value:g}" for name, value in question.parameters)
    return f"{system_kind(question.system).stem}: condition {question.condition}, {question.representation}" + (
        f", {fixed}" if fixed else ""
    )
