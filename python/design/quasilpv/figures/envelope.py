"""The operating envelope of a law against one of its runs."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.artifact.envelope import OperatingEnvelope
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION, new_figure, style

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits of exponents as plain text: the parser of mathematical text takes longer than the rest of the figure."""


def envelope_figure(result: TrackResult) -> Figure:
    """Per joint: the run in the operating domain with the tube of the stated margin, and its errors in two sets.

    Left: the angle, the tube ``r +- margin`` in which the errors of the box set stay, and the border of the domain.
    Middle: the errors of angle and speed against the torque set. Right: the same, closer, against the peak set of the
    smallest peak that accounts for the run's angle error, whose share of the largest peak the margin allows is printed;
    a dot is a sample, for a line between samples would be a scribble.

    Args:
        result: the run.

    Raises:
        ValueError: the artifact that ran states no envelope.
    """
    envelope = result.envelope
    if envelope is None:
        raise ValueError(f"{result.variant.controller} states no operating envelope")
    joints = result.run.joints
    with style():
        figure = new_figure(1.9 * joints + 0.75, f"{result.title}: operating envelope of the design model")
        grid = figure.subplots(joints, 3, squeeze=False, width_ratios=(1.25, 1.0, 1.0))
        for joint, (tube, wide, close) in enumerate(grid):
            _plot_tube(tube, result, envelope, joint)
            _plot_torque_set(wide, result, envelope, joint)
            _plot_peak_set(close, result, envelope, joint)
            tube.set_ylabel(f"joint {joint + 1} (rad)")
            wide.set_ylabel("speed error (rad/s)")
            close.set_ylabel("speed error (rad/s)")
        tube.set_xlabel("time (s)")
        wide.set_xlabel("angle error (mrad)")
        close.set_xlabel("angle error (µrad)")
        handles = {
            label: handle for axes in grid[0] for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, handlelength=2.2)
        return figure


def _plot_tube(axes: Axes, result: TrackResult, envelope: OperatingEnvelope, joint: int) -> None:
    time_s, run = result.run.time_s, result.run
    reference = run.reference_angle_rad[:, joint]
    margin = envelope.reference_margin_rad[joint]
    axes.fill_between(
        time_s, reference - margin, reference + margin, color=GREEN, alpha=0.2, linewidth=0, label="box set, tube"
    )
    axes.plot(time_s, run.true_angle_rad[:, joint], color=BLUE, linewidth=1.0, label="run")
    for border in envelope.angle_rad[joint]:
        axes.axhline(border, color=BLACK, linewidth=1.0, linestyle=(0, (4, 2)), label="operating domain")
    axes.set_xlim(0.0, float(time_s[-1]))
    low, high = envelope.angle_rad[joint]
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))


def _plot_torque_set(axes: Axes, result: TrackResult, envelope: OperatingEnvelope, joint: int) -> None:
    scale = envelope.torque.scale
    if scale is not None:
        border = envelope.torque.border(joint, float(scale[joint]))
        axes.fill(1e3 * border[:, 0], border[:, 1], facecolor=ORANGE, alpha=0.2)
        axes.plot(1e3 * border[:, 0], border[:, 1], color=ORANGE, label="torque set")
    angle, speed = _errors(result, joint)
    axes.plot(1e3 * angle, speed, color=BLUE, linewidth=0.6)


def _plot_peak_set(axes: Axes, result: TrackResult, envelope: OperatingEnvelope, joint: int) -> None:
    angle, speed = _errors(result, joint)
    peak = float(np.abs(angle).max()) / float(envelope.peak.angle_bound_rad[joint])
    border = envelope.peak.border(joint, peak)
    axes.fill(1e6 * border[:, 0], border[:, 1], facecolor=VERMILION, alpha=0.12)
    label = "peak set as wide as the run's angle error: a size, no bound"
    axes.plot(1e6 * border[:, 0], border[:, 1], color=VERMILION, label=label)
    axes.plot(1e6 * angle, speed, color=BLUE, linestyle="", marker=".", markersize=1.6, alpha=0.5, markeredgewidth=0)
    allowed = envelope.peak.largest_scale(envelope.reference_margin_rad)[joint]
    axes.set_title(f"{peak / allowed:.2%} of what\nthe margin allows", fontsize=8.0)


def _errors(result: TrackResult, joint: int) -> tuple[FloatArray, FloatArray]:
    run = result.run
    return (
        run.true_angle_rad[:, joint] - run.reference_angle_rad[:, joint],
        run.true_speed_rad_s[:, joint] - run.reference_speed_rad_s[:, joint],
    )
