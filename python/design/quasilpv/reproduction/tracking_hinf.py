"""Figures III.5 to III.8, tables III.1 and III.2: the 3-DoF arm, Theorem III.10 against PID and computed torque."""

from __future__ import annotations

from functools import partial

from quasilpv.figures.side_by_side import disturbance_estimates, input_columns, tracking_columns
from quasilpv.reproduction import rules, tracking_claims
from quasilpv.reproduction.closed_loops import ClosedLoop, Outcome, described, outcome, results
from quasilpv.reproduction.item import Check, Effort, Finding, Item
from quasilpv.reproduction.tracking_claims import CTC, CTC_ALONE, PID, RATE_HZ, Printed

LAW = "Theorem III.10"
CONTROLLERS = {PID: "pid", CTC: "ctc-dob", LAW: "hinf-tracking"}

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

PLANT = "m_1 grows in the gravity torque only, as in the source, which a rigid link can do; friction is 10 N m s/rad"
DESIGN = "gains of Theorem III.10 are limited so that the sampled loop is stable with every payload: it bounds none"
ASSUMPTIONS = (
    tracking_claims.DEFAULTS,
    PLANT,
    DESIGN,
    tracking_claims.DOB_GAIN,
    tracking_claims.SAMPLED,
)


def _loops(path: str) -> dict[str, Outcome]:
    return {label: _run(path, controller) for label, controller in CONTROLLERS.items()}


def _run(path: str, controller: str) -> Outcome:
    return outcome(ClosedLoop(f"serial-{path}", controller, RATE_HZ, plant="chapter-III"))


def law_outcome(path: str) -> Outcome:
    """Theorem III.10 on ``square`` or ``circle``, for comparison."""
    return _run(path, CONTROLLERS[LAW])


def _title(path: str) -> str:
    return f"3-DoF arm of chapter III, {path}, {RATE_HZ / 1e3:g} kHz, noisy speeds"


def _instead(loops: dict[str, Outcome], path: str) -> str:
    return (
        "Theorem III.10 feeds nothing forward and its gains are bounded by sampling and noise; computed torque with the"
        " sign of its observer corrected is the better law. RMS X / Y (mm): "
        + tracking_claims.rms_listed({**loops, CTC_ALONE: _run(path, "ctc")})
    )


def _tracking(path: str, _: Effort) -> Finding:
    loops = _loops(path)
    checks = [
        *tracking_claims.better(loops, LAW, (PID, CTC)),
        tracking_claims.as_accurate(loops, LAW, PRINTED[path][LAW]),
    ]
    estimate = disturbance_estimates({CTC: loops[CTC].result}, 2, f"{_title(path)}: disturbance and its estimate")
    return Finding(
        checks,
        described({**loops, CTC_ALONE: _run(path, "ctc")}),
        {"": tracking_columns(results(loops), _title(path)), "disturbance": estimate},
        instead=_instead(loops, path),
    )


def _inputs(path: str, _: Effort) -> Finding:
    loops, printed = _loops(path), PRINTED[path]
    checks = [
        *_noisiest(loops),
        tracking_claims.torque_ratio(loops, printed, LAW, PID),
        tracking_claims.torque_ratio(loops, printed, LAW, CTC),
    ]
    if path == "circle":
        checks += tracking_claims.less_torque_on(loops, _loops("square"))
    torque = loops[LAW].metrics.rms_torque_nm
    return Finding(
        checks,
        described(loops),
        {"": input_columns(results(loops), _title(path))},
        instead=f"All three controllers move the same arm along the same path against the same disturbance, which takes"
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


def _table(path: str, _: Effort) -> Finding:
    loops, printed = _loops(path), PRINTED[path]
    checks = tracking_claims.columns(loops, printed)
    if path == "circle":
        checks += tracking_claims.moves_to_y(loops, _loops("square"), (PID, CTC))
    return Finding(checks, described({**loops, CTC_ALONE: _run(path, "ctc")}), instead=_instead(loops, path))


ITEMS = tuple(
    item
    for path, tracking, inputs, table in (
        ("square", "fig-III.5", "fig-III.6", "table-III.1"),
        ("circle", "fig-III.7", "fig-III.8", "table-III.2"),
    )
    for item in (
        Item(
            id=tracking,
            title=f"3-DoF arm, {path}: tracking with Theorem III.10, PID and computed torque",
            printed={"claim": "Theorem III.10 tracks best", **PRINTED[path][LAW].as_dict()},
            assumptions=ASSUMPTIONS,
            compute=partial(_tracking, path),
        ),
        Item(
            id=inputs,
            title=f"3-DoF arm, {path}: torques and speed errors of the same controllers",
            printed={
                "claim": "noise shows in the torque of Theorem III.10",
                **tracking_claims.printed_document(PRINTED[path]),
            },
            assumptions=(*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS),
            compute=partial(_inputs, path),
        ),
        Item(
            id=table,
            title=f"3-DoF arm, {path}: errors and torques of the same controllers",
            printed=tracking_claims.printed_document(PRINTED[path]),
            assumptions=(*ASSUMPTIONS, tracking_claims.TORQUE_RATIOS),
            compute=partial(_table, path),
        ),
    )
)
