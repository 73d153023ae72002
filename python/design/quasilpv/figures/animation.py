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

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from PIL import Image

from quasilpv.arrays import FloatArray
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import BLACK, BLUE, REFERENCE_COLOUR, VERMILION, WIDTH_IN, length_unit, style
from quasilpv.files import write_atomically
from quasilpv.progress import Progress, no_progress
from quasilpv.systems.robots.mechanism import PlanarMechanism

FRAMES_PER_SECOND = 20
PIXELS_PER_INCH = 100
HEIGHT_IN = 4.6
LAST_FRAME_S = 2.0
TRAIL_S = 0.3
COLOURS_IN_FILE = 96

RUN_COLOURS = (VERMILION, BLUE)
LINK_COLOUR = "#4d5a66"
LOWEST_DISTANCE_UM = 1.0
SMALLEST_RING_M = 1e-9


def write_animation(
    results: Sequence[TrackResult],
    robot: PlanarMechanism,
    path: Path,
    progress: Progress = no_progress,
) -> int:
    """Write runs of one scenario side by side as a GIF that plays in real time.

    Args:
        results: two, of one scenario.
        robot: the plant whose links are drawn.
        path: of the file; missing folders are made.
        progress: called with (frames drawn, frames in all).

    Returns:
        Number of frames.

    Raises:
        InputError: the file cannot be written.
    """
    with style():
        film = Film(results, robot)
        images = []
        for frame, time_s in enumerate(film.times_s):
            images.append(film.draw(float(time_s)))
            progress(frame + 1, film.times_s.size)
    # One palette for all frames, without dithering: what does not move does not flicker, and costs nothing.
    palette = images[-1].quantize(COLOURS_IN_FILE, method=Image.Quantize.FASTOCTREE)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    durations_ms = [1000 // FRAMES_PER_SECOND] * len(others) + [round(1000 * LAST_FRAME_S)]
    data = io.BytesIO()
    first.save(data, format="GIF", save_all=True, append_images=others, duration=durations_ms, loop=0)
    write_atomically({path: data.getvalue()})
    return len(images)


class Film:
    """The figure, and what moves in it.

    Attributes:
        figure: its layout does not depend on time.
        times_s: of the frames.

    Args:
        results, robot: as `write_animation`.
    """

    def __init__(self, results: Sequence[TrackResult], robot: PlanarMechanism) -> None:
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
        self._views = []
        for i, (result, colour) in enumerate(zip(results, RUN_COLOURS, strict=True)):
            panels = [self.figure.add_subplot(grid[0, 2 * i + column]) for column in (0, 1)]
            self._views.append(_View(result, robot, colour, (panels[0], panels[1], distances)))
        corners = np.concatenate([view.skeleton(time_s) for view in self._views for time_s in self.times_s])
        for view in self._views:
            _fit(view.robot_axes, corners)
        for view in self._views[1:]:
            view.robot_axes.tick_params(labelleft=False)
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

    def __init__(self, result: TrackResult, robot: PlanarMechanism, colour: str, axes: tuple[Axes, Axes, Axes]) -> None:
        self._run, self._robot = result.run, robot
        self._tool = result.tool_position_m
        self._error = result.tool_position_m - result.reference_position_m
        self.distance_um = 1e6 * np.hypot(*self._error.T)
        self.robot_axes, glass, distances = axes
        self._draw_robot(result, colour)
        self._draw_glass(glass, colour, math.hypot(result.metrics.rms_x_m, result.metrics.rms_y_m))
        (self._curve,) = distances.plot([], [], color=colour, linewidth=0.9)

    def _draw_robot(self, result: TrackResult, colour: str) -> None:
        axes = self.robot_axes
        with_or_without = "with" if result.variant.compensated else "without"
        axes.set_title(f"{with_or_without} disturbance compensation", color=colour)
        axes.plot(*result.reference_position_m.T, color=REFERENCE_COLOUR, linewidth=2.4, solid_capstyle="round")
        (self._links,) = axes.plot(
            [], [], color=LINK_COLOUR, linewidth=4.0, marker="o", markersize=5.0, markerfacecolor="white"
        )
        (self._trace,) = axes.plot([], [], color=colour, linewidth=1.2)
        axes.set_xlabel("X, Y (m)")

    def _draw_glass(self, axes: Axes, colour: str, rms_m: float) -> None:
        largest_m = float(np.hypot(*self._error.T).max())
        unit = length_unit(largest_m)
        ring = _round_number(max(largest_m, SMALLEST_RING_M) * unit.factor)
        self._to_glass = unit.factor / ring
        caption = f"magnified:\nring {ring:g} {unit.name}\nrms {rms_m * unit.factor:.3g} {unit.name}"
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

    def _sample(self, time_s: float) -> int:
        return min(round(time_s / self._run.sample_period_s), self._run.time_s.size - 1)

    def skeleton(self, time_s: float) -> FloatArray:
        """Ends of the links at a time, points x 2, m."""
        return self._robot.skeleton(self._run.true_angle_rad[self._sample(time_s)])

    def show(self, time_s: float) -> None:
        """Move everything to a time."""
        now, past = self._sample(time_s), self._sample(max(time_s - TRAIL_S, 0.0))
        self._links.set_data(*self.skeleton(time_s).T)
        self._trace.set_data(*self._tool[: now + 1].T)
        self._trail.set_data(*(self._to_glass * self._error[past : now + 1]).T)
        self._dot.set_data(*(self._to_glass * self._error[now : now + 1]).T)
        self._curve.set_data(self._run.time_s[: now + 1], self.distance_um[: now + 1])


def _fit(axes: Axes, points: FloatArray) -> None:
    """Equal scales, and room for all points."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.08 * float((high - low).max())
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)


def _round_number(value: float) -> float:
    """The least of 1, 2 or 5 times a power of ten that is not below a positive value."""
    scale = 10.0 ** math.floor(math.log10(value))
    return scale * next(step for step in (1.0, 2.0, 5.0, 10.0) if value <= step * scale * (1 + 1e-12))
