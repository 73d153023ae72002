"""The equations of motion a stabilising law is checked against, written out from the parameters of an artifact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def robot_dynamics(
    parameters: Mapping[str, Any], theta: FloatArray, omega: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Inertia, torque ``N omega + G`` and the size of its terms at K states (K, n), of an arm or of a disc."""
    return (disc_dynamics if "radius_m" in parameters else arm_dynamics)(parameters, theta, omega)


def disc_dynamics(
    parameters: Mapping[str, Any], theta: FloatArray, omega: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """As `arm_dynamics`, of a disc that rolls: ``(J + M r^2) theta'' + b r^2 theta' + r F(r theta) = u``.

    F is the force of the spring, k_1 x + k_2 x^3; the J of the parameters is that of delta = 0.
    """
    r, b = float(parameters["radius_m"]), float(parameters["damping_n_s_m"])
    inertia = float(parameters["inertia_kg_m2"]) + float(parameters["mass_kg"]) * r**2
    spring = _spring_stiffness(parameters, theta) * theta
    damping = b * r**2 * omega
    scale = float(np.abs(spring).max() + np.abs(damping).max() + inertia)
    return np.full((len(theta), 1, 1), inertia), spring + damping, scale


def _spring_stiffness(parameters: Mapping[str, Any], theta: FloatArray) -> FloatArray:
    """``r^2 (k_1 + k_2 (r theta)^2)``, N m/rad."""
    r = float(parameters["radius_m"])
    cubic = float(parameters["cubic_stiffness_n_m3"]) * (r * theta) ** 2
    return np.asarray(r**2 * (float(parameters["stiffness_n_m"]) + cubic))


def arm_dynamics(
    parameters: Mapping[str, Any], theta: FloatArray, omega: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Inertia, torque ``N omega + G``, and the size of its terms, of a planar serial arm at K states (K, n).

    In absolute angles ``alpha = S theta``, W = S omega: ``M = S' [D_kl cos(alpha_k - alpha_l)] S`` and the torque is
    ``S' (sum_l D_kl sin(alpha_k - alpha_l) W_l^2 + g_k sin(alpha_k)) + friction``.
    """
    links = parameters["links"]
    n = len(links)
    L, m, r, I, friction = (  # noqa: E741
        np.array([float(link[field]) for link in links])
        for field in ("length_m", "mass_kg", "com_m", "inertia_kg_m2", "friction_nm_s")
    )
    outer = np.array([m[k + 1 :].sum() for k in range(n)])
    D = np.diag(I + L**2 * outer)
    for k in range(n):
        for j in range(k):
            D[j, k] = D[k, j] = L[j] * (m[k] * r[k] + L[k] * outer[k])
    sign = 1.0 if parameters["equilibrium"] == "hanging" else -1.0
    g = sign * float(parameters["gravity_m_s2"]) * (m * r + L * outer)
    alpha, W = np.cumsum(theta, axis=1), np.cumsum(omega, axis=1)
    difference = alpha[:, :, None] - alpha[:, None, :]
    S = np.tril(np.ones((n, n)))
    inertia = S.T @ (D * np.cos(difference)) @ S
    link_torque = np.einsum("kij,kj->ki", D * np.sin(difference), W**2) + g * np.sin(alpha)
    scale = float(np.abs(g).sum() + np.abs(D).sum() * (1.0 + (W**2).max()) + np.abs(friction * omega).max())
    return inertia, link_torque @ S + friction * omega, scale


def gravity_stiffness(document: Mapping[str, Any], theta: FloatArray, payload_fraction: float) -> FloatArray:
    """Gravity torque as ``H(theta) theta`` of the robot with a payload, at K configurations (K, n): H, (K, n, n).

    Of a disc, whose payload is one of inertia, the torque of its spring.
    """
    parameters, payloads = document["robot"]["parameters"], document["payloads"]
    if "radius_m" in parameters:
        return _spring_stiffness(parameters, theta)[:, :, None]
    first = []
    for k, link in enumerate(parameters["links"]):
        factor = {
            name: 1.0 + payload_fraction * (float(payloads[name][k]) - 1.0) for name in ("mass_scale", "com_scale")
        }
        mass = float(link["mass_kg"]) * factor["mass_scale"]
        first.append((mass, mass * float(link["com_m"]) * factor["com_scale"], float(link["length_m"])))
    outer = [sum(mass for mass, _, _ in first[k + 1 :]) for k in range(len(first))]
    sign = 1.0 if parameters["equilibrium"] == "hanging" else -1.0
    g = sign * float(parameters["gravity_m_s2"])
    constants = np.array([g * (moment + length * m) for (_, moment, length), m in zip(first, outer, strict=True)])
    S = np.tril(np.ones((len(first), len(first))))
    sinc = np.sinc(np.cumsum(theta, axis=1) / np.pi)
    return np.asarray(np.einsum("ki,zk,kj->zij", S, constants * sinc, S))
