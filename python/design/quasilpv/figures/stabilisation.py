"""Figures of plants that come to rest: an arm with the Lyapunov function of its certificate, and a rolling disc."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.experiments.run import Run
from quasilpv.figures.constraint import SMALLEST_DRAWN
from quasilpv.figures.style import BLUE, JOINT_COLOURS, REFERENCE_COLOUR, legend_below, new_figure, style
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
        legend_below(angle, columns=run.joints)
        for axes in (torque, energy):
            label_time(axes, run.time_s)
        return figure


def rolling_disc_figure(
    time_s: FloatArray, states: FloatArray, torque_nm: FloatArray, slip_m_s: FloatArray, title: str
) -> Figure:
    """Draw a rolling disc that comes to rest.

    Args:
        time_s: (N,).
        states: (N, 4) position of the centre (m), its speed (m/s), angular speed (rad/s), contact force (N).
        torque_nm: (N,).
        slip_m_s: (N,) absolute value of the algebraic equation, 0 while it rolls.
        title: of the figure.
    """
    with style():
        figure = new_figure(4.6, title)
        (moving, contact), (torque, slip) = figure.subplots(2, 2, sharex=True)
        for colour, values, label in zip(
            JOINT_COLOURS, states.T[:3], ("x₁ (m)", "x₂ (m/s)", "x₃ (rad/s)"), strict=False
        ):
            moving.plot(time_s, values, color=colour, label=label)
        moving.set_ylabel("x₁, x₂, x₃ (units beside)")
        moving.legend()
        contact.plot(time_s, states[:, 3], color=BLUE)
        contact.set_ylabel("contact force λ (N)")
        torque.plot(time_s, torque_nm, color=BLUE)
        torque.set_ylabel("torque u (N m)")
        slip.semilogy(time_s, np.maximum(slip_m_s, SMALLEST_DRAWN), color=BLUE, linewidth=0.7)
        slip.set_ylabel("|x₂ − r x₃| (m/s)")
        for axes in (torque, slip):
            label_time(axes, time_s)
        return figure
