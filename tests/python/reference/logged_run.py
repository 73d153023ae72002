"""A short run and its log: fixtures of the tests of logs, and how a log is changed for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import Artifact
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import EXTERNAL_TORQUE, Sensors, TrackingExperiment, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.telemetry import LOG_NAME, Event, read_events, write_events
from quasilpv.telemetry.message_types import channel_type
from quasilpv.trajectories import rest

SAMPLES = 300


@pytest.fixture(scope="module")
def logged_artifact() -> Artifact:
    return release(DesignRequest.of("arm3", "ctc-dob", Specification())).artifact


@pytest.fixture(scope="module")
def logged_experiment() -> TrackingExperiment:
    """A quick one: the arm holds a posture against the disturbance."""
    still = rest("hold", 3, SAMPLES * 1e-3)
    posture = tracking_experiment("serial-square").trajectory.evaluate(0.0).angle
    coefficients = still.coefficients + np.eye(1, 6)[None] * posture[None, :, None]
    trajectory = replace(still, coefficients=coefficients)
    return TrackingExperiment("hold", robot("arm3"), trajectory, EXTERNAL_TORQUE)


@pytest.fixture(scope="module")
def tracked(
    logged_artifact: Artifact, logged_experiment: TrackingExperiment, tmp_path_factory: pytest.TempPathFactory
) -> tuple[TrackResult, Path]:
    """A run in this process, and its log."""
    folder = tmp_path_factory.mktemp("log")
    return track(
        RunSetup(logged_experiment, logged_artifact, plant="perturbed", sensors=Sensors()), folder
    ), folder / LOG_NAME


def edited(path: Path, target: Path, change: Any) -> Path:
    """A copy of a log whose events are passed through a function that may return None to drop one."""
    events = [change(index, event) for index, event in enumerate(read_events(path))]
    return write_events(target, [event for event in events if event is not None])


def resealed(event: Event, **members: Any) -> Event:
    """The event with other members and a correct checksum."""
    kind = channel_type(event.channel)
    records = np.frombuffer(event.data, kind.record).copy()
    for name, value in members.items():
        records[name] = value
    return event._replace(data=kind.encode(records)[0])
