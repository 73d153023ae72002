"""The grid gate in one picture: how fast the worst loop of the grid decays or grows as the true inertia is scaled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from quasilpv.certificate.gate.elastic_grid import LABEL, ElasticGridGate
from quasilpv.certificate.gate.grid import GridGate, GrowthCurve
from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION, legend_of_one_plot, one_plot, style

_COLOURS = (GREEN, BLUE, VERMILION)
_TICKS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)


def growth_figure(gate: GridGate, curves: Sequence[GrowthCurve], ax: Axes | None = None) -> Figure:
    """Worst growth rate against a common factor on all true inertias, one curve per transport delay.

    The gate passes if the curves of no delay and of the specified delay are below zero at factor 1. The shaded factors
    are those at which the loop with the specified delay is stable.

    Args:
        gate: what it found.
        curves: of `growth_curves`, the shortest delay first.
        ax: draw into this plot.
    """
    with style():
        period = gate.plants.law.sample_period_s
        title = f"Worst growth rate of the frozen loop over the grid at {1.0 / period:g} Hz (no proof)"
        figure, axes = one_plot(3.8, title, ax)
        if gate.factors is not None:
            axes.axvspan(*gate.factors, color=ORANGE, alpha=0.2, linewidth=0, label="stable at the specified delay")
        for curve, colour in zip(curves, _COLOURS, strict=True):
            label = f"delay {curve.delay_s * 1e3:g} ms = {curve.delay_s / period:g} T"
            axes.plot(curve.factors, curve.rates_per_s, color=colour, marker=".", markersize=3, label=label)
        axes.axhline(0.0, color=BLACK, linewidth=0.8)
        axes.axvline(1.0, color=BLACK, linewidth=0.8, linestyle=(0, (4, 2)))
        decay = -min(float(curve.rates_per_s.min()) for curve in curves)
        axes.set_ylim(-1.3 * decay, 3.0 * decay)
        axes.set_xscale("log")
        axes.set_xlim(curves[0].factors[0], curves[0].factors[-1])
        axes.xaxis.set_major_locator(FixedLocator(_TICKS))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_xlabel("factor on the true inertia of every configuration and payload")
        axes.set_ylabel("worst growth rate (1/s)")
        legend_of_one_plot(figure, axes, 2, is_own=ax is None)
        return figure


def elastic_growth_figure(gate: ElasticGridGate, ax: Axes | None = None) -> Figure:
    """Growth rates of all loops of a grid of elastic arms, the largest first, one curve per stiffness and delay.

    The gate passes if all are below zero.

    Args:
        gate: what it found.
        ax: draw into this plot.
    """
    with style():
        title = f"Growth rates of frozen loops at {1.0 / gate.sample_period_s:g} Hz: {LABEL}"
        figure, axes = one_plot(3.8, title, ax)
        cases = dict.fromkeys((loop.gears, loop.delay_s) for loop in gate.loops)
        for (gears, delay_s), colour in zip(cases, (GREEN, BLUE, ORANGE, VERMILION), strict=False):
            rates = [own.growth_rate_per_s for own in gate.loops if (own.gears, own.delay_s) == (gears, delay_s)]
            label = f"{gears} gears, delay {delay_s * 1e3:g} ms"
            axes.plot(np.arange(1, len(rates) + 1), sorted(rates, reverse=True), color=colour, label=label)
        axes.axhline(0.0, color=BLACK, linewidth=0.8)
        axes.set_xlabel("loop")
        axes.set_ylabel("growth rate (1/s)")
        legend_of_one_plot(figure, axes, 2, is_own=ax is None)
        return figure
