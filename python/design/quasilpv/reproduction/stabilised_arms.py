"""Figures I.2 and II.6: arms brought to rest from 22.5 degrees, with the Lyapunov function of the certificate."""

from __future__ import annotations

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.laws.descriptor_feedback import DescriptorFeedbackLaw
from quasilpv.figures.stabilisation import regulation_figure
from quasilpv.reproduction import rules
from quasilpv.reproduction.closed_loops import EXACT, ClosedLoop, Outcome, outcome
from quasilpv.reproduction.item import Check, Effort, Finding, Item

READINGS = {"hanging": "stabilise-arm2", "upright": "stabilise-arm2-upright"}

SETTLED = 1e-3
"""V relative to its start below which sampling and the speed filter, which the certificate leaves out, may show."""


def lyapunov_along(closed_loop: Outcome) -> FloatArray:
    """V = x' P^-1 x at the samples of a run, (N,), with the exactly certified P of the artifact.

    Args:
        closed_loop: of a law ``state-feedback`` or ``descriptor-feedback``.
    """
    artifact, run = closed_loop.artifact, closed_loop.result.run
    law = artifact.law
    P = law.lyapunov if isinstance(law, DescriptorFeedbackLaw) else (artifact.witness or {})["feedback"]["P"]
    x = np.concatenate([run.true_angle_rad, run.true_speed_rad_s], axis=1)
    return np.asarray(np.einsum("ki,ki->k", x, np.linalg.solve(np.asarray(P), x.T).T))


def _stabilised(scenario: str, controller: str, rate_hz: float) -> Outcome:
    return outcome(ClosedLoop(scenario, controller, rate_hz, plant="nominal", sensors=EXACT))


def _decay(closed_loop: Outcome) -> float:
    return float((closed_loop.artifact.witness or {})["feedback"]["decay_per_s"])


def claims(name: str, closed_loop: Outcome) -> list[Check]:
    """V falls along the run, and as fast as the certificate says."""
    run = closed_loop.result.run
    V, decay = lyapunov_along(closed_loop), _decay(closed_loop)
    falling = V[:-1] > SETTLED * V[0]
    rising = int(np.count_nonzero(np.diff(V)[falling] >= 0.0))
    bound = float(np.exp(-2.0 * decay * run.time_s[-1]))
    return [
        rules.fact(
            f"{name}: V decreases from sample to sample, down to {SETTLED:g} of its start",
            rising == 0,
            f"{rising} of {int(falling.sum())} samples without decrease",
        ),
        rules.at_most(
            f"{name}: converges with the decay rate of {decay:g} 1/s",
            {"V at the end over V at the start": bound},
            {"V at the end over V at the start": float(V[-1] / V[0])},
        ),
    ]


def computed(closed_loop: Outcome) -> dict[str, object]:
    """What is reported of a run, JSON-able."""
    run, V = closed_loop.result.run, lyapunov_along(closed_loop)
    return closed_loop.described() | {
        "lyapunov_start": float(V[0]),
        "lyapunov_end": float(V[-1]),
        "largest_angle_end_deg": float(np.degrees(np.abs(run.true_angle_rad[-1]).max())),
        "largest_torque_nm": np.abs(run.torque_nm).max(axis=0).tolist(),
    }


def _fig_i2(_: Effort) -> Finding:
    loops = {name: _stabilised(scenario, "pdc", 1000.0) for name, scenario in READINGS.items()}
    figures = {
        "" if name == "hanging" else name: regulation_figure(
            loop.result.run,
            lyapunov_along(loop),
            _decay(loop),
            f"2-DoF arm, θ = 0 {name}, Theorem I.2 at 1 kHz, no friction",
        )
        for name, loop in loops.items()
    }
    checks = [check for name, loop in loops.items() for check in claims(name, loop)]
    return Finding(checks, {name: computed(loop) for name, loop in loops.items()}, figures)


def _fig_ii6(_: Effort) -> Finding:
    loop = _stabilised("stabilise-arm3", "descriptor", 4000.0)
    title = "3-DoF arm, m₃ = 1 kg, |θ| ≤ π, law (II.38) of Theorem II.6 at 4 kHz"
    figure = regulation_figure(loop.result.run, lyapunov_along(loop), _decay(loop), title)
    return Finding(claims("Theorem II.6", loop), computed(loop), {"": figure})


SENSORS = "angles and speeds are measured exactly, speeds filtered over two samples; the law is sampled"
LEAST_GAIN = "of all gains the condition allows the least is taken (the condition bounds none)"

ITEMS = (
    Item(
        id="fig-I.2",
        title="2-DoF arm brought to rest with Theorem I.2, decay rate 1/s",
        printed={"x0_deg": [22.5, 0, 0, 0], "decay_per_s": 1, "claim": "converges with the decay rate, V decreases"},
        assumptions=(
            "the signs of (I.35) are read in both ways, theta = 0 hanging and upright",
            "the operating domain, which is not stated, is |theta_i| <= pi/4, |theta_i'| <= 2 rad/s",
            LEAST_GAIN,
            SENSORS,
        ),
        compute=_fig_i2,
    ),
    Item(
        id="fig-II.6",
        title="3-DoF arm with m3 = 1 kg brought to rest with Theorem II.6 over the whole workspace",
        printed={"m3_kg": 1, "theta_max_rad": float(np.pi), "claim": "converges"},
        assumptions=(
            "|theta_i'| <= 2 rad/s; I_3 follows m_3 (parallel axes); m_11 and z_4 are corrected",
            "starts at rest from (22.5, 0, 0) degrees: the source does not say",
            LEAST_GAIN,
            SENSORS,
        ),
        compute=_fig_ii6,
    ),
)
