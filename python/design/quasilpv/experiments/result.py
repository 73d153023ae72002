"""The result of tracking one scenario with one controller: its table row and what its figures show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact.envelope import OperatingEnvelope
from quasilpv.defaults import ENCODER_BITS
from quasilpv.experiments.metrics import Metrics
from quasilpv.experiments.run import Run
from quasilpv.systems.robots.drawing import Drawing


@dataclass(frozen=True, eq=False)
class Disturbance:
    """The true lumped disturbance in the coordinates in which the controller estimates it.

    Attributes:
        values: (N, n).
        unit: ``"rad/s²"`` or ``"N m"``.
        quantity: ``"acceleration"`` or ``"torque"``.
    """

    values: FloatArray
    unit: str
    quantity: str


@dataclass(frozen=True)
class Variant:
    """What distinguishes the rows of one scenario.

    Attributes:
        controller: controller id.
        encoder_bits: encoder resolution, 0 for exact angles.
        compensated: False if the law observes the disturbance but was told not to compensate it.
    """

    controller: str
    encoder_bits: int = ENCODER_BITS
    compensated: bool = True

    @property
    def label(self) -> str:
        """Controller, and what is not the default: encoders of another resolution, no compensation."""
        parts = [self.controller]
        if self.encoder_bits != ENCODER_BITS:
            parts.append(f"{self.encoder_bits} bits" if self.encoder_bits else "exact angles")
        if not self.compensated:
            parts.append("no compensation")
        return ", ".join(parts)

    @property
    def slug(self) -> str:
        """The label as the name of a folder."""
        return self.label.replace(", ", "-").replace(" ", "-")


@dataclass(frozen=True, eq=False)
class TrackResult:
    """One row of the table and everything its figures show.

    Attributes:
        scenario: scenario id, or the name of a trajectory given as a file.
        variant: controller and what distinguishes it from other rows.
        rate_hz: sample rate of the controller.
        plant: ``"nominal"`` or ``"perturbed"``.
        velocity_noise_rad_s: standard deviation of the noise on measured speeds.
        metrics: the numbers.
        worst_growth_rate_per_s: worst growth rate of the sampled closed loop with half a sample of delay; ``None`` if
            the design has no such result (baselines).
        run: the record.
        robot: what moved, as pictures show it.
        torque_limit_nm: (n,) what its drives deliver.
        tool_position_m: (N, 2) true position of the tool; (N, 3) in space.
        reference_position_m: likewise, where it should have been.
        true_disturbance: ``None`` for laws that estimate none.
        envelope: what the artifact says of its operating envelope; ``None`` if it says nothing.
    """

    scenario: str
    variant: Variant
    rate_hz: float
    plant: str
    velocity_noise_rad_s: float
    metrics: Metrics
    worst_growth_rate_per_s: float | None
    run: Run
    robot: Drawing
    torque_limit_nm: FloatArray
    tool_position_m: FloatArray
    reference_position_m: FloatArray
    true_disturbance: Disturbance | None
    envelope: OperatingEnvelope | None = None

    def __repr__(self) -> str:
        """What ran, in a line, and its numbers in another."""
        return f"TrackResult({self.title}, {self.plant} plant, {self.rate_hz:g} Hz\n  {self.metrics})"

    @property
    def in_space(self) -> bool:
        """Whether the tool leaves a plane."""
        return bool(self.reference_position_m.shape[1] > 2)

    @property
    def distance_m(self) -> FloatArray:
        """(N,) of the tool from where it should have been."""
        return np.asarray(np.linalg.norm(self.tool_position_m - self.reference_position_m, axis=1))

    @property
    def title(self) -> str:
        """Scenario and label, for titles of figures."""
        return f"{self.scenario}, {self.variant.label}"

    def row(self) -> dict[str, Any]:
        """The row of ``design track --json``; member names and order are an interface."""
        return {
            "scenario": self.scenario,
            "controller": self.variant.controller,
            "rate_hz": self.rate_hz,
            **self.metrics.as_dict(),
            "worst_growth_rate_per_s": self.worst_growth_rate_per_s,
            "plant": self.plant,
            "sensors": {"encoder_bits": self.variant.encoder_bits, "velocity_noise_rad_s": self.velocity_noise_rad_s},
        }
