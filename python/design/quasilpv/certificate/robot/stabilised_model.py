"""Checks that the model behind a stabilising law is that of its robot, over the whole operating domain.

The witness states ``E(z) x' = A(z) x + B u`` with x = (theta, omega) and B = [0; I] as two vertex tables over the
premises of the program ``schedule``. Two claims tie it to the robot:

* **premise box** (proved): every output of the program, enclosed in ball arithmetic over a subdivision of the operating
  domain of angles and speeds, lies in the box the run-time side clamps it to.
* **equations of motion**: the tables give the robot's own inertia, and its torque ``N omega + G``, within `ROUNDING`.
  Premises and equations are written as polynomials in angles, speeds, sines, cosines and sinc with the rational numbers
  that are shipped (`trigonometric`); the coefficients of the difference bound the error over the whole domain, exactly.
  If a premise is something else, both sides are compared at random states in double arithmetic instead: sampled.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from flint import fmpq

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import identity, stack, zero
from quasilpv.certificate.exact.program_ranges import outputs_of, range_claim
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.trigonometric import Polynomial, UnsupportedError
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.equations_of_motion import (
    EquationsOfMotion,
    equations_of_motion,
    gravity_moments,
    largest_state,
)
from quasilpv.certificate.robot.registry import numeric_robot

SCHEDULE = "schedule"
ROUNDING = 1e-9
ROUNDING_EXACTLY = fmpq(1, 10**9)
STATES = 64
_SEED = 2022


def premise_box_claims(shipped: Shipped[Any], table: VertexTable, name: str = SCHEDULE) -> list[Claim]:
    """The claims that the outputs of a program, of angles and speeds, stay in the box of a table."""
    domain = [*shipped.artifact.domain.angle_rad, *shipped.artifact.domain.speed_rad_s]
    outputs = outputs_of(shipped.program(name).code)
    if len(outputs) != len(table.lower):
        raise ValueError(f"{len(outputs)} outputs of the program {name}, {len(table.lower)} premises")
    n = len(domain) // 2
    return [
        range_claim(
            f"premise box: output {p} of {name} on the operating domain",
            output,
            {"angle": domain[:n], "speed": domain[n:]},
            (table.lower[p], table.upper[p]),
        )
        for p, output in enumerate(outputs)
    ]


def equations_of_motion_claim(shipped: Shipped[Any], E: VertexTable, A: VertexTable) -> Claim:
    """The claim that ``E(z) = diag(I, M)`` and ``A(z) x = (omega, -N omega - G)`` on the operating domain."""
    try:
        robot, reach = equations_of_motion(shipped), largest_state(shipped)
        inertia = _inertia_error(shipped, E, robot, reach)
        n = len(robot.torque)
        theta, omega = Polynomial.variables(n)
        state = [*theta, *omega]
        expected = [*omega, *(-torque for torque in robot.torque)]
        drift = [
            sum((entry * x for entry, x in zip(row, state, strict=True)), Polynomial.number(n, 0))
            for row in _on_trajectories(shipped, A, n)
        ]
        error = max((found - wanted).bound(reach) for found, wanted in zip(drift, expected, strict=True))
    except UnsupportedError:
        return _sampled_equations(shipped, E, A)
    return Claim.at_most(
        "design model: the robot's equations of motion", max(inertia, error / robot.torque_scale), ROUNDING_EXACTLY
    )


def linearisation_claim(shipped: Shipped[Any], E: VertexTable, A: VertexTable) -> Claim:
    """The claim that A is the robot's at rest, ``[0, I; -H(0), -N(0, 0)]``, and ``E(z) = diag(I, M)``.

    What gravity and Coriolis torque are beyond that is a disturbance to the law.
    """
    try:
        robot, reach = equations_of_motion(shipped), largest_state(shipped)
        inertia = _inertia_error(shipped, E, robot, reach)
        n = len(robot.torque)
        expected = stack([[zero(n, n), identity(n)], [-robot.stiffness, -robot.friction]]).table()
        found = _on_trajectories(shipped, A, n)
        error = max((found[i][j] - expected[i][j]).bound(reach) for i, j in product(range(2 * n), repeat=2))
    except UnsupportedError:
        return _sampled_linearisation(shipped, E, A)
    return Claim.at_most(
        "design model: the robot's inertia, linearised at rest otherwise",
        max(inertia, error / robot.torque_scale),
        ROUNDING_EXACTLY,
    )


def _inertia_error(shipped: Shipped[Any], E: VertexTable, robot: EquationsOfMotion, reach: Sequence[fmpq]) -> fmpq:
    """Bound of ``|E(z) - diag(I, M)|`` over all entries, those of M relative to its size."""
    n = len(robot.torque)
    found = _on_trajectories(shipped, E, n)
    worst = fmpq(0)
    for i, j in product(range(2 * n), repeat=2):
        of_robot = i >= n and j >= n
        wanted = robot.inertia[i - n][j - n] if of_robot else fmpq(int(i == j))
        worst = max(worst, (found[i][j] - wanted).bound(reach) / (robot.inertia_scale if of_robot else 1))
    return worst


def _on_trajectories(shipped: Shipped[Any], table: VertexTable, n: int) -> list[list[Polynomial]]:
    """``X(z(theta, omega))``, entry by entry; inside the box of the premises, where they are by another claim."""
    premises = program_values(shipped.program(SCHEDULE).code, *Polynomial.variables(n))
    if len(premises) != len(table.lower):
        raise ValueError(f"{len(premises)} outputs of the program schedule, {len(table.lower)} premises")
    size = 2 * n
    total = [[Polynomial.number(n, 0)] * size for _ in range(size)]
    for factors, coefficient in table.monomials().items():
        value = Polynomial.number(n, 1)
        for p in factors:
            value = value * premises[p]
        for i, j in product(range(size), repeat=2):
            if coefficient[i, j] != 0:
                total[i][j] = total[i][j] + value * coefficient[i, j]
    return total


def _sampled_equations(shipped: Shipped[Any], E: VertexTable, A: VertexTable) -> Claim:
    """`equations_of_motion_claim` at random states of the domain."""
    rng = np.random.default_rng(_SEED)
    theta, omega = (
        np.column_stack([rng.uniform(low, high, STATES) for low, high in intervals])
        for intervals in (shipped.artifact.domain.angle_rad, shipped.artifact.domain.speed_rad_s)
    )
    n = theta.shape[1]
    premises = np.column_stack(program_values(shipped.program(SCHEDULE).code, list(theta.T), list(omega.T)))
    motion = numeric_robot(shipped.mechanism, shipped.source).motion(theta, omega)
    inertia, torque, scale = motion.inertia, motion.torque, motion.scale
    descriptor = np.broadcast_to(np.eye(2 * n), (STATES, 2 * n, 2 * n)).copy()
    descriptor[:, n:, n:] = inertia
    drift = np.einsum("kij,kj->ki", A.evaluate(premises), np.concatenate([theta, omega], axis=1))
    errors = (
        np.abs(E.evaluate(premises) - descriptor).max() / np.abs(inertia).max(),
        np.abs(drift - np.concatenate([omega, -torque], axis=1)).max() / scale,
    )
    title = f"design model: the robot's equations of motion at {STATES} states (sampled)"
    return Claim.sampled(title, float(max(errors)), ROUNDING)


def _sampled_linearisation(shipped: Shipped[Any], E: VertexTable, A: VertexTable) -> Claim:
    """`linearisation_claim` at random angles of the domain."""
    n = shipped.artifact.joints
    robot = numeric_robot(shipped.mechanism, shipped.source)
    zero, step = np.zeros((n, n)), 1e-6 * np.eye(n)
    ahead = robot.motion(step, zero)
    above, scale = ahead.torque, ahead.scale
    below, friction = robot.motion(-step, zero).torque, robot.motion(zero, step).torque
    expected = np.block([[zero, np.eye(n)], [-(above - below).T / 2e-6, -friction.T / 1e-6]])
    rng = np.random.default_rng(_SEED)
    theta = np.column_stack([rng.uniform(low, high, STATES) for low, high in shipped.artifact.domain.angle_rad])
    premises = np.column_stack(program_values(shipped.program(SCHEDULE).code, list(theta.T), list(0.0 * theta.T)))
    inertia = robot.motion(theta, 0.0 * theta).inertia
    found = E.evaluate(premises)
    errors = (
        np.abs(A.evaluate(premises) - expected).max() / scale,
        np.abs(found[:, n:, n:] - inertia).max() / np.abs(inertia).max(),
        np.abs(found[:, :n, :n] - np.eye(n)).max() + np.abs(found[:, :n, n:]).max() + np.abs(found[:, n:, :n]).max(),
    )
    title = f"design model: the robot's inertia at {STATES} states (sampled), linearised at rest otherwise"
    return Claim.sampled(title, float(max(errors)), ROUNDING)


def payload_claim(shipped: Shipped[Any]) -> Claim:
    """The claim that a payload changes the robot's inertia only: its gravity torque (or spring) is the nominal one.

    Every first moment is a polynomial in the payload fraction f; on [0, 1] its change is at most the sum of the
    coefficients of f, f^2, ... in magnitude.
    """
    moments = gravity_moments(shipped)
    change = max((sum((abs(x) for x in moment.coeffs()[1:]), fmpq(0)) for moment in moments), default=fmpq(0))
    size = max([fmpq(1), *(abs(moment(fmpq(0))) for moment in moments)])
    return Claim.at_most("design model: a payload changes the inertia only", change / size, ROUNDING_EXACTLY)
