"""From a robot and a specification to the numbers of a tracking law.

A new law is one new file and one line in `CONTROLLERS`.
"""

from __future__ import annotations

from quasilpv.errors import InputError
from quasilpv.synthesis import baselines
from quasilpv.synthesis.acceleration_design import Progress, no_progress
from quasilpv.synthesis.acceleration_law import acceleration_law
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.torque_law import torque_law
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.registry import Robot

CONTROLLERS = {
    "pid": "PID with feedforward, gains of Dehak 2022 (III.55), measured speeds",
    "ctc": "computed torque, gains of Dehak 2022 (III.57), measured speeds",
    "ctc-dob": "computed torque with a disturbance observer (Mohammadi et al. 2013), measured speeds",
    "dob-torque": "disturbance-observer tracking at the torque level (Dehak 2022, Theorem IV.11), positions only",
    "dob-acceleration": "disturbance-observer tracking at the acceleration level, positions only (default)",
}

DEFAULT_CONTROLLER = "dob-acceleration"

__all__ = ["CONTROLLERS", "DEFAULT_CONTROLLER", "Specification", "TrackingDesign", "synthesise"]


def synthesise(
    robot: Robot,
    controller: str = DEFAULT_CONTROLLER,
    specification: Specification | None = None,
    *,
    disturbance_compensation: bool = True,
    progress: Progress = no_progress,
) -> TrackingDesign:
    """Design one controller for one robot.

    Args:
        robot: from the registry of robots.
        controller: one of `CONTROLLERS`.
        specification: what is asked for (default: `Specification()`); baselines use its sample rate only.
        disturbance_compensation: of `dob-acceleration`.
        progress: called with (points done, points in all).

    Raises:
        InputError: unknown controller, or compensation switched off for a law that has none.
        InfeasibleError: no design meets the specification.
    """
    wanted = specification or Specification()
    if controller not in CONTROLLERS:
        raise InputError("controllers", "controller", controller, f"one of {', '.join(CONTROLLERS)}")
    if controller == "dob-acceleration":
        return acceleration_law(robot, wanted, progress, disturbance_compensation)
    if not disturbance_compensation:
        raise InputError(controller, "disturbance_compensation", "off", "dob-acceleration, the law that has it")
    if controller == "dob-torque":
        return torque_law(robot, wanted, progress)
    fixed = {"pid": baselines.pid, "ctc": baselines.computed_torque, "ctc-dob": baselines.computed_torque_with_observer}
    return fixed[controller](robot, wanted)
