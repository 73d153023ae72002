"""A run in space: the robot with the path of its tool, and the tool's error along that path."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from quasilpv.arrays import FloatArray
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.space import Viewpoint, draw_shadow, draw_skeleton, space_axes
from quasilpv.figures.style import BLACK, BLUE, REFERENCE_COLOUR, new_figure, style

MARKS = "ABCD"
"""At the start and after every quarter of the way."""

SHORTEST_WAY_M = 1e-6
"""A tool that has a shorter way stands still: its error is shown over time."""


def robot_figure(result: TrackResult) -> Figure:
    """The skeleton at the start and, paler, after every quarter of the way; the tool's path; its error along the path.

    Args:
        result: of a robot in space.
    """
    way, marks = way_of(result)
    postures = [result.robot.skeleton(result.run.true_angle_rad[sample]) for sample in marks]
    with style():
        figure = new_figure(7.0, f"{result.title}: the robot, and its tool along the path")
        grid = figure.add_gridspec(2, 1, height_ratios=(2.7, 1.0), hspace=0.2)  # axes in space have labels below them
        points = np.concatenate([*postures, result.reference_position_m])
        axes = space_axes(figure, grid[0], points, Viewpoint.of_path(result.reference_position_m), zoom=0.9)
        for posture in reversed(postures[1:]):
            draw_skeleton(axes, posture, alpha=0.18)
        draw_shadow(axes, postures[0])
        draw_skeleton(axes, postures[0])
        _draw_path(axes, result, marks)
        _draw_error(figure.add_subplot(grid[1]), result, way, marks)
        return figure


def way_of(result: TrackResult) -> tuple[FloatArray, list[int]]:
    """The way of the reference up to every sample, m, and the samples at `MARKS`; of a tool that stands, the time."""
    steps = np.linalg.norm(np.diff(result.reference_position_m, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    if way[-1] < SHORTEST_WAY_M:
        way = result.run.time_s
    quarters = way[-1] * np.arange(len(MARKS)) / len(MARKS)
    return way, [int(sample) for sample in np.searchsorted(way, quarters)]


def _draw_path(axes: Axes3D, result: TrackResult, marks: list[int]) -> None:
    reference = result.reference_position_m
    axes.plot(*reference.T, color=REFERENCE_COLOUR, linewidth=2.6, label="reference")
    axes.plot(*result.tool_position_m.T, color=BLUE, linewidth=1.2, label="tool")
    for name, sample in zip(MARKS, marks, strict=True):
        x, y, z = reference[sample]
        axes.plot([x], [y], [z], color=BLACK, marker="o", markersize=3.0)
        axes.text(x, y, z, f" {name}", fontsize=9.0, fontweight="bold")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 1.0))


def _draw_error(axes: Axes, result: TrackResult, way: FloatArray, marks: list[int]) -> None:
    distance_mm = 1e3 * result.distance_m
    rms_mm, largest_mm = 1e3 * result.metrics.rms_tool_m, 1e3 * result.metrics.max_tool_m
    axes.plot(way, distance_mm, color=BLUE, linewidth=0.8)
    axes.axhline(rms_mm, color=BLACK, linewidth=0.8, linestyle="--")
    axes.set_title(f"error of the tool, rms {rms_mm:.3g} mm (dashed), largest {largest_mm:.3g} mm")
    axes.set_ylabel("tool error (mm)")
    axes.set_ylim(0.0, 1.25 * largest_mm or None)
    axes.set_xlim(0.0, float(way[-1]))
    axes.set_xlabel("time (s)" if way is result.run.time_s else "way along the path (m)")
    for name, sample in zip(MARKS, marks, strict=True):
        axes.axvline(way[sample], color=REFERENCE_COLOUR, linewidth=0.6)
        axes.annotate(
            name,
            (way[sample], 1.0),
            (3, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            va="top",
            fontweight="bold",
        )
