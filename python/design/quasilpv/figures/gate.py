"""The figure of a gate, whichever it is."""

from __future__ import annotations

from flint import fmpq
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv.certificate import Gate
from quasilpv.certificate.gate.elastic import ElasticGate
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
from quasilpv.certificate.gate.grid import GridGate, growth_curves
from quasilpv.certificate.gate.proof import RobustGate, margin_curve
from quasilpv.figures.distance import distance_figure
from quasilpv.figures.growth import elastic_growth_figure, growth_figure
from quasilpv.figures.margins import margin_figure

BEYOND_THE_MARGIN = fmpq(3, 2)
SHORTEST_CURVE_SAMPLES = fmpq(1)


def gate_figure(found: Gate, ax: Axes | None = None) -> Figure:
    """What a gate found: growth rates or the inertia margin over the delay; distances over the frequency."""
    if isinstance(found, ElasticGate):
        return distance_figure(found, ax)
    if isinstance(found, ElasticGridGate):
        return elastic_growth_figure(found, ax)
    if isinstance(found, GridGate):
        return growth_figure(found, growth_curves(found), ax)
    return margin_figure(found, margin_curve(found.loop, _longest_delay(found), lag_samples=found.lag[1]), ax)


def _longest_delay(gate: RobustGate) -> fmpq:
    """Well beyond the delay margin, samples."""
    longest = max(SHORTEST_CURVE_SAMPLES, gate.specified_delay_samples * 2)
    if gate.delays is not None and gate.delays.proved is not None:
        longest = max(longest, gate.delays.proved * BEYOND_THE_MARGIN)
    return longest
