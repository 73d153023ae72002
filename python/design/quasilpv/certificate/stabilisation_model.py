"""Checks that the model behind a stabilising law is that of its robot, over the whole operating domain.

The witness states ``E(z) x' = A(z) x + B u`` with x = (theta, omega) and B = [0; I] as two vertex tables over the
premises of the program ``schedule``. Two claims tie it to the robot:

* **premise box** (proved): every output of the program, enclosed in ball arithmetic over a subdivision of the operating
  domain of angles and speeds, lies in the box the run-time side clamps it to.
* **equations of motion** (sampled): at random states of the domain the tables give the robot's own inertia, and its
  torque ``N omega + G``, within `ROUNDING`. Both sides are sums of few analytic terms, so that another model would
  be found out at almost every state; a proof it is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from flint import arb

from quasilpv.certificate.claims import Claim
from quasilpv.certificate.program_values import program_values
from quasilpv.certificate.robot_dynamics import gravity_stiffness, robot_dynamics
from quasilpv.certificate.vertex_tables import VertexTable

FloatArray = npt.NDArray[np.float64]

ROUNDING = 1e-9
STATES = 64
LARGEST_SUBDIVISION = 200_000
_SEED = 2022


def premise_box_claims(document: Mapping[str, Any], table: VertexTable, name: str = "schedule") -> list[Claim]:
    """The claims that the outputs of a program, of angles and speeds, stay in the box of a table."""
    program = document["programs"][name]
    domain = [*document["domain"]["angle_rad"], *document["domain"]["speed_rad_s"]]
    outputs = _outputs(program)
    if len(outputs) != len(table.lower):
        raise ValueError(f"{len(outputs)} outputs of the program {name}, {len(table.lower)} premises")
    return [
        _premise_claim(f"output {p} of {name}", output, domain, (table.lower[p], table.upper[p]))
        for p, output in enumerate(outputs)
    ]


def _outputs(program: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The program taken apart, one for each output: the shortest final pieces that leave one value each."""
    pops = {"const": 0, "angle": 0, "speed": 0, "add": 2, "sub": 2, "mul": 2, "div": 2}
    code = list(program["code"])
    pieces: list[Mapping[str, Any]] = []
    while code:
        missing, start = 1, len(code)
        while missing:
            start -= 1
            missing += pops.get(code[start][0], 1) - 1
        pieces.append({"code": code[start:]})
        del code[start:]
    return pieces[::-1]


def _premise_claim(
    output: str, program: Mapping[str, Any], domain: Sequence[Sequence[float]], box: tuple[float, float]
) -> Claim:
    """Subdivide the domain until every piece is seen to stay inside the box, or the middle of one to be outside.

    Only inputs that occur are divided.
    """
    used = sorted(
        {int(op[1]) + (len(domain) // 2 if op[0] == "speed" else 0) for op in program["code"] if op[0] in _INPUTS}
    )
    pending = [[(float(low), float(high)) for low, high in domain]]
    title = f"premise box: {output} on the operating domain"
    for _ in range(LARGEST_SUBDIVISION):
        if not pending:
            return Claim(title, True, 1.0)
        piece = pending.pop()
        value = _enclosure(program, piece)
        if value.lower() >= box[0] and value.upper() <= box[1]:
            continue
        middle = _enclosure(program, [((low + high) / 2.0,) * 2 for low, high in piece])
        if middle.upper() < box[0] or middle.lower() > box[1]:
            break
        widths = {k: (piece[k][1] - piece[k][0]) / (domain[k][1] - domain[k][0]) for k in used}
        widest = max(widths, key=lambda k: widths[k])
        low, high = piece[widest]
        for half in ((low, (low + high) / 2.0), ((low + high) / 2.0, high)):
            pending.append([half if k == widest else interval for k, interval in enumerate(piece)])
    return Claim(title, False, -1.0)


_INPUTS = ("angle", "speed")


def _enclosure(program: Mapping[str, Any], piece: Sequence[tuple[float, float]]) -> arb:
    balls = [arb(low).union(arb(high)) for low, high in piece]
    n = len(piece) // 2
    value: arb
    (value,) = program_values(program, balls[:n], balls[n:])
    return value


def equations_of_motion_claim(document: Mapping[str, Any], E: VertexTable, A: VertexTable) -> Claim:
    """The claim that ``E(z) = diag(I, M)`` and ``A(z) x = (omega, -N omega - G)`` at random states of the domain."""
    rng = np.random.default_rng(_SEED)
    theta, omega = (
        np.column_stack([rng.uniform(low, high, STATES) for low, high in document["domain"][field]])
        for field in ("angle_rad", "speed_rad_s")
    )
    n = theta.shape[1]
    premises = np.column_stack(program_values(document["programs"]["schedule"], list(theta.T), list(omega.T)))
    inertia, torque, scale = robot_dynamics(document["robot"]["parameters"], theta, omega)
    descriptor = np.broadcast_to(np.eye(2 * n), (STATES, 2 * n, 2 * n)).copy()
    descriptor[:, n:, n:] = inertia
    drift = np.einsum("kij,kj->ki", A.evaluate(premises), np.concatenate([theta, omega], axis=1))
    errors = (
        np.abs(E.evaluate(premises) - descriptor).max() / np.abs(inertia).max(),
        np.abs(drift - np.concatenate([omega, -torque], axis=1)).max() / scale,
    )
    title = f"design model: the robot's equations of motion at {STATES} states (sampled)"
    return Claim(title, max(errors) <= ROUNDING, max(-1.0, 1.0 - float(max(errors)) / ROUNDING))


def linearisation_claim(document: Mapping[str, Any], E: VertexTable, A: VertexTable) -> Claim:
    """The claim that A is the robot's at rest, ``[0, I; -H(0), -N(0, 0)]``, and ``E(z) = diag(I, M)`` is sampled.

    What gravity and Coriolis torque are beyond that is a disturbance to the law.
    """
    n = int(document["joints"])
    parameters = document["robot"]["parameters"]
    zero, step = np.zeros((n, n)), 1e-6 * np.eye(n)
    _, above, scale = robot_dynamics(parameters, step, zero)
    _, below, _ = robot_dynamics(parameters, -step, zero)
    _, friction, _ = robot_dynamics(parameters, zero, step)
    expected = np.block([[zero, np.eye(n)], [-(above - below).T / 2e-6, -friction.T / 1e-6]])
    rng = np.random.default_rng(_SEED)
    theta = np.column_stack([rng.uniform(low, high, STATES) for low, high in document["domain"]["angle_rad"]])
    premises = np.column_stack(program_values(document["programs"]["schedule"], list(theta.T), list(0.0 * theta.T)))
    inertia, _, _ = robot_dynamics(parameters, theta, 0.0 * theta)
    found = E.evaluate(premises)
    errors = (
        np.abs(A.evaluate(premises) - expected).max() / scale,
        np.abs(found[:, n:, n:] - inertia).max() / np.abs(inertia).max(),
        np.abs(found[:, :n, :n] - np.eye(n)).max() + np.abs(found[:, :n, n:]).max() + np.abs(found[:, n:, :n]).max(),
    )
    title = f"design model: the robot's inertia at {STATES} states (sampled), linearised at rest otherwise"
    return Claim(title, max(errors) <= ROUNDING, max(-1.0, 1.0 - float(max(errors)) / ROUNDING))


def payload_claim(document: Mapping[str, Any]) -> Claim:
    """The claim that a payload changes the robot's inertia only: its gravity torque (or spring) is the nominal one."""
    low, high = np.array(document["domain"]["angle_rad"], dtype=float).T
    angles = np.linspace(low, high, STATES)
    nominal, *others = (gravity_stiffness(document, angles, fraction) for fraction in (0.0, 0.5, 1.0))
    error = max(float(np.abs(other - nominal).max()) for other in others) / max(1.0, float(np.abs(nominal).max()))
    title = f"design model: a payload changes the inertia only, at {STATES} postures (sampled)"
    return Claim(title, error <= ROUNDING, max(-1.0, 1.0 - error / ROUNDING))
