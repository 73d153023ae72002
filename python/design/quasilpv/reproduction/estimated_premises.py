"""Table III.3 with its constants, and the observer the source names as a perspective: scheduled with estimates."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.figures.style import BLUE, GREEN, ORANGE, VERMILION, legend_below, new_figure, style
from quasilpv.reproduction import rules
from quasilpv.reproduction.item import Check, Effort, Finding, Item
from quasilpv.reproduction.observers.eigenvalue_bounds import Bound
from quasilpv.reproduction.observers.speed_estimates import Observer, speed_errors
from quasilpv.reproduction.observers.speed_observer import SpeedObserver, speed_observer
from quasilpv.reproduction.observers.velocity_classes import VelocityClasses
from quasilpv.scenarios import tracking_experiment
from quasilpv.systems.robots.registry import robot

GAMMA_2 = (-75.0, -25.0, 25.0, 75.0)
"""Values of the second constant of quadratic inner-boundedness, N m s/rad."""

DECAYS_PER_S = (20.0, 40.0)
SAMPLE_PERIOD_S = 1e-3
STEP_S = {Effort.QUICK: 1e-3, Effort.FULL: 5e-4}
FIRST_ERROR_RAD_S = 0.5
SETTLED_S = 0.5
"""Root mean squares are taken from here on."""


@cache
def _classes() -> VelocityClasses:
    arm = robot("arm3")
    return VelocityClasses(arm.model, arm.domain)


def _document(bound: Bound) -> dict[str, float | int]:
    return {"proved": bound.proved, "attained": bound.attained, "ratio": bound.tightness, "cells": bound.cells}


def _table_iii3(effort: Effort) -> Finding:
    classes = _classes()
    low, high = classes.jacobian_bounds
    lipschitz, one_sided = classes.lipschitz, classes.one_sided
    chosen = GAMMA_2 if effort is Effort.FULL else GAMMA_2[:2]
    inner = {gamma_2: classes.inner_bounded(gamma_2) for gamma_2 in chosen}
    computed: dict[str, Any] = {
        "bounded Jacobian, N m s/rad": {"lower": low.tolist(), "upper": high.tolist()},
        "Lipschitz, N m s/rad": _document(lipschitz),
        "one-sided Lipschitz, N m s/rad": _document(one_sided),
        "quadratically inner-bounded, gamma_1 by gamma_2": {f"{g:g}": _document(bound) for g, bound in inner.items()},
        "quadratically bounded, N m s/rad": _document(classes.bounded),
        "Lipschitz in the norm of the kinetic energy, 1/s": _document(classes.energy),
    }
    excess = max(bound.tightness for bound in (lipschitz, one_sided, classes.energy))
    least = min(bound.attained for bound in inner.values())
    ends = f"{np.sqrt(least):.4g} against {lipschitz.proved:.4g} N m s/rad"
    checks = [
        rules.fact(
            "the velocity torque is in all five classes on the operating domain",
            bool(np.isfinite([*low.ravel(), *high.ravel(), lipschitz.proved, one_sided.proved]).all()),
            f"Lipschitz {lipschitz.proved:.4g}, one-sided {one_sided.proved:.4g},"
            f" quadratic {classes.bounded.proved:.4g} N m s/rad",
        ),
        rules.fact("(own) proved constants exceed attained values by at most 1 %", excess < 1.01, f"{excess:.4f}"),
        rules.fact(
            "(own) a second constant of inner-boundedness never gives less than the Lipschitz constant",
            least >= lipschitz.attained**2,
            f"least sqrt(gamma_1) {ends}",
        ),
    ]
    words = (
        f"Proved on the operating domain, in N m s/rad: Lipschitz {lipschitz.proved:.4g}, one-sided Lipschitz"
        f" {one_sided.proved:.4g}, quadratically bounded {classes.bounded.proved:.4g}; in the norm of the kinetic"
        f" energy the acceleration is Lipschitz with {classes.energy.proved:.4g} 1/s. The torque is quadratic in the"
        " speeds, so these are suprema of its Jacobian, with no gap; the set of Jacobians is that of their negatives,"
        " so one-sided and inner-bounded classes give an observer nothing the Lipschitz class does not"
    )
    return Finding(checks, computed, {"": _constants_figure(classes)}, instead=words)


def _constants_figure(classes: VelocityClasses) -> Figure:
    """Intervals of the entries of the Jacobian, and the constants beside what is attained."""
    low, high = (bounds.ravel() for bounds in classes.jacobian_bounds)
    n = classes.mechanism.joints
    names = [f"df{i + 1}/dw{j + 1}" for i in range(n) for j in range(n)]
    bounds = {
        "Lipschitz": classes.lipschitz,
        "one-sided\nLipschitz": classes.one_sided,
        "quadratically\nbounded": classes.bounded,
    }
    with style():
        figure = new_figure(3.4, "arm3: velocity torque f = -N(theta, w) w on the operating domain, proved constants")
        left, right = figure.subplots(1, 2)
        place = np.arange(len(names))
        left.barh(place, high - low, left=low, color=BLUE, height=0.6)
        left.set_yticks(place, names)
        left.invert_yaxis()
        left.set_xlim(1.1 * low.min(), 1.1 * high.max())
        left.set_xlabel("bounded Jacobian (N m s/rad)")
        columns = np.arange(len(bounds))
        right.bar(columns - 0.18, [b.proved for b in bounds.values()], 0.34, color=BLUE, label="proved")
        right.bar(columns + 0.18, [b.attained for b in bounds.values()], 0.34, color=ORANGE, label="attained")
        right.set_xticks(columns, list(bounds))
        right.set_ylabel("constant (N m s/rad)")
        right.legend()
        return figure


def _fastest(mismatch: float, decays_per_s: tuple[float, ...]) -> SpeedObserver:
    """The observer of the largest decay rate of the list that is proved."""
    found = None
    for decay in decays_per_s:
        try:
            found = speed_observer(robot("arm3"), mismatch, decay, SAMPLE_PERIOD_S)
        except InfeasibleError:
            break
    if found is None:
        raise InfeasibleError(f"arm3: no observer with a decay rate of {decays_per_s[0]:g} 1/s")
    return found


def _middle() -> FloatArray:
    """The middle of the premises of the inertia."""
    arm = robot("arm3")
    return np.array([(p.lower + p.upper) / 2.0 for p in arm.model.inertia_premises(arm.domain)])


def _observers(proved: SpeedObserver) -> dict[str, Observer]:
    """Estimated or lumped, without and with an observed disturbance, whose poles are as fast as the fastest proved."""
    arm = robot("arm3")
    n = arm.model.joints
    one, none = np.eye(n), np.zeros((n, n))
    chain = np.block([[none, one], [none, none]]) - proved.gain(_middle()) @ np.hstack([one, none])
    w = float(np.abs(np.linalg.eigvals(chain)).max())
    observed = np.vstack([4 * w * one, 6 * w**2 * one, 4 * w**3 * one, w**4 * one])

    def scheduled(theta: FloatArray) -> FloatArray:
        return proved.gain(np.cos([theta[1], theta[2], theta[1] + theta[2]]))

    return {
        "estimated": Observer(True, scheduled),
        "lumped": Observer(False, scheduled),
        "estimated, disturbance observed": Observer(True, lambda _: observed),
        "lumped, disturbance observed": Observer(False, lambda _: observed),
    }


def _study(effort: Effort) -> Finding:
    mismatch = _classes().energy.proved
    proved = _fastest(mismatch, DECAYS_PER_S)
    time_s, errors = _simulated(proved, effort)
    settled = time_s >= SETTLED_S
    rms = {
        plant: {name: float(np.sqrt(np.mean(np.sum(e[settled] ** 2, axis=1)))) for name, e in by_observer.items()}
        for plant, by_observer in errors.items()
    }
    words = "; ".join(
        f"{plant}: " + ", ".join(f"{name} {value:.3g} rad/s" for name, value in values.items())
        for plant, values in rms.items()
    )
    computed = {
        "decay_rate_per_s": proved.decay_per_s,
        "mismatch_per_s": mismatch,
        "rms_speed_error_rad_s": rms,
        "gains_at_the_middle": proved.gain(_middle()).tolist(),
    }
    return Finding(
        _study_checks(mismatch, proved, rms["nominal plant"], rms["loaded plant"]),
        computed,
        {"": _errors_figure(time_s, errors)},
        instead=f"Root mean square errors: {words}. With the right model the estimate is exact: what is left is the"
        " step of the integration",
    )


def _simulated(proved: SpeedObserver, effort: Effort) -> tuple[FloatArray, dict[str, dict[str, FloatArray]]]:
    """Times, (N,), and the error of the estimated speeds on the square, (N, 3), by plant and observer."""
    arm = robot("arm3")
    trajectory = tracking_experiment("serial-square").by(arm).trajectory
    time_s = np.arange(0.0, trajectory.duration_s if effort is Effort.FULL else 1.0, STEP_S[effort])

    def motion(t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        point = trajectory.evaluate(t)
        return point.angle, point.speed, point.acceleration

    plants = {"nominal plant": arm.model, "loaded plant": arm.with_payload_fraction(1.0)}
    return time_s, {
        name: speed_errors(
            _observers(proved),
            arm.model,
            plant,
            motion,
            speed_box=np.array(arm.domain.speed_rad_s).T,
            time_s=time_s,
            first_error_rad_s=FIRST_ERROR_RAD_S,
        )
        for name, plant in plants.items()
    }


def _study_checks(
    mismatch: float, proved: SpeedObserver, nominal: dict[str, float], loaded: dict[str, float]
) -> list[Check]:
    return [
        rules.fact(
            "(own) an observer scheduled with estimated speeds exists with a proof over the whole domain",
            proved.decay_per_s > 0.0,
            f"decay rate {proved.decay_per_s:g} 1/s for a mismatch of {mismatch:.4g} 1/s",
        ),
        rules.fact(
            "(own) right model: at the same gains the estimate is at least 100 times better than with premises lumped",
            nominal["lumped"] > 100.0 * nominal["estimated"],
            f"{nominal['estimated']:.3g} against {nominal['lumped']:.3g} rad/s",
        ),
        rules.fact(
            "(own) loaded plant: without an observed disturbance neither estimate is worth much",
            loaded["estimated"] > 3.0 * loaded["lumped, disturbance observed"],
            ", ".join(f"{name} {value:.3g}" for name, value in loaded.items()),
        ),
    ]


def _errors_figure(time_s: FloatArray, errors: dict[str, dict[str, FloatArray]]) -> Figure:
    with style():
        figure = new_figure(3.6, "arm3 on the square: error of the estimated joint speeds, norm over the joints")
        panels = figure.subplots(1, len(errors), sharey=True)
        for axes, (plant, by_observer) in zip(panels, errors.items(), strict=True):
            for colour, (name, error) in zip((BLUE, ORANGE, GREEN, VERMILION), by_observer.items(), strict=True):
                axes.semilogy(time_s, np.linalg.norm(error, axis=1), color=colour, linewidth=0.8, label=name)
            axes.set_title(plant)
            axes.set_xlabel("time (s)")
            axes.set_ylim(1e-8, 10.0)
        panels[0].set_ylabel("speed error (rad/s)")
        legend_below(panels[0], columns=2)
        return figure


DOMAIN = "the operating domain is that of the default trajectories: the source states none"

ITEMS = (
    Item(
        id="table-III.3",
        title="classes of the velocity torque of the 3-DoF arm, with constants",
        printed={"claim": "f is assumed in one of five classes; no constant is printed"},
        assumptions=(
            DOMAIN,
            "f = -N(theta, w) w with theta measured: (III.62) as printed has A(z) x and f(x) - f(x^) overlap",
        ),
        compute=_table_iii3,
    ),
    Item(
        id="study-estimation",
        title="an observer scheduled with estimated premises, against lumping them",
        printed={"claim": "a perspective of the source (III.4): conditions from the bounds of Table III.3"},
        assumptions=(DOMAIN,),
        compute=_study,
    ),
)
