"""A general system in closed loop: signals between their limits, the Lyapunov function, the region in a plane."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.defaults import DEFAULT_FORMATS
from quasilpv.documents.system_artifact import Signal
from quasilpv.experiments.system_grid import SystemGrid
from quasilpv.experiments.system_run import SystemRun
from quasilpv.figures.style import BLACK, BLUE, GREEN, REFERENCE_COLOUR, VERMILION, new_figure, save, style

MOST_PLANES = 6
CLOSE = 3.0
"""A limit is drawn if the signal comes within so many times its own largest magnitude."""


def draw_system_run(run: SystemRun, folder: Path, formats: Sequence[str] = DEFAULT_FORMATS) -> list[Path]:
    """Write both figures of a run; paths as `save`."""
    written = save(signals_figure(run), folder / "signals", formats)
    return [*written, *save(region_figure(run), folder / "region", formats)]


def signals_figure(run: SystemRun) -> Figure:
    """States, inputs and V against time; limits dashed where they are near."""
    artifact = run.artifact
    signals = [*artifact.states, *artifact.inputs]
    values = np.hstack([run.state, run.input])
    exact = run.scenario.has_exact_sensors
    rows = len(signals) + 1
    with style():
        title = "the nonlinear plant under the sampled law"
        if run.exit is not None:
            title = f"{run.exit[1]} leaves its domain at {run.exit[0]:.6g} s"
        figure = new_figure(1.0 + 1.05 * rows, f"{artifact.name}: {title}")
        axes = figure.subplots(rows, 1, sharex=True)
        for k, signal in enumerate(signals):
            is_input = signal.role == "input"
            draw = axes[k].step if is_input else axes[k].plot
            where = {"where": "post"} if is_input else {}
            if not is_input and np.any(run.measured[:, k] != run.state[:, k]):
                axes[k].plot(run.time_s, run.measured[:, k], ".", color=REFERENCE_COLOUR, markersize=2.5)
            draw(run.time_s, values[:, k], color=VERMILION if is_input else BLUE, **where)
            _limits(axes[k], signal, values[:, k])
            axes[k].set_ylabel(_name(signal), rotation=0, ha="right", va="center")
        level = np.maximum(run.level, 1e-12)
        axes[-1].semilogy(run.time_s, level, color=GREEN)
        axes[-1].axhline(1.0, color=BLACK, linewidth=0.8, linestyle=(0, (4, 2)))
        axes[-1].set_ylim(bottom=max(float(level.min()) / 2.0, 1e-10))
        axes[-1].set_ylabel("V", rotation=0, ha="right", va="center")
        told = "" if exact else ", measured grey"
        if artifact.observer is not None:
            told = ", measured or estimated grey"
        axes[-1].set_xlabel(f"time (s); states blue{told}, inputs red, V ≤ 1 in the region, limits dashed")
        return figure


def _name(signal: Signal) -> str:
    """With its unit, if it has one."""
    return signal.name if signal.unit in ("", "1") else f"{signal.name} ({signal.unit})"


def _limits(axes: Axes, signal: Signal, values: FloatArray) -> None:
    axes.axhline(signal.trim, color=REFERENCE_COLOUR, linewidth=0.6)
    reach = max(float(np.abs(values - signal.trim).max()), 1e-300)
    for bound in (signal.low, signal.high):
        if bound is not None and abs(bound) < CLOSE * reach:
            axes.axhline(bound + signal.trim, color=BLACK, linewidth=0.8, linestyle=(0, (4, 2)))


def planes_of(run: SystemRun) -> list[tuple[int, int]]:
    """The pairs of differential states whose planes `region_figure` shows, in the order of its plots."""
    return list(combinations(range(run.artifact.model.differential), 2))[:MOST_PLANES] or [(0, 0)]


def region_figure(run: SystemRun, *, faint: bool = False) -> Figure:
    """The region in planes of two differential states: its shadow, its cut through the trim, the domain, the run.

    Args:
        run: what is drawn.
        faint: draw the run as where it will pass, and no start.
    """
    artifact = run.artifact
    pairs = planes_of(run)
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    P = np.array(artifact.region.lyapunov)
    with style():
        figure = new_figure(0.9 + 2.4 * rows, f"{artifact.name}: the region that no solution leaves, proved")
        plots = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
        for axes, pair in zip(plots, pairs, strict=False):
            _plane(axes, run, P, pair, faint=faint)
        for axes in plots[len(pairs) :]:
            axes.set_axis_off()
        handles, labels = plots[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        return figure


def draw_region(axes: Axes, run: SystemRun) -> None:
    """The same in the plane of the first two differential states, into a plot."""
    pair = (0, min(1, run.artifact.model.differential - 1))
    _plane(axes, run, np.array(run.artifact.region.lyapunov), pair, faint=False)
    axes.legend()


def _plane(axes: Axes, run: SystemRun, P: FloatArray, pair: tuple[int, int], *, faint: bool) -> None:
    i, j = pair
    states = run.artifact.states
    centre = np.array([states[i].trim, states[j].trim])
    own = [i, j]
    shadow = _ellipse(P[np.ix_(own, own)]) if i != j else np.array([[-1.0, 1.0], [0.0, 0.0]]) * np.sqrt(P[i, i])
    cut = _ellipse(np.linalg.inv(np.linalg.inv(P)[np.ix_(own, own)])) if i != j else shadow
    if run.artifact.model.differential > len(set(pair)):
        axes.fill(*(centre[:, None] + shadow), color=BLUE, alpha=0.12, linewidth=0, label="its shadow")
    axes.fill(*(centre[:, None] + cut), color=BLUE, alpha=0.3, linewidth=0, label="the region, cut through the trim")
    dashes: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "linestyle": (0, (4, 2))}
    for draw, k in ((axes.axvline, i), (axes.axhline, j)):
        for end in _ends(states[k]):
            if np.isfinite(end):
                draw(end, **dashes)
    axes.plot([], [], label="domain", **dashes)
    axes.plot(run.state[:, i], run.state[:, j], color=VERMILION, label="the run", alpha=0.35 if faint else 1.0)
    if not faint:
        axes.plot(run.state[0, i], run.state[0, j], marker="o", markersize=3, color=VERMILION)
    axes.set_xlabel(_name(states[i]))
    axes.set_ylabel(_name(states[j]))


def grid_figure(grid: SystemGrid) -> Figure:
    """Where V falls least in a sample: the points of a grid check in planes of two differential states."""
    artifact, q = grid.artifact, grid.artifact.model.differential
    pairs = list(combinations(range(q), 2))[:MOST_PLANES] or [(0, 0)]
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    finite = np.where(np.isfinite(grid.growth), grid.growth, 1.0)
    order, P = np.argsort(finite), np.array(artifact.region.lyapunov)
    with style():
        delay = f" with {grid.delay_s:.3g} s of delay" if grid.delay_s else ""
        figure = new_figure(0.9 + 2.4 * rows, f"{artifact.name}: V+/V at {len(order)} points{delay} (sampled)")
        plots = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
        for axes, (i, j) in zip(plots, pairs, strict=False):
            states, place = artifact.states, grid.state[:, [i, j]]
            shadow = _ellipse(P[np.ix_([i, j], [i, j])]) if i != j else np.zeros((2, 0))
            axes.plot(*(np.array([[states[i].trim], [states[j].trim]]) + shadow), color=BLACK, linewidth=0.8)
            points = axes.scatter(*place[order].T, c=finite[order], s=4, cmap="viridis")
            axes.plot(*place[grid.worst], "x", color=VERMILION, markersize=6)
            axes.set_xlabel(_name(states[i]))
            axes.set_ylabel(_name(states[j]))
        for axes in plots[len(pairs) :]:
            axes.set_axis_off()
        figure.colorbar(points, ax=plots.tolist(), label="V+/V, the worst red")
        return figure


def _ellipse(P: FloatArray) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    return np.asarray(np.linalg.cholesky(P) @ np.stack([np.cos(angle), np.sin(angle)]))


def _ends(signal: Signal) -> tuple[float, float]:
    low = -np.inf if signal.low is None else signal.low
    high = np.inf if signal.high is None else signal.high
    return low + signal.trim, high + signal.trim
