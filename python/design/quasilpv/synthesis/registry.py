"""The controllers known by name.

The registry is read by help pages: an entry says where its design is, which is imported when one is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from quasilpv.errors import InputError, look_up
from quasilpv.progress import Progress
from quasilpv.synthesis.specification import Specification

if TYPE_CHECKING:
    from quasilpv.synthesis.tracking_design import TrackingDesign
    from quasilpv.systems.robots.registry import AnyRobot


@dataclass(frozen=True)
class ControllerKind:
    """An entry of the registry of controllers.

    Attributes:
        summary: one line for a listing.
        function: from robot, specification and progress to a design: ``module.name`` in this room.
        rate_hz: sample rate if nobody asks for another.
        in_space: the same function for robots in space; None if there is none.
        arm_classes: of robots in space that it is for (`quasilpv.systems.robots.joint_drive.ArmClass`).
        only_by_name: it is never the default of a class.
    """

    summary: str
    function: str | None
    rate_hz: float = 1000.0
    in_space: str | None = None
    arm_classes: tuple[str, ...] = ("rigid",)
    only_by_name: bool = False

    def design(self, robot: AnyRobot, specification: Specification, progress: Progress) -> TrackingDesign:
        """Design it; see `synthesise`."""
        function = self.in_space if robot.in_space else self.function
        if function is None:
            side, place = ("in_space", "in space") if robot.in_space else ("function", "in the plane")
            known = ", ".join(name for name, kind in CONTROLLERS.items() if getattr(kind, side) is not None)
            raise InputError(robot.id, "controller", self.summary, f"one for robots {place}: {known}")
        self._require_class(robot)
        module, _, name = function.rpartition(".")
        design: Callable[[Any, Specification, Progress], TrackingDesign]
        design = getattr(import_module(f"quasilpv.synthesis.{module}"), name)
        return design(robot, specification, progress)

    def _require_class(self, robot: AnyRobot) -> None:
        """InputError: it is for robots in space of another class."""
        from quasilpv.systems.robots.spatial_robot import SpatialRobot  # noqa: PLC0415 -- help pages ask for no robot

        if isinstance(robot, SpatialRobot) and robot.arm_class not in self.arm_classes:
            from quasilpv.synthesis.elastic.classes import require_class  # noqa: PLC0415

            own = next(name for name, kind in CONTROLLERS.items() if kind is self)
            others = [name for name, kind in CONTROLLERS.items() if robot.arm_class in kind.arm_classes]
            require_class(robot, own, self.arm_classes, others)


CONTROLLERS: Mapping[str, ControllerKind] = {
    "pid": ControllerKind(
        "PID with feedforward, gains of Dehak 2022 (III.55), measured speeds", "baselines.printed.pid"
    ),
    "ctc": ControllerKind(
        "computed torque, gains of Dehak 2022 (III.57), measured speeds", "baselines.printed.computed_torque"
    ),
    "ctc-dob": ControllerKind(
        "computed torque with a disturbance observer (Mohammadi et al. 2013), measured speeds",
        "baselines.printed.computed_torque_with_observer",
    ),
    "pd-tuned": ControllerKind(
        "pid without its integral, in space PD with gravity, tuned as dob-acceleration is",
        "baselines.tuned.pd_tuned",
        in_space="baselines.in_space.pd_gravity_tuned",
    ),
    "pid-tuned": ControllerKind(
        "pid, in space PID with gravity, tuned as dob-acceleration is",
        "baselines.tuned.pid_tuned",
        in_space="baselines.in_space.pid_gravity_tuned",
    ),
    "ctc-tuned": ControllerKind(
        "ctc, tuned as dob-acceleration is",
        "baselines.tuned.computed_torque_tuned",
        in_space="baselines.in_space.computed_torque_tuned",
    ),
    "ctc-dob-tuned": ControllerKind(
        "ctc-dob, tuned as dob-acceleration is",
        "baselines.tuned.computed_torque_with_observer_tuned",
        in_space="baselines.in_space.computed_torque_with_observer_tuned",
    ),
    "hinf-tracking": ControllerKind(
        "H-infinity PI tracking with limited gains (Dehak 2022, Theorem III.10), measured speeds, no feedforward",
        "hinf.hinf_tracking",
        rate_hz=4000.0,
    ),
    "pdc": ControllerKind(
        "stabilises theta = 0: scheduled state feedback of least gain (Dehak 2022, Theorem I.2), measured speeds",
        "stabilising.laws.pdc",
    ),
    "descriptor": ControllerKind(
        "stabilises theta = 0: descriptor law of least gain (Dehak 2022, Theorem II.6), measured speeds",
        "stabilising.laws.descriptor",
        rate_hz=4000.0,
    ),
    "robust": ControllerKind(
        "stabilises theta = 0 with unknown inertia: feedback of least gain (Dehak 2022, Theorem III.9), speeds too",
        "stabilising.laws.robust",
    ),
    "delayed": ControllerKind(
        "stabilises theta = 0: descriptor law with a moving window (Dehak 2022, Theorem II.8), measured speeds",
        "stabilising.laws.delayed",
    ),
    "dob-torque": ControllerKind(
        "disturbance-observer tracking at the torque level (Dehak 2022, Theorem IV.11), positions only",
        "torque.law.torque_law",
        rate_hz=4000.0,
    ),
    "dob-torque-premultiplied": ControllerKind(
        "dob-torque for the equations of motion times the robot's own matrix beta (Dehak 2022, IV.5.2)",
        "torque.law.premultiplied_torque_law",
        rate_hz=4000.0,
    ),
    "link-damped": ControllerKind(
        "elastic joints with encoders on both sides: dob-acceleration on the links, motors damp the gears",
        None,
        in_space="elastic.link_damped.link_damped",
        arm_classes=("elastic, dual encoders",),
        only_by_name=True,
    ),
    "link-dob": ControllerKind(
        "elastic joints with link encoders alone: dob-acceleration on the links, slower than the gears; positions only",
        None,
        in_space="elastic.link_damped.link_dob",
        arm_classes=("elastic, link encoders",),
    ),
    "motor-pid": ControllerKind(
        "elastic joints with motor encoders: PID of the motors, inverse dynamics and elastic reference; positions only",
        None,
        in_space="elastic.motor_pid.motor_pid",
        arm_classes=("elastic, motor encoders", "elastic, dual encoders"),
    ),
    "dob-moving": ControllerKind(
        "dob-acceleration with one Lyapunov function for all motions, proved; positions only",
        "acceleration.law.moving_acceleration_law",
        in_space="acceleration.tree_law.moving_tree_acceleration_law",
    ),
    "dob-acceleration": ControllerKind(
        "disturbance-observer tracking at the acceleration level, positions only (default)",
        "acceleration.law.acceleration_law",
        in_space="elastic.torque_controlled.acceleration_in_space",
        arm_classes=("rigid", "torque-controlled"),
    ),
}

DEFAULT_CONTROLLER = "dob-acceleration"


def controller_kind(controller: str) -> ControllerKind:
    """The controller of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    return look_up(CONTROLLERS, controller, "controllers", "controller")


def default_controller(robot: AnyRobot) -> str:
    """The controller of a robot if nobody asks for another: for robots in space by the class of their joints.

    Raises:
        InputError: there is none for its class.
    """
    from quasilpv.systems.robots.spatial_robot import SpatialRobot  # noqa: PLC0415 -- help pages ask for no robot

    if not isinstance(robot, SpatialRobot) or robot.arm_class in CONTROLLERS[DEFAULT_CONTROLLER].arm_classes:
        return DEFAULT_CONTROLLER
    for name, kind in CONTROLLERS.items():
        if robot.arm_class in kind.arm_classes and not kind.only_by_name:
            return name
    known = dict.fromkeys(str(own) for kind in CONTROLLERS.values() for own in kind.arm_classes)
    raise InputError(robot.source, "joints", f"an arm that is {robot.arm_class}", f"one that is {' or '.join(known)}")
