"""All controllers of one scenario in one figure: accuracy over time, accuracy and torque activity in numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import BLACK, CONTROLLER_COLOURS, new_figure, style

_FLOOR_MM = 1e-3


def comparison_figure(results: Sequence[TrackResult]) -> Figure:
    """Distance of the tool from its reference over time, and its rms beside the torque activity.

    One colour per controller. Both error axes are logarithmic: the controllers differ by orders of magnitude.

    Args:
        results: runs of the same scenario, at least one.
    """
    with style():
        figure = new_figure(5.4, f"{results[0].scenario}, {results[0].plant} plant: all controllers")
        upper, lower = figure.subplots(2, 1, height_ratios=(3, 2))
        _plot_distance(upper, results)
        _plot_bars(lower, results)
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=3, handlelength=2.5)
        return figure


def _plot_distance(axes: Axes, results: Sequence[TrackResult]) -> None:
    for result, dashes in zip(results, _dashes(results), strict=True):
        distance_mm = 1e3 * result.distance_m
        axes.semilogy(
            result.run.time_s,
            np.maximum(distance_mm, _FLOOR_MM),
            color=_colour(result),
            linestyle=dashes,
            linewidth=0.9,
            label=_label(result),
        )
    axes.set_ylabel("distance from the reference (mm)")
    axes.set_ylim(bottom=_FLOOR_MM)
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, max(float(result.run.time_s[-1]) for result in results))


def _plot_bars(axes: Axes, results: Sequence[TrackResult]) -> None:
    """Horizontal bars of the rms distance, over all axes of the tool, annotated with the torque increment."""
    position = np.arange(len(results))[::-1]
    rms_mm = np.array([1e3 * result.metrics.rms_tool_m for result in results])
    hatches = ["" if dashes == "-" else "///" for dashes in _dashes(results)]
    colours = [_colour(result) for result in results]
    axes.barh(position, rms_mm, height=0.62, color=colours, hatch=hatches, edgecolor="white", linewidth=0.0, log=True)
    for y, value, result in zip(position, rms_mm, results, strict=True):
        note = f" {value:.3g} mm, {result.metrics.rms_torque_increment_nm:.3g} N m per sample"
        axes.text(value, y, note, va="center", fontsize=8)
    axes.set_yticks(position, [_label(result) for result in results])
    axes.set_xlim(0.3 * float(rms_mm.min()), 60.0 * float(rms_mm.max()))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("rms distance from the reference (mm); rms torque increment beside it")


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
