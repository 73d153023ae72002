"""Figures III.5 to III.8, tables III.1 and III.2: the 3-DoF arm, Theorem III.10 against PID and computed torque."""

from __future__ import annotations

from functools import partial

from quasilpv.reproduction import rules, tracking_claims
from quasilpv.reproduction.closed_loops import Outcome, described
from quasilpv.reproduction.item import Check, Finding, Item
from quasilpv.reproduction.tracking_claims import CTC, CTC_ALONE, PID, RATE_HZ, Printed
from quasilpv.reproduction.tracking_comparison import Comparison, Sampled

LAW = "Theorem III.10"

PRINTED = {
    "square": {
        PID: Printed(1.66e-2, 1.16e-2, 3.37e-2, 2.41e-2, 1.36e4),
        CTC: Printed(1.79e-2, 2.04e-2, 3.76e-2, 4.16e-2, 1.62e4),
        LAW: Printed(3.21e-4, 2.52e-4, 8.86e-4, 7.73e-4, 3.02e4),
    },
    "circle": {
        PID: Printed(1e-2, 1.38e-2, 2.7e-2, 2.8e-2, 1.32e4),
        CTC: Printed(1.35e-2, 1.92e-2, 3.23e-2, 3.45e-2, 1.63e4),
        LAW: Printed(1.84e-4, 2.33e-4, 7.64e-4, 9.37e-4, 2.74e4),
    },
}

SLEW_SCALE = 2.0
DRIVES = (
    f"for Theorem III.10 the drives slew {SLEW_SCALE:g} times as fast as the robot's, which are too slow for the noise"
    " in its torque; the source states no limit"
)
PLANT = "m_1 grows in the gravity torque only, as in the source, which a rigid link can do; friction is 10 N m s/rad"
DESIGN = "gains of Theorem III.10 are limited so that the sampled loop is stable with every payload: it bounds none"
ASSUMPTIONS = (
    tracking_claims.DEFAULTS,
    PLANT,
    DESIGN,
    DRIVES,
    tracking_claims.DOB_GAIN,
    tracking_claims.SAMPLED,
)


def _compared(path: str) -> Comparison:
    return Comparison(
        name=f"3-DoF arm, {path}",
        title=f"3-DoF arm of chapter III, {path}, {RATE_HZ / 1e3:g} kHz, noisy speeds",
        scenario=f"serial-{path}",
        plant="chapter-III",
        law=LAW,
        controllers={
            PID: Sampled("pid"),
            CTC: Sampled("ctc-dob"),
            LAW: Sampled("hinf-tracking", slew_scale=SLEW_SCALE),
        },
        beside={CTC_ALONE: Sampled("ctc")},
        printed=PRINTED[path],
        assumptions=ASSUMPTIONS,
        reason="Theorem III.10 feeds nothing forward and its gains are bounded by sampling and noise; computed torque"
        " with the sign of its observer corrected is the better law. ",
    )


SQUARE, CIRCLE = _compared("square"), _compared("circle")


def _inputs(compared: Comparison) -> Finding:
    loops = compared.loops
    checks = [
        *_noisiest(loops),
        *(tracking_claims.torque_ratio(loops, compared.printed, LAW, other) for other in compared.others),
    ]
    if compared is CIRCLE:
        checks += tracking_claims.less_torque_on(loops, SQUARE.loops)
    torque = loops[LAW].metrics.rms_torque_nm
    return compared.inputs_finding(
        checks,
        "All three controllers move the same arm along the same path against the same disturbance, which takes"
        f" about {torque:.0f} N m rms; only a torque dominated by noise could be twice as large",
    )


def _noisiest(loops: dict[str, Outcome]) -> list[Check]:
    """Noise shows in the torque: its increments per sample, at the same rate for all."""
    increments = {label: entry.metrics.rms_torque_increment_nm for label, entry in loops.items()}
    return [
        rules.smaller(
            f"noise shows more in the torque of {LAW} than in that of {other}",
            {"increment per sample (N m)": increments[other]},
            {"increment per sample (N m)": increments[LAW]},
        )
        for other in (PID, CTC)
    ]


def _table(compared: Comparison) -> Finding:
    loops = compared.loops
    checks = tracking_claims.columns(loops, compared.printed)
    if compared is CIRCLE:
        checks += tracking_claims.moves_to_y(loops, SQUARE.loops, compared.others)
    return Finding(checks, described({**loops, **compared.loops_beside}), instead=compared.numbers)


def _items(compared: Comparison, tracking: str, inputs: str, table: str) -> tuple[Item, ...]:
    printed = tracking_claims.printed_document(compared.printed)
    noise = {"claim": "noise shows in the torque of Theorem III.10", **printed}
    ratios = (*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS)
    same = "of the same controllers"
    return (
        compared.tracking_item(tracking, observers=(CTC,)),
        compared.item(inputs, f"torques and speed errors {same}", noise, ratios, partial(_inputs, compared)),
        compared.item(table, f"errors and torques {same}", printed, ratios, partial(_table, compared)),
    )


ITEMS = (
    *_items(SQUARE, "fig-III.5", "fig-III.6", "table-III.1"),
    *_items(CIRCLE, "fig-III.7", "fig-III.8", "table-III.2"),
)
