"""Controllers of one experiment side by side, a column each: path and errors, torques and speed estimates.

Each column has its own scale of errors: controllers differ by orders of magnitude, and on a common scale the best of
them would be a line on the axis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import (
    BLUE,
    JOINT_COLOURS,
    ORANGE,
    REFERENCE_COLOUR,
    VERMILION,
    legend_above,
    legend_below,
    length_unit,
    new_figure,
    style,
)
from quasilpv.figures.tracking import AXES, exaggeration, label_time, plane_of, plot_disturbance, plot_joints


def tracking_columns(results: Mapping[str, TrackResult], title: str) -> Figure:
    """Path of the tool with its error exaggerated, and the error along every axis over time.

    Args:
        results: by what their columns are called, at least one.
        title: plant, rate and whatever else the runs have in common.
    """
    with style():
        figure = new_figure(5.8, title)
        count = next(iter(results.values())).tool_position_m.shape[1]
        grid = figure.subplots(1 + count, len(results), squeeze=False, height_ratios=(1.5, *[1.0] * count))
        for column, (label, result) in zip(grid.T, results.items(), strict=True):
            _path(column[0], result, label)
            error = result.tool_position_m - result.reference_position_m
            unit = length_unit(float(np.abs(error).max()))
            for axes, shown, name in zip(column[1:], error.T * unit.factor, AXES, strict=False):
                axes.plot(result.run.time_s, shown, color=BLUE, linewidth=0.6)
                axes.set_ylabel(f"{name} error ({unit.name})")
                axes.set_title(f"rms {np.sqrt(np.mean(shown**2)):.3g}, max {np.abs(shown).max():.3g} {unit.name}")
                label_time(axes, result.run.time_s)
        legend_below(grid[0, 0], columns=2)
        return figure


def input_columns(results: Mapping[str, TrackResult], title: str) -> Figure:
    """Applied torque of every joint, and the error of the speeds the laws use; arguments as `tracking_columns`.

    A row has one scale, which torques of a column whose rms is twice the smallest one may leave.
    """
    joints = next(iter(results.values())).run.joints
    with style():
        figure = new_figure(1.25 * joints + 2.2, title)
        grid = figure.subplots(joints + 1, len(results), squeeze=False, sharex=True, sharey="row")
        for column, (label, result) in zip(grid.T, results.items(), strict=True):
            run, metrics = result.run, result.metrics
            for joint, axes in enumerate(column[:-1]):
                axes.plot(run.time_s, run.torque_nm[:, joint], color=JOINT_COLOURS[joint], linewidth=0.5)
            plot_joints(column[-1], run.time_s, run.estimated_speed_rad_s - run.true_speed_rad_s, linewidth=0.4)
            activity = f"per sample {metrics.rms_torque_increment_nm:.3g} N m"
            column[0].set_title(f"{label}\nrms {metrics.rms_torque_nm:.4g} N m\n{activity}")
            column[-1].set_title(f"rms {metrics.rms_velocity_error_rad_s:.2g} rad/s")
            label_time(column[-1], run.time_s)
        for joint, (axes, largest) in enumerate(zip(grid[:-1, 0], _common_scale(results), strict=True)):
            axes.set_ylim(-largest, largest)
            axes.set_ylabel(f"torque {joint + 1} (N m)")
        grid[-1, 0].set_ylabel("speed error (rad/s)")
        figure.align_ylabels()
        legend_below(grid[-1, 0], columns=joints)
        return figure


def speed_errors(without: TrackResult, observing: TrackResult, title: str) -> Figure:
    """Error of the estimated speed of every joint, without and with the disturbance in the observer.

    Args:
        without: the run without.
        observing: the run with it.
        title: of the figure.
    """
    joints = observing.run.joints
    with style():
        figure = new_figure(1.5 * joints + 0.8, title)
        for joint, axes in enumerate(figure.subplots(joints, 1, sharex=True, squeeze=False)[:, 0]):
            runs = (("without", without, ORANGE), ("with disturbance observer", observing, BLUE))
            for label, result, colour in runs:
                error = result.run.estimated_speed_rad_s[:, joint] - result.run.true_speed_rad_s[:, joint]
                rms = np.sqrt(np.mean(error**2))
                text = f"{label}, rms {rms:.2g} rad/s"
                axes.plot(result.run.time_s, error, color=colour, linewidth=0.8, label=text)
            axes.set_ylabel(f"joint {joint + 1} (rad/s)")
            legend_above(axes)
        figure.align_ylabels()
        label_time(axes, observing.run.time_s)
        return figure


def disturbance_estimates(results: Mapping[str, TrackResult], joint: int, title: str) -> Figure:
    """The true lumped disturbance on one joint and what each controller takes it for, a row each.

    Args:
        results: runs of laws that estimate one, by what their rows are called.
        joint: index.
        title: of the figure.

    Raises:
        ValueError: the law of a run estimates no disturbance.
    """
    with style():
        figure = new_figure(1.8 * len(results) + 0.8, title)
        for axes, (label, result) in zip(
            figure.subplots(len(results), 1, sharex=True, squeeze=False)[:, 0], results.items(), strict=True
        ):
            rms = plot_disturbance(axes, result, joint)
            axes.set_title(f"{label}: rms of the difference {rms}")
            legend_above(axes)
        label_time(axes, result.run.time_s)
        return figure


def _path(axes: Axes, result: TrackResult, label: str) -> None:
    plane = plane_of(result.reference_position_m)
    reference = result.reference_position_m[:, plane]
    error = result.tool_position_m[:, plane] - reference
    factor = exaggeration(error, reference)
    axes.plot(*reference.T, color=REFERENCE_COLOUR, linewidth=2.0, label="reference")
    axes.plot(*(reference + factor * error).T, color=VERMILION, linewidth=0.8, label="tool, error times the factor")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"{label}\nerror × {factor:g}")
    axes.set_xlabel(f"{AXES[plane[0]]} (m)")
    axes.set_ylabel(f"{AXES[plane[1]]} (m)")


def _common_scale(results: Mapping[str, TrackResult]) -> list[float]:
    """Per joint, a torque that holds every column but those whose rms is twice the smallest one or more."""
    smallest = min(result.metrics.rms_torque_nm for result in results.values())
    calm = [result.run.torque_nm for result in results.values() if result.metrics.rms_torque_nm < 2.0 * smallest]
    return [1.1 * max(float(np.abs(torque[:, joint]).max()) for torque in calm) for joint in range(calm[0].shape[1])]
