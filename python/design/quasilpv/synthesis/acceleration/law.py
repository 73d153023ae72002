"""The tracking law `dob-acceleration`, from robot and specification to a design with its witness.

Two controllers have this law: `dob-acceleration`, the default, stable in every posture with every payload; and
`dob-moving`, with one Lyapunov function for all of them, whatever the motion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from quasilpv.certificate.laws.dob_acceleration import DobAccelerationLaw
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.design import AccelerationDesign, design_acceleration_law
from quasilpv.synthesis.acceleration.envelope import acceleration_envelope
from quasilpv.synthesis.acceleration.moving_lyapunov import MovingLyapunov, moving_lyapunov
from quasilpv.synthesis.acceleration.planar_range import planar_chain_witness
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign, inertia_table, premise_and_gravity
from quasilpv.systems.robots.registry import Robot


def acceleration_law(robot: Robot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `dob-acceleration`.

    Args:
        robot: what it is for.
        specification: what is asked for.
        progress: called with (points done, points in all).

    Raises:
        InfeasibleError: no design meets the specification.
    """
    return _law(robot, specification, progress, moving=False)


def moving_acceleration_law(
    robot: Robot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Design `dob-moving`: arguments and errors as of `acceleration_law`."""
    return _law(robot, specification, progress, moving=True)


def _law(robot: Robot, specification: Specification, progress: Progress, *, moving: bool) -> TrackingDesign:
    design = design_acceleration_law(robot, specification, progress, moving=moving)
    made = acceleration_law_of(robot, specification, design)
    period, bandwidth = specification.sample_period_s, design.candidate.bandwidths[0]
    envelope = acceleration_envelope(robot, dict(made.law), period, bandwidth)
    return replace(made, witness={**(made.witness or {}), "envelope": envelope})


def acceleration_law_of(robot: Robot, specification: Specification, design: AccelerationDesign) -> TrackingDesign:
    """What a design ships, its operating envelope left out.

    Args:
        robot, specification: what it was made for.
        design: scalars and evidence.
    """
    scalars, lyapunov = design.candidate.law, _lyapunov(design, specification)
    controller = DobAccelerationLaw.tag() if design.disc is None else "dob-moving"
    kp, kd, ki = (float(gain) for gain in scalars.feedback)
    return TrackingDesign(
        controller=controller,
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law={
            "kind": DobAccelerationLaw.tag(),
            "feedback": {"kp": kp, "kd": kd, "ki": ki},
            "observer": [float(gain) for gain in scalars.observer],
            "filter_time_constant_s": scalars.filter_time_constant_s,
            "disturbance_compensation": True,
            "inertia": inertia_table(robot, design.candidate.inertia_scale),
            **({} if lyapunov is None else {"lyapunov_bound": lyapunov.bound_document()}),
        },
        expressions=premise_and_gravity(robot),
        inputs={"controller": controller, "specification": specification.to_document()},
        report=design.report(),
        witness=_witness(robot, design, specification, lyapunov),
    )


def _lyapunov(design: AccelerationDesign, specification: Specification) -> MovingLyapunov | None:
    """A common Lyapunov function for the disc of the design, if it has one and a function is found."""
    if design.disc is None:
        return None
    return moving_lyapunov(design.candidate.law, design.disc, specification.delay_samples)


def _witness(
    robot: Robot, design: AccelerationDesign, specification: Specification, lyapunov: MovingLyapunov | None
) -> dict[str, Any]:
    """The points of the two conditions, in their own time unit, and the bandwidths that fix their data."""
    wc, wo = design.candidate.bandwidths
    motion = {}
    if design.disc is not None:
        function = {} if lyapunov is None else {"lyapunov": lyapunov.to_document()}
        longest = {"longest_delay_samples": specification.delay_samples}
        motion = {"motion": {**design.disc.to_document(), **longest, **function}}
    return {
        **planar_chain_witness(robot, design.candidate.inertia_scale),
        "feedback": {"condition": "sampled-feedback", "bandwidth_rad_s": wc, **design.feedback.point("P")},
        "observer": {"condition": "sampled-observer", "bandwidth_rad_s": wo, **design.observer.point("Q")},
        **motion,
    }
