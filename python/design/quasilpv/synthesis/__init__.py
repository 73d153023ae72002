"""From a robot and a specification to the numbers of a tracking law.

A new law is one new file and one entry of `CONTROLLERS`. The registry is read by help pages: an entry says where its
design is, which is imported when one is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

from quasilpv.errors import InputError, one_of
from quasilpv.synthesis.progress import Progress, no_progress
from quasilpv.synthesis.specification import Specification

if TYPE_CHECKING:
    from quasilpv.synthesis.tracking_design import TrackingDesign
    from quasilpv.systems.robots.registry import Robot


@dataclass(frozen=True)
class ControllerKind:
    """An entry of the registry of controllers.

    Attributes:
        summary: one line for a listing.
        function: from robot, specification and progress to a design: ``module.name`` in this room.
        rate_hz: sample rate if nobody asks for another.
    """

    summary: str
    function: str
    rate_hz: float = 1000.0

    def design(self, robot: Robot, specification: Specification, progress: Progress) -> TrackingDesign:
        """Design it; see `synthesise`."""
        module, _, name = self.function.rpartition(".")
        design: Callable[[Robot, Specification, Progress], TrackingDesign]
        design = getattr(import_module(f"{__name__}.{module}"), name)
        return design(robot, specification, progress)


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
    "pid-tuned": ControllerKind("pid, tuned as dob-acceleration is", "baselines.tuned.pid_tuned"),
    "ctc-tuned": ControllerKind("ctc, tuned as dob-acceleration is", "baselines.tuned.computed_torque_tuned"),
    "ctc-dob-tuned": ControllerKind(
        "ctc-dob, tuned as dob-acceleration is", "baselines.tuned.computed_torque_with_observer_tuned"
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
    "dob-moving": ControllerKind(
        "dob-acceleration with one Lyapunov function for all motions, proved; positions only",
        "acceleration.law.moving_acceleration_law",
    ),
    "dob-acceleration": ControllerKind(
        "disturbance-observer tracking at the acceleration level, positions only (default)",
        "acceleration.law.acceleration_law",
    ),
}

DEFAULT_CONTROLLER = "dob-acceleration"

__all__ = [
    "CONTROLLERS",
    "DEFAULT_CONTROLLER",
    "Specification",
    "controller_kind",
    "specification_for",
    "synthesise",
    "without_compensation",
]


def controller_kind(controller: str) -> ControllerKind:
    """The controller of that name.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    if controller not in CONTROLLERS:
        raise InputError("controllers", "controller", controller, one_of(CONTROLLERS, controller))
    return CONTROLLERS[controller]


def specification_for(
    robot: Robot,
    controller: str = DEFAULT_CONTROLLER,
    *,
    rate_hz: float | None = None,
    encoder_bits: int | None = None,
    margin_spare: float | None = None,
    torque_activity: float | None = None,
) -> Specification:
    """The specification for these numbers; what is not given, and exact angles (0 bits), keep their default.

    The default rate is the controller's own, the frequency of disturbances the robot's.

    Args:
        robot: what is designed for.
        controller: one of `CONTROLLERS`.
        rate_hz, encoder_bits, margin_spare, torque_activity: see `Specification`.

    Raises:
        InputError: an unknown controller, or a number out of range.
    """
    return Specification(
        rate_hz=controller_kind(controller).rate_hz if rate_hz is None else rate_hz,
        encoder_bits=encoder_bits or Specification.encoder_bits,
        margin_spare=Specification.margin_spare if margin_spare is None else margin_spare,
        torque_activity=Specification.torque_activity if torque_activity is None else torque_activity,
        disturbance_frequency_rad_s=robot.disturbance_frequency_rad_s,
    )


def synthesise(
    robot: Robot,
    controller: str = DEFAULT_CONTROLLER,
    specification: Specification | None = None,
    *,
    progress: Progress = no_progress,
) -> TrackingDesign:
    """Design one controller for one robot.

    Args:
        robot: from the registry of robots.
        controller: one of `CONTROLLERS`.
        specification: what is asked for (default: that of `Specification`, at the controller's own rate and
            the robot's own frequency of disturbances); baselines use
            its sample rate only.
        progress: called with (points done, points in all).

    Raises:
        InputError: unknown controller.
        InfeasibleError: no design meets the specification.
    """
    kind = controller_kind(controller)
    return kind.design(robot, specification or specification_for(robot, controller), progress)


def without_compensation(design: TrackingDesign) -> TrackingDesign:
    """The same gains with the observed disturbance left out of the torque, to show what it is worth.

    Args:
        design: of a law that has the choice.

    Raises:
        InputError: the law cannot do without.
    """
    if "disturbance_compensation" not in design.law:
        raise InputError(design.controller, "disturbance_compensation", "off", "dob-acceleration, the law that has it")
    without = {"disturbance_compensation": False}
    # The envelope and the Lyapunov function are those of the compensated loop.
    law = {name: member for name, member in design.law.items() if name != "lyapunov_bound"}
    witness = {name: member for name, member in (design.witness or {}).items() if name not in ("envelope", "motion")}
    return replace(design, law={**law, **without}, inputs={**design.inputs, **without}, witness=witness or None)
