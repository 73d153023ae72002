"""The numbers of one closed-loop run: tracking error of the tool, torque, torque activity, speed estimate."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.experiments.run import Run
from quasilpv.telemetry.codes import AT_LIMIT


@dataclass(frozen=True)
class Metrics:
    """Metrics over all samples from t = 0, no pre-roll.

    Attributes:
        rms_x_m: root mean square of the tool's error along X.
        rms_y_m: the same along Y.
        rms_z_m: the same along Z; None in a plane.
        mav_x_m: maximum absolute value of the tool's error along X.
        mav_y_m: the same along Y.
        rms_tool_m, max_tool_m: the same of the tool's distance from where it should be.
        rms_torque_nm: sqrt(mean over samples of the sum over joints of torque^2).
        rms_torque_increment_nm: the same of the differences of the torque between consecutive samples.
        rms_velocity_error_rad_s: the same of estimated minus true joint speed.
        share_at_limit: share of the samples in which a torque or slew limit acted on a joint. There the loop is open,
            and no certificate or gate speaks of it.
        largest_premise_excess: largest distance of a premise from its box, in widths of that box; 0 if none left it,
            None if the law has no premises.
    """

    rms_x_m: float
    rms_y_m: float
    rms_z_m: float | None
    mav_x_m: float
    mav_y_m: float
    rms_tool_m: float
    max_tool_m: float
    rms_torque_nm: float
    rms_torque_increment_nm: float
    rms_velocity_error_rad_s: float
    share_at_limit: float
    largest_premise_excess: float | None

    def as_dict(self) -> dict[str, float | None]:
        """The metrics by name, in the order of the attributes."""
        return asdict(self)


def rms_over_samples(values: FloatArray) -> float:
    """Root over the mean over samples of the sum over joints of squares: `sqrt(1/N sum_k |v_k|^2)`.

    Args:
        values: (N, n), N >= 1.
    """
    return float(np.sqrt(np.mean(np.sum(np.square(values), axis=1))))


def compute_metrics(run: Run, tool_error_m: FloatArray, *, has_premises: bool = True) -> Metrics:
    """All metrics of one run.

    Args:
        run: the record.
        tool_error_m: (N, 2) m, position error of the tool, FK(true angle) - FK(reference angle), in the base frame (X
            to the right, Y up; in space (N, 3), Z up). True angles, not measured ones: the encoder's rounding is not
            excused.
        has_premises: whether the law has any.
    """
    error = tool_error_m
    distance = np.linalg.norm(error, axis=1)
    rms, mav = np.sqrt(np.mean(np.square(error), axis=0)), np.max(np.abs(error), axis=0)
    return Metrics(
        rms_x_m=float(rms[0]),
        rms_y_m=float(rms[1]),
        rms_z_m=float(rms[2]) if len(rms) > 2 else None,
        mav_x_m=float(mav[0]),
        mav_y_m=float(mav[1]),
        rms_tool_m=float(np.sqrt(np.mean(np.square(distance)))),
        max_tool_m=float(np.max(distance)),
        rms_torque_nm=rms_over_samples(run.torque_nm),
        rms_torque_increment_nm=rms_over_samples(np.diff(run.torque_nm, axis=0)),
        rms_velocity_error_rad_s=rms_over_samples(run.estimated_speed_rad_s - run.true_speed_rad_s),
        share_at_limit=float(np.mean((run.flags & AT_LIMIT) != 0)),
        largest_premise_excess=float(np.max(run.premise_excess)) if has_premises else None,
    )
