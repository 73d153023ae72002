"""Figures IV.10 to IV.14 and table IV.5: the five-bar robot draws a spiral, from positions only, with Theorem IV.11."""

from __future__ import annotations

from quasilpv.figures.constraint import constraint_figure
from quasilpv.figures.side_by_side import input_columns, speed_errors, tracking_columns
from quasilpv.reproduction import rules, tracking_claims
from quasilpv.reproduction.closed_loops import ClosedLoop, Observer, Outcome, described, outcome, results
from quasilpv.reproduction.constraints import closure_along
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.reproduction.tracking_claims import PID, RATE_HZ, Printed
from quasilpv.scenarios import VELOCITY_NOISE_RAD_S

DEFAULT_RATE_HZ = 2000.0
CTC, LAW = "CTC (IV.78)", "Theorem IV.11"
CONTROLLERS = {PID: "pid", CTC: "ctc", LAW: "dob-torque-premultiplied"}
PLAIN, DEFAULT = "Theorem IV.11 without beta", "default law at 2 kHz"

PRINTED = {
    PID: Printed(1.2e-3, 3e-3, 4.3e-3, 5.3e-3, 10.54),
    CTC: Printed(1.1e-3, 3.6e-3, 3.7e-3, 5.9e-3, 10.43),
    LAW: Printed(1.25e-4, 1.45e-4, 3.42e-4, 3.18e-4, 10.84),
}

WITH_AND_WITHOUT: tuple[Observer, Observer] = ("whole", "without disturbance")
FIVEFOLD = 5.0
CLOSED_M = 1e-9
PASSIVE_LENGTHS_M = (0.165, 0.2)
"""Those of the robot, and longer ones: equal links hide drift."""
REPLAYED_RAD = 1e-5

READING = "(IV.77) as printed, 15 sin 50t and 15 sin 5t N m"
PAYLOAD = "moments of inertia are kept about the centres of mass: about the joints, M is indefinite"
DESIGN = (
    "Theorem IV.11, for the equations premultiplied by beta, is corrected, reduced, and bounded in its poles and gains"
)
FILTER = "the filter gain is 1: one of 100 over-compensates"
GAINS = "k_d and g_d are read without the factor 1e4, with which they diverge"
LAW_ASSUMPTIONS = (tracking_claims.DEFAULTS, PAYLOAD, DESIGN, FILTER, tracking_claims.SAMPLED)
ASSUMPTIONS = (*LAW_ASSUMPTIONS, READING, GAINS)


def _loops(scenario: str = "fivebar-spiral") -> dict[str, Outcome]:
    return {label: _run(scenario, controller) for label, controller in CONTROLLERS.items()}


def _run(scenario: str, controller: str, observer: Observer = "whole", rate_hz: float = RATE_HZ) -> Outcome:
    return outcome(ClosedLoop(scenario, controller, rate_hz, observer=observer))


def _law(scenario: str, observer: Observer = "whole") -> Outcome:
    return _run(scenario, CONTROLLERS[LAW], observer)


def _default(scenario: str, observer: Observer = "whole") -> Outcome:
    return _run(scenario, "dob-acceleration", observer, DEFAULT_RATE_HZ)


def _others(scenario: str) -> dict[str, Outcome]:
    """What the source does not show and the comparison needs."""
    return {PLAIN: _run(scenario, "dob-torque"), DEFAULT: _default(scenario)}


TITLE = f"five-bar robot with full payload, spiral, {RATE_HZ / 1e3:g} kHz"


def _tracking(_: Effort) -> Finding:
    loops = _loops()
    checks = [
        *tracking_claims.better(loops, LAW, (PID, CTC)),
        tracking_claims.as_accurate(loops, LAW, PRINTED[LAW]),
    ]
    others = _others("fivebar-spiral")
    return Finding(
        checks,
        described({**loops, **others}),
        {"": tracking_columns(results(loops), TITLE)},
        instead="RMS X / Y (mm): " + tracking_claims.rms_listed({**loops, **others}),
    )


def _inputs(_: Effort) -> Finding:
    loops = _loops()
    checks = [tracking_claims.torque_ratio(loops, PRINTED, LAW, other) for other in (PID, CTC)]
    return Finding(checks, described(loops), {"": input_columns(results(loops), TITLE)})


def _estimates(_: Effort) -> Finding:
    observing, without = (_law("fivebar-spiral", observer) for observer in WITH_AND_WITHOUT)
    checks = [
        tracking_claims.better_estimates(observing, without),
        rules.at_most(
            "estimates are better than the noisy measurement, rms error",
            {"largest of the joints (rad/s)": VELOCITY_NOISE_RAD_S},
            {"largest of the joints (rad/s)": max(observing.speed_errors)},
        ),
    ]
    figure = speed_errors(without.result, observing.result, f"{TITLE}, Theorem IV.11: error of estimated speeds")
    return Finding(checks, described({"with": observing, "without": without}), {"": figure})


def _closure(_: Effort) -> Finding:
    run = _law("fivebar-spiral")
    along = {f"b = {length:g} m": closure_along(run, length) for length in PASSIVE_LENGTHS_M}
    largest = {name: float(closure.error.max()) for name, closure in along.items()}
    checks = [
        rules.at_most("largest |h| over the run (m)", dict.fromkeys(largest, CLOSED_M), largest),
        rules.at_most(
            "(own) driven angles of the integration |h| comes from, against the run (rad)",
            dict.fromkeys(along, REPLAYED_RAD),
            {name: closure.replay_deviation_rad for name, closure in along.items()},
        ),
    ]
    curves = {name: (closure.time_s, closure.error) for name, closure in along.items()}
    return Finding(
        checks,
        {"largest |h| (m)": largest, **described({LAW: run})},
        {"": constraint_figure(curves, "|h| (m)", f"{TITLE}, Theorem IV.11: constraint")},
        instead="With equal links closure means q = (theta_2, theta_1), a linear invariant that integration keeps to"
        " the last digit; passive links of another length show what the stabilisation holds",
    )


def _strong(_: Effort) -> Finding:
    scenario = "fivebar-spiral-strong"
    observing, without = (_law(scenario, observer) for observer in WITH_AND_WITHOUT)
    loops = {
        "with observer": observing,
        "without observer": without,
        DEFAULT: _default(scenario),
        f"{DEFAULT}, not compensating": _default(scenario, "without compensation"),
        f"{DEFAULT}, without observer": _default(scenario, "without disturbance"),
    }
    checks = [
        rules.smaller(
            "errors are significantly smaller with the disturbance observer: five times RMS against RMS without",
            _rms_mm(observing, FIVEFOLD),
            _rms_mm(without),
        ),
        *(
            rules.smaller(
                f"(own) the same of the {label}",
                _rms_mm(loops[DEFAULT], FIVEFOLD),
                _rms_mm(loops[label]),
            )
            for label in list(loops)[3:]
        ),
    ]
    shown = {label: loops[label].result for label in list(loops)[:2]}
    title = f"{TITLE}, 100 sin 50t N m, Theorem IV.11"
    return Finding(
        checks,
        described(loops),
        {"": tracking_columns(shown, title)},
        instead="RMS X / Y (mm): " + tracking_claims.rms_listed(loops),
    )


def _rms_mm(entry: Outcome, factor: float = 1.0) -> dict[str, float]:
    metrics = entry.metrics
    return {"X (mm)": 1e3 * factor * metrics.rms_x_m, "Y (mm)": 1e3 * factor * metrics.rms_y_m}


def _table(_: Effort) -> Finding:
    loops, other = _loops(), _loops("fivebar-spiral-fast")
    others = _others("fivebar-spiral")
    computed = described({**loops, **others}) | {
        f"{label}, 15 sin 50t on both": entry.described() for label, entry in other.items()
    }
    return Finding(
        tracking_claims.columns(loops, PRINTED),
        computed,
        instead="Disturbed as printed, PID and CTC err alike along both axes, and with 15 sin 50t on both joints along"
        " X; the printed errors, mostly along Y, belong to a spiral or a disturbance that is not stated."
        f" RMS X / Y (mm): {tracking_claims.rms_listed({**loops, **others})}; with"
        f" 15 sin 50t on both joints: {tracking_claims.rms_listed(other)}",
    )


ITEMS = (
    Item(
        id="fig-IV.10",
        title="five-bar robot, spiral: tracking with Theorem IV.11, PID and computed torque",
        printed={"claim": "Theorem IV.11 tracks best", **PRINTED[LAW].as_dict()},
        assumptions=ASSUMPTIONS,
        compute=_tracking,
    ),
    Item(
        id="fig-IV.11",
        title="five-bar robot, spiral: torques of the same controllers",
        printed={"claim": "torques alike", **{f"RMS_u {law}": column.rms_torque for law, column in PRINTED.items()}},
        assumptions=(*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS),
        compute=_inputs,
    ),
    Item(
        id="fig-IV.12",
        title="five-bar robot, spiral: estimated speeds with and without disturbance observer",
        printed={"claim": "better with the disturbance observer, and better than the noisy measurement"},
        assumptions=(*LAW_ASSUMPTIONS, READING, tracking_claims.WITHOUT),
        compute=_estimates,
    ),
    Item(
        id="fig-IV.13",
        title="five-bar robot, spiral: constraint over time",
        printed={"claim": "the algebraic constraints are fully respected"},
        assumptions=(*LAW_ASSUMPTIONS, READING, "'fully' is read as at most 1e-9 m"),
        compute=_closure,
    ),
    Item(
        id="fig-IV.14",
        title="five-bar robot, spiral under 100 sin 50t N m, with and without disturbance observer",
        printed={"claim": "errors significantly lower along X and Y with the disturbance observer"},
        assumptions=(*LAW_ASSUMPTIONS, tracking_claims.WITHOUT),
        compute=_strong,
    ),
    Item(
        id="table-IV.5",
        title="five-bar robot, spiral: errors and torques of all controllers",
        printed=tracking_claims.printed_document(PRINTED),
        assumptions=(*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS),
        compute=_table,
    ),
)
