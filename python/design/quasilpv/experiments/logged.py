"""Runs from their logs: the record, the robot and the numbers, as if the run had just been made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quasilpv.documents.mechanism import LinkParameters
from quasilpv.documents.plants import (
    ElasticTreePlant,
    FiveBarPlant,
    Plant,
    SerialArmPlant,
    SpringDiscPlant,
    TreePlant,
)
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import variant_of
from quasilpv.experiments.track import run_from_columns, summarise_as
from quasilpv.systems.robots.arm_parameters import Link
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.fivebar import RhombicFiveBar
from quasilpv.systems.robots.fivebar_linkage import FiveBarLinkage
from quasilpv.systems.robots.mechanism import PlanarMechanism
from quasilpv.systems.robots.rolling_disc import RollingDisc
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind, KinematicTree, TreeJoint
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from quasilpv.telemetry import RunLog
from quasilpv.telemetry.recording import columns_of

NO_LIMIT = 1e6
"""Of a plant's joint, whose limits a scenario does not state."""


def logged_result(log: RunLog) -> TrackResult:
    """The numbers of a logged run, and all that its figures show.

    Raises:
        InputError: the log lacks a document, or the plant's true motion.
    """
    scenario, artifact = log.scenario, log.artifact
    variant = replace(variant_of(artifact, scenario.sensors), controller=log.header.controller)
    return summarise_as(
        logged_run(log),
        scenario.name,
        mechanism_of(scenario.plant),
        artifact,
        plant=scenario.plant.label,
        sensors=scenario.sensors,
        variant=variant,
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
    columns = {"time_s": seq * T, "flags": telemetry["flags"], "premise_excess": telemetry["premise_excess"]}
    columns |= columns_of("QLPV_TELEMETRY", telemetry, n) | columns_of("QLPV_TRUTH", truth, n)
    return run_from_columns(columns, n, T)


def mechanism_of(plant: Plant) -> PlanarMechanism | TreeMechanism:
    """The mechanism that the ``plant`` member of a scenario describes.

    Raises:
        InputError: a five-bar with links of two lengths, which are simulated but not designed for, or a robot in space.
    """
    name = plant.kind
    if isinstance(plant, SerialArmPlant):
        # In opposite gravity an arm hangs upright: its angles count from there.
        arm = PlanarSerialArm(name, tuple(map(_link, plant.links)), abs(plant.gravity_m_s2))
        return replace(arm, equilibrium="upright") if plant.gravity_m_s2 < 0.0 else arm
    if isinstance(plant, FiveBarPlant):
        return RhombicFiveBar(FiveBarLinkage(name, _link(plant.active), _link(plant.passive), plant.gravity_m_s2))
    if isinstance(plant, SpringDiscPlant):
        return RollingDisc(name, **plant.model_dump(exclude={"kind", "label"}))
    if isinstance(plant, TreePlant | ElasticTreePlant):
        return _tree(plant)
    raise InputError("scenario", "plant.kind", name, "a mechanism that is known here")


def _tree(plant: TreePlant | ElasticTreePlant) -> TreeMechanism:
    joints = tuple(
        TreeJoint(
            name=joint.name,
            kind=JointKind(joint.kind),
            placement=Placement(np.array(joint.rotation), np.array(joint.translation_m)),
            axis=np.array(joint.axis),
            inertia=SpatialInertia(joint.mass_kg, np.array(joint.first_moment_kg_m), np.array(joint.rotational_kg_m2)),
            rotor_inertia_kg_m2=joint.rotor_inertia_kg_m2,
            lower=-NO_LIMIT,
            upper=NO_LIMIT,
        )
        for joint in plant.chain
    )
    tool = Placement.identity()
    if plant.tool is not None:
        tool = Placement(np.array(plant.tool.rotation), np.array(plant.tool.translation_m))
    return TreeMechanism(
        KinematicTree(plant.label, joints, tool, np.array(plant.gravity_m_s2)),
        tuple(joint.friction_viscous_nm_s for joint in plant.chain),
        tuple(joint.friction_coulomb_nm for joint in plant.chain),
    )


def _link(link: LinkParameters) -> Link:
    return Link(**link.model_dump())
