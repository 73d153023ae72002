"""What a design is asked for, in numbers a control engineer would give."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import isfinite, pi, sqrt
from typing import Any

from quasilpv.errors import InputError

VELOCITY_NOISE_RAD_S = 0.05
"""Standard deviation of the noise on measured speeds the torque activity is bounded for: that of the scenarios."""


@dataclass(frozen=True)
class Specification:
    """Requirements on the default design.

    Attributes:
        rate_hz: sample rate of the controller.
        encoder_bits: resolution of the joint encoders the torque activity is bounded for.
        delay_samples: transport delay that must lie inside the margin, in samples.
        margin_spare: factor by which the inertia margin exceeds the needed range on both sides.
        torque_activity: bound on the rms torque increment per sample caused by encoder quantisation, as a fraction of
            the Euclidean norm of the torque limits.
        disturbance_frequency_rad_s: disturbances are to be rejected best up to this frequency.

    Raises:
        InputError: a number is not finite or out of range.
    """

    rate_hz: float = 1000.0
    encoder_bits: int = 20
    delay_samples: float = 0.5
    margin_spare: float = 1.1
    torque_activity: float = 0.15
    disturbance_frequency_rad_s: float = 20.0

    def __post_init__(self) -> None:
        """Refuse numbers that mean nothing."""
        bounds: dict[str, tuple[float, float]] = {
            "rate_hz": (50.0, 50_000.0),
            "encoder_bits": (8, 32),
            "delay_samples": (0.0, 4.0),
            "margin_spare": (1.0, 10.0),
            "torque_activity": (1e-6, 10.0),
            "disturbance_frequency_rad_s": (1e-3, 1e4),
        }
        for field, (low, high) in bounds.items():
            value = getattr(self, field)
            if not (isfinite(value) and low <= value <= high):
                raise InputError("specification", field, value, f"a number in [{low:g}, {high:g}]")

    @property
    def sample_period_s(self) -> float:
        """T."""
        return 1.0 / self.rate_hz

    @property
    def delay_s(self) -> float:
        """The delay that must lie inside the margin."""
        return self.delay_samples * self.sample_period_s

    @property
    def angle_noise_rad(self) -> float:
        """Standard deviation of the rounding error of the encoders, uniform over one count."""
        return 2.0 * pi / 2.0**self.encoder_bits / sqrt(12.0)

    def to_document(self) -> dict[str, Any]:
        """JSON-able copy, part of the design inputs."""
        return asdict(self)
