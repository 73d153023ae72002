"""All figures of a run, and of a scenario, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from quasilpv.experiments.result import TrackResult
from quasilpv.figures.comparison import comparison_figure
from quasilpv.figures.envelope import envelope_figure
from quasilpv.figures.style import DEFAULT_FORMATS, save
from quasilpv.figures.tracking import (
    disturbance_figure,
    error_figure,
    path_figure,
    torque_figure,
    velocity_figure,
)


def write_gallery(result: TrackResult, folder: Path, formats: Sequence[str] = DEFAULT_FORMATS) -> list[Path]:
    """Write path, errors, torques, speed error and, if the law has them, disturbance and operating envelope of a run.

    Returns:
        The files, one per figure and format.

    Raises:
        InputError: the folder cannot be written.
    """
    figures = {
        "path": path_figure,
        "errors": error_figure,
        "torques": torque_figure,
        "velocity": velocity_figure,
    }
    if result.true_disturbance is not None:
        figures["disturbance"] = disturbance_figure
    if result.envelope is not None:
        figures["envelope"] = envelope_figure
    return [file for name, draw in figures.items() for file in save(draw(result), folder / name, formats)]


def write_comparison(
    results: Sequence[TrackResult], folder: Path, formats: Sequence[str] = DEFAULT_FORMATS
) -> list[Path]:
    """Write the comparison of all runs of one scenario.

    Raises:
        InputError: the folder cannot be written.
    """
    return save(comparison_figure(results), folder / "comparison", formats)
