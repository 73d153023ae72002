"""The robust gate in one picture: which inertia ratios the loop tolerates at each delay, and which ones occur."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import ArrayLike

from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.gate.proof import MarginCurve, RobustGate
from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION, legend_of_one_plot, one_plot, style

_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)


def margin_figure(gate: RobustGate, curve: MarginCurve, ax: Axes | None = None) -> Figure:
    """Inertia margin against transport delay, with the needed range, the specified delay and the delay margin.

    The gate passes if the band of needed ratios lies in the stable region from no delay to the specified one.

    Args:
        gate: the verdict.
        curve: the margin at a series of delays, from 0 to beyond the delay margin.
        ax: draw into this plot.
    """
    with style():
        rate = 1.0 / gate.loop.sample_period_s
        figure, axes = one_plot(3.8, f"Inertia margin of the frozen loop at {rate:g} Hz{_lag(gate)}", ax)
        _plot_margin(axes, curve)
        if gate.needed is not None:
            low, high = gate.needed.to_floats()
            # Hatched: over the area of the stable region a second colour would make a third.
            look: dict[str, Any] = {"facecolor": "none", "edgecolor": ORANGE, "hatch": "///", "linewidth": 0.8}
            axes.axhspan(low, high, zorder=0.9, label="needed range (proved)", **look)
        specified_ms = to_float(gate.specified_delay_samples) * 1e3 / rate
        axes.axvline(specified_ms, color=BLACK, linestyle=(0, (4, 2)), label="specified delay")
        if gate.delay_margin_s is not None:
            axes.axvline(gate.delay_margin_s * 1e3, color=VERMILION, label="delay margin (proved)")
        _label(axes, curve, rate)
        legend_of_one_plot(figure, axes, 3, is_own=ax is None)
        return figure


def _lag(gate: RobustGate) -> str:
    return f", drives that lag by {gate.lag_s[1] * 1e3:.3g} ms" if gate.lag[1] > 0 else ""


def _plot_margin(axes: Axes, curve: MarginCurve) -> None:
    """The stable region as an area between its limits; it ends where the loop is unstable at ``M_t = M_n``."""
    delay_ms = curve.delay_s * 1e3
    ceiling = 1.5 * float(np.max(curve.highest, initial=1.0, where=np.isfinite(curve.highest)))
    highest = np.minimum(curve.highest, ceiling)
    axes.fill_between(delay_ms, curve.lowest, highest, color=GREEN, alpha=0.18, linewidth=0, label="stable (proved)")
    axes.plot(delay_ms, highest, color=BLUE)
    axes.plot(delay_ms, curve.lowest, color=BLUE, label="inertia margin")


def _label(axes: Axes, curve: MarginCurve, rate: float) -> None:
    axes.set_yscale("log")
    axes.set_yticks(_TICKS)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    limits = np.concatenate([curve.lowest, curve.highest, [1.0]])
    limits = limits[np.isfinite(limits) & (limits > 0)]
    axes.set_ylim(0.7 * float(limits.min()), 1.4 * float(limits.max()))
    axes.set_xlim(0.0, float(curve.delay_s[-1]) * 1e3)
    axes.set_xlabel("constant transport delay (ms)")
    axes.set_ylabel(r"true over design inertia, $M_t/M_n$")
    per_ms = rate / 1e3

    def to_samples(value: ArrayLike) -> ArrayLike:
        return np.asarray(value, dtype=float) * per_ms

    def to_ms(value: ArrayLike) -> ArrayLike:
        return np.asarray(value, dtype=float) / per_ms

    axes.secondary_xaxis("top", functions=(to_samples, to_ms)).set_xlabel("samples")
