"""Runs of one scenario side by side in motion: the robot, its tool under a magnifying glass, the error over time.

Errors of tens of micrometres are invisible on a robot of metres. Beside each robot the position of its tool relative to
the reference is therefore drawn at a scale of its own, with a ring of stated radius; below, the distances from the
reference share one logarithmic axis.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import LogLocator
from PIL import Image

from quasilpv.arrays import FloatArray
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.space import Viewpoint, draw_shadow, draw_skeleton, on_floor, space_axes
from quasilpv.figures.style import BLACK, BLUE, REFERENCE_COLOUR, VERMILION, WIDTH_IN, length_unit, style
from quasilpv.figures.tracking import AXES, plane_of
from quasilpv.files import write_atomically
from quasilpv.progress import Progress, no_progress

FRAMES_PER_SECOND = 20
PIXELS_PER_INCH = 100
HEIGHT_IN = 4.6
LAST_FRAME_S = 2.0
TRAIL_S = 0.3
COLOURS_IN_FILE = 96

RUN_COLOURS = (VERMILION, BLUE)
LOWEST_DISTANCE_UM = 1.0
SMALLEST_RING_M = 1e-9


def write_animation(
    results: Sequence[TrackResult],
    path: Path,
    progress: Progress = no_progress,
) -> int:
    """Write runs of one scenario side by side as a GIF that plays in real time.

    Args:
        results: two, of one scenario.
        path: of the file; missing folders are made.
        progress: called with (frames drawn, frames in all).

    Returns:
        Number of frames.

    Raises:
        InputError: the file cannot be written.
    """
    with style():
        film = Film(results)
        images = []
        for frame, time_s in enumerate(film.times_s):
            images.append(film.draw(float(time_s)))
            progress(frame + 1, film.times_s.size)
    write_gif(images, path)
    return len(images)


def write_gif(images: Sequence[Image.Image], path: Path) -> None:
    """Write frames as a GIF of `FRAMES_PER_SECOND`, the last one shown longer. InputError: it cannot be written."""
    # One palette for all frames, without dithering: what does not move does not flicker, and costs nothing.
    palette = images[-1].quantize(COLOURS_IN_FILE, method=Image.Quantize.FASTOCTREE)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    durations_ms = [1000 // FRAMES_PER_SECOND] * len(others) + [round(1000 * LAST_FRAME_S)]
    data = io.BytesIO()
    first.save(data, format="GIF", save_all=True, append_images=others, duration=durations_ms, loop=0)
    write_atomically({path: data.getvalue()})


class Film:
    """The figure, and what moves in it.

    Attributes:
        figure: its layout does not depend on time.
        times_s: of the frames.

    Args:
        results: as `write_animation`.
    """

    def __init__(self, results: Sequence[TrackResult]) -> None:
        """Draw what does not move."""
        duration_s = float(results[0].run.time_s[-1])
        self.times_s = np.append(np.arange(0.0, duration_s, 1.0 / FRAMES_PER_SECOND), duration_s)
        self.figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=PIXELS_PER_INCH)
        self._canvas = FigureCanvasAgg(self.figure)
        self._title = self.figure.suptitle("0.00 s", fontsize=10.5, x=0.01, ha="left")
        self._name = f"{results[0].scenario}, {results[0].plant} plant, {results[0].rate_hz:g} Hz"
        grid = self.figure.add_gridspec(
            2, 4, width_ratios=(2.0, 1.0) * 2, height_ratios=(2.4, 1.0), wspace=0.2, hspace=0.36
        )
        grid.update(left=0.08, right=0.985, top=0.89, bottom=0.1)
        distances = self.figure.add_subplot(grid[1, :])
        distances.set_yscale("log")
        distances.yaxis.set_major_locator(LogLocator(numticks=9))
        distances.set_xlim(0.0, duration_s)
        distances.set_xlabel("time (s)")
        distances.set_ylabel("tool error (µm)")
        postures = [skeleton_at(result, time_s) for result in results for time_s in self.times_s]
        corners = np.concatenate(postures)
        self._views = []
        largest_m = max(
            result.metrics.max_tool_m for result in results
        )  # one scale for all: they are beside each other
        for i, (result, colour) in enumerate(zip(results, RUN_COLOURS, strict=True)):
            panel = _space_panel if result.in_space else _plane_panel
            robot = panel(self.figure, grid[0, 2 * i], corners, result)
            glass = self.figure.add_subplot(grid[0, 2 * i + 1])
            if i:
                robot.tick_params(labelleft=False)
            self._views.append(_View(result, colour, (robot, glass, distances), largest_m))
        largest_um = max(float(view.distance_um.max()) for view in self._views)
        distances.set_ylim(LOWEST_DISTANCE_UM, 2.0 * max(largest_um, LOWEST_DISTANCE_UM))

    def draw(self, time_s: float) -> Image.Image:
        """The frame at a time."""
        self._title.set_text(f"{self._name}: t = {time_s:.2f} s")
        for view in self._views:
            view.show(time_s)
        self._canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(self._canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(pixels).convert("RGB")


class _View:
    """One run: robot, magnified tool, and its curve of the distance."""

    def __init__(self, result: TrackResult, colour: str, axes: tuple[Axes, Axes, Axes], largest_m: float) -> None:
        self._result, self._run = result, result.run
        self._plane = plane_of(result.reference_position_m)
        self._error = (result.tool_position_m - result.reference_position_m)[:, self._plane]
        self.distance_um = 1e6 * result.distance_m
        robot, glass, distances = axes
        self._draw_robot(robot, result, colour)
        self._draw_glass(glass, colour, result, largest_m)
        (self._curve,) = distances.plot([], [], color=colour, linewidth=0.9)

    def _draw_robot(self, axes: Axes, result: TrackResult, colour: str) -> None:
        with_or_without = "with" if result.variant.compensated else "without"
        axes.set_title(f"{with_or_without} disturbance compensation", color=colour)
        axes.plot(*result.reference_position_m.T, color=REFERENCE_COLOUR, linewidth=2.4, solid_capstyle="round")
        start = skeleton_at(result, 0.0)
        self._shadow = draw_shadow(axes, start) if result.in_space else None
        self._links = draw_skeleton(axes, start)
        (self._trace,) = axes.plot(*result.tool_position_m[:1].T, color=colour, linewidth=1.2)

    def _draw_glass(self, axes: Axes, colour: str, result: TrackResult, largest_m: float) -> None:
        rms_m = result.metrics.rms_tool_m
        own = length_unit(result.metrics.max_tool_m)
        unit = length_unit(largest_m)
        ring = _round_number(max(largest_m, SMALLEST_RING_M) * unit.factor)
        self._to_glass = unit.factor / ring
        plane = f" {AXES[self._plane[0]]}, {AXES[self._plane[1]]}" if result.in_space else ""
        caption = f"magnified{plane}:\nring {ring:g} {unit.name}\nrms {rms_m * own.factor:.3g} {own.name}"
        axes.text(0.0, -1.2, caption, ha="center", va="top", fontsize=8.0)
        angle = np.linspace(0.0, 2.0 * math.pi, 90)
        axes.plot(np.cos(angle), np.sin(angle), color=BLACK, linewidth=0.8)
        axes.plot([0.0], [0.0], marker="+", markersize=9.0, color=REFERENCE_COLOUR)
        (self._trail,) = axes.plot([], [], color=colour, linewidth=0.8)
        (self._dot,) = axes.plot([], [], color=colour, marker="o", markersize=4.0)
        axes.set_aspect("equal")
        axes.set_xlim(-1.1, 1.1)
        axes.set_ylim(-1.1, 1.1)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_axis_off()

    def show(self, time_s: float) -> None:
        """Move everything to a time."""
        now, past = sample_at(self._result, time_s), sample_at(self._result, max(time_s - TRAIL_S, 0.0))
        skeleton = skeleton_at(self._result, time_s)
        _move(self._links, skeleton)
        if self._shadow is not None:
            _move(self._shadow, on_floor(skeleton))
        _move(self._trace, self._result.tool_position_m[: now + 1])
        self._trail.set_data(*(self._to_glass * self._error[past : now + 1]).T)
        self._dot.set_data(*(self._to_glass * self._error[now : now + 1]).T)
        self._curve.set_data(self._run.time_s[: now + 1], self.distance_um[: now + 1])


def sample_at(result: TrackResult, time_s: float) -> int:
    """The sample of a run that is next to a time."""
    return min(round(time_s / result.run.sample_period_s), result.run.time_s.size - 1)


def skeleton_at(result: TrackResult, time_s: float) -> FloatArray:
    """Ends of the links at a time, points x 2 or points x 3, m."""
    return result.robot.skeleton(result.run.true_angle_rad[sample_at(result, time_s)])


def _plane_panel(figure: Figure, place: SubplotSpec, points: FloatArray, result: TrackResult) -> Axes:
    """Equal scales, and room for all points."""
    del result
    axes = figure.add_subplot(place)
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.08 * float((high - low).max())
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    axes.set_xlabel("X, Y (m)")
    return axes


def _space_panel(figure: Figure, place: SubplotSpec, points: FloatArray, result: TrackResult) -> Any:
    """The same in space, seen from before the path; no numbers, for which there is no room."""
    axes: Any = space_axes(figure, place, points, Viewpoint.of_path(result.reference_position_m), zoom=1.4)
    for axis, name in ((axes.xaxis, "X"), (axes.yaxis, "Y"), (axes.zaxis, "Z")):
        axis.set_ticklabels([])
        axis.set_label_text(name)
        axis.labelpad = -14.0
    return axes


def _move(line: Any, points: FloatArray) -> None:
    """Give a line other points, in a plane or in space."""
    (line.set_data if points.shape[1] == 2 else line.set_data_3d)(*points.T)


def _round_number(value: float) -> float:
    """The least of 1, 2 or 5 times a power of ten that is not below a positive value."""
    scale = 10.0 ** math.floor(math.log10(value))
    return scale * next(step for step in (1.0, 2.0, 5.0, 10.0) if value <= step * scale * (1 + 1e-12))
