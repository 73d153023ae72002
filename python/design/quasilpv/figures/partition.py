"""Runs of one law that differ in the premises it is scheduled with: tracking, and what the observer estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import BLUE, GREEN, ORANGE, REFERENCE_COLOUR, VERMILION, length_unit, new_figure, style

_WINDOW_S = 0.02

_COLOURS = (BLUE, GREEN, ORANGE, VERMILION)


@dataclass(frozen=True)
class Column:
    """One column of panels: runs under the same conditions.

    Attributes:
        title: the conditions.
        runs: by what the legend calls them; the same names and order in every column.
        magnified: factor by which deviations from the path are drawn.
    """

    title: str
    runs: Mapping[str, TrackResult]
    magnified: float


def tracking_by_partition(title: str, columns: Sequence[Column]) -> Figure:
    """Path, tool error along X and Y, and error of the disturbance estimate (norm over joints, rms per 20 ms)."""
    with style():
        figure = new_figure(9.0, title)
        grid = figure.subplots(4, len(columns), squeeze=False, height_ratios=(2.2, 1.0, 1.0, 1.0))
        for column, panels in zip(columns, grid.T, strict=True):
            panels[0].set_title(column.title)
            _plot_paths(panels[0], column)
            for axis, name in enumerate("XY"):
                _plot_errors(panels[1 + axis], column, axis, name)
            _plot_disturbance(panels[3], column)
            panels[3].set_xlabel("time (s)")
        _shared_legend(figure, grid[1, 0])
        return figure


def speed_estimates_by_partition(title: str, columns: Sequence[Column]) -> Figure:
    """Error of the estimated speed of every joint, rms per 20 ms over time."""
    joints = next(iter(columns[0].runs.values())).run.joints
    with style():
        figure = new_figure(1.7 * joints + 1.0, title)
        grid = figure.subplots(joints, len(columns), squeeze=False, sharex=True)
        for column, panels in zip(columns, grid.T, strict=True):
            panels[0].set_title(column.title)
            for joint, axes in enumerate(panels):
                for colour, (name, result) in zip(_COLOURS, column.runs.items(), strict=False):
                    run = result.run
                    error = run.estimated_speed_rad_s[:, [joint]] - run.true_speed_rad_s[:, [joint]]
                    axes.semilogy(run.time_s, _running_rms(error, run.sample_period_s), color=colour, label=name)
                axes.set_ylabel(f"joint {joint + 1} (rad/s)")
            panels[-1].set_xlabel("time (s)")
        _shared_legend(figure, grid[0, 0])
        return figure


def _plot_paths(axes: Axes, column: Column) -> None:
    reference = next(iter(column.runs.values())).reference_position_m
    axes.plot(*reference.T, color=REFERENCE_COLOUR, linewidth=2.2)
    for colour, result in zip(_COLOURS, column.runs.values(), strict=False):
        error = result.tool_position_m - result.reference_position_m
        axes.plot(*(reference + column.magnified * error).T, color=colour, linewidth=0.5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"X (m), deviations × {column.magnified:g}")
    axes.set_ylabel("Y (m)")


def _plot_errors(axes: Axes, column: Column, axis: int, name: str) -> None:
    errors = {key: (r.tool_position_m - r.reference_position_m)[:, axis] for key, r in column.runs.items()}
    unit = length_unit(max(float(np.abs(error).max()) for error in errors.values()))
    for colour, (key, error) in zip(_COLOURS, errors.items(), strict=False):
        axes.plot(column.runs[key].run.time_s, unit.factor * error, color=colour, linewidth=0.5, label=key)
    axes.set_ylabel(f"{name} error ({unit.name})")


def _plot_disturbance(axes: Axes, column: Column) -> None:
    for colour, result in zip(_COLOURS, column.runs.values(), strict=False):
        if result.true_disturbance is None:
            raise ValueError(f"{result.variant.controller} estimates no disturbance")
        error = result.run.filtered_disturbance - result.true_disturbance.values
        axes.semilogy(result.run.time_s, _running_rms(error, result.run.sample_period_s), color=colour, linewidth=0.8)
        axes.set_ylabel(f"disturbance error\n({result.true_disturbance.unit})")


def _running_rms(error: FloatArray, sample_period_s: float) -> FloatArray:
    """Root of the mean over a window of the sum over joints of squares, (N, n) -> (N,)."""
    kernel = np.ones(max(1, round(_WINDOW_S / sample_period_s)))
    inside = np.convolve(np.ones(len(error)), kernel, mode="same")  # fewer at the ends
    return np.asarray(np.sqrt(np.convolve(np.sum(error**2, axis=1), kernel, mode="same") / inside))


def _shared_legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    legend = figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), handlelength=2.5)
    for line in legend.get_lines():
        line.set_linewidth(1.6)
