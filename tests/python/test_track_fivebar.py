"""The five-bar robot in closed loop: C++ controller, closed-chain plant under IDA, full payload, 20-bit encoders."""

from __future__ import annotations

from pathlib import Path

import pytest

from quasilpv.experiments.designs import kept_design
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification

LARGEST_RMS_M = {2000.0: 1.0e-4, 4000.0: 2.0e-5}
"""Required accuracy of the default design on the spiral, both axes, by rate."""


def run(folder: Path, scenario: str, rate_hz: float, *, compensate: bool = True) -> TrackResult:
    artifact = kept_design(
        DesignRequest.of("fivebar", "dob-acceleration", Specification(rate_hz=rate_hz), compensated=compensate),
        folder=folder / "designs",
    )
    experiment = tracking_experiment(scenario)
    return track(RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors()), folder / scenario)


@pytest.mark.parametrize("rate_hz", sorted(LARGEST_RMS_M))
@pytest.mark.parametrize("scenario", ["fivebar-spiral", pytest.param("fivebar-spiral-fast", marks=pytest.mark.full)])
def test_when_the_default_design_draws_the_spiral_expect_the_required_accuracy(
    scenario: str, rate_hz: float, tmp_path: Path
) -> None:
    metrics = run(tmp_path, scenario, rate_hz).metrics
    assert max(metrics.rms_x_m, metrics.rms_y_m) <= LARGEST_RMS_M[rate_hz]


def test_when_the_disturbance_is_strong_expect_compensation_to_divide_the_error_by_five_at_least(
    tmp_path: Path,
) -> None:
    with_observer, without = (
        run(tmp_path / str(on), "fivebar-spiral-strong", 2000.0, compensate=on).metrics for on in (True, False)
    )
    for axis in ("rms_x_m", "rms_y_m"):
        assert getattr(without, axis) >= 5.0 * getattr(with_observer, axis)
