"""Closed-loop runs that items share: each is made once per process, with the design kept on disk.

Plants: ``nominal``; ``perturbed``, with the full payload of chapter IV; ``chapter-III``, see `chapter_three`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, TypeAlias

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.certificate.laws.dob_acceleration import DobAccelerationLaw
from quasilpv.certificate.laws.dob_torque import DobTorqueLaw
from quasilpv.experiments.designs import kept_design
from quasilpv.experiments.metrics import Metrics
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.scenarios import Sensors, tracking_experiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import AnyRobot, Robot

PlantName: TypeAlias = Literal["nominal", "perturbed", "chapter-III"]
Observer: TypeAlias = Literal["whole", "without compensation", "without disturbance"]

SENSORS = Sensors()
"""Encoders and speed noise of the scenarios."""

EXACT = Sensors(encoder_bits=0, velocity_noise_rad_s=0.0)
"""Angles and speeds as they are."""

FRICTION_NM_S = 10.0
FIRST_MASS_SCALE = 2.2


@dataclass(frozen=True)
class ClosedLoop:
    """One controller on one scenario.

    Attributes:
        scenario: scenario id.
        controller: controller id, with the registry's gains.
        rate_hz: sample rate.
        plant: see the module.
        sensors: what is measured.
        observer: ``whole``; ``without compensation``, the disturbance estimated but not fed back; ``without
            disturbance``, an observer of angles and speeds only.
        slew_scale: the slew limits of the robot times this; the source states none.
    """

    scenario: str
    controller: str
    rate_hz: float
    plant: PlantName = "perturbed"
    sensors: Sensors = SENSORS
    observer: Observer = "whole"
    slew_scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """A closed loop that was run.

    Attributes:
        loop: which.
        artifact: the controller.
        result: the run and its numbers.
    """

    loop: ClosedLoop
    artifact: Artifact
    result: TrackResult

    @property
    def metrics(self) -> Metrics:
        """Errors and torques."""
        return self.result.metrics

    @property
    def speed_errors(self) -> tuple[float, ...]:
        """Rms error of the estimated speed of each joint, rad/s."""
        error = self.result.run.estimated_speed_rad_s - self.result.run.true_speed_rad_s
        return tuple(float(rms) for rms in np.sqrt(np.mean(np.square(error), axis=0)))

    @property
    def saturated_samples(self) -> int:
        """Samples in which a joint has its largest torque."""
        torque = np.abs(self.result.run.torque_nm)
        return int(np.count_nonzero(np.any(torque >= self.artifact.limits.torque_nm, axis=1)))

    def described(self) -> dict[str, Any]:
        """Plant, rate, sensors, gains and numbers, JSON-able."""
        row = self.result.row() | {"plant": self.loop.plant, "observer": self.loop.observer}
        samples = {"samples": len(self.result.run.time_s), "saturated_samples": self.saturated_samples}
        return row | samples | {"gains": gains(self.artifact)}


@cache
def outcome(loop: ClosedLoop) -> Outcome:
    """Design, or take from the cache, and run.

    Raises:
        InfeasibleError, ClaimError: the controller cannot be designed.
    """
    experiment = tracking_experiment(loop.scenario)
    artifact = kept_design(
        DesignRequest.of(
            _with_drives(experiment.robot, loop.slew_scale),
            loop.controller,
            Specification(
                rate_hz=loop.rate_hz, disturbance_frequency_rad_s=experiment.robot.disturbance_frequency_rad_s
            ),
            compensated=loop.observer != "without compensation",
        )
    )
    if loop.observer == "without disturbance":
        artifact = without_disturbance_states(artifact)
    if loop.plant == "chapter-III":
        assert isinstance(experiment.robot, Robot)
        experiment = replace(experiment, robot=chapter_three(experiment.robot))
    plant: Literal["nominal", "perturbed"] = "perturbed" if loop.plant == "perturbed" else "nominal"
    variant = Variant(loop.controller, loop.sensors.encoder_bits, loop.observer == "whole")
    with TemporaryDirectory() as folder:
        result = track(RunSetup(experiment, artifact, plant=plant, sensors=loop.sensors, variant=variant), Path(folder))
    return Outcome(loop, artifact, result)


def _with_drives(robot: AnyRobot, slew_scale: float) -> AnyRobot:
    if slew_scale == 1.0:
        return robot
    assert isinstance(robot, Robot)
    slew = tuple(slew_scale * own for own in robot.limits.slew_nm_per_s)
    return replace(robot, limits=replace(robot.limits, slew_nm_per_s=slew))


def described(outcomes: Mapping[str, Outcome]) -> dict[str, dict[str, Any]]:
    """`Outcome.described` of each."""
    return {label: entry.described() for label, entry in outcomes.items()}


def results(outcomes: Mapping[str, Outcome]) -> dict[str, TrackResult]:
    """The runs, for figures."""
    return {label: entry.result for label, entry in outcomes.items()}


def chapter_three(robot: Robot) -> Robot:
    """The plant of Dehak 2022, III.3.3: m_1 up by 120 %, in the gravity torque only, friction 10 N m s/rad.

    Of link 1 the dynamics hold its static moment m_1 r_1 and its moment of inertia about the joint. A heavier link with
    its centre of mass nearer to the joint has the larger static moment and the same inertia, and is a rigid body.
    """
    arm = robot.model
    assert isinstance(arm, PlanarSerialArm)
    first, *others = arm.links
    static_moment = FIRST_MASS_SCALE * first.mass_kg * first.com_m
    com = 0.5 * first.inertia_kg_m2 / static_moment
    links = (replace(first, mass_kg=static_moment / com, com_m=com), *others)
    rubbing = tuple(replace(link, friction_nm_s=FRICTION_NM_S) for link in links)
    return replace(robot, model=replace(arm, links=rubbing))


def without_disturbance_states(artifact: Artifact) -> Artifact:
    """The law with an observer of angles and speeds only: the gains of its disturbance states are zero.

    The artifact makes no claim: those of the design do not hold for it.

    Args:
        artifact: of a law with a disturbance observer.
    """
    document = artifact.content()
    observer: Any = document["law"]["observer"]
    if isinstance(artifact.law, DobAccelerationLaw):
        observer = [*observer[:2], 0.0, 0.0]
    else:
        kept = 2 * artifact.joints
        blocks = [
            {**block, "vertices": [_upper_rows(vertex, kept) for vertex in block["vertices"]]}
            for block in observer["blocks"]
        ]
        observer = {**observer, "blocks": blocks}
    law = {**document["law"], "observer": observer}
    return Artifact.from_document({**document, "law": law, "witness": None, "verification": None})


def _upper_rows(matrix: list[list[float]], count: int) -> list[list[float]]:
    return [row if index < count else [0.0] * len(row) for index, row in enumerate(matrix)]


def gains(artifact: Artifact) -> dict[str, Any]:
    """The gains of a law and what its design reports, JSON-able.

    Of a scheduled feedback [Kp Kd KI] the bounds that the vertices put on the entries of each part.
    """
    law = artifact.content()["law"]
    found = {name: value for name, value in law.items() if name != "kind" and _is_plain(value)}
    if isinstance(artifact.law, DobTorqueLaw):
        bound = sum(np.abs(block["vertices"]).max(axis=0) for block in law["feedback"]["blocks"])
        parts = zip(("Kp", "Kd", "KI"), np.split(bound, 3, axis=1), strict=True)
        found["feedback_at_most"] = {name: float(part.max()) for name, part in parts}
    return {"law": found, "design": (artifact.verification or {}).get("report", {})}


def _is_plain(value: object) -> bool:
    """Whether a member is a number or a truth value, or several of them: no table."""
    members = value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]
    return all(isinstance(entry, int | float) for entry in members)
