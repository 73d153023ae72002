"""Figure III.4: the rolling disc of Example III.12, its inertia unknown to the law of Theorem III.9, comes to rest."""

from __future__ import annotations

from quasilpv.figures.stabilisation import rolling_disc_figure
from quasilpv.reproduction import rules
from quasilpv.reproduction.closed_loops import EXACT, ClosedLoop, outcome
from quasilpv.reproduction.constraints import rolling_along
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.reproduction.stabilised_arms import LEAST_GAIN, SENSORS, claims, computed

ROLLING_M_S = 1e-9
REPLAYED_RAD = 1e-5
SHOWN_S = 2.0
"""Of the 10 s of the run: it is at rest before."""


def _fig_iii4(_: Effort) -> Finding:
    loop = outcome(ClosedLoop("stabilise-spring-disc", "robust", 1000.0, sensors=EXACT))
    replay, rolling = rolling_along(loop)
    largest = float(rolling.error.max())
    checks = [
        *claims("Theorem III.9", loop),
        rules.at_most("algebraic equation x_2 - r x_3 over the run (m/s)", {"|.|": ROLLING_M_S}, {"|.|": largest}),
        rules.at_most(
            "(own) angle of the integration it comes from, against the run",
            {"difference (rad)": REPLAYED_RAD},
            {"difference (rad)": rolling.replay_deviation_rad},
        ),
    ]
    title = "rolling disc, M = 0.1 kg, Jδ = 1 kg m² (δ = 3), law (III.25) of Theorem III.9 at 1 kHz"
    shown = replay.time_s <= SHOWN_S
    figure = rolling_disc_figure(
        replay.time_s[shown], replay.states[shown], replay.torque_nm[shown, 0], rolling.error[shown], title
    )
    contact = replay.states[:, 3]
    return Finding(
        checks,
        {
            **computed(loop),
            "largest_rolling_error_m_s": largest,
            "contact_force_start_n": float(contact[0]),
            "contact_force_end_n": float(contact[-1]),
        },
        {"": figure},
        instead="Rolling is a linear invariant of the form of index 1: integration keeps it to the last digits whatever"
        " the controller does, so the constraint says nothing about the law",
    )


ITEMS = (
    Item(
        id="fig-III.4",
        title="rolling disc of unknown inertia brought to rest with Theorem III.9",
        printed={
            "M_kg": 0.1,
            "delta_per_kg": 3,
            "x_d0": [-5, 10],
            "claim": "converges, the algebraic equation is virtually null",
        },
        assumptions=(
            "the signs of dA_44 and dB_4, printed wrong, follow from the constraint",
            "delta in [0, 3] and |x_1| <= 5.2 m, decay rate 1/s: none is stated",
            "'virtually null' is read as at most 1e-9 m/s",
            LEAST_GAIN,
            SENSORS,
        ),
        compute=_fig_iii4,
    ),
)
