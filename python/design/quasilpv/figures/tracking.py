"""Figures of one closed-loop run: path, tool error, torques, disturbance and its estimate, speed estimate."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import uniform_filter1d

from quasilpv.arrays import FloatArray
from quasilpv.experiments.result import Disturbance, TrackResult
from quasilpv.figures.style import (
    BLACK,
    BLUE,
    JOINT_COLOURS,
    ORANGE,
    REFERENCE_COLOUR,
    VERMILION,
    WIDTH_IN,
    legend_above,
    length_unit,
    new_figure,
    style,
)

AXES = "XYZ"
"""Of the base."""

NARROWEST = 0.75
"""Of the sides of a path's plot, the shorter one in parts of the longer one."""

AROUND_IN = 1.05
"""Of a figure of paths, for title, legend and labels."""

MEAN_S = 0.05
"""Of a trace that is mostly noise."""

TALL = 3
"""So many panels stand one above the other; more stand in two columns."""


def plot_path(axes: Axes, result: TrackResult) -> None:
    """Draw the tool's path in the plane over its reference, m."""
    plane = plane_of(result.reference_position_m)
    axes.plot(*result.reference_position_m[:, plane].T, color=REFERENCE_COLOUR, linewidth=2.2, label="reference")
    axes.plot(*result.tool_position_m[:, plane].T, color=BLUE, linewidth=1.0, label="tool")
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(f"{AXES[plane[0]]} (m)")
    axes.set_ylabel(f"{AXES[plane[1]]} (m)")
    legend_above(axes)


def plot_error(axes: Axes, result: TrackResult) -> None:
    """Draw the distance of the tool from its reference over time."""
    distance = result.distance_m
    unit = length_unit(float(distance.max()))
    axes.plot(result.run.time_s, distance * unit.factor, color=BLUE, linewidth=0.8)
    axes.set_ylabel(f"distance from the reference ({unit.name})")
    label_time(axes, result.run.time_s)


def plot_torque(axes: Axes, result: TrackResult) -> None:
    """Draw the applied torque of every joint over time."""
    plot_joints(axes, result.run.time_s, result.run.torque_nm)
    axes.set_ylabel("torque (N m)")
    legend_above(axes)
    label_time(axes, result.run.time_s)


def plane_of(points: FloatArray) -> list[int]:
    """The two axes along which points (N, 2) or (N, 3) extend most, in their order."""
    extent = np.ptp(points, axis=0)
    return sorted(np.argsort(-extent, kind="stable")[:2].tolist())


def path_figure(result: TrackResult) -> Figure:
    """The tool's path in the plane over its reference, and the same path with the error exaggerated.

    The right panel draws reference + factor * (actual - reference): the factor, a round number printed in the legend,
    makes the largest deviation about a tenth of the path's extent, so that micrometres are seen where they happen;
    where the error is as large as that by itself there is no such panel. A path in space is seen along the axis of the
    base in which it extends least.
    """
    plane = plane_of(result.reference_position_m)
    reference, actual = result.reference_position_m[:, plane], result.tool_position_m[:, plane]
    error = actual - reference
    factor = exaggeration(error, reference)
    with style():
        figure = new_figure(4.0, f"{result.title}: path of the tool")
        panels = figure.subplots(1, 1 if factor == 1.0 else 2, sharex=True, sharey=True, squeeze=False)[0]
        for axes in panels:
            axes.plot(*reference.T, color=REFERENCE_COLOUR, linewidth=2.2, label="reference")
            axes.plot(*reference[0], marker="o", color=REFERENCE_COLOUR, markersize=4)
            axes.set_aspect("equal", adjustable="box")
            axes.set_xlabel(f"{AXES[plane[0]]} (m)")
            axes.xaxis.set_major_locator(MaxNLocator(4))
        panels[0].plot(*actual.T, color=BLUE, linewidth=1.0, label="tool")
        if factor != 1.0:
            panels[1].plot(*(reference + factor * error).T, color=VERMILION, label=f"tool, error × {factor:g}")
        panels[0].set_ylabel(f"{AXES[plane[1]]} (m)")
        for axes in panels:
            legend_above(axes)
        _widen(panels[0])
        side = np.ptp(panels[0].get_ylim()) / np.ptp(panels[0].get_xlim())
        width_in = (WIDTH_IN - AROUND_IN) / max(len(panels), 1.5)
        figure.set_figheight(float(side) * width_in + AROUND_IN)  # else a band stays empty above the plots
        return figure


def _widen(axes: Axes) -> None:
    """Room beside a path that is narrow, for the numbers below it."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    middle, half = limits.mean(axis=1), 0.5 * np.ptp(limits, axis=1)
    half = np.maximum(half, NARROWEST * half.max())
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])


def error_figure(result: TrackResult) -> Figure:
    """Position error of the tool along every axis over time, with its rms and maximum."""
    error = result.tool_position_m - result.reference_position_m
    unit = length_unit(float(np.max(np.abs(error))))
    with style():
        count = error.shape[1]
        figure = new_figure(1.9 * count, f"{result.title}: position error of the tool")
        for column, axes in enumerate(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]):
            shown = error[:, column] * unit.factor
            rms, peak = np.sqrt(np.mean(shown**2)), np.max(np.abs(shown))
            axes.axhspan(-rms, rms, color="#e8eef4", linewidth=0.0)
            axes.plot(result.run.time_s, shown, color=BLUE, linewidth=0.8)
            axes.set_ylabel(f"{AXES[column]} error ({unit.name})")
            axes.set_title(f"rms {rms:.3g} {unit.name} (shaded), largest {peak:.3g} {unit.name}")
        label_time(axes, result.run.time_s)
        return figure


def torque_figure(result: TrackResult) -> Figure:
    """Applied torque of every joint over time between its limits, and the increments from sample to sample."""
    run, n = result.run, result.run.joints
    columns = 1 if n <= TALL else 2
    rows = math.ceil(n / columns)
    with style():
        share = f"at a limit in {100.0 * result.metrics.share_at_limit:.3g} % of the samples"
        figure = new_figure(1.15 * rows + 2.0, f"{result.title}: applied torque, {share}")
        grid = figure.add_gridspec(rows + 1, columns, height_ratios=[*[1.0] * rows, 1.3])
        panels = [figure.add_subplot(grid[joint % rows, joint // rows]) for joint in range(n)]
        for joint, axes in enumerate(panels):
            _plot_between_limits(axes, result, joint)
            axes.tick_params(labelbottom=joint % rows == rows - 1 or joint == n - 1)
        lower = figure.add_subplot(grid[rows, :])
        plot_joints(lower, run.time_s[1:], np.diff(run.torque_nm, axis=0), linewidth=0.5)
        lower.set_ylabel("increment (N m)")
        lower.set_title(f"per sample, rms over the joints {result.metrics.rms_torque_increment_nm:.3g} N m")
        label_time(lower, run.time_s)
        figure.align_ylabels()
        return figure


def _plot_between_limits(axes: Axes, result: TrackResult, joint: int) -> None:
    torque, limit = result.run.torque_nm[:, joint], float(result.torque_limit_nm[joint])
    for side in (-limit, limit):
        axes.axhline(side, color=BLACK, linewidth=0.8, linestyle="--")
    axes.plot(result.run.time_s, torque, color=JOINT_COLOURS[joint], linewidth=0.9)
    axes.set_ylabel(f"joint {joint + 1} (N m)")
    used = 100.0 * float(np.abs(torque).max()) / limit
    axes.set_title(f"at most {used:.3g} % of {limit:g} N m (dashed)")
    axes.set_xlim(0.0, float(result.run.time_s[-1]))


def disturbance_figure(result: TrackResult) -> Figure:
    """The true lumped disturbance and its estimate, joint by joint, in the units of the controller's law.

    Raises:
        ValueError: the law of the run estimates no disturbance.
    """
    quantity = _true_disturbance(result).quantity
    with style():
        figure = new_figure(
            1.7 * result.run.joints + 0.6, f"{result.title}: disturbance as {quantity}, and its estimate"
        )
        for joint, axes in enumerate(figure.subplots(result.run.joints, 1, sharex=True, squeeze=False)[:, 0]):
            axes.set_title(f"rms of the difference {plot_disturbance(axes, result, joint)}")
            if joint == 0:
                legend_above(axes)
        figure.align_ylabels()
        label_time(axes, result.run.time_s)
        return figure


def velocity_figure(result: TrackResult) -> Figure:
    """Error of the joint speeds that the law used, estimated or measured and filtered, over time.

    The trace is light, for most of it is noise; over it its mean of the last `MEAN_S`.
    """
    error = result.run.estimated_speed_rad_s - result.run.true_speed_rad_s
    with style():
        figure = new_figure(1.4 * result.run.joints + 0.6, f"{result.title}: error of the joint speed the law used")
        samples = max(1, round(MEAN_S * result.rate_hz))
        for joint, axes in enumerate(figure.subplots(result.run.joints, 1, sharex=True, squeeze=False)[:, 0]):
            colour, own = JOINT_COLOURS[joint], error[:, joint]
            axes.plot(result.run.time_s, own, color=colour, linewidth=0.5, alpha=0.35)
            axes.plot(result.run.time_s, uniform_filter1d(own, samples), color=colour, linewidth=1.4)
            axes.set_ylabel(f"joint {joint + 1} (rad/s)")
            axes.set_title(f"rms {np.sqrt(np.mean(error[:, joint] ** 2)):.2g} rad/s")
        figure.align_ylabels()
        label_time(axes, result.run.time_s)
        return figure


def plot_disturbance(axes: Axes, result: TrackResult, joint: int) -> str:
    """Draw the true disturbance on one joint and its estimate; return the rms of their difference with its unit.

    Raises:
        ValueError: the law of the run estimates no disturbance.
    """
    disturbance = _true_disturbance(result)
    true, estimate = disturbance.values[:, joint], result.run.filtered_disturbance[:, joint]
    axes.plot(result.run.time_s, true, color=REFERENCE_COLOUR, linewidth=2.2, label="true")
    axes.plot(result.run.time_s, estimate, color=ORANGE, linewidth=0.7, label="estimate")
    axes.set_ylabel(f"joint {joint + 1} ({disturbance.unit})")
    return f"{np.sqrt(np.mean((estimate - true) ** 2)):.3g} {disturbance.unit}"


def _true_disturbance(result: TrackResult) -> Disturbance:
    if result.true_disturbance is None:
        raise ValueError(f"{result.variant.controller} estimates no disturbance")
    return result.true_disturbance


def plot_joints(axes: Axes, time_s: FloatArray, values: FloatArray, linewidth: float = 0.9) -> None:
    """Draw one line per column, in the colours of the joints."""
    for joint in range(values.shape[1]):
        colour = JOINT_COLOURS[joint]
        axes.plot(time_s, values[:, joint], color=colour, linewidth=linewidth, label=f"joint {joint + 1}")


def label_time(axes: Axes, time_s: FloatArray) -> None:
    """Label the axis of time and end it where the run ends."""
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, float(time_s[-1]))


def exaggeration(error: FloatArray, reference: FloatArray) -> float:
    """The round factor (1, 2 or 5 times a power of ten) that makes the largest error about a tenth of the extent."""
    largest = float(np.max(np.linalg.norm(error, axis=1)))
    extent = float(np.max(np.ptp(reference, axis=0)))
    if largest == 0.0 or 0.1 * extent <= largest:
        return 1.0
    exponent = math.floor(math.log10(0.1 * extent / largest))
    scale = 10.0**exponent
    return max(step for step in (1.0, 2.0, 5.0) if step * scale <= 0.1 * extent / largest * (1 + 1e-12)) * scale
