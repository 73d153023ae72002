"""What the plots of the view show, as numbers: curves over time, and the histogram of step times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray
from quasilpv.figures.style import BLACK, JOINT_COLOURS
from quasilpv.view.playback import Playback

MAX_POINTS = 400
HISTOGRAM_BINS = 40
_SLOWEST_SHARE = 0.999
"""Of the steps that the histogram shows: the last ones would squeeze it into its left end."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Lines that share one plot.

    Attributes:
        title: of the plot, unit included.
        labels: of the lines.
        colours: of the lines.
        rows: (K,) samples that are drawn.
        time_s: (K,) of these samples.
        values: (K, lines), finite.
        dashed: which lines are dashed; none by default.
    """

    title: str
    labels: Sequence[str]
    colours: Sequence[str]
    rows: npt.NDArray[np.int64]
    time_s: FloatArray
    values: FloatArray
    dashed: Sequence[bool] = ()

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest value with some room, so that the axis keeps still while the curves grow."""
        low, high = float(self.values.min()), float(self.values.max())
        room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        return low - room, high + room

    def until(self, sample: int) -> tuple[FloatArray, ...]:
        """Times and values of every line up to a sample; at least the first point."""
        count = max(int(np.searchsorted(self.rows, sample, side="right")), 1)
        return self.time_s[:count], *(np.ascontiguousarray(column) for column in self.values[:count].T)


def curves_of(playback: Playback) -> tuple[Curves, ...]:
    """Errors, torques, disturbances, premise weights and Lyapunov function of a motion, each if there are any."""
    motion = playback.motion
    rows = np.unique(np.linspace(0, motion.samples - 1, MAX_POINTS).astype(np.int64))
    joints = [f"joint {k + 1}" for k in range(motion.angle_rad.shape[1])]
    error = (motion.angle_rad - motion.reference_angle_rad)[rows]
    unit, factor = ("mrad", 1e3) if np.nanmax(np.abs(error)) >= 1e-4 else ("µrad", 1e6)

    def curves(title: str, values: FloatArray, labels: Sequence[str] = joints) -> Curves:
        colours = [JOINT_COLOURS[k % len(JOINT_COLOURS)] for k in range(len(labels))]
        return Curves(title, labels, colours, rows, motion.time_s[rows], np.nan_to_num(values))

    plots = [curves(f"joint error ({unit})", factor * error), curves("torque (N m)", motion.torque_nm[rows])]
    if np.any(motion.estimate):
        plots.append(
            _with_truth(curves("", motion.estimate[rows]), motion.disturbance[rows], playback.disturbance_unit)
        )
    if motion.weight.shape[1]:
        names = [f"premise {p + 1}" for p in range(motion.weight.shape[1])]
        plots.append(curves("weight of the upper vertex of each premise", motion.weight[rows], names))
    if np.any(np.isfinite(motion.lyapunov_rad2)):
        plots.append(curves("Lyapunov function, at least (rad²)", motion.lyapunov_rad2[rows, None], ["all joints"]))
    return tuple(plots)


def _with_truth(estimate: Curves, disturbance: FloatArray, unit: str) -> Curves:
    """Estimates, and the true disturbances as dashed black lines if they are known everywhere."""
    if not np.all(np.isfinite(disturbance)):
        return replace(estimate, title=f"estimated disturbance ({unit})")
    n = len(estimate.labels)
    return replace(
        estimate,
        title=f"disturbance ({unit}): estimates, true ones dashed",
        labels=[*estimate.labels, *(f"true {k + 1}" for k in range(n))],
        colours=[*estimate.colours, *[BLACK] * n],
        values=np.hstack([estimate.values, disturbance]),
        dashed=[False] * n + [True] * n,
    )


@dataclass(frozen=True, eq=False)
class Histogram:
    """Outline of a histogram.

    Attributes:
        title: with the number of steps and the largest time.
        edge: (2 B + 2,) times, us, ascending, each edge twice.
        count: (2 B + 2,) heights between them, 0 at both ends.
    """

    title: str
    edge: FloatArray
    count: FloatArray


def step_histogram(step_us: FloatArray) -> Histogram | None:
    """How long the control steps took; None if nothing was measured."""
    measured = step_us[step_us > 0.0]
    if not measured.size:
        return None
    end = max(float(np.quantile(measured, _SLOWEST_SHARE)), 1e-3)
    counts, edges = np.histogram(measured, HISTOGRAM_BINS, (0.0, end))
    median, largest = float(np.median(measured)), float(measured.max())
    title = f"step time (µs) of {measured.size} steps: median {median:.2g}, largest {largest:.3g}"
    outline = np.concatenate([[0], np.repeat(counts, 2), [0]]).astype(np.float64)
    return Histogram(title, np.repeat(edges, 2), outline)
