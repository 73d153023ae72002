"""All figures of a run, and of a scenario, as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from quasilpv.defaults import DEFAULT_FORMATS
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.comparison import comparison_figure
from quasilpv.figures.envelope import envelope_figure
from quasilpv.figures.robot import robot_figure
from quasilpv.figures.style import save
from quasilpv.figures.tracking import (
    disturbance_figure,
    error_figure,
    path_figure,
    torque_figure,
    velocity_figure,
)

FIGURES: Mapping[str, Callable[[TrackResult], Figure]] = {
    "robot": robot_figure,
    "path": path_figure,
    "errors": error_figure,
    "torques": torque_figure,
    "velocity": velocity_figure,
    "disturbance": disturbance_figure,
    "envelope": envelope_figure,
}
"""All figures of a run, by name."""


def figures_of(result: TrackResult) -> list[str]:
    """Names of the figures that a run has: of the robot in space only, others only if its law knows what they show."""
    missing = {
        "robot": not result.in_space,
        "disturbance": result.true_disturbance is None,
        "envelope": result.envelope is None,
    }
    return [name for name in FIGURES if not missing.get(name)]


def write_gallery(result: TrackResult, folder: Path, formats: Sequence[str] = DEFAULT_FORMATS) -> list[Path]:
    """Write the figures of a run: see `figures_of`.

    Returns:
        The files, one per figure and format.

    Raises:
        InputError: the folder cannot be written.
    """
    drawn = {name: FIGURES[name](result) for name in figures_of(result)}
    return [file for name, figure in drawn.items() for file in save(figure, folder / name, formats)]


def write_comparison(
    results: Sequence[TrackResult], folder: Path, formats: Sequence[str] = DEFAULT_FORMATS
) -> list[Path]:
    """Write the comparison of all runs of one scenario.

    Raises:
        InputError: the folder cannot be written.
    """
    return save(comparison_figure(results), folder / "comparison", formats)
