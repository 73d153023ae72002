"""Figure of the constraint of a closed mechanism over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.figures.style import JOINT_COLOURS, legend_above, new_figure, style
from quasilpv.figures.tracking import label_time

SMALLEST_DRAWN = 1e-18
"""What an error of exactly zero is drawn as."""


def constraint_figure(errors: Mapping[str, tuple[FloatArray, FloatArray]], label: str, title: str) -> Figure:
    """Draw constraint errors over time on a logarithmic axis.

    Args:
        errors: (time_s, error), (N,) each, by what the legend calls them.
        label: of the axis, with its unit.
        title: of the figure.
    """
    with style():
        figure = new_figure(3.0, title)
        axes = figure.subplots()
        for colour, (name, (time_s, error)) in zip(JOINT_COLOURS, errors.items(), strict=False):
            text = f"{name}, largest {error.max():.1e}"
            axes.semilogy(time_s, np.maximum(error, SMALLEST_DRAWN), color=colour, linewidth=0.7, label=text)
            label_time(axes, time_s)
        axes.set_ylabel(label)
        legend_above(axes)
        return figure
