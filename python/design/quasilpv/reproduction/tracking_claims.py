"""What the source claims of tracking controllers, as checks: columns of its tables, and who is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from quasilpv.defaults import ENCODER_BITS
from quasilpv.experiments.metrics import Metrics
from quasilpv.reproduction import rules
from quasilpv.reproduction.closed_loops import Outcome
from quasilpv.reproduction.item import Check
from quasilpv.scenarios import VELOCITY_NOISE_RAD_S
from quasilpv.synthesis.baselines.printed import DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S

RATE_HZ = 4000.0
"""Sample rate of controllers that are compared; those of the source are in continuous time."""

PID, CTC, CTC_ALONE = "PID", "CTC with observer", "CTC without observer"

DEFAULTS = "paths are the project's defaults: none is stated"
DOB_GAIN = (
    f"the observer of CTC has {DISTURBANCE_OBSERVER_BANDWIDTH_RAD_S:g} rad/s and is subtracted: no gain is stated, the"
    " printed sign adds it"
)
SAMPLED = (
    f"{RATE_HZ / 1e3:g} kHz, encoders of {ENCODER_BITS} bits, speeds with noise of {VELOCITY_NOISE_RAD_S:g} rad/s and"
    " filtered: none is stated"
)
WITHOUT = "'without DOB' is read as an observer of angles and speeds only"
TORQUE_RATIOS = "of RMS_u ratios are compared: the printed values do not follow from the printed formula"


@dataclass(frozen=True)
class Printed:
    """A column of a table of the source, m and N m."""

    rms_x: float
    rms_y: float
    mav_x: float
    mav_y: float
    rms_torque: float

    def as_dict(self) -> dict[str, float]:
        """By name, JSON-able."""
        return asdict(self)

    @property
    def errors_mm(self) -> dict[str, float]:
        """RMS and MAV on both axes, mm."""
        return _errors_mm(self.rms_x, self.rms_y, self.mav_x, self.mav_y)


def errors_mm(metrics: Metrics) -> dict[str, float]:
    """RMS and MAV on both axes, mm, by the names of `Printed.errors_mm`."""
    return _errors_mm(metrics.rms_x_m, metrics.rms_y_m, metrics.mav_x_m, metrics.mav_y_m)


def _errors_mm(*values: float) -> dict[str, float]:
    names = ("RMS_X", "RMS_Y", "MAV_X", "MAV_Y")
    return {f"{name} (mm)": 1e3 * value for name, value in zip(names, values, strict=True)}


def better(outcomes: Mapping[str, Outcome], law: str, others: Sequence[str]) -> list[Check]:
    """Smaller errors, RMS and MAV on both axes, than each of the others."""
    own = errors_mm(outcomes[law].metrics)
    return [
        rules.smaller(f"{law} tracks better than {other}", own, errors_mm(outcomes[other].metrics)) for other in others
    ]


def as_accurate(outcomes: Mapping[str, Outcome], law: str, printed: Printed) -> Check:
    """Errors no larger than the printed ones."""
    return rules.as_small(f"errors of {law}", printed.errors_mm, errors_mm(outcomes[law].metrics))


def columns(outcomes: Mapping[str, Outcome], printed: Mapping[str, Printed]) -> list[Check]:
    """Every column of a table, and the ratios of its torques to that of the first."""
    first, *others = printed
    checks = [
        rules.numbers(f"errors of {law}", column.errors_mm, errors_mm(outcomes[law].metrics))
        for law, column in printed.items()
    ]
    return [*checks, *(torque_ratio(outcomes, printed, other, first) for other in others)]


def torque_ratio(outcomes: Mapping[str, Outcome], printed: Mapping[str, Printed], law: str, other: str) -> Check:
    """RMS_u of one law over that of another."""
    expected = printed[law].rms_torque / printed[other].rms_torque
    ratio = outcomes[law].metrics.rms_torque_nm / outcomes[other].metrics.rms_torque_nm
    return rules.number(f"RMS_u of {law} over that of {other}", round(expected, 3), ratio)


def less_torque(outcomes: Mapping[str, Outcome], law: str, others: Sequence[str]) -> list[Check]:
    """A smaller RMS_u than each of the others."""
    return [
        rules.smaller(
            f"{law} needs less torque than {other}", _torque(outcomes[law].metrics), _torque(outcomes[other].metrics)
        )
        for other in others
    ]


def less_torque_on(curve: Mapping[str, Outcome], line: Mapping[str, Outcome]) -> list[Check]:
    """Every controller needs less torque on the curve than on the line."""
    return [
        rules.smaller(
            f"{law} needs less torque on the circle than on the square",
            _torque(curve[law].metrics),
            _torque(line[law].metrics),
        )
        for law in curve
    ]


def moves_to_y(curve: Mapping[str, Outcome], line: Mapping[str, Outcome], laws: Sequence[str]) -> list[Check]:
    """On the curve the error along X is smaller than on the line, and that along Y larger."""
    found = []
    for law in laws:
        on_curve, on_line = errors_mm(curve[law].metrics), errors_mm(line[law].metrics)
        x, y = ({name: value for name, value in on_curve.items() if axis in name} for axis in ("_X", "_Y"))
        found.append(rules.smaller(f"{law}: circle better than square along X", x, on_line))
        found.append(rules.smaller(f"{law}: circle worse than square along Y", {name: on_line[name] for name in y}, y))
    return found


def better_estimates(observing: Outcome, without: Outcome) -> Check:
    """The speed of every joint is estimated better with the disturbance in the observer."""
    own, other = (
        {f"joint {joint} (rad/s)": rms for joint, rms in enumerate(entry.speed_errors, start=1)}
        for entry in (observing, without)
    )
    return rules.smaller("speeds are estimated better with the disturbance observer, rms error", own, other)


def rms_listed(outcomes: Mapping[str, Outcome]) -> str:
    """RMS errors X / Y, mm, in one line."""
    metrics = {label: entry.metrics for label, entry in outcomes.items()}
    return ", ".join(f"{label} {1e3 * m.rms_x_m:.2g} / {1e3 * m.rms_y_m:.2g}" for label, m in metrics.items())


def printed_document(columns: Mapping[str, Printed]) -> dict[str, Any]:
    """Columns of a table, JSON-able."""
    return {law: column.as_dict() for law, column in columns.items()}


def _torque(metrics: Metrics) -> dict[str, float]:
    return {"RMS_u (N m)": metrics.rms_torque_nm}
