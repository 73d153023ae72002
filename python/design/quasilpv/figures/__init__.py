"""Figures of closed-loop runs: one style, readable in print and for colour-blind readers."""

from quasilpv.figures.comparison import comparison_figure
from quasilpv.figures.style import save
from quasilpv.figures.tracking import (
    disturbance_figure,
    error_figure,
    path_figure,
    torque_figure,
    velocity_figure,
)

__all__ = [
    "comparison_figure",
    "disturbance_figure",
    "error_figure",
    "path_figure",
    "save",
    "torque_figure",
    "velocity_figure",
]
