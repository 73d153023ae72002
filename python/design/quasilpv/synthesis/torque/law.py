"""The tracking law `dob-torque`, from robot and specification to a design with its witness."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from quasilpv.certificate.laws.dob_torque import DobTorqueLaw
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.inertia_schedule import premultiplied_schedule
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.torque.design import TorqueDesign, design_torque_law
from quasilpv.synthesis.torque.envelope import VertexTables, torque_envelope
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import Robot


def torque_law(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `dob-torque`: Theorem IV.11 of Dehak 2022 in reduced form, with usable gains.

    Args:
        robot: what it is for.
        specification: what is asked for.
        progress: called with (points done, points in all).

    Raises:
        InfeasibleError: no design meets the specification.
    """
    return tracking_design(robot, specification, design_torque_law(robot, specification, progress))


def premultiplied_torque_law(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Design `dob-torque` for beta(z) times the equations of motion, as Dehak 2022, IV.5.2 does for the five-bar robot.

    The inertia of the design model is beta(z) times the constant one of the driven joints; what the mechanism adds to
    it is disturbance. No operating envelope is stated: its sets would be those of premultiplied torques.

    Args:
        robot, specification, progress: as for `torque_law`.

    Raises:
        InfeasibleError: the robot has no premultiplication, or no design meets the specification.
    """
    design = design_torque_law(robot, specification, progress, premultiplied_schedule(robot))
    controller = "dob-torque-premultiplied"
    return replace(
        tracking_design(robot, specification, design, envelope=False),
        controller=controller,
        inputs={"controller": controller, "specification": specification.to_document()},
    )


def tracking_design(
    robot: Robot, specification: Specification, design: TorqueDesign, *, envelope: bool = True
) -> TrackingDesign:
    """What a design of `design_torque_law` ships.

    Args:
        robot, specification: what it was made for.
        design: vertex tables and evidence.
        envelope: whether to state an operating envelope.

    Raises:
        InfeasibleError: the law has no verified operating envelope.
    """
    tables, premultiplication = design.law, {}
    if tables.premultiplication is not None:
        premultiplication = {"premultiplication": tables.polytope.to_document(tables.premultiplication)}
    witness = _witness(design)
    if envelope:
        vertices = VertexTables(tables.inertia, tables.feedback, tables.observer)
        witness["envelope"] = torque_envelope(robot, vertices, witness)
    return TrackingDesign(
        controller=DobTorqueLaw.tag(),
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law={
            "kind": DobTorqueLaw.tag(),
            "feedback": tables.polytope.to_document(tables.feedback),
            "observer": tables.polytope.to_document(tables.observer),
            "filter_time_constant_s": tables.filter_time_constant_s,
            "inertia": tables.polytope.to_document(tables.inertia),
            **premultiplication,
        },
        expressions={
            "premises": tuple(premise.expression for premise in design.schedule.premises),
            "gravity": tuple(robot.model.symbolic.gravity),
        },
        inputs={"controller": DobTorqueLaw.tag(), "specification": specification.to_document()},
        report=design.report(),
        witness=witness,
    )


def _witness(design: TorqueDesign) -> dict[str, Any]:
    """The points of the two conditions, SI; inertia and gains are those of the law's own tables."""
    feedback, observer = design.feedback, design.observer
    return {
        "feedback": {
            "condition": "IV.11-reduced-feedback",
            "decay_per_s": feedback.decay,
            "disk_rad_s": feedback.disk,
            "gamma": feedback.gamma,
            "P": feedback.P.tolist(),
        },
        "observer": {
            "condition": "IV.11-reduced-observer",
            "decay_per_s": observer.decay,
            "disk_rad_s": observer.disk,
            "noise": observer.noise,
            "gamma": observer.gamma,
            "Q": observer.Q.tolist(),
            "multipliers": {
                "bounded_real": observer.multipliers["bounded real"][0].tolist(),
                "pole_disk": observer.multipliers["pole disk"][0].tolist(),
            },
        },
    }
