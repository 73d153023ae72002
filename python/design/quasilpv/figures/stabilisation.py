"""Figure of an arm that comes to rest: angles, speeds, torques, and the Lyapunov function of the certificate."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from quasilpv.experiments.run import FloatArray, Run
from quasilpv.figures.style import BLUE, REFERENCE_COLOUR, new_figure, style
from quasilpv.figures.tracking import label_time, plot_joints


def regulation_figure(run: Run, lyapunov: FloatArray, decay_per_s: float, title: str) -> Figure:
    """Draw a run around theta = 0.

    Args:
        run: the record, N samples.
        lyapunov: (N,) V along the run.
        decay_per_s: alpha that the certificate states; ``V(0) exp(-2 alpha t)`` is drawn beside V.
        title: robot, law and rate.
    """
    with style():
        figure = new_figure(4.6, title)
        (angle, speed), (torque, energy) = figure.subplots(2, 2, sharex=True)
        for axes, values, label in (
            (angle, np.degrees(run.true_angle_rad), "angle (deg)"),
            (speed, np.degrees(run.true_speed_rad_s), "speed (deg/s)"),
            (torque, run.torque_nm, "torque (N m)"),
        ):
            plot_joints(axes, run.time_s, values)
            axes.set_ylabel(label)
        bound = lyapunov[0] * np.exp(-2.0 * decay_per_s * run.time_s)
        energy.semilogy(run.time_s, lyapunov, color=BLUE, label="V(x(t))")
        energy.semilogy(
            run.time_s, bound, color=REFERENCE_COLOUR, linestyle="--", label=f"V(0) exp(−{2.0 * decay_per_s:g} t)"
        )
        energy.set_ylabel("Lyapunov function V")
        energy.legend()
        figure.legend(*angle.get_legend_handles_labels(), loc="outside lower center", ncols=run.joints)
        for axes in (torque, energy):
            label_time(axes, run.time_s)
        return figure
