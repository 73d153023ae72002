"""`dob-acceleration` with inertia premises that are not measured, or not used: lumped into the disturbance.

A lumped premise is held at the middle of its interval in the design inertia M_n. The law itself does not change: its
scalars act on each joint alike. What changes is the range of ``M_t / M_n`` the loop has to tolerate, and so either the
margin that is left at a given bandwidth (`with_premises_lumped`), or the bandwidth that is left at a given margin
(`lumped_acceleration_law`).
"""

from __future__ import annotations

from dataclasses import replace

from quasilpv.synthesis.acceleration.design import design_acceleration_law
from quasilpv.synthesis.acceleration.law import acceleration_law_of
from quasilpv.synthesis.inertia_schedule import Schedule
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import Robot


def with_premises_lumped(design: TrackingDesign, scheduled: Schedule) -> TrackingDesign:
    """The same scalars and the same scale of the design inertia, scheduled with some of the premises only.

    Args:
        design: of `dob-acceleration`, scheduled with all premises.
        scheduled: by those that are left.

    Returns:
        A design without operating envelope: that of the given one is about another design inertia.
    """
    scale = float(design.report["inertia_scale"])
    return replace(
        design,
        law={**design.law, "inertia": scheduled.polytope.to_document(scale * scheduled.inertia)},
        expressions={
            **design.expressions,
            "premises": tuple(premise.expression for premise in scheduled.premises),
        },
        inputs={**design.inputs, "scheduled_premises": [str(premise.expression) for premise in scheduled.premises]},
        report={"inertia_scale": scale},
        witness={name: member for name, member in (design.witness or {}).items() if name != "envelope"},
    )


def lumped_acceleration_law(robot: Robot, specification: Specification, scheduled: Schedule) -> TrackingDesign:
    """The law with the largest bandwidth whose margins hold although some premises are lumped.

    Args:
        robot: what it is for.
        specification: what is asked for.
        scheduled: by the premises that are not lumped.

    Raises:
        InfeasibleError: no design meets the specification.
    """
    chosen = design_acceleration_law(robot, specification, scheduled=scheduled)
    design = acceleration_law_of(robot, specification, chosen)
    return replace(with_premises_lumped(design, scheduled), report=design.report)
