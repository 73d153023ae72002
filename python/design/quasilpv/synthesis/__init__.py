"""From a robot and a specification to the numbers of a tracking law.

A new law is one new file and one entry of `CONTROLLERS`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from quasilpv.errors import InputError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.registry import (
    CONTROLLERS,
    DEFAULT_CONTROLLER,
    ControllerKind,
    controller_kind,
    default_controller,
)
from quasilpv.synthesis.request import DesignRequest, specification_for
from quasilpv.synthesis.specification import Specification

if TYPE_CHECKING:
    from quasilpv.synthesis.tracking_design import TrackingDesign

__all__ = [
    "CONTROLLERS",
    "DEFAULT_CONTROLLER",
    "ControllerKind",
    "DesignRequest",
    "Specification",
    "controller_kind",
    "default_controller",
    "specification_for",
    "synthesise",
    "without_compensation",
]


def synthesise(request: DesignRequest, *, progress: Progress = no_progress) -> TrackingDesign:
    """Design one controller for one robot.

    Args:
        request: what is asked for.
        progress: called with (points done, points in all).

    Raises:
        InputError: unknown controller, or a law that cannot do without compensation.
        InfeasibleError: no design meets the specification.
    """
    design = controller_kind(request.controller).design(request.robot, request.specification, progress)
    return design if request.compensated else without_compensation(design)


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
    law = {name: member for name, member in design.law.items() if name not in ("lyapunov_bound", "motion_limits")}
    witness = {name: member for name, member in (design.witness or {}).items() if name not in ("envelope", "motion")}
    return replace(design, law={**law, **without}, inputs={**design.inputs, **without}, witness=witness or None)
