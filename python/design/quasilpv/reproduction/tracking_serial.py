"""Figures IV.3 to IV.8, tables IV.1 and IV.2: the 3-DoF arm tracked from positions only, with Theorem IV.11."""

from __future__ import annotations

from functools import partial

import numpy as np

from quasilpv.reproduction import rules, tracking_claims, tracking_hinf
from quasilpv.reproduction.closed_loops import Outcome, described
from quasilpv.reproduction.item import Check, Finding, Item
from quasilpv.reproduction.tracking_claims import CTC, CTC_ALONE, PID, RATE_HZ, Printed
from quasilpv.reproduction.tracking_comparison import Comparison, Sampled

LAW, HINF, DEFAULT = "Theorem IV.11", tracking_hinf.LAW, "default law at 1 kHz"

PRINTED = {
    "square": {
        PID: Printed(1.66e-2, 1.16e-2, 3.37e-2, 2.41e-2, 1.29e4),
        CTC: Printed(1.79e-2, 2.04e-2, 3.76e-2, 4.16e-2, 1.65e4),
        LAW: Printed(4.86e-4, 3.64e-4, 1.2e-3, 9.10e-4, 1.24e4),
    },
    "circle": {
        PID: Printed(1e-2, 1.37e-2, 2.69e-2, 2.79e-2, 1.21e4),
        CTC: Printed(1.34e-2, 1.89e-2, 3.22e-2, 3.45e-2, 1.52e4),
        LAW: Printed(4.01e-4, 4.28e-4, 1.2e-3, 9.65e-4, 1.13e4),
    },
}

PAYLOAD = "moments of inertia are kept about the centres of mass: about the joints, as printed, M is indefinite"
DESIGN = "Theorem IV.11 is corrected, reduced, and bounded in its poles and gains"
LAW_ASSUMPTIONS = (tracking_claims.DEFAULTS, PAYLOAD, DESIGN, tracking_claims.SAMPLED)
ASSUMPTIONS = (*LAW_ASSUMPTIONS, tracking_claims.DOB_GAIN)


def _compared(path: str) -> Comparison:
    return Comparison(
        name=f"3-DoF arm, {path}",
        title=f"3-DoF arm with full payload, {path}, {RATE_HZ / 1e3:g} kHz",
        scenario=f"serial-{path}",
        law=LAW,
        controllers={PID: Sampled("pid"), CTC: Sampled("ctc-dob"), LAW: Sampled("dob-torque")},
        beside={CTC_ALONE: Sampled("ctc"), DEFAULT: Sampled("dob-acceleration", 1000.0)},
        printed=PRINTED[path],
        assumptions=ASSUMPTIONS,
    )


SQUARE, CIRCLE = _compared("square"), _compared("circle")
OF_CHAPTER_III = {SQUARE.scenario: tracking_hinf.SQUARE, CIRCLE.scenario: tracking_hinf.CIRCLE}


def _inputs(compared: Comparison) -> Finding:
    loops = compared.loops
    checks = tracking_claims.less_torque(loops, LAW, compared.others)
    if compared is CIRCLE:
        checks += tracking_claims.less_torque_on(loops, SQUARE.loops)
    return compared.inputs_finding(checks)


def _estimates(compared: Comparison) -> Finding:
    loops = compared.with_and_without
    checks = _compensates(loops["with"]) if compared is CIRCLE else []
    return compared.estimates_finding(checks, f"RMS X / Y (mm): {tracking_claims.rms_listed(loops)}")


def _compensates(observing: Outcome) -> list[Check]:
    """Remark IV.24: what is left of the disturbance is less than the disturbance."""
    disturbance = observing.result.true_disturbance
    assert disturbance is not None
    left = disturbance.values - observing.result.run.filtered_disturbance
    rms = {
        name: {f"joint {joint} (N m)": float(value) for joint, value in enumerate(values, start=1)}
        for name, values in (
            ("left", np.sqrt(np.mean(left**2, axis=0))),
            ("all", np.sqrt(np.mean(disturbance.values**2, axis=0))),
        )
    }
    return [rules.smaller("|d - d_f| is smaller than |d|, rms", rms["left"], rms["all"])]


def _table(compared: Comparison) -> Finding:
    loops, printed = compared.loops, dict(compared.printed)
    checks = tracking_claims.columns(loops, printed)
    hinf = OF_CHAPTER_III[compared.scenario]
    loops[HINF], printed[HINF] = hinf.run(HINF), hinf.printed[HINF]
    checks.append(tracking_claims.torque_ratio(loops, printed, LAW, HINF))
    if compared is CIRCLE:
        checks += tracking_claims.moves_to_y(loops, SQUARE.loops, compared.others)
    saturated = loops[PID].saturated_samples / len(loops[PID].result.run.time_s)
    return Finding(
        checks,
        described({**loops, **compared.loops_beside}),
        instead="Printed errors of PID and CTC are those of chapter III, whose plant is another; with the payload of"
        f" chapter IV the printed PID saturates its motors in {saturated:.1%} of the samples. Theorem IV.11 is more"
        f" accurate than printed. {compared.numbers}",
    )


def _items(compared: Comparison, ids: tuple[str, str, str, str], observers: tuple[str, ...] = ()) -> tuple[Item, ...]:
    tracking, inputs, estimates, table = ids
    return (
        compared.tracking_item(tracking, observers),
        compared.item(
            inputs,
            "torques and speed errors of the same controllers",
            {"claim": "Theorem IV.11 needs less torque"},
            ASSUMPTIONS,
            partial(_inputs, compared),
        ),
        compared.item(
            estimates,
            "estimated speeds with and without disturbance observer",
            {"claim": "speeds are estimated better with the disturbance observer"},
            (*LAW_ASSUMPTIONS, tracking_claims.WITHOUT),
            partial(_estimates, compared),
        ),
        compared.item(
            table,
            "errors and torques of all controllers",
            tracking_claims.printed_document(compared.printed),
            (*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS),
            partial(_table, compared),
        ),
    )


ITEMS = (
    *_items(SQUARE, ("fig-IV.3", "fig-IV.4", "fig-IV.5", "table-IV.1")),
    *_items(CIRCLE, ("fig-IV.6", "fig-IV.7", "fig-IV.8", "table-IV.2"), observers=(CTC, LAW)),
)
