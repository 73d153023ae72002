"""The table of tracking results."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from quasilpv.cli.console import print_note, print_table
from quasilpv.experiments.result import TrackResult

COLUMNS = (
    "controller",
    "rate\nHz",
    "rms X\nmm",
    "rms Y\nmm",
    "max X\nmm",
    "max Y\nmm",
    "torque\nrms N m",
    "increment\nrms N m",
    "speed error\nrms rad/s",
    "growth rate\n1/s",
)


COLUMNS_IN_SPACE = (
    "controller",
    "rate\nHz",
    "rms X\nµm",
    "rms Y\nµm",
    "rms Z\nµm",
    "rms tool\nµm",
    "max tool\nµm",
    "torque\nrms N m",
    "increment\nrms N m",
    "at a limit\n%",
)


def print_warnings(result: TrackResult, label: str = "") -> None:
    """Say on stderr where a run was outside of what is proved: at a limit, or outside the box of the premises.

    Args:
        result: of the run.
        label: what to call it; by default scenario and variant.
    """
    about = f"warning: {label or result.title}"
    if result.metrics.share_at_limit > 0.0:
        share = f"a torque or slew limit acted in {100.0 * result.metrics.share_at_limit:.3g} % of the samples"
        print_note(f"{about}: {share}; certificate and gate hold while none does")
    if (result.metrics.largest_premise_excess or 0.0) > 0.0:
        excess = f"a premise was outside its box by up to {result.metrics.largest_premise_excess:.3g} of its width"
        print_note(f"{about}: {excess}; certificate and gate hold inside")


def print_results(results: Sequence[TrackResult]) -> None:
    """Print one table per scenario on stdout."""
    for scenario in dict.fromkeys(result.scenario for result in results):
        own = [result for result in results if result.scenario == scenario]
        columns, row = layout(own[0])
        print_table(f"{scenario}, {own[0].plant} plant", columns, [row(result, result.variant.label) for result in own])


def layout(result: TrackResult) -> tuple[tuple[str, ...], Callable[[TrackResult, str], list[str]]]:
    """Columns and rows of the table that a result stands in: a tool in space has a third axis."""
    return (COLUMNS, cells) if result.metrics.rms_z_m is None else (COLUMNS_IN_SPACE, cells_in_space)


def cells_in_space(result: TrackResult, label: str) -> list[str]:
    """One row of `COLUMNS_IN_SPACE` under a label of its own."""
    metrics = result.metrics
    lengths = (metrics.rms_x_m, metrics.rms_y_m, metrics.rms_z_m or 0.0, metrics.rms_tool_m, metrics.max_tool_m)
    return [
        label,
        f"{result.rate_hz:g}",
        *(f"{1e6 * length:.3g}" for length in lengths),
        *(_torque(value) for value in (metrics.rms_torque_nm, metrics.rms_torque_increment_nm)),
        f"{100.0 * metrics.share_at_limit:.3g}",
    ]


def cells(result: TrackResult, label: str) -> list[str]:
    """One row of `COLUMNS` under a label of its own."""
    metrics, growth = result.metrics, result.worst_growth_rate_per_s
    lengths = (metrics.rms_x_m, metrics.rms_y_m, metrics.mav_x_m, metrics.mav_y_m)
    return [
        label,
        f"{result.rate_hz:g}",
        *(f"{1e3 * length:.3g}" for length in lengths),
        *(_torque(value) for value in (metrics.rms_torque_nm, metrics.rms_torque_increment_nm)),
        f"{metrics.rms_velocity_error_rad_s:.2g}",
        "-" if growth is None else f"{growth:.2f}",
    ]


def _torque(value_nm: float) -> str:
    """A torque, N m, in whole numbers from 100 on, with three digits below."""
    return f"{value_nm:.0f}" if value_nm >= 100.0 else f"{value_nm:.3g}"
