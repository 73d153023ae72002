"""The law `motor-pid` for arms with elastic joints whose encoders sit on the motors.

With ``M_n(q)`` on motor encoders no gains are known that are stable: above the resonance with its link a motor feels
its own rotor only. So the feedback is that of the rotors, ``B (r'' + kp e + kd e' + ki int e)``, and what the links
need is fed forward: their inverse dynamics along the reference, which also tells how far each spring will be wound,
``r_m = r + K^-1 tau_r``. What the torque is beside that winds it further, and slowly corrects ``r_m``.

The frozen loops of the joints do not decouple. Of each choice of gains the exclusion of
`quasilpv.certificate.gate.two_mass` is asked first: the stiffest that is proved is taken, and the artifact claims it.
Where none is, a grid is looked at: postures x loads x stiffness x delay, each loop exactly. It proves nothing between
its points, the artifact is called gridded and claims nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.gate.elastic import elastic_set
from quasilpv.certificate.gate.motor_loop import CorrectionSource, MotorLoopData
from quasilpv.certificate.gate.two_mass import Exclusion, TwoMassExclusion
from quasilpv.certificate.laws.motor_pid import MotorPidLaw
from quasilpv.conditions.tracking.sampled_chains import observer_gains
from quasilpv.documents.payloads import TreePayloads
from quasilpv.documents.strict_model import validate
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.loops.elastic_loop import MotorLaw, growth_rate
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.tree_law import design_inertia
from quasilpv.synthesis.chain_range import find_range
from quasilpv.synthesis.elastic.arms import elastic_drives, first_stable, grid_arms, links_of
from quasilpv.synthesis.elastic.classes import Reach
from quasilpv.synthesis.rest import dead_zone_rad
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.joint_drive import ElasticDrive
from quasilpv.systems.robots.spatial import SpatialInertia
from quasilpv.systems.robots.spatial_robot import SpatialRobot

POSTURES = 100
BESIDE_A_PROOF = 20
"""Postures of the grid, and of that whose worst loop is reported beside a proof."""

DAMPINGS_S = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4)
"""Over stiffness: what is tried for whoever states none."""

MOTOR_CORRECTION, SENSED_CORRECTION = 3.0, 8.0
"""Bandwidths of the correction, rad/s: by the motors' torques, which friction is part of, and by sensors."""


@dataclass(frozen=True)
class Gains:
    """A choice of gains: kp = -kappa w_p, kd = -kappa, ki = -kappa w_p w_i; bandwidths of observer and correction."""

    kappa: float
    proportional: float
    integral: float
    observer: float
    correction: float = MOTOR_CORRECTION

    def feedback(self) -> FloatArray:
        """(kp, kd, ki)."""
        return -self.kappa * np.array([self.proportional, 1.0, self.proportional * self.integral])


CHOICES = (Gains(700.0, 45.0, 4.0, 400.0), Gains(250.0, 45.0, 4.0, 1100.0), Gains(120.0, 30.0, 3.0, 900.0))
"""Tried in this order: the stiffest that is proved is taken, else the stiffest that is stable on the grid."""


def motor_pid(robot: SpatialRobot, specification: Specification, progress: Progress = no_progress) -> TrackingDesign:
    """Design `motor-pid`.

    Args:
        robot: all of its joints give, and their motors carry encoders.
        specification: its rate and delay count; activity and margins do not.
        progress: called with (choices tried, choices in all).

    Raises:
        InputError: a joint is rigid, its encoder is on the link only, or a gear rings above the loop's lead undamped.
        InfeasibleError: no choice of gains is stable on the whole grid.
    """
    drives = elastic_drives(robot, MotorPidLaw.tag(), ("motor", "both"))
    try:
        reach = Reach.of(robot, specification)
    except InputError as error:
        needed = _least_damping(robot, specification)
        more = f"from {needed:g} s on it is proved" if needed is not None else "none of these would be proved"
        raise InputError(error.source, error.field, error.got, f"{error.expected}; {more}") from error
    laws = _laws(robot, drives, specification.sample_period_s)
    witness = _links_witness(robot, specification)
    given_up = []
    for choice, law in laws.items() if witness is not None else ():
        found = _excluded(robot, law, witness or {}, specification)
        if found.proved:
            rates = list(_growth_rates(robot, drives, law, specification.delay_s, BESIDE_A_PROOF))
            grid = {"loops": len(rates), "worst_growth_rate_per_s": max(rates)}
            report = {"evidence": "proved", **reach.to_document(), **grid}
            return _design(robot, specification, (choice, law), report, witness)
        given_up.append(found.given_up_rad_s)
    choice, grid = first_stable(
        f"{robot.id}: no motor-pid at {specification.rate_hz:g} Hz",
        list(laws),
        lambda gains: _growth_rates(robot, drives, laws[gains], specification.delay_s, POSTURES),
        progress,
        "in a posture of the grid: its elastic modes are beyond the reach of this sample rate, or need more damping "
        "(joints.NAME.damping_least)",
    )
    report = {"evidence": "gridded", "not_excluded_at_rad_s": given_up, **reach.to_document(), **grid}
    return _design(robot, specification, (choice, laws[choice]), report, None)


def _laws(robot: SpatialRobot, drives: tuple[ElasticDrive, ...], period_s: float) -> dict[Gains, MotorLaw]:
    """With the choices of gains, the stiffest first."""
    source, correction = _correction(drives)
    choices = [replace(choice, correction=correction) for choice in CHOICES]
    return {choice: _law(robot, drives, choice, period_s, source) for choice in choices}


def _least_damping(robot: SpatialRobot, specification: Specification) -> float | None:
    """The first of a few dampings of all gears with which some choice of gains is proved; None if there is none."""
    witness = _links_witness(robot, specification)
    for damping_s in DAMPINGS_S if witness is not None else ():
        joints = tuple(
            replace(joint, drive=replace(drive, damping_least_s=max(damping_s, drive.damping_least_s)))
            for joint in robot.joints
            if (drive := joint.drive) is not None
        )
        damped = replace(robot, joints=joints)
        drives = elastic_drives(damped, MotorPidLaw.tag(), ("motor", "both"))
        laws = _laws(damped, drives, specification.sample_period_s).values()
        if any(_excluded(damped, law, witness or {}, specification).proved for law in laws):
            return damping_s
    return None


def _growth_rates(
    robot: SpatialRobot, drives: tuple[ElasticDrive, ...], law: MotorLaw, delay_s: float, postures: int
) -> Iterator[float]:
    """Of all loops of a grid."""
    for arm in grid_arms(robot, drives, postures):
        for delay in {0.0, delay_s}:
            yield growth_rate(law, arm.plant, delay)


def _links_witness(robot: SpatialRobot, specification: Specification) -> dict[str, Any] | None:
    """Bounds of the links by the rotors with their storages; None if none were found."""
    rotors = replace(
        robot.tree, joints=tuple(replace(joint, inertia=SpatialInertia.zero()) for joint in robot.tree.joints)
    )
    links = replace(robot, tree=links_of(robot.tree))
    try:
        found = find_range(links, rotors)
    except InfeasibleError:
        return None
    return {
        "chain": found.for_scaled_design(1.0),
        "exclusion": {"longest_delay_samples": specification.delay_samples},
    }


def _excluded(robot: SpatialRobot, law: MotorLaw, witness: dict[str, Any], specification: Specification) -> Exclusion:
    """What the exclusion will say of these gains, if the bounds of the links are what they seem."""
    loop = MotorLoopData(
        sample_period_s=law.sample_period_s,
        feedback=_numbers(law.feedback),
        observer=_numbers(law.observer),
        correction_rad_s=law.correction_rad_s,
        rotors=_numbers(law.rotors),
        stiffness=_numbers(law.stiffness),
        source=law.source,
    )
    payloads = validate(TreePayloads, robot.payloads.to_document(), robot.source)
    chain = witness["chain"]
    links = rational(chain["lowest"]["bound"]), rational(chain["highest"]["bound"])
    delay = rational(specification.delay_samples)
    shortest, longest = (rational(end) / loop.period for end in robot.lag_s)
    plants = elastic_set(loop, links, payloads, delay, (shortest, longest))
    return TwoMassExclusion(loop, plants).decide()


def _numbers(values: FloatArray) -> Any:
    return tuple(float(value) for value in values)


def _correction(drives: tuple[ElasticDrive, ...]) -> tuple[CorrectionSource, float]:
    """By what the motors' reference is corrected, and how fast: what is measured of the gears tells most."""
    if all(drive.encoder_side == "both" for drive in drives):
        return "deflection", SENSED_CORRECTION
    if all(drive.torque_sensor for drive in drives):
        return "joint-torque", SENSED_CORRECTION
    return "motor-torque", MOTOR_CORRECTION


def _law(
    robot: SpatialRobot, drives: tuple[ElasticDrive, ...], choice: Gains, period_s: float, source: CorrectionSource
) -> MotorLaw:
    return MotorLaw(
        sample_period_s=period_s,
        feedback=choice.feedback(),
        observer=np.asarray(observer_gains(choice.observer, period_s).gains),
        rotors=np.array([joint.rotor_inertia_kg_m2 for joint in robot.joints]),
        stiffness=np.array([sqrt(drive.stiffness_nm_rad[0] * drive.stiffness_nm_rad[1]) for drive in drives]),
        correction_rad_s=choice.correction,
        source=source,
    )


def _design(
    robot: SpatialRobot,
    specification: Specification,
    chosen: tuple[Gains, MotorLaw],
    found: dict[str, Any],
    witness: dict[str, Any] | None,
) -> TrackingDesign:
    choice, law = chosen
    kp, kd, ki = (float(gain) for gain in law.feedback)
    links = replace(robot, tree=links_of(robot.tree))
    members: dict[str, Any] = {
        "kind": MotorPidLaw.tag(),
        "feedback": {"kp": kp, "kd": kd, "ki": ki},
        "observer": [float(gain) for gain in law.observer],
        "rotor_inertia_kg_m2": law.rotors.tolist(),
        "stiffness_nm_rad": law.stiffness.tolist(),
        "correction_bandwidth_rad_s": law.correction_rad_s,
        "correction_source": law.source,
        "friction_viscous_nm_s": [joint.friction_viscous_nm_s for joint in robot.joints],
        "friction_coulomb_nm": [joint.friction_coulomb_nm for joint in robot.joints],
        "dead_zone_rad": dead_zone_rad(robot, specification),
        **design_inertia(links, 1.0),
    }
    gears = [
        {"stiffness_nm_rad": list(drive.stiffness_nm_rad), "damping_least_s": drive.damping_least_s}
        for drive in elastic_drives(robot, MotorPidLaw.tag(), ("motor", "both"))
    ]
    return TrackingDesign(
        controller=MotorPidLaw.tag(),
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law=members,
        expressions={},
        inputs={"controller": MotorPidLaw.tag(), "specification": specification.to_document(), "gears": gears},
        report={
            "arm_class": str(robot.arm_class),
            **found,
            "kappa_per_s": choice.kappa,
            "proportional_rad_s": choice.proportional,
            "integral_rad_s": choice.integral,
            "observer_bandwidth_rad_s": choice.observer,
            "correction_bandwidth_rad_s": choice.correction,
            "correction_source": law.source,
        },
        witness=witness,
    )
