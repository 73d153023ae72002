"""Runs from their logs: the record, the robot and the numbers, as if the run had just been made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.experiments.run import FloatArray, Run
from quasilpv.experiments.track import summarise_as
from quasilpv.scenarios import FiveBarPlant, LinkParameters, Plant, SerialArmPlant
from quasilpv.systems.arm_parameters import Link
from quasilpv.systems.arms import PlanarSerialArm
from quasilpv.systems.fivebar import RhombicFiveBar
from quasilpv.systems.fivebar_linkage import FiveBarLinkage
from quasilpv.systems.mechanism import PlanarMechanism
from quasilpv.systems.rolling_disc import RollingDisc
from quasilpv.telemetry import RunLog


def logged_result(log: RunLog) -> TrackResult:
    """The numbers of a logged run, and all that its figures show.

    Raises:
        InputError: the log lacks a document, or the plant's true motion.
    """
    scenario, artifact = log.scenario, log.artifact
    compensated = getattr(artifact.law, "disturbance_compensation", True)
    return summarise_as(
        logged_run(log),
        scenario.name,
        mechanism_of(scenario.plant),
        artifact,
        plant=scenario.plant.label,
        sensors=scenario.sensors,
        variant=Variant(log.header.controller, scenario.sensors.encoder_bits, compensated),
    )


def logged_run(log: RunLog) -> Run:
    """The record of a logged run: the samples of which both telemetry and the truth are known.

    Raises:
        InputError: there is none, as in a log of a real robot, or of one heard on the wire only.
    """
    telemetry, truth = log["telemetry"].samples, log["truth"].samples
    seq, told, true = np.intersect1d(telemetry["seq"], truth["seq"], return_indices=True)
    if not seq.size:
        raise InputError(log.source, "QLPV_TRUTH", "no sample", "the true motion of the plant beside QLPV_TELEMETRY")
    telemetry, truth, n, T = telemetry[told], truth[true], log.artifact.joints, log.artifact.sample_period_s

    def told_by(name: str) -> FloatArray:
        return np.array(telemetry[name][:, :n])

    return Run(
        sample_period_s=T,
        time_s=seq * T,
        reference_angle_rad=told_by("reference_angle_rad"),
        reference_speed_rad_s=told_by("reference_speed_rad_s"),
        true_angle_rad=np.array(truth["angle_rad"][:, :n]),
        true_speed_rad_s=np.array(truth["speed_rad_s"][:, :n]),
        true_acceleration_rad_s2=np.array(truth["acceleration_rad_s2"][:, :n]),
        measured_angle_rad=told_by("measured_angle_rad"),
        estimated_angle_rad=told_by("estimated_angle_rad"),
        estimated_speed_rad_s=told_by("estimated_speed_rad_s"),
        estimated_disturbance=told_by("estimated_disturbance"),
        filtered_disturbance=told_by("filtered_disturbance"),
        torque_nm=told_by("applied_torque_nm"),
        flags=telemetry["flags"].astype(np.int64),
    )


def mechanism_of(plant: Plant) -> PlanarMechanism:
    """The mechanism that the ``plant`` member of a scenario describes.

    Raises:
        InputError: a five-bar with links of two lengths, which are simulated but not designed for.
    """
    name = plant.kind
    if isinstance(plant, SerialArmPlant):
        # In opposite gravity an arm hangs upright: its angles count from there.
        arm = PlanarSerialArm(name, tuple(map(_link, plant.links)), abs(plant.gravity_m_s2))
        return replace(arm, equilibrium="upright") if plant.gravity_m_s2 < 0.0 else arm
    if isinstance(plant, FiveBarPlant):
        return RhombicFiveBar(FiveBarLinkage(name, _link(plant.active), _link(plant.passive), plant.gravity_m_s2))
    return RollingDisc(name, **plant.model_dump(exclude={"kind", "label"}))


def _link(link: LinkParameters) -> Link:
    return Link(**link.model_dump())
