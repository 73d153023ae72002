"""All controllers of one scenario in one figure: accuracy over time, accuracy and torque activity in numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.ndimage import maximum_filter1d

from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import BLACK, CONTROLLER_COLOURS, new_figure, style

_FLOOR_MM = 1e-3

WINDOW_S = 0.2
"""Over which the largest distance is drawn: the distance itself passes through zero many times a second."""


def comparison_figure(results: Sequence[TrackResult]) -> Figure:
    """Largest recent distance of the tool from its reference over time, and its rms beside the torque activity.

    One colour per controller, named beside its rms. Both error axes are logarithmic, as the controllers differ by
    orders of magnitude; so the rms is a point and no bar, which would begin nowhere.

    Args:
        results: runs of the same scenario, at least one.
    """
    with style():
        count = len(results)
        who = results[0].variant.label if count == 1 else f"{count} controllers"
        figure = new_figure(3.3 + 0.22 * count, f"{results[0].scenario}, {results[0].plant} plant: {who}")
        upper, lower = figure.subplots(2, 1, height_ratios=(2.4, 0.5 + 0.22 * count))
        _plot_distance(upper, results)
        _plot_points(lower, results)
        return figure


def _plot_distance(axes: Axes, results: Sequence[TrackResult]) -> None:
    for result, dashes in zip(results, _dashes(results), strict=True):
        samples = max(1, round(WINDOW_S * result.rate_hz))
        distance_mm = 1e3 * maximum_filter1d(result.distance_m, samples, origin=(samples - 1) // 2)
        axes.semilogy(
            result.run.time_s,
            np.maximum(distance_mm, _FLOOR_MM),
            color=_colour(result),
            linestyle=dashes,
            linewidth=1.2,
        )
    axes.set_ylabel(f"largest distance\nin the last {WINDOW_S:g} s (mm)")
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, max(float(result.run.time_s[-1]) for result in results))


def _plot_points(axes: Axes, results: Sequence[TrackResult]) -> None:
    """The rms distance, over all axes of the tool, annotated with the torque increment."""
    position = np.arange(len(results))[::-1]
    rms_mm = np.array([1e3 * result.metrics.rms_tool_m for result in results])
    axes.set_xscale("log")
    for y, value, result, dashes in zip(position, rms_mm, results, _dashes(results), strict=True):
        filled = _colour(result) if dashes == "-" else "white"
        axes.plot(value, y, marker="o", markersize=7, color=_colour(result), markerfacecolor=filled, linestyle="none")
        note = f"   {value:.3g} mm, {result.metrics.rms_torque_increment_nm:.3g} N m per sample"
        axes.text(value, y, note, va="center", fontsize=8)
    axes.set_yticks(position, [_label(result) for result in results])
    axes.set_ylim(-0.6, len(results) - 0.4)
    axes.set_xlim(0.5 * float(rms_mm.min()), 60.0 * float(rms_mm.max()))
    axes.set_xlabel("rms distance, all axes together (mm); rms torque increment beside it")


def _colour(result: TrackResult) -> str:
    return CONTROLLER_COLOURS.get(result.variant.controller, BLACK)


def _dashes(results: Sequence[TrackResult]) -> list[str | tuple[int, tuple[float, ...]]]:
    """Solid for the first run of a controller, dashed for its next (the same colour, other sensors)."""
    seen: set[str] = set()
    dashes: list[str | tuple[int, tuple[float, ...]]] = []
    for result in results:
        dashes.append((0, (4.0, 1.5)) if result.variant.controller in seen else "-")
        seen.add(result.variant.controller)
    return dashes


def _label(result: TrackResult) -> str:
    return f"{result.variant.label}, {result.rate_hz / 1e3:g} kHz"
