"""The true lumped disturbance of a run, in the coordinates in which the controller's law estimates it.

It is everything the design model does not know: payload, external torque, friction, and for the acceleration-level law
the Coriolis torque too. The record holds accelerations as left limits: the torque of sample k - 1 goes with sample k.
"""

from __future__ import annotations

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, evaluate
from quasilpv.documents.mechanism import Tree
from quasilpv.experiments.result import Disturbance
from quasilpv.experiments.run import Run


def true_disturbance(run: Run, artifact: Artifact, runtime: _runtime.Artifact) -> Disturbance | None:
    """The disturbance that the law's estimate should equal, or ``None`` if it estimates none.

    * an acceleration: ``a_d = theta'' - M_n(z)^-1 (Gamma - G(theta))``, rad/s^2;
    * a torque: ``d = M_n(z) theta'' + G(theta) - Gamma``, N m, and ``N(theta, w) w`` more if the law knows it;

    with the design model of the artifact at the true angles and speeds.

    Args:
        run: record of a run of the artifact.
        artifact: the controller.
        runtime: the same as the run-time side loaded it.
    """
    level = artifact.law.DISTURBANCE
    if level is None:
        return None
    inertia, gravity, coriolis = _model(run, artifact, runtime)
    torque = np.vstack([np.zeros(run.joints), run.torque_nm[:-1]])
    acceleration = run.true_acceleration_rad_s2
    if level == "acceleration":
        known = np.linalg.solve(inertia, (torque - gravity)[..., None])[..., 0]
        return Disturbance(acceleration - known, "rad/s²", "acceleration")
    unknown: FloatArray = np.einsum("kij,kj->ki", inertia, acceleration) + gravity - torque
    return Disturbance(unknown + coriolis, "N m", "torque")


def _model(
    run: Run, artifact: Artifact, runtime: _runtime.Artifact
) -> tuple[FloatArray, FloatArray, FloatArray | float]:
    """M_n, (N, n, n), G and the Coriolis torque of the law, (N, n), along the true motion."""
    angle, speed = run.true_angle_rad, run.true_speed_rad_s
    if isinstance(artifact.law.inertia, Tree):
        tree = _runtime.Tree(artifact.law.inertia.model_dump(mode="json", by_alias=True))
        still = np.zeros(run.joints)
        moving = np.array([tree.inverse_dynamics(q, w, still) for q, w in zip(angle, speed, strict=True)])
        at_rest = np.array([tree.torque_at_rest(q, still) for q in angle])
        gravity = np.array([runtime.gravity(q) for q in angle])
        return np.array([tree.inertia(q) for q in angle]), gravity, moving - at_rest
    premise = evaluate(artifact.programs["premises"], angle.T).T
    inertia = np.array([runtime.inertia(z) for z in premise])
    has_coriolis = "coriolis" in artifact.programs
    coriolis = evaluate(artifact.programs["coriolis"], angle.T, speed.T).T if has_coriolis else 0.0
    return inertia, evaluate(artifact.programs["gravity"], angle.T).T, coriolis
