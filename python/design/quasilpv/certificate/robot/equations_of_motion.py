"""Exact equations of motion of the robots that stabilising laws are for, from the parameters of an artifact.

``M(theta) theta'' + tau(theta, theta') = u`` in joint coordinates, as polynomials of `trigonometric`.

* Mechanism in a plane, ``alpha = S theta``, W = S omega, D and h of `robot.mechanism` at no payload:
  ``M = S' [D_kl cos(alpha_k - alpha_l)] S``,
  ``tau = S' (sum_l D_kl sin(alpha_k - alpha_l) W_l^2 + g h_k sin(alpha_k)) + friction``, g < 0 upright.
* Rolling disc: ``M = J + M r^2``, ``tau = b r^2 omega + r F(r theta)``, ``F(x) = k_1 x + k_2 x^3``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from flint import fmpq, fmpq_mat, fmpq_poly

from quasilpv.certificate.exact.matrices import matrix, rational, zero
from quasilpv.certificate.exact.trigonometric import Polynomial
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.registry import exact_robot, known

NO_PAYLOAD = fmpq(0)


@dataclass(frozen=True, eq=False)
class EquationsOfMotion:
    """Of one robot.

    Attributes:
        inertia: M, n x n.
        torque: tau, n.
        stiffness, friction: derivatives of tau at rest in the angles and in the speeds, n x n.
        inertia_scale, torque_scale: sizes of their terms, to compare errors with.
    """

    inertia: list[list[Polynomial]]
    torque: list[Polynomial]
    stiffness: fmpq_mat
    friction: fmpq_mat
    inertia_scale: fmpq
    torque_scale: fmpq


def equations_of_motion(shipped: Shipped[Any]) -> EquationsOfMotion:
    """The equations of an artifact's robot.

    Raises:
        InputError: its kind has none here.
    """
    return known(EQUATIONS, shipped.mechanism, shipped.source)(shipped)


def largest_state(shipped: Shipped[Any]) -> list[fmpq]:
    """Bounds of the absolute values of angles and speeds in the operating domain, 2 n."""
    domain = shipped.artifact.domain
    return [max(abs(rational(x)) for x in interval) for interval in (*domain.angle_rad, *domain.speed_rad_s)]


def gravity_moments(shipped: Shipped[Any]) -> list[fmpq_poly]:
    """``g h_k`` as polynomials in the payload fraction; of a disc, whose torque no payload changes, none."""
    robot = exact_robot(shipped.mechanism, shipped.source)
    if robot.gravity is None:
        return []
    return [robot.gravity * moment for moment in robot.first_moments(*shipped.payloads.scales)]


def _in_a_plane(shipped: Shipped[Any]) -> EquationsOfMotion:
    robot = exact_robot(shipped.mechanism, shipped.source)
    n, S = robot.joints, robot.absolute_map.table()
    D = [[entry(NO_PAYLOAD) for entry in row] for row in robot.inertia(*shipped.payloads.scales)]
    moments = [moment(NO_PAYLOAD) for moment in gravity_moments(shipped)]
    friction = [robot.friction[i, i] for i in range(n)]
    theta, omega = Polynomial.variables(n)
    nothing = Polynomial.number(n, 0)

    def absolute(variables: list[Polynomial]) -> list[Polynomial]:
        return [sum((variables[j] * S[k][j] for j in range(n)), nothing) for k in range(n)]

    alpha, W = absolute(theta), absolute(omega)
    coupled = [[(alpha[k] - alpha[j]).cos() * D[k][j] for j in range(n)] for k in range(n)]
    inertia = [
        [sum((coupled[k][m] * (S[k][i] * S[m][j]) for k in range(n) for m in range(n)), nothing) for j in range(n)]
        for i in range(n)
    ]
    on_links = [
        sum(((alpha[k] - alpha[j]).sin() * D[k][j] * W[j] ** 2 for j in range(n)), alpha[k].sin() * moments[k])
        for k in range(n)
    ]
    torque = [sum((on_links[k] * S[k][i] for k in range(n)), omega[i] * friction[i]) for i in range(n)]
    reach = largest_state(shipped)[n:]
    fastest = max(sum((abs(S[k][j]) * reach[j] for j in range(n)), fmpq(0)) for k in range(n))
    inertias, weights = sum(abs(x) for row in D for x in row), sum(map(abs, moments), fmpq(0))
    rubbing = max(f * speed for f, speed in zip(friction, reach, strict=True))
    stiffness, damping = zero(n, n), zero(n, n)
    for i in range(n):
        damping[i, i] = friction[i]
        for j in range(n):
            stiffness[i, j] = sum((S[k][i] * moments[k] * S[k][j] for k in range(n)), fmpq(0))
    scales = max(D[k][k] for k in range(n)), weights + inertias * (1 + fastest**2) + rubbing
    return EquationsOfMotion(inertia, torque, stiffness, damping, *scales)


def _disc(shipped: Shipped[Any]) -> EquationsOfMotion:
    names = ("mass_kg", "radius_m", "inertia_kg_m2", "stiffness_n_m", "cubic_stiffness_n_m3", "damping_n_s_m")
    M, r, J, k1, k2, b = (rational(getattr(shipped.mechanism, name)) for name in names)
    (theta,), (omega,) = Polynomial.variables(1)
    inertia = J + M * r**2
    angle, speed = largest_state(shipped)
    scale = r**2 * (k1 + k2 * (r * angle) ** 2) * angle + b * r**2 * speed + inertia
    torque = theta * (r**2 * k1) + theta**3 * (r**4 * k2) + omega * (b * r**2)
    stiffness, friction = matrix([[r**2 * k1]]), matrix([[b * r**2]])
    return EquationsOfMotion([[Polynomial.number(1, inertia)]], [torque], stiffness, friction, inertia, scale)


EQUATIONS: Mapping[str, Callable[[Shipped[Any]], EquationsOfMotion]] = {
    "serial-arm": _in_a_plane,
    "five-bar": _in_a_plane,
    "spring-disc": _disc,
}
"""By the kind of the robot, of those in `robot.registry.EXACT`."""
