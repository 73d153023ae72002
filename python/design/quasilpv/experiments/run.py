"""The record of one closed-loop run, whoever produced it: the bindings in one process or two processes over LCM."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv.arrays import FloatArray

IntArray: TypeAlias = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Run:
    """One row per sample k at time k T, N samples of n joints, SI units, joint space.

    Attributes:
        sample_period_s: T.
        time_s: (N,) k T.
        reference_angle_rad: (N, n) r.
        reference_speed_rad_s: (N, n) r'.
        true_angle_rad: (N, n) angles of the plant, before the encoder.
        true_speed_rad_s: (N, n) speeds of the plant.
        true_acceleration_rad_s2: (N, n) accelerations of the plant, under the torque of the sample before.
        measured_angle_rad: (N, n) what the controller read.
        estimated_angle_rad: (N, n) corrected estimate of the controller at the sample.
        estimated_speed_rad_s: (N, n) as above.
        estimated_disturbance: (N, n) rad/s^2 for acceleration-level laws, N m for the others.
        filtered_disturbance: (N, n) the estimate as the torque compensates it.
        torque_nm: (N, n) applied torque, after the limits.
        flags: (N,) fault bits of the step; 0 is healthy.
        premise_excess: (N,) largest distance of a premise from its box, in widths of that box; 0 inside.
    """

    sample_period_s: float
    time_s: FloatArray
    reference_angle_rad: FloatArray
    reference_speed_rad_s: FloatArray
    true_angle_rad: FloatArray
    true_speed_rad_s: FloatArray
    true_acceleration_rad_s2: FloatArray
    measured_angle_rad: FloatArray
    estimated_angle_rad: FloatArray
    estimated_speed_rad_s: FloatArray
    estimated_disturbance: FloatArray
    filtered_disturbance: FloatArray
    torque_nm: FloatArray
    flags: IntArray
    premise_excess: FloatArray

    def __repr__(self) -> str:
        """Its size in a line."""
        return f"Run({self.time_s.size} samples of {self.joints} joints, {self.sample_period_s:g} s each)"

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.true_angle_rad.shape[1])

    def until(self, sample: int) -> Run:
        """The record before a sample, given by its number k."""
        before = np.rint(self.time_s / self.sample_period_s) < sample
        names = (field.name for field in fields(self) if field.name != "sample_period_s")
        return replace(self, **{name: getattr(self, name)[before] for name in names})

    def first_difference(self, other: Run) -> str | None:
        """Name the first sample and quantity in which two runs differ in any bit.

        Returns:
            ``None`` if every sample of both runs is identical, else e.g. ``"torque_nm differs first at sample 17"``.
        """
        for field in fields(self):
            mine: Any = np.asarray(getattr(self, field.name))
            theirs: Any = np.asarray(getattr(other, field.name))
            if mine.shape != theirs.shape:
                return f"{field.name} has shape {mine.shape} against {theirs.shape}"
            differing = np.argwhere(mine != theirs)
            if differing.size:
                return f"{field.name} differs first at sample {int(differing[0][0]) if mine.ndim else 0}"
        return None
