"""The gate of elastic joints in one picture: how far the loop keeps from a root on the unit circle."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.certificate.gate.elastic import ElasticGate
from quasilpv.certificate.gate.two_mass import TwoMassExclusion
from quasilpv.figures.style import BLUE, VERMILION, legend_of_one_plot, one_plot, style

POINTS = 400
LOWEST_SHARE = 1e-3


def distance_figure(gate: ElasticGate, ax: Axes | None = None) -> Figure:
    """Distance of what a root needs from what the arms of the set have, over the frequency; no curve without a set.

    The gate passes if it is positive at every frequency; cells prove it, the points of the curve do not.

    Args:
        gate: the verdict.
        ax: draw into this plot.
    """
    rate = 1.0 / gate.loop.sample_period_s
    with style():
        figure, axes = one_plot(3.8, f"Exclusion of roots on the unit circle at {rate:g} Hz (numerical)", ax)
        if gate.plants is not None:
            rates = np.geomspace(LOWEST_SHARE, 1.0, POINTS) * np.pi * rate * (1.0 - 1e-12)
            left = TwoMassExclusion(gate.loop, gate.plants).distances(rates)
            axes.plot(rates, np.where(left > 0.0, left, np.nan), color=BLUE, label="distance left")
            for frequency in rates[left <= 0.0]:
                axes.axvline(frequency, color=VERMILION, linewidth=0.5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("frequency (rad/s)")
        axes.set_ylabel("distance, relative")
        legend_of_one_plot(figure, axes, 2, is_own=ax is None)
        return figure
