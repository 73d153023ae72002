"""The true lumped disturbance of a run, in the coordinates in which the controller's law estimates it.

It is everything the design model does not know: payload, external torque, friction, and for the acceleration-level law
the Coriolis torque too. The record holds accelerations as left limits: the torque of sample k - 1 goes with sample k.
"""

from __future__ import annotations

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact, evaluate
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
    angle, speed = run.true_angle_rad.T, run.true_speed_rad_s.T
    gravity = evaluate(artifact.programs["gravity"], angle).T
    premise = evaluate(artifact.programs["premises"], angle).T
    inertia = np.array([runtime.inertia(z) for z in premise])
    torque = np.vstack([np.zeros(run.joints), run.torque_nm[:-1]])
    acceleration = run.true_acceleration_rad_s2
    if level == "acceleration":
        known = np.linalg.solve(inertia, (torque - gravity)[..., None])[..., 0]
        return Disturbance(acceleration - known, "rad/s²", "acceleration")
    unknown: FloatArray = np.einsum("kij,kj->ki", inertia, acceleration) + gravity - torque
    if "coriolis" in artifact.programs:
        unknown = unknown + evaluate(artifact.programs["coriolis"], angle, speed).T
    return Disturbance(unknown, "N m", "torque")
