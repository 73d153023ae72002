"""Laws that stabilise a robot around theta = 0: the conditions of chapters I to III with the smallest gains.

Of the gains of `stabilising_gains`, one set per rate, the smallest is chosen whose frozen sampled loop is stable with
every payload and delay.

`pdc` and `descriptor` use all premises of the robot, of angles and measured speeds: where the plant is the nominal one
their Lyapunov function decreases over the whole operating domain. `robust` knows the same premises, and its function
decreases with every payload. `delayed` uses the premise of the inertia alone (its inequalities grow with the fifth
power of the number of vertices) and takes gravity and Coriolis torque as they are at rest; what they are beyond that is
a disturbance to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.laws.delayed_feedback import DelayedFeedbackLaw
from quasilpv.errors import InfeasibleError
from quasilpv.loops.loop_grid import PAYLOAD_FRACTIONS, LoopGrid, configurations
from quasilpv.loops.state_law import StateLaw
from quasilpv.polytopes import BlockPolytope, PolytopicModel
from quasilpv.progress import Progress
from quasilpv.synthesis.specification import Specification
from quasilpv.synthesis.stabilising.gains import (
    WINDOW_S,
    Candidate,
    Solver,
    solve_delayed,
    solve_descriptor,
    solve_pdc,
)
from quasilpv.synthesis.stabilising.robust_feedback import robust_solver
from quasilpv.synthesis.tracking_design import TrackingDesign, inertia_table, premise_and_gravity
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.registry import Robot

DECAY_PER_S = 1.0
"""Decay rate of the state; V decreases twice as fast (Dehak 2022, fig. I.2)."""

RATES = (4.0, 8.0)
"""Weights w of the gain limit, 1/s."""

FILTER_SAMPLES = 2.0
"""Time constant of the speed filter, in samples."""


def full_model(robot: Robot) -> PolytopicModel:
    """The robot around theta = 0 with all its premises, one block each."""
    system = robot.model.as_descriptor_system(robot.domain)
    return _per_premise(replace(system, premises=tuple(premise.widened() for premise in system.premises)))


def inertia_model(robot: Robot) -> PolytopicModel:
    """The robot with the premise of its inertia only, the torque linearised at rest.

    Raises:
        InfeasibleError: the inertia has more than one premise.
    """
    count = len(robot.model.inertia_premises(robot.domain))
    if count != 1:
        raise InfeasibleError(f"{robot.id}: no delayed design: its inertia has {count} premises, expected 1")
    system = robot.model.as_descriptor_system(robot.domain)
    at_rest = system.A.evaluate(system.premise_values(np.zeros(system.order)))

    def alone(matrix: AffineMatrix) -> AffineMatrix:
        return AffineMatrix(matrix.constant, matrix.coefficients[:1])

    return _per_premise(
        replace(
            system,
            premises=(system.premises[0].widened(),),
            E=alone(system.E),
            A=AffineMatrix(at_rest, np.zeros((1, *at_rest.shape))),
            B=alone(system.B),
            C=alone(system.C),
        )
    )


def _per_premise(system: DescriptorSystem) -> PolytopicModel:
    return PolytopicModel(system, BlockPolytope.per_premise(system.lower, system.upper))


@dataclass(frozen=True)
class _Kind:
    """A stabilising controller: its condition, the model its claim is about, and who solves it for a robot."""

    condition: str
    model: Callable[[Robot], PolytopicModel]
    solver: Callable[[Robot], Solver]


_KINDS: Mapping[str, _Kind] = {
    "pdc": _Kind("I.2", full_model, lambda _: solve_pdc),
    "descriptor": _Kind("II.6", full_model, lambda _: solve_descriptor),
    "robust": _Kind("III.9", full_model, robust_solver),
    "delayed": _Kind("II.8-direct", inertia_model, lambda _: solve_delayed),
}


def pdc(robot: Robot, specification: Specification, progress: Progress) -> TrackingDesign:
    """Design `pdc`; see `stabilisation`."""
    return stabilisation(robot, "pdc", specification, progress)


def descriptor(robot: Robot, specification: Specification, progress: Progress) -> TrackingDesign:
    """Design `descriptor`; see `stabilisation`."""
    return stabilisation(robot, "descriptor", specification, progress)


def robust(robot: Robot, specification: Specification, progress: Progress) -> TrackingDesign:
    """Design `robust`; see `stabilisation`."""
    return stabilisation(robot, "robust", specification, progress)


def delayed(robot: Robot, specification: Specification, progress: Progress) -> TrackingDesign:
    """Design `delayed`; see `stabilisation`."""
    return stabilisation(robot, "delayed", specification, progress)


def stabilisation(
    robot: Robot,
    controller: str,
    specification: Specification,
    progress: Progress,
    *,
    decay_per_s: float = DECAY_PER_S,
    rates: Sequence[float] = RATES,
) -> TrackingDesign:
    """Design a law that stabilises theta = 0.

    Args:
        robot: its operating domain contains theta = 0.
        controller: ``pdc``, ``descriptor``, ``robust`` or ``delayed``.
        specification: sample rate, and the delay its frozen loop has to tolerate.
        progress: called with (rates done, rates in all).
        decay_per_s: alpha > 0, of the state.
        rates: weights w of the gain limit to try, 1/s.

    Raises:
        InfeasibleError: the operating domain does not contain theta = 0, the inequalities have no verified solution,
            or no rate gives a frozen sampled loop that is stable with every payload and delay.
    """
    if any(not low < 0.0 < high for low, high in robot.domain.angle_rad):
        raise InfeasibleError(f"{robot.id}: no {controller} design: its operating domain does not contain theta = 0")
    kind = _KINDS[controller]
    model, solve = kind.model(robot), kind.solver(robot)
    found = []
    for done, rate in enumerate(rates, start=1):
        candidate = solve(model, decay_per_s, rate)
        if candidate is not None:
            found.append((candidate.gain_limit, rate, candidate))
        progress(done, len(rates))
    for _, rate, candidate in sorted(found, key=lambda entry: entry[0]):
        growth = dict(_growth_rates(robot, specification, model, candidate))
        if max(growth.values()) < 0.0:
            report = _report(robot, kind, model, candidate) | {
                "decay_per_s": decay_per_s,
                "rate_per_s": rate,
                "worst_growth_rate_per_s": max(growth.values()),
                "growth_rates_per_s": growth,
            }
            return _design(robot, controller, specification, candidate, model=model, report=report)
    raise InfeasibleError(
        f"{robot.id}: no {controller} design at {specification.rate_hz:g} Hz: of {len(found)} solutions with decay "
        f"rate {decay_per_s:g} 1/s none is stable with every payload and {specification.delay_s:g} s delay"
    )


def _growth_rates(
    robot: Robot, specification: Specification, model: PolytopicModel, candidate: Candidate
) -> Iterator[tuple[str, float]]:
    """Worst growth rate of the frozen sampled loops, 1/s, without delay and with the specified one."""
    angles = configurations(robot.domain.angle_rad, every_joint=True)
    nominal = np.array([robot.model.inertia(theta) for theta in angles])
    weights = [_weights_at_rest(model, theta) for theta in angles]
    law = StateLaw(
        specification.sample_period_s,
        np.array([candidate.gain(w, M) for w, M in zip(weights, nominal, strict=True)]),
        FILTER_SAMPLES * specification.sample_period_s,
    )
    plants = {fraction: robot.with_payload_fraction(fraction) for fraction in PAYLOAD_FRACTIONS}
    grid = LoopGrid(
        law,
        angles,
        {f: np.array([plant.inertia(theta) for theta in angles]) for f, plant in plants.items()},
        {f: np.array([plant.gravity_stiffness(theta) for theta in angles]) for f, plant in plants.items()},
    )
    for case, delay_s in (("no_delay", 0.0), ("specified_delay", specification.delay_s)):
        yield case, grid.worst(delay_s=delay_s).growth_rate_per_s


def _weights_at_rest(model: PolytopicModel, theta: FloatArray) -> FloatArray:
    premises = model.system.premise_values(np.concatenate([theta, np.zeros(len(theta))]))
    return model.polytope.weights(model.polytope.saturate(premises)[0])


def _report(robot: Robot, kind: _Kind, model: PolytopicModel, candidate: Candidate) -> dict[str, Any]:
    """The numbers a person asks for, JSON-able, but for those of the loop."""
    at_rest = np.zeros(robot.model.joints)
    gain = candidate.gain(_weights_at_rest(model, at_rest), robot.model.inertia(at_rest))
    proportional, derivative = np.split(gain, 2, axis=1)
    return {
        "condition": kind.condition,
        "scheduled_premises": [str(premise.expression) for premise in model.system.premises],
        "vertices": model.vertex_count,
        "gain_limit": candidate.gain_limit,
        "largest_gains_at_rest": {
            "proportional": float(np.abs(proportional).max()),
            "derivative": float(np.abs(derivative).max()),
        },
    }


def _design(
    robot: Robot,
    controller: str,
    specification: Specification,
    candidate: Candidate,
    *,
    model: PolytopicModel,
    report: Mapping[str, Any],
) -> TrackingDesign:
    """What is shipped."""
    system, polytope, T = model.system, model.polytope, specification.sample_period_s
    tables = {name: polytope.vertices(X.constant, X.coefficients) for name, X in (("E", system.E), ("A", system.A))}
    law = {**candidate.law, "velocity_filter_time_constant_s": FILTER_SAMPLES * T, "inertia": inertia_table(robot)}
    if law["kind"] == DelayedFeedbackLaw.tag():
        law["window_samples"] = round(WINDOW_S / T)
    asked = {name: report[name] for name in ("decay_per_s", "rate_per_s")}
    return TrackingDesign(
        controller=controller,
        robot=robot,
        sample_period_s=T,
        law=law,
        expressions={
            **premise_and_gravity(robot),
            "schedule": tuple(premise.expression for premise in system.premises),
        },
        inputs={"controller": controller, "specification": specification.to_document(), **asked},
        report=report,
        witness={
            "feedback": {
                "condition": report["condition"],
                "decay_per_s": report["decay_per_s"],
                "model": {name: polytope.to_document(vertices) for name, vertices in tables.items()},
                **candidate.witness,
            }
        },
    )
